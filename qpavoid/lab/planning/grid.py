"""Grid of static obstacles, inflated by the robot's size."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError, MissingExtraError
from qpavoid.model.obstacles import Obstacles
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


FORGOTTEN = -math.inf

MOST_CELLS = 16_000_000
"""128 MB."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of a rectangle of the world, with the last time of an obstacle in each.

    Attributes:
        corner: (2,) lower left corner, world frame, m.
        resolution: Side of a cell, m.
        seen: (rows, columns) s; +∞: on the map, −∞: never.
    """

    corner: Array
    resolution: float
    seen: Array

    @classmethod
    def around(cls, places: Array, margin: float, resolution: float) -> "Grid":
        """Return an empty grid around positions (n, 2), with a margin, both in m.

        Raises:
            InvalidInputError: It has too many cells.
        """
        low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
        columns, rows = np.ceil((high - low) / resolution).tolist()
        if not columns * rows <= MOST_CELLS:
            told = f"{columns:g} × {rows:g} cells of {resolution:g} m"
            raise InvalidInputError(f"{told}, where {MOST_CELLS:,} are most")
        return cls(low, resolution, np.full((int(rows), int(columns)), FORGOTTEN))

    def mark(self, obstacles: Obstacles, time: float) -> None:
        """Mark the grid's cells of obstacles, world frame, at ``time`` s.

        Points, walls and edges of polygons mark the cells that they touch, discs and
        polygons those whose middle they cover, and discs the one of their own middle.
        """
        self._mark(obstacles.points, time)
        for line in obstacles.lines:
            self._mark(_along(line, 0.5 * self.resolution), time)
        for corners in obstacles.polygons:
            self._mark(_inside(corners, 0.5 * self.resolution), time)
        self._mark(obstacles.discs[:, :2], time)
        for disc in obstacles.discs:
            self._mark(_within(disc, 0.5 * self.resolution), time)

    def _mark(self, places: Array, time: float) -> None:
        rows, columns = self.cells(places).T
        inside = (rows >= 0) & (columns >= 0)
        inside &= (rows < self.seen.shape[0]) & (columns < self.seen.shape[1])
        self.seen[rows[inside], columns[inside]] = time

    def cells(self, places: Array) -> npt.NDArray[np.intp]:
        """Return row and column (n, 2) of places (n, 2) in m; they may lie outside."""
        found = np.floor((places - self.corner) / self.resolution)
        return np.asarray(found[:, ::-1], dtype=np.intp)

    def nearest_cells(self, places: Array) -> npt.NDArray[np.intp]:
        """Return the cells (n, 2) of the grid that are nearest to places (n, 2)."""
        return np.clip(self.cells(places), 0, np.array(self.seen.shape) - 1)

    def places(self, cells: npt.NDArray[np.intp]) -> Array:
        """Return the middles (n, 2), m, of cells (n, 2)."""
        return np.asarray(self.corner + self.resolution * (cells[:, ::-1] + 0.5))

    def clearance(self, since: float) -> Array:
        """Return the distance of each cell from those marked after ``since`` s, m.

        From its middle to about the border of the nearest marked cell; 0 in a marked
        one.
        """
        from scipy.ndimage import distance_transform_edt

        free = self.seen <= since
        if free.all():
            return np.full(free.shape, math.inf)
        far = self.resolution * np.asarray(distance_transform_edt(free))
        return np.maximum(far - 0.5 * self.resolution, 0.0)

    def copy(self) -> "Grid":
        """Return an independent copy."""
        return Grid(self.corner, self.resolution, self.seen.copy())


def costs_of(clearance: Array, inflation: float, soft: float, weight: float) -> Costs:
    """Return the cost of each cell: 0 nearer than ``inflation``, 1 from ``soft`` m on.

    In between 1 + weight·(1 − (d − inflation)/soft), rounded: the middle of a corridor
    is cheaper than its sides.
    """
    share = np.clip((clearance - inflation) / soft, 0.0, 1.0)
    costs = np.rint(1.0 + weight * (1.0 - share)).astype(np.int32)
    return np.where(clearance < inflation, np.int32(0), costs)


def _along(wall: Array, spacing: float) -> Array:
    """Return points (n, 2) on a wall, its ends included."""
    count = math.ceil(math.dist(wall[:2], wall[2:]) / spacing) + 1
    return np.linspace(wall[:2], wall[2:], max(count, 2))


def _inside(corners: Array, spacing: float) -> Array:
    """Return points (n, 2) of a lattice within a convex polygon, counter-clockwise."""
    lines = [
        np.arange(low, high, spacing)
        for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)
    ]
    places = np.column_stack([one.ravel() for one in np.meshgrid(*lines)])
    for start, (d_x, d_y) in zip(
        corners, np.roll(corners, -1, axis=0) - corners, strict=True
    ):
        away = places - start
        places = places[d_x * away[:, 1] >= d_y * away[:, 0]]
    return places


def _within(disc: Array, spacing: float) -> Array:
    """Return points (n, 2) of a lattice within a disc."""
    x, y, radius = disc.tolist()
    line = np.arange(-radius, radius + spacing, spacing)
    d_x, d_y = np.meshgrid(line, line)
    inside = np.hypot(d_x, d_y) <= radius
    return np.column_stack([x + d_x[inside], y + d_y[inside]])
