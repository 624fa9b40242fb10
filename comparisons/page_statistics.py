"""Statistics of the page: paired, by cluster, and all comparisons of a study at once.

Runs of scenes that repeat (phases of a world, levels of a scene) are no independent
draws: they are one cluster, and it is clusters that are drawn. A study says in
``page.toml`` what its clusters are; else each scene is one of its own.

* Intervals of means and differences: percentile bootstrap over clusters, that of scipy
  with the draws kept for all that have as many; of shares: Wilson's, n divided by the
  design effect [Korn1998].
* p: both methods are exchangeable in a cluster, so the sum of its differences may have
  the other sign [Fisher1935]: all signs are counted. For successes that is McNemar's
  exact test where each scene is a cluster, else one for clustered pairs
  [Obuchowski1998]; times and metrics are rounded for it (:data:`GRID`).
* All p of a study are Holm's [Holm1979], and what is in doubt is against ours: what
  speaks for it is corrected over all comparisons, what speaks against it over those of
  its kind (behind a planner, or not) in the same quantity.
* The size of an effect on successes: Cohen's g [Cohen1988, chapter 5].
"""

import math
from collections import Counter
from collections.abc import Hashable, Mapping, MutableMapping, Sequence
from functools import lru_cache
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import stats

from qpavoid.lab.study.statistics import RESAMPLES, Interval
from qpavoid.types import Array

LEVEL = 0.05
"""Of Holm's p: below it a difference is clear."""

FEW = 8
"""Clusters with both values from which on a difference has an interval and a p."""

Values: TypeAlias = Mapping[Hashable, float | None]
"""By scene."""

Hits: TypeAlias = Mapping[Hashable, bool]
"""By scene."""

Clusters: TypeAlias = Mapping[Hashable, int]
"""By scene: the number of its cluster, from 0 on without a gap."""

Draws: TypeAlias = npt.NDArray[np.float32]
"""A row a draw, a column a cluster."""


class Difference(NamedTuple):
    """What one method has more than another, on the same scenes.

    Attributes:
        value: Mean difference, or for times the geometric mean of the ratios, with its
            95 % interval.
        p: That it is none; Holm's, once a study is complete (:func:`adjust`).
        better: 1 if the difference is in favour of the first, −1 if not, 0 if none.
        single: The p of it by itself, once p is Holm's.
    """

    value: Interval
    p: float
    better: int
    single: float = math.nan

    @property
    def clear(self) -> int:
        """As :attr:`better`; 0 where p does not tell the two apart."""
        return self.better if self.p < LEVEL else 0


class Pair(NamedTuple):
    """Two methods on the scenes that both ran.

    Attributes:
        scenes: How many both ran.
        only_first: Scenes in which only the first succeeded.
        only_second: Scenes in which only the second did.
        both: Scenes in which both did.
        differences: Of ``success``; contacts; ``time``, ``metric``, where enough have.
    """

    scenes: int
    only_first: int
    only_second: int
    both: int
    differences: MutableMapping[str, Difference]

    @property
    def g(self) -> float:
        """Cohen's g: the first's share of the scenes in which one succeeded, less ½."""
        split = self.only_first + self.only_second
        return self.only_first / split - 0.5 if split else 0.0


@lru_cache(maxsize=16)
def drawn(clusters: int) -> Draws:
    """Return how often each cluster is in each of the bootstrap's draws."""
    rng = np.random.default_rng(0)
    found = rng.integers(clusters, size=(RESAMPLES, clusters))
    found += clusters * np.arange(RESAMPLES)[:, None]
    counts = np.bincount(found.ravel(), minlength=RESAMPLES * clusters)
    return counts.reshape(RESAMPLES, clusters).astype(np.float32)


GRID = 40_000
"""Times and metrics are rounded to this part of the sum of their sizes for p."""


def mean(sums: Array, counts: Array) -> Interval:
    """Return a mean and its 95 % bootstrap interval from sums and counts by cluster."""
    ran = counts > 0.0  # a cluster that was not run is no cluster
    both = np.column_stack([sums[ran], counts[ran]]).astype(np.float32)
    total, many = (drawn(len(both)) @ both).T
    means = total / many
    low, high = np.quantile(means, (0.025, 0.975)).tolist()
    return float(sums.sum() / counts.sum()), low, high


def share(hits: Array, clusters: Array) -> Interval:
    """Return the share of hits (n,) and Wilson's 95 % interval, by clusters (n,).

    n is divided by the design effect: the variance of the mean between clusters over
    that of independent runs, times what t with n - 1 degrees of freedom is squared over
    t with those of k clusters. Where all runs end alike, n is k.
    """
    n, rate = len(hits), float(np.mean(hits))
    _, number = np.unique(clusters, return_inverse=True)
    k = number.max() + 1
    between = (np.bincount(number, hits - rate) ** 2).sum() / n**2 * k / max(k - 1, 1)
    within = rate * (1.0 - rate) / max(n - 1, 1)
    size = float(k)
    if within > 0.0 and k > 1:
        wider = stats.t.ppf(0.975, k - 1) / stats.t.ppf(0.975, n - 1)
        size = n / max(between / within, 1.0) / wider**2
    z2 = float(stats.norm.ppf(0.975)) ** 2 / size
    middle = (rate + z2 / 2.0) / (1.0 + z2)
    half = np.sqrt(z2 * (rate * (1.0 - rate) + z2 / 4.0)) / (1.0 + z2)
    return rate, max(0.0, middle - half), min(1.0, middle + half)


def exact_p(sums: Array) -> float:
    """Return the share of all signs of whole numbers that sum up to as much.

    Counted by shifts [Streitberg1986].
    """
    spread = np.ones(1)  # of the sum of those with a plus
    for step in sorted(np.abs(sums[sums != 0]).astype(int).tolist()):
        shifted = np.zeros(len(spread) + step)
        shifted[: len(spread)] += 0.5 * spread
        shifted[step:] += 0.5 * spread
        spread = shifted
    reached = np.abs(2 * np.arange(len(spread)) - len(spread) + 1)
    return min(1.0, float(spread[reached >= abs(sums.sum())].sum()))


def on_grid(sums: Array) -> Array:
    """Return numbers as whole ones: thousandths where they are such, else rounded."""
    sizes: float = np.abs(sums).sum()
    thousandths: Array = np.rint(1e3 * sums)
    rest = np.abs(1e3 * sums - thousandths).max(initial=0.0)
    if sizes <= 1e-3 * GRID and rest <= 1e-6 * sizes:
        return thousandths
    rounded: Array = np.rint(sums * (GRID / sizes))
    return rounded


def holm(p: Sequence[float]) -> list[float]:
    """Return Holm's p of several, in their order."""
    order = np.argsort(p, kind="stable")
    times = np.arange(len(p), 0, -1)
    raised = np.minimum(np.maximum.accumulate(np.asarray(p)[order] * times), 1.0)
    return [float(x) for x in raised[np.argsort(order, kind="stable")]]


def adjust(*kinds: Sequence[Pair]) -> None:
    """Raise every p of a study's pairs to Holm's.

    In favour of the first of a pair over all of these; else over those of a kind in the
    same quantity.
    """
    places = [
        [(x.differences, key) for x in some if key in x.differences]
        for some in kinds
        for key in dict.fromkeys(chain.from_iterable(x.differences for x in some))
    ]
    single = [[found[key].p for found, key in some] for some in places]
    of_kind = chain.from_iterable(map(holm, single))
    of_all = holm([*chain.from_iterable(single)])
    for (found, key), kind, every in zip(
        chain.from_iterable(places), of_kind, of_all, strict=True
    ):
        old = found[key]
        p = every if old.better > 0 else kind
        found[key] = old._replace(p=p, single=old.p)


def compare(first: Values, second: Values, clusters: Clusters) -> Pair | None:
    """Return how two methods differ on the scenes that both ran, if there are any.

    Args:
        first: Time of every success by scene, s; ``None`` for a failure.
        second: The same of the other method.
        clusters: Of each scene.
    """
    ours, theirs = (
        {x: time is not None for x, time in of.items()} for of in (first, second)
    )
    ends = Counter((hit, theirs[x]) for x, hit in ours.items() if x in theirs)
    if not ends:
        return None
    found = {"success": rates(ours, theirs, clusters)}
    ratio = time_ratio(first, second, clusters)
    found |= {} if ratio is None else {"time": ratio}
    split = ends[True, False], ends[False, True], ends[True, True]
    return Pair(ends.total(), *split, found)


def rates(first: Hits, second: Hits, clusters: Clusters) -> Difference:
    """Return the share of hits less that of another's, on the scenes that both ran.

    A hit is in favour of who has it.
    """
    more = {x: float(hit) - second[x] for x, hit in first.items() if x in second}
    sums, counts = summed(more, clusters)
    return Difference(mean(sums, counts), exact_p(sums), int(np.sign(sums.sum())))


def time_ratio(first: Values, second: Values, clusters: Clusters) -> Difference | None:
    """Return first over second, where both arrived; none in too few clusters."""
    ours, theirs = (
        {k: math.log(t) for k, t in x.items() if t} for x in (first, second)
    )
    found = difference(ours, theirs, clusters)
    if found is None:
        return None
    middle, low, high = map(math.exp, found.value)
    return found._replace(value=(middle, low, high), better=-found.better)


def difference(first: Values, second: Values, clusters: Clusters) -> Difference | None:
    """Return first less second, where both have a value; none in too few clusters."""
    pairs = {k: (a, second.get(k)) for k, a in first.items()}
    less = {k: a - b for k, (a, b) in pairs.items() if a is not None and b is not None}
    sums, counts = summed(less, clusters)
    if (counts > 0).sum() < FEW:
        return None
    return Difference(
        mean(sums, counts), exact_p(on_grid(sums)), int(np.sign(sums.sum()))
    )


def summed(values: Mapping[Hashable, float], clusters: Clusters) -> tuple[Array, Array]:
    """Return the sums of values and how many there are, by cluster."""
    number, many = [clusters[x] for x in values], max(clusters.values()) + 1
    sums = np.bincount(number, [*values.values()], minlength=many)
    return sums.astype(float), np.bincount(number, minlength=many).astype(float)
