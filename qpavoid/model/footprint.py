"""Convex footprints: the pentagon with a tip (section 2, Eq. 8), rectangle, polygon."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.types import Array

CORNER, ONCE_ROUND = 1e-9, 7.0
"""Sine of the least turn of a corner; rad, a bound between one whole turn and two."""


def why_not_convex(vertices: Array) -> str:
    """Return the fault of the corners (n, 2) of a polygon, m; empty if convex."""
    side = np.roll(vertices, -1, axis=0) - vertices
    length, following = np.hypot(*side.T), np.roll(side, -1, axis=0)
    turn = side[:, 0] * following[:, 1] - side[:, 1] * following[:, 0]
    angle = np.arctan2(turn, (side * following).sum(axis=1)).sum()
    least = CORNER * length * np.roll(length, -1)
    left, right = turn > least, turn < -least
    if left.all() and angle <= ONCE_ROUND:
        return ""
    if not left.any() and right.any():
        return "are clockwise"
    if right.any() or left.all():
        return "make a polygon that is not convex, or crosses itself"
    return "repeat a corner, or have one on a side"


@dataclass(frozen=True, eq=False)
class Footprint:
    """Convex polygon in the robot frame, whose origin is the middle of the axle.

    Attributes:
        vertices: (n, 2) corners in m, counter-clockwise, none of 180°.
        edges: (n, 5) edge i, from vertex i to the next: a_x, a_y (its start, m),
            n_x, n_y (outward unit normal), length (m). The unit tangent is
            (−n_y, n_x). Read-only, as is ``vertices``.

    Raises:
        InvalidInputError: Fewer than three corners, not finite, clockwise or not
            strictly convex.
    """

    vertices: Array
    edges: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        try:
            vertices = np.array(self.vertices, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"footprint vertices must be numbers: {error}"
            ) from None
        if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 3:
            raise InvalidInputError(
                "a footprint takes (n, 2) vertices with n >= 3, "
                f"not shape {vertices.shape}"
            )
        if not np.isfinite(vertices).all():
            raise InvalidInputError("footprint vertices must be finite")
        if wrong := why_not_convex(vertices):
            raise InvalidInputError(
                "footprint vertices must be the corners of a convex polygon, "
                f"counter-clockwise, without repeated or collinear ones: these {wrong}"
            )
        side = np.roll(vertices, -1, axis=0) - vertices
        length = np.hypot(side[:, 0], side[:, 1])
        normal = np.column_stack([side[:, 1], -side[:, 0]]) / length[:, None]
        edges = np.column_stack([vertices, normal, length])
        for array in (vertices, edges):
            array.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "edges", edges)

    @classmethod
    def pentagon(cls, length: float, width: float, tip_angle: float) -> "Footprint":
        """Return the paper's footprint: a rectangle with a tip at its front (Fig. 2b).

        The left tip edge runs from the corner (L/2, D/2) to the apex
        (L/2 + D/2·tan α, 0); its outward normal is (cos α, sin α). Segments, in order:
        right side, right tip edge, left tip edge, left side, rear.

        Args:
            length: L, length of the chassis without the tip, m.
            width: D, its width, m.
            tip_angle: α_mp, rad, between X_R and the outward normal of a tip edge.

        Raises:
            InvalidInputError: Eq. 8, tan α > D/L, does not hold, so that on part of
                the tip Eq. 7 would turn towards the obstacle.
        """
        _positive(length=length, width=width)
        least = math.atan2(width, length)
        if not least < tip_angle < math.pi / 2:
            raise InvalidInputError(
                f"tip angle {math.degrees(tip_angle):.4g} deg: Eq. 8 needs more than "
                f"atan(D/L) = {math.degrees(least):.4g} deg (and less than 90 deg)"
            )
        half_length, half_width = length / 2, width / 2
        apex = half_length + half_width * math.tan(tip_angle)
        return cls(
            np.array(
                [
                    (-half_length, -half_width),
                    (half_length, -half_width),
                    (apex, 0.0),
                    (half_length, half_width),
                    (-half_length, half_width),
                ]
            )
        )

    @classmethod
    def rectangle(cls, length: float, width: float) -> "Footprint":
        """Return a rectangle centred on the axle (Fig. 2a: four segments), sizes in m.

        Segments, in order: right side, front, left side, rear.
        """
        _positive(length=length, width=width)
        x, y = length / 2, width / 2
        return cls(np.array([(-x, -y), (x, -y), (x, y), (-x, y)]))

    @classmethod
    def polygon(cls, vertices: Sequence[Sequence[float]] | Array) -> "Footprint":
        """Return any strictly convex polygon, counter-clockwise, robot frame, m."""
        return cls(vertices)  # type: ignore[arg-type]

    @property
    def circumradius(self) -> float:
        """Greatest distance of the footprint from the robot's origin, m."""
        return float(np.hypot(self.vertices[:, 0], self.vertices[:, 1]).max())


def offset_outline(vertices: Array, distance: float, corner: int = 16) -> Array:
    """Return the outline (n, 2) of the points within ``distance`` m of a footprint.

    Corners are rounded by ``corner`` points each; same frame as ``vertices``.
    """
    normals = Footprint(vertices).edges[:, 2:4]
    after = np.arctan2(normals[:, 1], normals[:, 0])[:, None]
    before = np.roll(after, 1, axis=0)
    angle = before + (after - before) % (2 * np.pi) * np.linspace(0.0, 1.0, corner)
    round_corner = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray((vertices[:, None] + distance * round_corner).reshape(-1, 2))


def _positive(**sizes: float) -> None:
    for name, value in sizes.items():
        if not (math.isfinite(value) and value > 0):
            raise InvalidInputError(f"footprint {name} must be positive, not {value}")
