"""The two laws of the paper and the QP filter, as controllers of equal standing."""
