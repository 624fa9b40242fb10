"""Geodesic distance of the grid's cells to a target through free cells, robot frame.

Heuristic of the search in :mod:`qpavoid.guide.way`.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.guide.heap import Item, drop_first, item_at, push
from qpavoid.guide.room import AMPLE, GRID_PITCH, Field, grid_size
from qpavoid.model.capsules import Segment, axis_of
from qpavoid.types import Array

CELL = 2 * GRID_PITCH
"""m; pitch of the search grid."""

TIGHT_COST = 5.0
"""Greatest relative cost added for small margins, which may not allow a turn."""


class Goal(NamedTuple):
    """Target of the distances.

    Attributes:
        x: m
        y: m
        walls: Capsules, for detours outside the grid.
    """

    x: float
    y: float
    walls: Array


@compiled
def cells_of(half: float) -> int:
    """Return the number of cells per side of the grid."""
    return (grid_size(half) + 1) // 2


@compiled
def _cross(wall: Segment, x: float, y: float) -> float:
    """Return a number whose sign is the side of a wall's line on which (x, y) is."""
    d_x, d_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    return d_x * (y - wall.y1) - d_y * (x - wall.x1)


@compiled
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@compiled_once
def way_beyond(goal: Goal, x: float, y: float) -> float:
    """Return a lower bound of the path length from (x, y) to the goal, m.

    Straight, or around the nearer end of the worst wall alone.
    """
    way, least = Segment(x, y, goal.x, goal.y), _length(goal.x - x, goal.y - y)
    for i in range(goal.walls.shape[0]):
        wall = axis_of(goal.walls, i)
        apart = _cross(wall, x, y) * _cross(wall, goal.x, goal.y)
        beside = _cross(way, wall.x1, wall.y1) * _cross(way, wall.x2, wall.y2)
        if apart < 0.0 and beside < 0.0:
            first = _length(wall.x1 - x, wall.y1 - y)
            first += _length(goal.x - wall.x1, goal.y - wall.y1)
            second = _length(wall.x2 - x, wall.y2 - y)
            second += _length(goal.x - wall.x2, goal.y - wall.y2)
            least = max(least, min(first, second))
    return least


@compiled_once
def geodesic(field: Field, least: float, goal: Goal, cost: Array, heap: Array) -> None:
    """Fill in the distance, m, from the grid's nodes to a goal through free ones.

    Dijkstra over eight neighbours; free nodes have a margin of ``least`` or more. Paths
    to a goal outside the grid cross its border, and continue around the walls.

    Args:
        field: Margins.
        least: m.
        goal: Robot frame.
        cost: (n, n) filled in.
        heap: Memory for the open nodes.
    """
    nodes, half, n, count = field.nodes, field.half, cost.shape[0], 0
    for i in range(n):
        for j in range(n):
            cost[i, j] = math.inf
    if max(abs(goal.x), abs(goal.y)) <= half:
        i, j = round((goal.x + half) / CELL), round((goal.y + half) / CELL)
        cost[i, j] = 0.0
        count = push(heap, count, Item(0.0, i, j))
    else:
        for k in range(n):
            for i, j in ((k, 0), (k, n - 1), (0, k), (n - 1, k)):
                if nodes[2 * i, 2 * j] >= least:
                    cost[i, j] = way_beyond(goal, i * CELL - half, j * CELL - half)
                    count = push(heap, count, Item(cost[i, j], i, j))
    while count > 0:
        known, i, j = item_at(heap, 0)
        count = drop_first(heap, count)
        if known > cost[i, j]:
            continue
        for d_i in range(-1, 2):
            for d_j in range(-1, 2):
                k, m = i + d_i, j + d_j
                if not (0 <= k < n and 0 <= m < n) or nodes[2 * k, 2 * m] < least:
                    continue
                tight = 1.0 - min((nodes[2 * k, 2 * m] - least) / AMPLE, 1.0)
                step = CELL * math.sqrt(d_i * d_i + d_j * d_j)
                longer = known + step * (1.0 + TIGHT_COST * tight * tight)
                if longer < cost[k, m]:
                    cost[k, m] = longer
                    count = push(heap, count, Item(longer, k, m))
