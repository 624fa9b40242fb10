"""The two laws of the paper and the QP filter, as controllers with one interface."""
