"""Rates, medians and means with their 95 % intervals, all by SciPy."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from scipy import stats

from qpavoid.types import Array

Interval: TypeAlias = tuple[float, float, float]
"""A value and its 95 % interval."""

RESAMPLES = 10_000
BLOCK_DRAWS = 2_000_000
"""Numbers drawn at a time."""


def wilson(hits: int, n: int) -> Interval:
    """Return the rate and its 95 % interval (Wilson), for n of at least 1."""
    low, high = stats.binomtest(hits, n).proportion_ci(method="wilson")
    return hits / n, float(low), float(high)


def bootstrap(
    values: Array, statistic: Callable[..., Any] = np.median
) -> Interval | None:
    """Return a statistic and its 95 % percentile bootstrap interval, always the same.

    Args:
        values: Finite numbers; without any the answer is ``None``.
        statistic: ``np.median`` or ``np.mean``, along an axis.
    """
    if len(values) < 2:
        return (float(values[0]),) * 3 if len(values) else None
    found = stats.bootstrap(
        (values,),
        statistic,
        n_resamples=RESAMPLES,
        batch=max(1, BLOCK_DRAWS // len(values)),
        method="percentile",
        random_state=np.random.default_rng(0),
    )
    low, high = found.confidence_interval
    return float(statistic(values, axis=0)), float(low), float(high)
