"""Oracle of driven motion with geometry of its own: exact arcs and their distances.

Compiled, so that it can look closely; it shares no formula with the package, and
``test_driven.py`` holds it to the oracles. An obstacle is a line that moves: see
:data:`LINE`.
"""

import math
from itertools import pairwise

import numba
import numpy as np
import shapely

LINE = 10
"""Columns: x1, y1, x2, y2, m; radius, m; v_x, v_y, m/s; turn, rad/s; pivot x, y, m."""

MISSED = 5e-8
"""m; how much of the least distance may lie between two looks."""


@numba.njit(cache=True)
def point_to_line(x, y, ax, ay, bx, by):
    """Distance of a point to a segment."""
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    share = 0.0
    if square > 0.0:
        share = min(max(((x - ax) * ex + (y - ay) * ey) / square, 0.0), 1.0)
    return math.hypot(x - ax - share * ex, y - ay - share * ey)


@numba.njit(cache=True)
def point_gap(corners, x, y):
    """Signed distance of a point to a convex polygon, counter-clockwise."""
    least, deep = math.inf, -math.inf
    for i in range(corners.shape[0]):
        ax, ay = corners[i - 1, 0], corners[i - 1, 1]
        bx, by = corners[i, 0], corners[i, 1]
        least = min(least, point_to_line(x, y, ax, ay, bx, by))
        left = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        deep = max(deep, -left / math.hypot(bx - ax, by - ay))
    return deep if deep <= 0.0 else least


@numba.njit(cache=True)
def overlap(corners, x1, y1, x2, y2):
    """Separation of a segment and a convex polygon along their normals, at most, m.

    Where they overlap it is the least shift that ends it, negative.
    """
    most, across, back = -math.inf, math.inf, math.inf
    length = math.hypot(x2 - x1, y2 - y1)
    for i in range(corners.shape[0]):
        ax, ay = corners[i - 1, 0], corners[i - 1, 1]
        n_x, n_y = corners[i, 1] - ay, ax - corners[i, 0]
        one = n_x * (x1 - ax) + n_y * (y1 - ay)
        other = n_x * (x2 - ax) + n_y * (y2 - ay)
        most = max(most, min(one, other) / math.hypot(n_x, n_y))
        if length > 0.0:
            beside = ((y2 - y1) * (ax - x1) - (x2 - x1) * (ay - y1)) / length
            across, back = min(across, beside), min(back, -beside)
    return max(most, across, back) if length > 0.0 else most


@numba.njit(cache=True)
def line_gap(corners, x1, y1, x2, y2):
    """Signed distance of a segment to a convex polygon, counter-clockwise."""
    apart = overlap(corners, x1, y1, x2, y2)
    if apart <= 0.0:
        return apart
    least = min(point_gap(corners, x1, y1), point_gap(corners, x2, y2))
    for i in range(corners.shape[0]):
        bx, by = corners[i, 0], corners[i, 1]
        least = min(least, point_to_line(bx, by, x1, y1, x2, y2))
    return least


@numba.njit(cache=True)
def driven_to(pose, v, omega, time):
    """Pose after a twist, by the circle's centre."""
    x, y, heading = pose
    end = heading + omega * time
    if abs(omega * time) < 1e-6:
        middle = heading + 0.5 * omega * time
        x, y = x + v * time * math.cos(middle), y + v * time * math.sin(middle)
        return x, y, end
    x += v / omega * (math.sin(end) - math.sin(heading))
    return x, y - v / omega * (math.cos(end) - math.cos(heading)), end


@numba.njit(cache=True)
def gap_at(corners, pose, line, time):
    """Distance of the footprint at a pose from an obstacle at a time, m."""
    cos, sin = math.cos(line[7] * time), math.sin(line[7] * time)
    x, y = line[8] + line[5] * time, line[9] + line[6] * time
    c, s = math.cos(pose[2]), math.sin(pose[2])
    ends = np.empty(4)
    for k in range(0, 4, 2):
        a, b = line[k] - line[8], line[k + 1] - line[9]
        d_x, d_y = x + cos * a - sin * b - pose[0], y + sin * a + cos * b - pose[1]
        ends[k], ends[k + 1] = c * d_x + s * d_y, c * d_y - s * d_x
    return line_gap(corners, ends[0], ends[1], ends[2], ends[3]) - line[4]


@numba.njit(cache=True)
def gaps_at(corners, poses, line, time):
    """Gaps at many poses (N, 3), m."""
    gaps = np.empty(len(poses))
    for i in range(len(poses)):
        pose = poses[i, 0], poses[i, 1], poses[i, 2]
        gaps[i] = gap_at(corners, pose, line, time)
    return gaps


@numba.njit(cache=True)
def fastest(line):
    """A speed that no point of an obstacle exceeds, m/s."""
    lever = math.hypot(line[0] - line[8], line[1] - line[9])
    lever = max(lever, math.hypot(line[2] - line[8], line[3] - line[9]))
    return math.hypot(line[5], line[6]) + abs(line[7]) * lever


@numba.njit(cache=True)
def least_of(corners, pose, twist, time, begin, line, least):
    """The least distance to one obstacle while a twist is driven from ``begin`` on, m.

    Or ``least``, if that is less. Passing a corner at a distance d, looks that lie s
    apart miss s²/8d.
    """
    size = 0.0
    for i in range(corners.shape[0]):
        size = max(size, math.hypot(corners[i, 0], corners[i, 1]))
    pace = abs(twist[0]) + abs(twist[1]) * size + fastest(line)
    now = 0.0
    while True:
        there = driven_to(pose, twist[0], twist[1], now)
        gap = gap_at(corners, there, line, begin + now)
        least = min(least, gap)
        if now >= time or pace == 0.0:
            return least
        fine = math.sqrt(8.0 * MISSED * gap) if gap > 0.0 else 1e-4
        now = min(now + max(gap - least, fine, 1e-5) / pace, time)


@numba.njit(cache=True)
def least_on_way(corners, trace, dt, lines):
    """The least distance in every step of a trace (steps, 5), and to whom at last, m.

    ``trace``: the pose at the start of each step and the twist driven then.
    """
    steps = trace.shape[0]
    least = np.full((steps, lines.shape[0]), math.inf)
    for k in range(steps):
        x, y, heading, v, omega = trace[k]
        for i in range(lines.shape[0]):
            least[k, i] = least_of(
                corners, (x, y, heading), (v, omega), dt, k * dt, lines[i], math.inf
            )
    return least


@numba.njit(cache=True)
def least_in_all(corners, trace, dt, lines):
    """The least distance of a whole trace, m."""
    least = math.inf
    for k in range(trace.shape[0]):
        x, y, heading, v, omega = trace[k]
        for i in range(lines.shape[0]):
            least = least_of(
                corners, (x, y, heading), (v, omega), dt, k * dt, lines[i], least
            )
    return least


def off_the_arcs(trace, dt):
    """By how much a pose of a trace is not where the one before leads, m or rad."""
    off = 0.0
    for one, after in pairwise(trace):
        there = driven_to(tuple(one[:3]), one[3], one[4], dt)
        off = max(off, np.abs(np.subtract(there, after[:3])).max())
    return off


def lines_of(points=(), discs=(), velocities=None, walls=(), polygons=(), motions=None):
    """The obstacles as :data:`LINE`; without velocities they stand."""
    rows = [[x, y, x, y, 0.0, 0.0, 0.0, 0.0, x, y] for x, y in points]
    for i, (x, y, radius) in enumerate(discs):
        v_x, v_y = (0.0, 0.0) if velocities is None else velocities[i]
        rows.append([x, y, x, y, radius, v_x, v_y, 0.0, x, y])
    rows += [[*wall, *[0.0] * 4, wall[0], wall[1]] for wall in walls]
    for i, corners in enumerate(polygons):
        corners = np.asarray(corners, dtype=float)
        motion = (0.0, 0.0, 0.0) if motions is None else motions[i]
        (middle,) = shapely.Polygon(corners).centroid.coords
        for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            rows.append([*one, *other, 0.0, *motion, *middle])
    return np.array(rows, dtype=float).reshape(-1, LINE)


def lines_of_world(world):
    """Lines of an ``Obstacles``; its walls are static."""
    return lines_of(
        world.points,
        world.discs,
        world.disc_velocities,
        world.walls,
        world.polygons,
        world.polygon_velocities,
    )
