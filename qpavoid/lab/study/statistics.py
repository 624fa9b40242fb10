"""Rates, medians and paired differences with their 95 % intervals, all by SciPy."""

from collections.abc import Callable, Hashable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy import stats

from qpavoid.types import Array

Interval: TypeAlias = tuple[float, float, float]
"""A value and its 95 % interval."""

RESAMPLES = 400
BLOCK = 2_000_000
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
        batch=max(1, BLOCK // len(values)),
        method="percentile",
        random_state=np.random.default_rng(0),
    )
    low, high = found.confidence_interval
    return float(statistic(values, axis=0)), float(low), float(high)


class Paired(NamedTuple):
    """Two methods on the same scenes.

    Attributes:
        scenes: That both ran.
        only_first: Scenes in which only the first succeeded.
        only_second: Scenes in which only the second did.
        success: First less second, share of the scenes, with its 95 % interval.
        both: Scenes in which both succeeded.
        time: First less second, mean over these, s, with its 95 % interval.
    """

    scenes: int
    only_first: int
    only_second: int
    success: Interval
    both: int
    time: Interval | None

    @property
    def p(self) -> float:
        """McNemar's exact p: how likely so uneven a split is between equal methods."""
        split = self.only_first, self.only_second
        return (
            float(stats.binomtest(min(split), sum(split)).pvalue) if any(split) else 1.0
        )


def paired(
    first: Mapping[Hashable, float | None], second: Mapping[Hashable, float | None]
) -> Paired | None:
    """Return how two methods differ on the scenes that both ran, if there are any.

    The intervals are a bootstrap over scenes.

    Args:
        first: Time of every success by scene, s; ``None`` for a failure.
        second: The same of the other method.
    """
    pairs = [(time, second[scene]) for scene, time in first.items() if scene in second]
    gained = np.array([(a is not None) - (b is not None) for a, b in pairs], float)
    late = np.array([a - b for a, b in pairs if a is not None and b is not None])
    success = bootstrap(gained, np.mean)
    if success is None:
        return None
    won, lost = int((gained > 0).sum()), int((gained < 0).sum())
    time = bootstrap(late, np.mean)
    return Paired(len(pairs), won, lost, success, len(late), time)
