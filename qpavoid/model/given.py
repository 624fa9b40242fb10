"""Validation of obstacles from a caller, and their table."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import CAPSULE_WIDTH, fill_capsules
from qpavoid.model.footprint import why_not_convex
from qpavoid.model.validation import (
    NO_POLYGONS,
    as_polygons,
    as_rows,
    as_velocities,
    check_finite,
)
from qpavoid.types import Array

NO_POINTS = np.empty((0, 2))
NO_DISCS = np.empty((0, 3))
NO_WALLS = np.empty((0, 4))
NO_TURNS = np.empty((0, 3))
NO_CHAINS = np.empty((0, 4))
NO_CAPSULES = np.empty((0, CAPSULE_WIDTH))


class Given(NamedTuple):
    """Validated obstacles from a caller.

    Attributes:
        points: (N, 2) m.
        discs: (D, 3) x, y, radius, m.
        disc_velocities: (D, 2) m/s.
        walls: (W, 4) x1, y1, x2, y2, m.
        wall_velocities: (W, 2) m/s.
        polygons: Of each its (n, 2) vertices, m.
        polygon_velocities: (P, 3) v_x, v_y, m/s, and turn, rad/s.
    """

    points: Array
    discs: Array
    disc_velocities: Array
    walls: Array
    wall_velocities: Array
    polygons: list[Array]
    polygon_velocities: Array

    @property
    def table(self) -> Array:
        """(M, CAPSULE_WIDTH) capsules; InvalidInputError: a polygon is not convex."""
        corners, polygons = NO_POINTS, NO_CHAINS
        if self.polygons:
            corners = np.concatenate(self.polygons)
            sizes = np.array([len(one) for one in self.polygons], dtype=np.float64)
            polygons = np.column_stack([sizes, self.polygon_velocities])
        rows = len(self.discs) + len(self.walls) + len(corners)
        capsules = np.empty((rows, CAPSULE_WIDTH))
        if rows == 0:  # imports must not need machine code
            return capsules
        given = (len(self.points), *self[1:5], corners, polygons)
        wrong = fill_capsules(*given, capsules)
        if wrong >= 0:
            check_finite(self.polygons[wrong], f"polygons[{wrong}]")
            why = why_not_convex(self.polygons[wrong]) or "hardly turn"
            raise InvalidInputError(
                f"polygons[{wrong}] must have the corners of a convex polygon, "
                f"counter-clockwise, without repeated or collinear ones: these {why}"
            )
        return capsules

    def check(self) -> None:
        """Raise InvalidInputError for the first row that is not finite or negative."""
        for name, value in self._asdict().items():
            for i, array in enumerate(value if name == "polygons" else [value]):
                check_finite(array, f"polygons[{i}]" if name == "polygons" else name)
        negative = self.discs[:, 2] < 0
        if negative.any():
            row = int(np.argmax(negative))
            raise InvalidInputError(
                f"discs[{row}] has the negative radius {self.discs[row, 2]:g} m"
            )


def given_obstacles(
    points: npt.ArrayLike = NO_POINTS,
    discs: npt.ArrayLike = NO_DISCS,
    disc_velocities: npt.ArrayLike = NO_POINTS,
    walls: npt.ArrayLike = NO_WALLS,
    polygons: Any = NO_POLYGONS,
    polygon_velocities: npt.ArrayLike = NO_TURNS,
    wall_velocities: npt.ArrayLike = NO_POINTS,
) -> Given:
    """Return the arrays in the right shapes; missing velocities are 0.

    Args:
        points: (N, 2) m.
        discs: (D, 3) x, y, radius, m.
        disc_velocities: (D, 2) m/s.
        walls: (W, 4) x1, y1, x2, y2, m.
        polygons: Of each its (n, 2) vertices, m.
        polygon_velocities: (P, 3) v_x, v_y, m/s, and turn, rad/s.
        wall_velocities: (W, 2) m/s.

    Raises:
        InvalidInputError: A shape does not fit, or not real numbers.
    """
    points, discs = as_rows(points, 2, "points"), as_rows(discs, 3, "discs")
    walls, chains = as_rows(walls, 4, "walls"), as_polygons(polygons)
    return Given(
        points,
        discs,
        as_velocities(disc_velocities, len(discs), 2, "disc_velocities"),
        walls,
        as_velocities(wall_velocities, len(walls), 2, "wall_velocities"),
        chains,
        as_velocities(polygon_velocities, len(chains), 3, "polygon_velocities"),
    )
