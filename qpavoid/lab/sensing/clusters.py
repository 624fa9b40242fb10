"""Moving discs from scan points: clusters, tracked from scan to scan.

Points nearer to each other than a gap are one cluster. A small cluster becomes its
smallest enclosing disc [Welzl1991]. From afar nearly half of a disc's outline is seen,
so that this is slightly smaller than the disc and nearer (people of 0.25 m at up to
6 m: 0.1 m). Clusters are assigned to known obstacles with the least sum of distances to
their predicted positions [Crouse2016].
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.validation import as_rows
from qpavoid.settings import POSITIVE, TABLE, check
from qpavoid.types import Array, Points

OUTSIDE, OUTSIDE_M = 1e-9, 1e-12
"""Relative and absolute (m) tolerance of a point outside a disc: the two or three that
define it lie on its rim but for rounding."""

FLAT = 1e-12
"""Four times the area of three points over their squared distance, below which they
count as collinear: their circumscribed disc would be arbitrarily large."""


def enclosing_disc(points: Array) -> tuple[float, float, float]:
    """Return x, y and radius (m) of the smallest disc around all points (n, 2)."""
    shuffled = np.random.default_rng(0).permutation(points)  # linear expected time
    return smallest_disc(np.ascontiguousarray(shuffled))


@entry
@compiled_once
def smallest_disc(points: Points) -> tuple[float, float, float]:
    """Return x, y and radius (m) of the smallest disc, grown point by point.

    Without points the radius is 0.
    """
    if points.shape[0] == 0:
        return 0.0, 0.0, 0.0
    x, y, radius = points[0, 0], points[0, 1], 0.0
    for i in range(1, points.shape[0]):
        if _holds(x, y, radius, points[i]):
            continue
        x, y, radius = points[i, 0], points[i, 1], 0.0
        for j in range(i):
            if _holds(x, y, radius, points[j]):
                continue
            x, y, radius = _disc_of_two(points[i], points[j])
            for k in range(j):
                if not _holds(x, y, radius, points[k]):
                    x, y, radius = _disc_of_three(points[i], points[j], points[k])
    return x, y, radius


@compiled
def _holds(x: float, y: float, radius: float, point: Array) -> bool:
    return (
        math.hypot(point[0] - x, point[1] - y) <= radius * (1.0 + OUTSIDE) + OUTSIDE_M
    )


@compiled
def _disc_of_two(p: Array, q: Array) -> tuple[float, float, float]:
    radius = 0.5 * math.hypot(p[0] - q[0], p[1] - q[1])
    return 0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), radius


@compiled
def _disc_of_three(p: Array, q: Array, r: Array) -> tuple[float, float, float]:
    """Return the circumscribed disc; on a line that of the ends, one of which is r."""
    a_x, a_y, b_x, b_y = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
    a, b = a_x * a_x + a_y * a_y, b_x * b_x + b_y * b_y
    twice = 2.0 * (a_x * b_y - a_y * b_x)
    if abs(twice) <= FLAT * max(a, b):
        first, second = _disc_of_two(p, r), _disc_of_two(q, r)
        return first if first[2] >= second[2] else second
    x, y = (b_y * a - a_y * b) / twice, (a_x * b - b_x * a) / twice
    return p[0] + x, p[1] + y, math.hypot(x, y)


COARSE = EstimatorSettings(noise=0.05)
"""Settings for discs of clusters, whose centres move as they turn."""


@dataclass(frozen=True)
class ClusterSettings:
    """Settings of the clustering and of moving clusters.

    Attributes:
        gap: Greatest distance of two points of one obstacle, m.
        largest: Greatest radius of a tracked cluster, m; larger ones are static points.
        reach: Greatest distance of an obstacle from its predicted position, m.
        estimation: Of the velocities.
    """

    gap: Annotated[float, "m", POSITIVE] = 0.3
    largest: Annotated[float, "m", POSITIVE] = 0.6
    reach: Annotated[float, "m", POSITIVE] = 0.6
    estimation: Annotated[EstimatorSettings, TABLE] = COARSE

    def __post_init__(self) -> None:
        check(self, "tracking of clusters needs")


class ClusterTracker:
    """Tracker of clusters, with velocities of :class:`VelocityEstimator`."""

    def __init__(self, settings: ClusterSettings | None = None) -> None:
        self.settings = settings if settings is not None else ClusterSettings()
        self._estimator = VelocityEstimator(self.settings.estimation)
        self._known: dict[int, tuple[float, Array, Array]] = {}
        self._named = 0

    def update(self, time: float, points: Array) -> Obstacles:
        """Return the obstacles of a scan: discs with velocities, and static points.

        Args:
            time: Of the scan, s. A repeated scan changes nothing.
            points: (n, 2) m, in a frame that is fixed to the ground: the scan's
                :func:`~qpavoid.model.kinematics.to_world` at the robot's pose.

        Raises:
            InvalidInputError: Points are not finite or time runs backwards.
        """
        scan = Obstacles(as_rows(points, 2, "points")).points
        labels = cluster(scan, self.settings.gap)
        discs, still = [], np.ones(len(scan), dtype=bool)
        for label in range(labels.max(initial=-1) + 1):
            members = labels == label
            if np.ptp(scan[members], axis=0).max() > 2 * self.settings.largest:
                continue
            disc = enclosing_disc(scan[members])
            if disc[2] <= self.settings.largest:
                discs.append(disc)
                still[members] = False
        seen = np.array(discs).reshape(-1, 3)
        ids = self._name(time, seen[:, :2])
        motion = self._estimator.update(time, ids, seen[:, :2])
        for row, name in enumerate(ids):
            self._known[name] = time, motion.positions[row], motion.velocities[row]
        found = np.column_stack([motion.positions, seen[:, 2]])
        return Obstacles(scan[still], found, motion.velocities)

    def _name(self, time: float, centres: Array) -> list[int]:
        """Return the ids of the clusters, known ones if in reach."""
        from scipy.optimize import linear_sum_assignment

        forget = self.settings.estimation.forget
        self._known = {
            name: known
            for name, known in self._known.items()
            if time - known[0] <= forget
        }
        names = list(self._known)
        due = [place + (time - t) * v for t, place, v in self._known.values()]
        apart = centres[:, None] - np.array(due).reshape(1, -1, 2)
        distance = np.hypot(apart[..., 0], apart[..., 1])
        ids = [-1] * len(centres)
        # An assignment needs finite costs; pairs out of reach are dropped afterwards.
        far = np.where(distance <= self.settings.reach, distance, 1e6)
        for row, column in zip(*linear_sum_assignment(far), strict=True):
            if distance[row, column] <= self.settings.reach:
                ids[row] = names[column]
        for row in (row for row, name in enumerate(ids) if name < 0):
            ids[row] = self._named
            self._named += 1
        return ids


def cluster(points: Array, gap: float) -> npt.NDArray[np.int32]:
    """Return the number of its cluster for each point (n, 2)."""
    if not len(points):
        return np.empty(0, dtype=np.int32)
    from scipy.sparse import coo_array  # half a second, which every start would wait
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(gap, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
    labels: npt.NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return labels
