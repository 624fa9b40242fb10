"""Smallest enclosing disc of points [Welzl1991]."""

import math

import numpy as np

from qpavoid.compiled import compiled, compiled_once, entry
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
