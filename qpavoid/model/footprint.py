"""Footprints: unions of convex polygons; the pentagon with a tip (section 2, Eq. 8)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled_once
from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import CORNER
from qpavoid.model.contact import point_contact
from qpavoid.model.validation import finite_rows
from qpavoid.settings import want
from qpavoid.types import Array

BENT = round(CORNER**-2)
"""Inverse square of the least sine of a corner's turn."""

Corner = tuple[int, int, int]
"""x, y of a corner in exact arithmetic, in a small unit, and its number."""


def turn(a: Corner, b: Corner, c: Corner) -> int:
    """Return twice the signed area of the triangle a, b, c; positive if c is left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def square(a: Corner, b: Corner) -> int:
    """Return the squared distance of two corners."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def bend(a: Corner, b: Corner, c: Corner) -> int:
    """Return 1 if a corner b turns left, −1 right, 0 hardly."""
    left = turn(a, b, c)
    bent = left * left * BENT > square(a, b) * square(b, c)
    return (left > 0) - (left < 0) if bent else 0


def bends(corners: list[Corner]) -> list[int]:
    """Return :func:`bend` of each corner of a polygon."""
    n = len(corners)
    return [bend(corners[k - 1], b, corners[k + 1 - n]) for k, b in enumerate(corners)]


def touch(a: Corner, b: Corner, c: Corner, d: Corner) -> bool:
    """Return whether the segments a–b and c–d have a common point."""
    for i in (0, 1):
        if max(a[i], b[i]) < min(c[i], d[i]) or max(c[i], d[i]) < min(a[i], b[i]):
            return False
    one, other = turn(a, b, c) * turn(a, b, d), turn(c, d, a) * turn(c, d, b)
    return one <= 0 and other <= 0


def why_not_simple(vertices: Array) -> str:
    """Return the fault of the corners (n, 2) of a polygon, m; empty if simple."""
    corners = exact(vertices)
    sides = list(zip(corners, corners[1:] + corners[:1], strict=True))
    if any(square(*side) == 0 for side in sides):
        return "repeat a corner"
    for i, one in enumerate(sides):
        for other in sides[i + 2 : len(sides) - (i == 0)]:
            if touch(*one, *other):
                return "make a polygon that crosses or touches itself"
    if sum(turn(corners[0], *side) for side in sides) < 0:
        return "are clockwise"
    return "" if all(bends(corners)) else "have one on a side"


def why_not_convex(vertices: Array) -> str:
    """Return the fault of the corners (n, 2) of a polygon, m; empty if convex."""
    inward = "make a polygon that is not convex" if -1 in bends(exact(vertices)) else ""
    return why_not_simple(vertices) or inward


def exact(vertices: Array) -> list[Corner]:
    """Return the corners (n, 2) in exact arithmetic."""
    pairs = [(Fraction(x), Fraction(y)) for x, y in vertices.tolist()]
    unit = max(one.denominator for pair in pairs for one in pair)  # a power of two
    return [(int(x * unit), int(y * unit), i) for i, (x, y) in enumerate(pairs)]


def is_diagonal(corners: list[Corner], i: int, j: int) -> bool:
    """Return whether the segment of two corners, not neighbours, is in a polygon."""
    n, a, b = len(corners), corners[i], corners[j]
    for k in range(n):
        ends = k, (k + 1) % n
        if not {i, j} & {*ends} and touch(a, b, *(corners[end] for end in ends)):
            return False
    before, after = corners[i - 1], corners[(i + 1) % n]
    beyond = turn(before, a, b) <= 0, turn(a, after, b) <= 0
    return not (all(beyond) if turn(before, a, after) < 0 else any(beyond))


def convex_parts(corners: list[Corner]) -> list[list[Corner]]:
    """Return convex polygons that make up a simple one, cut along diagonals.

    Each cut ends at a corner of more than 180° and leaves the fewest such corners; of
    equal ones the shortest is chosen. Corners of 180° that a cut makes are left out,
    and parts without a width.
    """
    turns = bends(corners)
    if -1 not in turns:
        part = [one for one, bent in zip(corners, turns, strict=True) if bent]
        return [part] if len(part) > 2 else []
    cuts, n = [], len(corners)
    for i in (k for k, one in enumerate(turns) if one < 0):
        for j in (k for k in range(n) if (i - k) % n not in (0, 1, n - 1)):
            a, b = corners[i], corners[j]
            left = [bend(corners[i - 1], a, b), bend(b, a, corners[i + 1 - n])]
            left += [bend(corners[j - 1], b, a), bend(a, b, corners[j + 1 - n])]
            cuts.append((left.count(-1) - (turns[j] < 0), square(a, b), i, j))
    cut = next(x[2:] for x in sorted(cuts) if is_diagonal(corners, *x[2:]))
    low, high = sorted(cut)
    halves = corners[low : high + 1], corners[high:] + corners[: low + 1]
    return [part for half in halves for part in convex_parts(half)]


@compiled_once
def fill_edges(corners: Array, begin: int, end: int, edges: Array) -> float:
    """Fill in the edges of a convex part; return its circumradius, m.

    Args:
        corners: (n, 2) of all parts, one after the other, m.
        begin: Row of its first corner.
        end: Row after its last one.
        edges: (n, 6) of all parts, see :attr:`Footprint.edges`.
    """
    reach = 0.0
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        a, edge = corners[i], edges[i]
        x, y = corners[j, 0] - a[0], corners[j, 1] - a[1]
        length = np.hypot(x, y)
        edge[0], edge[1], edge[2], edge[3] = a[0], a[1], y / length, -x / length
        edge[4], edge[5] = length, end
        reach = max(reach, np.hypot(a[0], a[1]))
    return reach


def simple_polygon(corners: npt.ArrayLike) -> Array:
    """Return the corners (n, 2) of a simple polygon, a read-only copy."""
    vertices = finite_rows(corners, 2, "footprint vertices").copy()
    few = f"a footprint takes n >= 3 vertices, not {len(vertices)}"
    want(len(vertices) >= 3, few)
    if wrong := why_not_simple(vertices):
        raise InvalidInputError(
            "footprint vertices must be the corners of a polygon, counter-clockwise, "
            f"without repeated or collinear ones: these {wrong}"
        )
    vertices.setflags(write=False)
    return vertices


@dataclass(frozen=True, eq=False)
class Footprint:
    """Union of polygons in the robot frame, whose origin is the middle of the axle.

    Each polygon is cut into convex *parts*. The distance to the footprint is the least
    of the distances to its parts: exact outside; inside, the depth within one part,
    which may be less than that within the union.

    Attributes:
        outlines: Polygons as given: (n, 2) corners in m each, counter-clockwise, none
            of 180°. They may overlap, or be apart.
        vertices: (n, 2) corners of all outlines, one after the other.
        parts: Convex polygons of the same union.
        edges: (n, 6) edges of all parts, one part after the other: a_x, a_y (start of
            the edge, m), n_x, n_y (outward unit normal), length (m), and the row after
            the last edge of the part. The unit tangent is (−n_y, n_x). Arrays are
            read-only.

    Raises:
        InvalidInputError: No polygon; or one with fewer than three corners, not finite,
            clockwise, that crosses or touches itself, or with a corner of 180°.
    """

    outlines: tuple[Array, ...]
    vertices: Array = field(init=False, repr=False)
    parts: tuple[Array, ...] = field(init=False, repr=False)
    edges: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        outlines, end = tuple(map(simple_polygon, self.outlines)), 0
        parts = list[Array]()
        want(len(outlines) > 0, "a footprint takes one polygon or more, not none")
        for outline in outlines:
            parts += [
                outline[[i for _, _, i in x]] for x in convex_parts(exact(outline))
            ]
        want(len(parts) > 0, "a footprint takes polygons with a width")
        vertices, corners = np.vstack(outlines), np.vstack(parts)
        edges = np.empty((len(corners), 6))
        for part in parts:
            begin, end = end, end + len(part)
            fill_edges.py_func(corners, begin, end, edges)  # type: ignore[attr-defined]
        for array in (*parts, vertices, edges):
            array.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "outlines", outlines)
        object.__setattr__(self, "parts", tuple(parts))
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
        return cls.polygon(
            [
                (-half_length, -half_width),
                (half_length, -half_width),
                (apex, 0.0),
                (half_length, half_width),
                (-half_length, half_width),
            ]
        )

    @classmethod
    def rectangle(cls, length: float, width: float) -> "Footprint":
        """Return a rectangle centred on the axle (Fig. 2a: four segments), sizes in m.

        Segments, in order: right side, front, left side, rear.
        """
        _positive(length=length, width=width)
        x, y = length / 2, width / 2
        return cls.polygon([(-x, -y), (x, -y), (x, y), (-x, y)])

    @classmethod
    def polygon(cls, vertices: Sequence[Sequence[float]] | Array) -> "Footprint":
        """Return any simple polygon, counter-clockwise, robot frame, m."""
        return cls((vertices,))  # type: ignore[arg-type]

    @classmethod
    def union(cls, parts: Sequence[Any]) -> "Footprint":
        """Return the union of footprints or corners of polygons, robot frame, m."""
        if not isinstance(parts, Iterable):
            raise InvalidInputError("a union takes several polygons")
        each = (x.outlines if isinstance(x, cls) else (x,) for x in parts)
        return cls(tuple(outline for outlines in each for outline in outlines))

    @property
    def starts(self) -> npt.NDArray[np.int64]:
        """(p,) row of the first edge of each part."""
        return np.cumsum([0, *map(len, self.parts[:-1])])

    @property
    def circumradius(self) -> float:
        """Greatest distance of the footprint from the robot's origin, m."""
        return float(np.hypot(self.vertices[:, 0], self.vertices[:, 1]).max())

    @property
    def inner_radius(self) -> float:
        """Radius of the greatest disc about the origin within one part, m.

        Negative outside: minus the distance of the origin.
        """
        return -float(point_contact(self.edges, 0.0, 0.0).distance)


def offset_outline(vertices: Array, distance: float, corner: int = 16) -> Array:
    """Return the outline (n, 2) of the points within ``distance`` m of a convex part.

    Corners are rounded by ``corner`` points each; same frame as ``vertices``.
    """
    normals = Footprint.polygon(vertices).edges[:, 2:4]
    after = np.arctan2(normals[:, 1], normals[:, 0])[:, None]
    before = np.roll(after, 1, axis=0)
    angle = before + (after - before) % (2 * np.pi) * np.linspace(0.0, 1.0, corner)
    round_corner = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.asarray((vertices[:, None] + distance * round_corner).reshape(-1, 2))


def _positive(**sizes: float) -> None:
    for name, value in sizes.items():
        if not (math.isfinite(value) and value > 0):
            raise InvalidInputError(f"footprint {name} must be positive, not {value}")
