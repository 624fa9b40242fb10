"""Cheapest path on a grid, by the path-finder of the tcod library."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.errors import MissingExtraError
from qpavoid.types import Array

Cell: TypeAlias = tuple[int, int]
Costs: TypeAlias = npt.NDArray[np.int32]
Way: TypeAlias = npt.NDArray[np.intp]

ACROSS, DIAGONAL = 70, 99
"""Cost of a step to the next cell of cost 1: 99/70 is √2 but for 0.005 %."""

SEARCHES = {
    "astar": "A* on an inflated grid, planned anew when the way is blocked",
    "dijkstra": "Dijkstra's search on the same grid, planned anew in the same way",
}
"""Every search by name: [Hart1968] and [Dijkstra1959]."""


def cheapest_way(search: str, costs: Costs, start: Cell, goal: Cell) -> Way:
    """Return the cells (n, 2) of the cheapest path, both ends included; n = 0: none.

    Dijkstra's search expands all reachable cells; A* uses the least cost with all cells
    free as heuristic.

    Args:
        search: A name of :data:`SEARCHES`.
        costs: (rows, columns) of a step into each cell, at least 1; 0: blocked.
        start: Row and column.
        goal: Row and column.

    Raises:
        MissingExtraError: tcod is not installed.
    """
    try:
        from tcod.path import Pathfinder, SimpleGraph
    except ImportError:
        raise MissingExtraError("tcod", "baselines") from None
    graph = SimpleGraph(cost=costs, cardinal=ACROSS, diagonal=DIAGONAL, greed=1)
    finder = Pathfinder(graph)
    finder.add_root(start)
    finder.resolve(goal if search == "astar" else None)
    way: Way = finder.path_to(goal).astype(np.intp)
    return way if tuple(way[0]) == start else way[:0]


def length(way: Array) -> float:
    """Return the length of a path, m.

    Args:
        way: (n, 2) positions, m.
    """
    return float(np.hypot(*np.diff(way, axis=0).T).sum())
