"""Table of obstacles for compiled functions: sensed points, and capsules.

A capsule is the set of points within a radius of a segment. A disc is one of length 0,
a wall one of radius 0, a convex polygon a closed counter-clockwise chain of edges of
radius 0 in contiguous rows of one owner. Columns of a row:

    X1, Y1, X2, Y2    its ends, m
    RADIUS            m
    V_X, V_Y          velocity of the pivot over ground, m/s
    TURN              rate of turn, rad/s, counter-clockwise
    PIVOT_X, PIVOT_Y  of a polygon the centroid of its area, else the middle, m
    OWNER             number of the obstacle: points, then discs, walls, polygons
    SIGMA             σ of the velocity, m/s

In an inertial frame a point e of it is at pivot + v t + R(turn t)(e − pivot) after t
seconds.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.types import (
    Array,
    Arrays,
    ArraysWritten,
    Capsules,
    CapsulesWritten,
    Matrix,
    Points,
    Pose,
    Sizes,
)

X1, Y1, X2, Y2, RADIUS, V_X, V_Y, TURN, PIVOT_X, PIVOT_Y, OWNER, SIGMA = range(12)
CAPSULE_WIDTH = 12

CORNER, ONCE_ROUND = 1e-9, 7.0
"""Sine of the least turn of a corner; rad, a bound between one whole turn and two."""

JOINT = 1e-9
"""m and rad; tolerance within which collinear adjoining walls are joined."""

NO_SQUARE = 1e-18
"""m²; replaces the squared length of a segment of length 0 as a divisor."""

JOINED = 64
"""Rows; at most so many walls are joined, since all pairs are compared."""


class Segment(NamedTuple):
    """A line segment: a wall, or the axis of a capsule.

    Attributes:
        x1: Of one end, m.
        y1: Of one end, m.
        x2: Of the other end, m.
        y2: Of the other end, m.
    """

    x1: float
    y1: float
    x2: float
    y2: float


@compiled_once
def is_convex(corners: Array, begin: int, end: int) -> bool:
    """Return whether corners make a strictly convex, counter-clockwise polygon."""
    turned = 0.0
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        k = j + 1 if j + 1 < end else begin
        a_x, a_y = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
        b_x, b_y = corners[k, 0] - corners[j, 0], corners[k, 1] - corners[j, 1]
        left = a_x * b_y - a_y * b_x
        size = math.sqrt((a_x * a_x + a_y * a_y) * (b_x * b_x + b_y * b_y))
        if not left > CORNER * size:
            return False
        # Left at every corner is not enough: a pentagram goes round twice.
        turned += math.atan2(left, a_x * b_x + a_y * b_y)
    return end - begin > 2 and turned < ONCE_ROUND


@compiled_once
def centroid(corners: Array, begin: int, end: int) -> tuple[float, float]:
    """Return the centroid of a polygon's area, m: weighted mean of its triangles."""
    x, y = corners[begin, 0], corners[begin, 1]
    area = c_x = c_y = 0.0
    for i in range(begin + 1, end - 1):
        a_x, a_y = corners[i, 0] - x, corners[i, 1] - y
        b_x, b_y = corners[i + 1, 0] - x, corners[i + 1, 1] - y
        twice = a_x * b_y - a_y * b_x
        area += twice
        c_x += twice * (a_x + b_x)
        c_y += twice * (a_y + b_y)
    return x + c_x / (3.0 * area), y + c_y / (3.0 * area)


class Rigid(NamedTuple):
    """Properties that all capsules of an obstacle share.

    Attributes:
        radius: m.
        v_x: Of the pivot, m/s.
        v_y: Of the pivot, m/s.
        turn: rad/s.
        pivot: x, y, m.
        owner: Number of the obstacle.
        sigma: σ of the velocity, m/s.
    """

    radius: float
    v_x: float
    v_y: float
    turn: float
    pivot: tuple[float, float]
    owner: int
    sigma: float


@compiled
def set_capsule(capsules: Array, row: int, axis: Segment, body: Rigid) -> None:
    """Write one row of the table."""
    c = capsules[row]
    c[X1], c[Y1], c[X2], c[Y2] = axis.x1, axis.y1, axis.x2, axis.y2
    c[RADIUS], c[V_X], c[V_Y], c[TURN] = body.radius, body.v_x, body.v_y, body.turn
    c[PIVOT_X], c[PIVOT_Y], c[OWNER] = body.pivot[0], body.pivot[1], body.owner
    c[SIGMA] = body.sigma


@entry
@compiled_once
def _fill_capsules_fits(
    first: int,
    discs: Annotated[Matrix, Sizes(0, 3)],
    disc_velocities: Points,
    walls: Annotated[Matrix, Sizes(0, 4)],
    wall_velocities: Points,
    corners: Points,
    polygons: Annotated[Matrix, Sizes(0, 4)],
    capsules: CapsulesWritten,
) -> bool:
    """Return whether the sizes fit: rows, velocities, corners of the polygons."""
    fits = disc_velocities.shape[0] >= discs.shape[0]
    fits = fits and wall_velocities.shape[0] >= walls.shape[0]
    for i in range(polygons.shape[0]):
        fits = fits and 0.0 <= polygons[i, 0] <= corners.shape[0]
    rows = discs.shape[0] + walls.shape[0] + corners.shape[0]
    all_fit: bool = fits and capsules.shape[0] >= rows
    return all_fit


@entry_if(_fill_capsules_fits)
@compiled_once
def fill_capsules(
    first: int,
    discs: Annotated[Matrix, Sizes(0, 3)],
    disc_velocities: Points,
    walls: Annotated[Matrix, Sizes(0, 4)],
    wall_velocities: Points,
    corners: Points,
    polygons: Annotated[Matrix, Sizes(0, 4)],
    capsules: CapsulesWritten,
) -> int:
    """Fill in the table; return the first polygon that is not convex.

    Args:
        first: Number of the first of these obstacles: the number of points.
        discs: (D, 3) x, y, radius, m.
        disc_velocities: (D, 2) m/s.
        walls: (W, 4) x1, y1, x2, y2, m.
        wall_velocities: (W, 2) m/s.
        corners: (C, 2) vertices of all polygons, one after the other, m.
        polygons: (P, 4) number of vertices, v_x, v_y (m/s), turn (rad/s).
        capsules: (D + W + C, CAPSULE_WIDTH) filled.

    Returns:
        The first polygon that is not strictly convex and counter-clockwise, or −1.
    """
    row, owner = 0, first
    for i in range(discs.shape[0]):
        x, y, v = discs[i, 0], discs[i, 1], disc_velocities[i]
        body = Rigid(discs[i, 2], v[0], v[1], 0.0, (x, y), owner, 0.0)
        set_capsule(capsules, row, Segment(x, y, x, y), body)
        row += 1
        owner += 1
    for i in range(walls.shape[0]):
        w, v = walls[i], wall_velocities[i]
        pivot = (0.5 * (w[0] + w[2]), 0.5 * (w[1] + w[3]))
        body = Rigid(0.0, v[0], v[1], 0.0, pivot, owner, 0.0)
        set_capsule(capsules, row, Segment(w[0], w[1], w[2], w[3]), body)
        row += 1
        owner += 1
    begin = 0
    for i in range(polygons.shape[0]):
        end = begin + int(polygons[i, 0])
        # The first invalid one is returned: compiled code raises nothing.
        if end > corners.shape[0] or not is_convex(corners, begin, end):
            return i
        p, pivot = polygons[i], centroid(corners, begin, end)
        body = Rigid(0.0, p[1], p[2], p[3], pivot, owner, 0.0)
        for j in range(begin, end):
            k = j + 1 if j + 1 < end else begin
            a, b = corners[j], corners[k]
            set_capsule(capsules, row, Segment(a[0], a[1], b[0], b[1]), body)
            row += 1
        begin = end
        owner += 1
    return -1


@compiled
def chain_end(capsules: Array, i: int) -> int:
    """Return the first row after i that belongs to another obstacle."""
    end = i + 1
    while end < capsules.shape[0] and capsules[end, OWNER] == capsules[i, OWNER]:
        end += 1
    return end


@compiled
def has_length(capsules: Array, i: int) -> bool:
    """Return whether the axis of a capsule has a length: no disc."""
    if capsules[i, X1] != capsules[i, X2] or capsules[i, Y1] != capsules[i, Y2]:
        return True
    return False


@compiled
def axis_of(capsules: Array, i: int) -> Segment:
    """Return the present axis of capsule i."""
    c = capsules[i]
    return Segment(c[X1], c[Y1], c[X2], c[Y2])


@compiled
def from_segment(axis: Segment, x: float, y: float) -> tuple[float, float]:
    """Return the vector from the nearest point of a segment to (x, y), m."""
    s_x, s_y, d_x, d_y = axis.x2 - axis.x1, axis.y2 - axis.y1, x - axis.x1, y - axis.y1
    share = (d_x * s_x + d_y * s_y) / max(s_x * s_x + s_y * s_y, NO_SQUARE)
    share = min(max(share, 0.0), 1.0)
    return d_x - share * s_x, d_y - share * s_y


@compiled
def holds_point(chain: Array, x: float, y: float) -> bool:
    """Return whether (x, y) lies within a polygon, given by its rows."""
    for i in range(chain.shape[0]):
        d_x, d_y = chain[i, X2] - chain[i, X1], chain[i, Y2] - chain[i, Y1]
        if d_x * (y - chain[i, Y1]) < d_y * (x - chain[i, X1]):
            return False
    return True


@compiled
def capsule_at(capsules: Array, i: int, time: float) -> Segment:
    """Return the axis of capsule i after ``time`` s of its motion."""
    on_x, on_y = time * capsules[i, V_X], time * capsules[i, V_Y]
    x1, y1, x2, y2 = axis_of(capsules, i)
    if capsules[i, TURN] != 0.0:
        angle = capsules[i, TURN] * time
        cos, sin = math.cos(angle), math.sin(angle)
        c_x, c_y = capsules[i, PIVOT_X], capsules[i, PIVOT_Y]
        d_x, d_y, e_x, e_y = x1 - c_x, y1 - c_y, x2 - c_x, y2 - c_y
        x1, y1 = c_x + (cos * d_x - sin * d_y), c_y + (sin * d_x + cos * d_y)
        x2, y2 = c_x + (cos * e_x - sin * e_y), c_y + (sin * e_x + cos * e_y)
    return Segment(x1 + on_x, y1 + on_y, x2 + on_x, y2 + on_y)


@compiled
def velocity_at(capsules: Array, i: int, x: float, y: float) -> tuple[float, float]:
    """Return the velocity of the point (x, y) of capsule i: v + turn ẑ × lever, m/s."""
    v_x, v_y, turn = capsules[i, V_X], capsules[i, V_Y], capsules[i, TURN]
    if turn != 0.0:
        v_x -= turn * (y - capsules[i, PIVOT_Y])
        v_y += turn * (x - capsules[i, PIVOT_X])
    return v_x, v_y


@compiled
def speed_bound(capsules: Array, i: int) -> float:
    """Return an upper bound of the speed of the axis of capsule i, m/s.

    |v| + |turn| times the greatest distance of its ends from the pivot: the distance
    of the capsule from any static point changes at most at this rate.
    """
    v_x, v_y = capsules[i, V_X], capsules[i, V_Y]
    speed, turn = math.sqrt(v_x * v_x + v_y * v_y), abs(capsules[i, TURN])
    if turn == 0.0:
        return speed
    c_x, c_y = capsules[i, PIVOT_X], capsules[i, PIVOT_Y]
    d_x, d_y = capsules[i, X1] - c_x, capsules[i, Y1] - c_y
    e_x, e_y = capsules[i, X2] - c_x, capsules[i, Y2] - c_y
    # On a segment the point farthest from a pivot is an end.
    far = max(d_x * d_x + d_y * d_y, e_x * e_x + e_y * e_y)
    return float(speed + turn * math.sqrt(far))


@entry
@compiled
def greatest_speed(capsules: Capsules) -> float:
    """Return the greatest :func:`speed_bound`, m/s; 0 if there is no capsule."""
    speed = 0.0
    for i in range(capsules.shape[0]):
        speed = max(speed, speed_bound(capsules, i))
    return speed


@compiled
def are_as_many(world: Arrays, seen: Arrays) -> bool:
    """Return whether two tables of obstacles have the same sizes."""
    same = world[0].shape[0] == seen[0].shape[0]
    all_fit: bool = same and world[1].shape[0] == seen[1].shape[0]
    return all_fit


@entry
@compiled_once
def _in_robot_frame_fits(
    pose: Pose, time: float, world: Arrays, seen: ArraysWritten
) -> bool:
    """Return whether ``seen`` has as many rows as ``world``."""
    return are_as_many(world, seen)


@entry_if(_in_robot_frame_fits)
@compiled_once
def in_robot_frame(pose: Pose, time: float, world: Arrays, seen: ArraysWritten) -> None:
    """Fill ``seen`` with the obstacles of ``world`` in the robot frame at a pose.

    Capsules have moved for ``time`` seconds. Velocities stay those over ground, in
    robot axes; rates of turn are unchanged.
    """
    (x, y, heading), (points, capsules) = pose, world
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(points.shape[0]):
        d_x, d_y = points[i, 0] - x, points[i, 1] - y
        seen[0][i, 0], seen[0][i, 1] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
    here = seen[1]
    for i in range(capsules.shape[0]):
        v_x, v_y = capsules[i, V_X], capsules[i, V_Y]
        x1, y1, x2, y2 = capsule_at(capsules, i, time)
        d_x, d_y = x1 - x, y1 - y
        here[i, X1], here[i, Y1] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
        d_x, d_y = x2 - x, y2 - y
        here[i, X2], here[i, Y2] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
        here[i, RADIUS], here[i, TURN] = capsules[i, RADIUS], capsules[i, TURN]
        here[i, V_X], here[i, V_Y] = cos * v_x + sin * v_y, cos * v_y - sin * v_x
        d_x = capsules[i, PIVOT_X] + time * v_x - x
        d_y = capsules[i, PIVOT_Y] + time * v_y - y
        here[i, PIVOT_X] = cos * d_x + sin * d_y
        here[i, PIVOT_Y] = cos * d_y - sin * d_x
        here[i, OWNER], here[i, SIGMA] = capsules[i, OWNER], capsules[i, SIGMA]


def like(arrays: Arrays) -> Arrays:
    """Return uninitialised memory for as many obstacles."""
    return np.empty_like(arrays[0]), np.empty_like(arrays[1])


@compiled
def is_plain_wall(capsules: Array, i: int) -> bool:
    """Return whether a capsule is a static wall: has a length, no polygon's edge."""
    if i > 0 and capsules[i - 1, OWNER] == capsules[i, OWNER]:
        return False
    if i + 1 < capsules.shape[0] and capsules[i + 1, OWNER] == capsules[i, OWNER]:
        return False
    return has_length(capsules, i) and speed_bound(capsules, i) == 0.0


@compiled_once
def lengthened(capsules: Array, i: int, j: int) -> bool:
    """Extend wall i by wall j if j continues it on a line; return whether it did."""
    # All pairs of ends: they must coincide, and the walls be collinear without
    # overlapping.
    if capsules[i, RADIUS] != capsules[j, RADIUS]:
        return False
    for k in range(4):
        a, b = 2 * (k // 2), 2 * (k % 2)
        x, y = capsules[i, a], capsules[i, a + 1]
        d_x, d_y = capsules[j, b] - x, capsules[j, b + 1] - y
        if abs(d_x) + abs(d_y) > JOINT:
            continue
        f_x, f_y = capsules[i, 2 - a] - x, capsules[i, 3 - a] - y
        g_x, g_y = capsules[j, 2 - b] - x, capsules[j, 3 - b] - y
        size = math.sqrt((f_x * f_x + f_y * f_y) * (g_x * g_x + g_y * g_y))
        if abs(f_x * g_y - f_y * g_x) <= JOINT * size and f_x * g_x + f_y * g_y < 0.0:
            capsules[i, a], capsules[i, a + 1] = capsules[j, 2 - b], capsules[j, 3 - b]
            capsules[i, PIVOT_X] = 0.5 * (capsules[i, X1] + capsules[i, X2])
            capsules[i, PIVOT_Y] = 0.5 * (capsules[i, Y1] + capsules[i, Y2])
            return True
    return False


@compiled_once
def join_walls(capsules: Array, joined: Array) -> int:
    """Copy the capsules, joining adjoining collinear walls; return their number.

    A wall is then the same in one piece as in several. Only the first :data:`JOINED`
    rows are compared.
    """
    count, many = 0, min(capsules.shape[0], JOINED)
    for i in range(capsules.shape[0]):
        for column in range(CAPSULE_WIDTH):
            # A copy: the caller's table stays unchanged.
            joined[count, column] = capsules[i, column]
        count += 1
    i = 0
    while i < min(count, many):
        j, grown = 0, False
        while j < min(count, many) and is_plain_wall(joined[:count], i):
            if j != i and is_plain_wall(joined[:count], j) and lengthened(joined, i, j):
                for row in range(j, count - 1):
                    for column in range(CAPSULE_WIDTH):
                        joined[row, column] = joined[row + 1, column]
                count, many, grown = count - 1, many - 1, True
                # Row i has moved with those after j; it may grow further.
                i = i - 1 if j < i else i
                break
            j += 1
        i = i if grown else i + 1
    return count
