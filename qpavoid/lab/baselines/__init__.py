"""Baselines from the literature, with the interface of the filter."""
