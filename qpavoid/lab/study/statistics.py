"""Rates with their 95 % intervals, by SciPy."""

from typing import TypeAlias

from scipy import stats

Interval: TypeAlias = tuple[float, float, float]
"""A value and its 95 % interval."""


def wilson(hits: int, n: int) -> Interval:
    """Return the rate and its 95 % interval (Wilson), for n of at least 1."""
    low, high = stats.binomtest(hits, n).proportion_ci(method="wilson")
    return hits / n, float(low), float(high)
