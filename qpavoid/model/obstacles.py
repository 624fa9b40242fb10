"""Obstacles as arrays: sensed points, discs with velocities, and wall segments."""

import math
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled
from qpavoid.errors import InvalidInputError
from qpavoid.model.footprint import Array

Arrays: TypeAlias = tuple[Array, Array, Array, Array]
"""Points, discs, disc velocities and walls, as the compiled functions take them."""

FLOAT = np.dtype(np.float64)
FARTHEST = 1e100
"""m (and m/s); numbers from here on are taken for infinite: their squares may be."""

NO_POINTS = np.empty((0, 2))
NO_DISCS = np.empty((0, 3))
NO_WALLS = np.empty((0, 4))


def as_rows(value: npt.ArrayLike, columns: int, name: str) -> Array:
    """Return ``value`` as a C-contiguous float array of shape (n, columns).

    An array that already is one is handed back as it is, uncopied. Whether the numbers
    are finite is checked where they are used.

    Raises:
        InvalidInputError: Another shape, or not numbers.
    """
    if (
        type(value) is np.ndarray
        and value.dtype is FLOAT
        and value.ndim == 2
        and value.shape[1] == columns
        and value.flags.carray
    ):
        return value
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from None
    if array.shape == (0,):
        return np.empty((0, columns))
    if array.ndim != 2 or array.shape[1] != columns:
        raise InvalidInputError(
            f"{name} must have shape (n, {columns}), not {array.shape}"
        )
    return array


@dataclass(frozen=True, eq=False, slots=True)
class Obstacles:
    """Everything that must not be touched, in one frame.

    Obstacles are numbered points first, then discs, then walls.

    Attributes:
        points: (N, 2) x, y in m; a sensed point is a disc of radius 0 at rest.
        discs: (M, 3) x, y, radius in m.
        disc_velocities: (M, 2) in m/s, components in the same frame; none means rest.
        walls: (K, 4) x1, y1, x2, y2 in m, at rest.

    Raises:
        InvalidInputError: Wrong shapes, numbers that are not finite, negative radii;
            the message names the array and the row.
    """

    points: Array = field(default_factory=lambda: NO_POINTS)
    discs: Array = field(default_factory=lambda: NO_DISCS)
    disc_velocities: Array = field(default_factory=lambda: NO_POINTS)
    walls: Array = field(default_factory=lambda: NO_WALLS)

    def __post_init__(self) -> None:
        arrays = obstacle_arrays(
            self.points, self.discs, self.disc_velocities, self.walls
        )
        check_obstacles(*arrays)
        for name, array in zip(self.__slots__, arrays, strict=True):
            object.__setattr__(self, name, array.copy())

    def __len__(self) -> int:
        return len(self.points) + len(self.discs) + len(self.walls)

    @property
    def arrays(self) -> Arrays:
        """Points, discs, disc velocities and walls, as the compiled functions take."""
        return self.points, self.discs, self.disc_velocities, self.walls

    def seen_from(self, pose: tuple[float, float, float]) -> "Obstacles":
        """Return the obstacles in the frame of a robot at ``pose`` (x, y, γ).

        Velocities stay those over ground; only their components are rotated.
        """
        seen = like(self.arrays)
        in_robot_frame(*pose, 0.0, self.arrays, seen)
        return Obstacles(*seen)

    def within(self, reach: float) -> "Obstacles":
        """Return those nearer than ``reach`` m to the origin of their frame."""
        points, discs, velocities, walls = self.arrays
        near = np.hypot(*discs[:, :2].T) - discs[:, 2] < reach
        return Obstacles(
            points[np.hypot(*points.T) < reach],
            discs[near],
            velocities[near],
            walls[np.hypot(*nearest_on_walls(walls, 0.0).T) < reach],
        )


def nearest_on_walls(walls: Array, ahead: float) -> Array:
    """Return the point (n, 2) of every wall nearest to (ahead, 0), m."""
    start, way = walls[:, :2], walls[:, 2:] - walls[:, :2]
    length = np.maximum((way * way).sum(axis=1), 1e-18)
    share = np.clip((((ahead, 0.0) - start) * way).sum(axis=1) / length, 0.0, 1.0)
    nearest: Array = start + share[:, None] * way
    return nearest


def like(arrays: Arrays) -> Arrays:
    """Return memory for as many obstacles."""
    points, discs, disc_velocities, walls = map(np.empty_like, arrays)
    return points, discs, disc_velocities, walls


@compiled
def in_robot_frame(
    x: float, y: float, heading: float, time: float, world: Arrays, seen: Arrays
) -> None:
    """Fill ``seen``: world-frame obstacles in the frame of a robot at (x, y, γ).

    Discs have moved with their velocities for ``time`` seconds.
    """
    points, discs, disc_velocities, walls = world
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(points.shape[0]):
        d_x, d_y = points[i, 0] - x, points[i, 1] - y
        seen[0][i, 0], seen[0][i, 1] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
    for i in range(discs.shape[0]):
        v_x, v_y = disc_velocities[i, 0], disc_velocities[i, 1]
        d_x, d_y = discs[i, 0] + time * v_x - x, discs[i, 1] + time * v_y - y
        seen[1][i, 0], seen[1][i, 1] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
        seen[1][i, 2] = discs[i, 2]
        seen[2][i, 0], seen[2][i, 1] = cos * v_x + sin * v_y, cos * v_y - sin * v_x
    for i in range(walls.shape[0]):
        for k in (0, 2):
            d_x, d_y = walls[i, k] - x, walls[i, k + 1] - y
            seen[3][i, k] = cos * d_x + sin * d_y
            seen[3][i, k + 1] = cos * d_y - sin * d_x


def obstacle_arrays(
    points: Any, discs: Any, disc_velocities: Any, walls: Any
) -> Arrays:
    """Return the four arrays with the right shapes; absent velocities become rest."""
    if points is not NO_POINTS:
        points = as_rows(points, 2, "points")
    if discs is not NO_DISCS:
        discs = as_rows(discs, 3, "discs")
    if disc_velocities is not NO_POINTS:
        disc_velocities = as_rows(disc_velocities, 2, "disc_velocities")
    if walls is not NO_WALLS:
        walls = as_rows(walls, 4, "walls")
    if len(disc_velocities) != len(discs):
        if len(disc_velocities):
            raise InvalidInputError(
                f"disc_velocities has {len(disc_velocities)} rows "
                f"for {len(discs)} discs"
            )
        disc_velocities = np.zeros((len(discs), 2))
    return points, discs, disc_velocities, walls


def check_obstacles(
    points: Array, discs: Array, disc_velocities: Array, walls: Array
) -> None:
    """Raise InvalidInputError for the first row that is not finite or negative."""
    named = {
        "points": points,
        "discs": discs,
        "disc_velocities": disc_velocities,
        "walls": walls,
    }
    for name, array in named.items():
        finite = np.abs(array).sum(axis=1) < FARTHEST
        if not finite.all():
            row = int(np.argmin(finite))
            raise InvalidInputError(
                f"{name}[{row}] = {array[row].tolist()} is not finite, or above "
                f"{FARTHEST:g}; leave out readings without an echo"
            )
    if (discs[:, 2] < 0).any():
        row = int(np.argmax(discs[:, 2] < 0))
        raise InvalidInputError(
            f"discs[{row}] has the negative radius {discs[row, 2]:g} m"
        )
