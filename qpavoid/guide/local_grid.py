"""Margin field: margins of points and poses on a grid near the robot.

The margin of a point is its distance to the nearest obstacle minus that obstacle's
r_min(v_o), in m, robot frame; that of a pose is the least margin of the footprint
there. Obstacles are taken at their present positions; space beyond the grid is free.
"""

import math
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.settings import RadiusCurve, safety_radius
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import (
    RADIUS,
    X1,
    Y1,
    Segment,
    capsule_at,
    chain_end,
    from_segment,
    holds_point,
    speed_bound,
)
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import wrap_angle
from qpavoid.types import Array, Arrays

GRID_PITCH = 0.05
"""m; pitch of the grid, interpolated between its nodes."""

CELL = 2 * GRID_PITCH
"""m; pitch of the search grid."""

AMPLE = 0.5
"""m; margin of a pose beyond which a larger one has no effect."""

SPOT_STEPS = 8
"""Samples of a turn on the spot."""

OUTLINE_SPACING = 0.06
"""m; spacing of points on the edge of a footprint."""


class Field(NamedTuple):
    """Margin field about the robot, and the points of its footprint.

    Attributes:
        nodes: (n, n) from :func:`room_field`, m.
        half: Half the side of its grid, m.
        body: (k, 2) points of the footprint, from :func:`outline`.
    """

    nodes: Array
    half: float
    body: Array


def outline(footprint: Footprint, spacing: float = OUTLINE_SPACING) -> Array:
    """Return points (n, 2) on the edges of all parts and halfway in, robot frame, m."""
    points = []
    for edges in np.split(footprint.edges, footprint.starts[1:]):
        ring = []
        for a_x, a_y, n_x, n_y, length, _ in edges:
            count = math.ceil(length / spacing)
            along = length * np.arange(count)[:, None] / count
            ring.append([a_x, a_y] + along * [-n_y, n_x])
        edge, middle = np.vstack(ring), edges[:, :2].mean(axis=0)
        points += [edge, 0.5 * (edge[::5] + middle)]
    return np.vstack(points)


@compiled
def grid_size(half: float) -> int:
    """Return the number of nodes per side of a grid over [−half, half]²."""
    return 2 * round(half / GRID_PITCH) + 1


@compiled_once
def room_field(
    half: float, ample: float, curve: RadiusCurve, obstacles: Arrays, nodes: Array
) -> None:
    """Fill in the margins (n, n) at the nodes of a grid over [−half, half]², m.

    Args:
        half: m; see :func:`grid_size`.
        ample: Upper bound, m: only the nodes near an obstacle are visited.
        curve: r_min of an obstacle by its speed.
        obstacles: Robot frame.
        nodes: Filled in.
    """
    n, (points, capsules) = grid_size(half), obstacles
    for i in range(n):
        for j in range(n):
            nodes[i, j] = ample
    low = safety_radius(0.0, curve)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        _lower(nodes, half, ample, Segment(x, y, x, y), low)
    end = 0
    while end < capsules.shape[0]:
        begin, end = end, chain_end(capsules, end)
        for i in range(begin, end):
            speed = speed_bound(capsules, i)
            r_min = safety_radius(speed, curve)
            wide = capsules[i, RADIUS] + r_min
            _lower(nodes, half, ample, capsule_at(capsules, i, 0.0), wide)
        if end > begin + 1:
            _fill(nodes, half, capsules[begin:end], -low)


@compiled_once
def _fill(field: Array, half: float, chain: Array, room: float) -> None:
    """Lower the field to ``room`` within a polygon, in place."""
    n = field.shape[0]
    x_low = y_low = math.inf
    x_high = y_high = -math.inf
    for i in range(chain.shape[0]):
        x_low, x_high = min(x_low, chain[i, X1]), max(x_high, chain[i, X1])
        y_low, y_high = min(y_low, chain[i, Y1]), max(y_high, chain[i, Y1])
    first_j = max(math.ceil((y_low + half) / GRID_PITCH), 0)
    last_j = min(math.floor((y_high + half) / GRID_PITCH), n - 1)
    for i in range(
        max(math.ceil((x_low + half) / GRID_PITCH), 0),
        min(math.floor((x_high + half) / GRID_PITCH), n - 1) + 1,
    ):
        for j in range(first_j, last_j + 1):
            if holds_point(chain, i * GRID_PITCH - half, j * GRID_PITCH - half):
                field[i, j] = min(field[i, j], room)


@compiled_once
def _lower(
    field: Array, half: float, ample: float, axis: Segment, radius: float
) -> None:
    """Lower the field to the distance from a segment less ``radius``, in place."""
    n, (x_1, y_1, x_2, y_2) = field.shape[0], axis
    # Division and square root take longest; most obstacles are points.
    is_point = axis.x1 == axis.x2 and axis.y1 == axis.y2
    wide = radius + ample + half
    first_i = max(math.ceil((min(x_1, x_2) - radius - ample + half) / GRID_PITCH), 0)
    last_i = min(math.floor((max(x_1, x_2) + wide) / GRID_PITCH), n - 1)
    first_j = max(math.ceil((min(y_1, y_2) - radius - ample + half) / GRID_PITCH), 0)
    last_j = min(math.floor((max(y_1, y_2) + wide) / GRID_PITCH), n - 1)
    for i in range(first_i, last_i + 1):
        for j in range(first_j, last_j + 1):
            x, y = i * GRID_PITCH - half, j * GRID_PITCH - half
            d_x, d_y = x - axis.x1, y - axis.y1
            if not is_point:
                d_x, d_y = from_segment(axis, x, y)
            square, most = d_x * d_x + d_y * d_y, field[i, j] + radius
            if most > 0.0 and square < most * most:
                field[i, j] = math.sqrt(square) - radius


@compiled_once
def pose_room(field: Field, x: float, y: float, heading: float) -> float:
    """Return the least margin, m, of the points of the footprint at a pose."""
    cos, sin, least = math.cos(heading), math.sin(heading), AMPLE
    (nodes, half, body), n = field, field.nodes.shape[0]
    for k in range(body.shape[0]):
        u = (x + cos * body[k, 0] - sin * body[k, 1] + half) / GRID_PITCH
        w = (y + sin * body[k, 0] + cos * body[k, 1] + half) / GRID_PITCH
        if not (0.0 <= u < n - 1 and 0.0 <= w < n - 1):
            continue
        i, j = int(u), int(w)
        u, w = u - i, w - j
        room = (1.0 - u) * ((1.0 - w) * nodes[i, j] + w * nodes[i, j + 1])
        room += u * ((1.0 - w) * nodes[i + 1, j] + w * nodes[i + 1, j + 1])
        least = min(least, room)
    return least


@compiled_once
def line_room(field: Field, x: float, y: float, heading: float) -> float:
    """Return the least margin of turning to (x, y), driving there, turning to heading.

    The robot starts at the origin with heading 0 and drives forwards.
    """
    bearing = math.atan2(y, x)
    least = AMPLE
    for k in range(SPOT_STEPS + 1):
        least = min(least, pose_room(field, 0.0, 0.0, bearing * k / SPOT_STEPS))
    count = math.ceil(math.sqrt(x * x + y * y) / (2.0 * GRID_PITCH))
    for k in range(1, count + 1):
        p_x, p_y = x * k / count, y * k / count
        least = min(least, pose_room(field, p_x, p_y, bearing))
    turn = wrap_angle(heading - bearing)
    for k in range(1, SPOT_STEPS + 1):
        end = bearing + turn * k / SPOT_STEPS
        least = min(least, pose_room(field, x, y, end))
    return least
