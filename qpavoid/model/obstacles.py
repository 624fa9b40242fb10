"""Obstacles: sensed points, discs, walls and convex polygons, in one table.

The table, its columns and the motion are those of :mod:`qpavoid.model.capsules`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import (
    CAPSULE_WIDTH,
    NO_SQUARE,
    OWNER,
    PIVOT_X,
    PIVOT_Y,
    RADIUS,
    SIGMA,
    TURN,
    V_X,
    V_Y,
    X1,
    Y1,
    Y2,
    fill_capsules,
    in_robot_frame,
    like,
)
from qpavoid.model.footprint import why_not_convex
from qpavoid.model.validation import (
    NO_POLYGONS,
    as_polygons,
    as_velocities,
    check_not_negative,
    finite_rows,
)
from qpavoid.types import Array, Arrays, Pose

NO_POINTS = np.empty((0, 2))
NO_DISCS = np.empty((0, 3))
NO_WALLS = np.empty((0, 4))
NO_TURNS = np.empty((0, 3))
NO_CAPSULES = np.empty((0, CAPSULE_WIDTH))


@dataclass(frozen=True, eq=False, slots=True, init=False)
class Obstacles:
    """Obstacles in one frame.

    They are numbered: points first, then discs, walls, polygons. Arguments:

    - ``points`` (N, 2): x, y in m; a sensed point is a disc of radius 0 at rest;
    - ``discs`` (D, 3): x, y, radius in m; ``disc_velocities`` (D, 2) in m/s;
      ``disc_sigmas`` (D,), standard deviations of these velocities, m/s: the guide
      passes uncertain discs at a greater distance;
    - ``walls`` (W, 4): x1, y1, x2, y2 in m; ``wall_velocities`` (W, 2) in m/s;
    - ``polygons``: of each its (n, 2) vertices in m, strictly convex and
      counter-clockwise; ``polygon_velocities`` (P, 3): v_x, v_y of the centroid of its
      area in m/s, rate of turn about it in rad/s, counter-clockwise.

    Velocities are those over ground, in the axes of the frame; without them obstacles
    are at rest.

    Attributes:
        points: (N, 2) sensed points, m.
        capsules: (M, CAPSULE_WIDTH) all others; see :mod:`qpavoid.model.capsules`.

    Raises:
        InvalidInputError: Wrong shapes, not real and finite numbers, negative radii, a
            polygon that is not convex; the message names the array and the row.
    """

    points: Array
    capsules: Array

    def __init__(
        self,
        points: npt.ArrayLike = NO_POINTS,
        discs: npt.ArrayLike = NO_DISCS,
        disc_velocities: npt.ArrayLike = NO_POINTS,
        walls: npt.ArrayLike = NO_WALLS,
        polygons: Sequence[npt.ArrayLike] = NO_POLYGONS,
        polygon_velocities: npt.ArrayLike = NO_TURNS,
        wall_velocities: npt.ArrayLike = NO_POINTS,
        disc_sigmas: npt.ArrayLike = (),
    ) -> None:
        points, discs = finite_rows(points, 2, "points"), finite_rows(discs, 3, "discs")
        walls, chains = finite_rows(walls, 4, "walls"), as_polygons(polygons)
        sigmas = np.reshape(disc_sigmas, (-1, 1))
        sigmas = as_velocities(sigmas, len(discs), 1, "disc_sigmas")
        check_not_negative(discs[:, 2], "the radius of discs")
        check_not_negative(sigmas[:, 0], "disc_sigmas")
        arrays = (
            discs,
            as_velocities(disc_velocities, len(discs), 2, "disc_velocities"),
            walls,
            as_velocities(wall_velocities, len(walls), 2, "wall_velocities"),
        )
        turns = as_velocities(polygon_velocities, len(chains), 3, "polygon_velocities")
        object.__setattr__(self, "points", points.copy())
        object.__setattr__(
            self, "capsules", as_table(len(points), arrays, chains, turns)
        )
        self.capsules[: len(discs), SIGMA] = sigmas[:, 0]

    @classmethod
    def of(cls, points: Array, capsules: Array) -> "Obstacles":
        """Return obstacles of the rows of tables, unchecked, numbered anew.

        Neighbouring rows of one owner are one obstacle.
        """
        made = object.__new__(cls)
        object.__setattr__(made, "points", points.copy())
        object.__setattr__(made, "capsules", capsules.copy())
        made.capsules[:, OWNER] = len(points) - 1 + np.cumsum(made._are_first)
        return made

    def __len__(self) -> int:
        return len(self.points) + len(self.starts)

    @property
    def arrays(self) -> Arrays:
        """Points and capsules, for compiled functions."""
        return self.points, self.capsules

    @property
    def _are_first(self) -> npt.NDArray[np.bool_]:
        """(M,) whether a row is the first of its obstacle."""
        owner = self.capsules[:, OWNER]
        return np.concatenate(([True], owner[1:] != owner[:-1]))[: len(owner)]

    @property
    def starts(self) -> npt.NDArray[np.int64]:
        """(n,) the first row of every obstacle among the capsules."""
        return np.flatnonzero(self._are_first)

    @property
    def sizes(self) -> npt.NDArray[np.int64]:
        """(n,) rows per obstacle among the capsules: a polygon's edges, else 1."""
        return np.bincount(np.cumsum(self._are_first) - 1)

    @property
    def chains(self) -> list[Array]:
        """Rows of every obstacle among the capsules."""
        return np.split(self.capsules, self.starts[1:]) if len(self.capsules) else []

    @property
    def lengthy(self) -> list[Array]:
        """Rows of every wall and polygon."""
        rows = np.column_stack([self.starts, self.sizes])[~self.is_disc[self.starts]]
        return [self.capsules[k : k + n] for k, n in rows.tolist()]

    @property
    def is_disc(self) -> npt.NDArray[np.bool_]:
        """(M,) whether a capsule has no length."""
        x1, y1, x2, y2 = self.capsules[:, X1 : Y2 + 1].T
        return np.asarray((x1 == x2) & (y1 == y2))

    @property
    def discs(self) -> Array:
        """(D, 3) x, y, radius of the capsules without length, m."""
        return self.capsules[self.is_disc][:, [X1, Y1, RADIUS]]

    @property
    def disc_velocities(self) -> Array:
        """(D, 2) velocities of the discs, m/s."""
        return self.capsules[self.is_disc][:, [V_X, V_Y]]

    @property
    def disc_sigmas(self) -> Array:
        """(D,) standard deviations of the discs' velocities, m/s."""
        return self.capsules[self.is_disc][:, SIGMA]

    @property
    def lines(self) -> Array:
        """(L, 4) x1, y1, x2, y2 of the capsules with a length: walls and edges, m."""
        return self.capsules[~self.is_disc][:, X1 : Y2 + 1]

    @property
    def is_wall(self) -> npt.NDArray[np.bool_]:
        """(M,) whether a capsule is neither a disc nor an edge of a polygon."""
        return np.asarray((np.repeat(self.sizes, self.sizes) == 1) & ~self.is_disc)

    @property
    def walls(self) -> Array:
        """(W, 4) x1, y1, x2, y2 of the walls, m."""
        return np.array(self.capsules[self.is_wall, X1 : Y2 + 1])

    @property
    def wall_velocities(self) -> Array:
        """(W, 2) velocities of the walls, m/s."""
        return np.array(self.capsules[self.is_wall, V_X : V_Y + 1])

    @property
    def polygons(self) -> list[Array]:
        """(n, 2) vertices of every polygon, m."""
        return [one[:, X1 : Y1 + 1].copy() for one in self.chains if len(one) > 1]

    @property
    def polygon_velocities(self) -> Array:
        """(P, 3) v_x, v_y (m/s) and rate of turn (rad/s) of the polygons."""
        return np.array(self.capsules[self.starts[self.sizes > 1], V_X : TURN + 1])

    @property
    def as_discs(self) -> "Obstacles":
        """Obstacles with each capsule replaced by the least disc about its pivot.

        For methods that use discs only. A disc moves as the pivot does.
        """
        starts = self.starts
        reach = self._levers + self.capsules[:, RADIUS]
        middles = self.capsules[starts, PIVOT_X : PIVOT_Y + 1]
        discs = np.column_stack([middles, np.maximum.reduceat(reach, starts)])
        velocities, sigmas = np.split(
            self.capsules[starts][:, [V_X, V_Y, SIGMA]], [2], 1
        )
        return Obstacles(self.points, discs, velocities, disc_sigmas=sigmas)

    def chosen(self, rows: npt.NDArray[np.bool_]) -> "Obstacles":
        """Return the points and those rows (M,) of the capsules, numbered anew."""
        return Obstacles.of(self.points, self.capsules[rows])

    def joined(self, others: "Obstacles") -> "Obstacles":
        """Return these obstacles followed by the capsules of others."""
        more = others.capsules.copy()
        more[:, OWNER] += len(self) + 1.0
        return Obstacles.of(self.points, np.vstack([self.capsules, more]))

    @property
    def speeds(self) -> Array:
        """(M,) an upper bound of the speed of the row's obstacle, m/s."""
        if not len(self.capsules):
            return np.empty(0)
        speeds = np.hypot(*self.capsules[:, V_X : V_Y + 1].T)
        speeds += np.abs(self.capsules[:, TURN]) * self._levers
        return np.repeat(np.maximum.reduceat(speeds, self.starts), self.sizes)

    @property
    def _levers(self) -> Array:
        """(M,) greatest distance of the ends of each row from its pivot, m."""
        pivots = self.capsules[:, None, PIVOT_X : PIVOT_Y + 1]
        ends = self.capsules[:, X1 : Y2 + 1].reshape(-1, 2, 2) - pivots
        return np.asarray(np.hypot(ends[..., 0], ends[..., 1]).max(axis=1, initial=0.0))

    def seen_from(self, pose: Pose, time: float = 0.0) -> "Obstacles":
        """Return the obstacles after ``time`` s in the frame of a robot at ``pose``.

        Velocities stay those over ground; only their components are rotated.
        """
        seen = like(self.arrays)
        in_robot_frame(pose, time, self.arrays, seen)
        return Obstacles.of(*seen)

    def moved(self, time: float) -> "Obstacles":
        """Return the obstacles after ``time`` s of their motion."""
        return self.seen_from((0.0, 0.0, 0.0), time)

    def at_rest(self) -> "Obstacles":
        """Return the obstacles without their velocities."""
        capsules = self.capsules.copy()
        capsules[:, [V_X, V_Y, TURN, SIGMA]] = 0.0
        return Obstacles.of(self.points, capsules)

    def within(self, reach: float) -> "Obstacles":
        """Return the obstacles nearer than ``reach`` m to the origin of their frame."""
        points = self.points[np.hypot(*self.points.T) < reach]
        if not len(self.capsules):
            return Obstacles.of(points, self.capsules)
        lines, starts, sizes = self.capsules[:, X1 : Y2 + 1], self.starts, self.sizes
        start, way = lines[:, :2], lines[:, 2:] - lines[:, :2]
        length = np.maximum((way * way).sum(axis=1), NO_SQUARE)
        share = np.clip((-start * way).sum(axis=1) / length, 0.0, 1.0)
        near = np.hypot(*(start + share[:, None] * way).T) - self.capsules[:, RADIUS]
        near = np.logical_or.reduceat(near < reach, starts)
        left = lines[:, 0] * lines[:, 3] > lines[:, 1] * lines[:, 2]
        near |= (sizes > 1) & np.logical_and.reduceat(left, starts)  # round the origin
        return Obstacles.of(points, self.capsules[np.repeat(near, sizes)])


def as_table(
    first: int,
    arrays: tuple[Array, Array, Array, Array],
    chains: list[Array],
    turns: Array,
) -> Array:
    """Return the capsules (M, CAPSULE_WIDTH) of valid arrays.

    Args:
        first: Number of the first obstacle.
        arrays: Discs and walls, each with its velocities.
        chains: Of each polygon its (n, 2) vertices, m.
        turns: (P, 3) velocities of the polygons.

    Raises:
        InvalidInputError: A polygon is not strictly convex and counter-clockwise.
    """
    corners, polygons = NO_POINTS, NO_WALLS
    if chains:
        corners = np.concatenate(chains)
        sizes = np.array([len(one) for one in chains], dtype=np.float64)
        polygons = np.column_stack([sizes, turns])
    rows = len(arrays[0]) + len(arrays[2]) + len(corners)
    capsules = np.empty((rows, CAPSULE_WIDTH))
    if rows == 0:  # imports must not need machine code
        return capsules
    wrong = fill_capsules(first, *arrays, corners, polygons, capsules)
    if wrong >= 0:
        why = why_not_convex(chains[wrong]) or "hardly turn"
        raise InvalidInputError(
            f"polygons[{wrong}] must have the corners of a convex polygon, "
            f"counter-clockwise, without repeated or collinear ones: these {why}"
        )
    return capsules


NO_OBSTACLES = Obstacles()
