"""Global planner: a path to the goal, planned again when it is blocked.

Walls and points of the world are the map, known from the start. Discs, polygons, and
points of a sensor are known once they are within sight: static ones are remembered for
a while, moving ones are at their present positions. The path is the cheapest one on the
grid (lower cost farther from obstacles), smoothed and timed like any other reference. A
path blocked by moving obstacles only is kept, unless another one is hardly longer: else
a robot that turned back for each person would oscillate. Without a path the robot
stands, and plans again soon.
"""

import math
from dataclasses import dataclass

import numpy as np

from qpavoid.avoidance.cbf_rows import SPEED_AT_REST
from qpavoid.lab.planning.grid import Grid, cheapest_way, costs_of, length
from qpavoid.model.kinematics import wrap_angle
from qpavoid.model.obstacles import NO_POINTS, Obstacles
from qpavoid.tracking.path import DISTINCT, SplinePath
from qpavoid.types import Array, Pose

DEAR_CELL = 50
"""Cost of a cell nearer than the clearance, near the robot and the goal."""

ROUNDING = 1e-9
"""s; tolerance of the memory's end for rounding."""


GRID_SIDE, GRID_MARGIN = 0.1, 3.0
"""m: side of a cell; by so much the grid exceeds start, goal and map."""

SOFT_RANGE, SOFT_WEIGHT = 0.6, 4.0
"""m beyond the clearance within which the cost is higher; its greatest relative
increase."""

SIGHT, ASTRAY, LONGER_WAY = 8.0, 1.0, 1.0
"""m: range of the robot's sensors and of the check of the path; distance from the path
from which on it is planned again; by so much a path around moving obstacles may be
longer than the blocked one."""

REMEMBERED, LOOK_EVERY = 10.0, 0.5
"""s: for so long static obstacles are remembered; time between two checks."""


@dataclass(frozen=True)
class PlanningProblem:
    """Planning problem and speeds of the path.

    Attributes:
        start: x, y (m), γ (rad).
        goal: x, y (m), γ (rad).
        keep: Clearance of the path, m.
        speed: Greatest, m/s.
        turn_rate: Greatest, rad/s.
        acceleration: Greatest, m/s².
        times: (n,) sampling times from its beginning, s.
    """

    start: Pose
    goal: Pose
    keep: float
    speed: float
    turn_rate: float
    acceleration: float
    times: Array


class Planner:
    """State of a global planner.

    Args:
        search: Name of the search.
        problem: Start and goal.
        chart: The map, world frame: its points and walls.

    Raises:
        MissingExtraError: The search's library is not installed.
    """

    def __init__(self, search: str, problem: PlanningProblem, chart: Obstacles) -> None:
        self.search, self.problem = search, problem
        ends = np.array([problem.start[:2], problem.goal[:2]])
        walls = chart.walls.reshape(-1, 2)
        places = np.vstack([ends, chart.points, walls])
        self._grid = Grid.around(places, GRID_MARGIN, GRID_SIDE)
        self._grid.mark(chart, math.inf)
        self._route: Array | None = None
        self._due = -math.inf

    def __call__(
        self, time: float, pose: Pose, speed: float, seen: Obstacles
    ) -> Array | None:
        """Return a new reference (n, 5) from now on; ``None``: the old one is kept."""
        if time < self._due:
            return None
        self._due = time + LOOK_EVERY
        since = time - REMEMBERED - ROUNDING
        clearance, kept = self._look(time, pose, seen, since), self._route
        if kept is not None and not self._is_lost(kept, clearance, pose):
            return None
        found = self._plan(clearance, pose)
        if kept is not None:
            nearest = int(np.hypot(*(kept - pose[:2]).T).argmin())
            most = length(kept[nearest:]) + LONGER_WAY
            if found is None or length(found) > most:
                if not self._is_lost(kept, self._grid.clearance(since), pose):
                    return None
        self._route = found
        if found is not None:
            return self._timed(found, max(0.0, speed))
        return None if kept is None else standing(pose, len(self.problem.times))

    def _look(self, time: float, pose: Pose, seen: Obstacles, since: float) -> Array:
        """Return the distance of every cell from the known obstacles, m."""
        seen = seen.within(SIGHT)
        moves, back = seen.speeds > SPEED_AT_REST, inverse(pose)
        still = seen.chosen(~moves & ~seen.is_wall).seen_from(back)
        moving = Obstacles.of(NO_POINTS, seen.capsules[moves]).seen_from(back)
        self._grid.mark(still, time)
        # In a copy: moving obstacles are not remembered.
        now = self._grid.copy()
        now.mark(moving, math.inf)
        return now.clearance(since)

    def _is_lost(self, route: Array, clearance: Array, pose: Pose) -> bool:
        """Return whether the path ahead is blocked, or the robot far from it."""
        away = np.hypot(*(route - pose[:2]).T)
        nearest = int(away.argmin())
        if away[nearest] > ASTRAY:
            return True
        ahead = route[nearest:]
        ahead = ahead[np.hypot(*(ahead - pose[:2]).T) < SIGHT]
        rows, columns = self._grid.nearest_cells(ahead).T
        # One cell less than planned with: rounding to cells must not block the path.
        tight = self.problem.keep - GRID_SIDE
        return bool((clearance[rows, columns] < tight).any())

    def _plan(self, clearance: Array, pose: Pose) -> Array | None:
        """Return the cells' middles (n, 2) of the cheapest path from here, or ``None``.

        Near the robot and the goal cells nearer than the clearance are expensive, not
        blocked.
        """
        keep = self.problem.keep
        costs = costs_of(clearance, keep, SOFT_RANGE, SOFT_WEIGHT)
        ends = np.array([pose[:2], self.problem.goal[:2]])
        cells = self._grid.nearest_cells(ends)
        rows, columns = np.indices(costs.shape)
        for row, column in cells:
            near = np.hypot(rows - row, columns - column)
            near = near * GRID_SIDE <= keep
            # Else a robot inside the inflated zone could not leave it.
            costs[near & (costs == 0) & (clearance > 0.0)] = DEAR_CELL
            costs[row, column] = max(1, costs[row, column])
        start, goal = map(tuple, cells.tolist())
        way = self._grid.places(cheapest_way(self.search, costs, start, goal))
        if len(way) < 2 or np.hypot(*(ends[1] - ends[0])) < DISTINCT:
            return None
        way[0], way[-1] = ends
        return way

    def _timed(self, route: Array, speed: float) -> Array:
        """Return the reference along a route, at rest at its end."""
        problem = self.problem
        path = SplinePath(
            route,
            problem.speed,
            problem.turn_rate,
            problem.acceleration,
            0.5 * GRID_SIDE,
            min(speed, problem.speed),
        )
        plan = path.sample(problem.times)
        there = problem.times >= path.duration
        turn = wrap_angle(problem.goal[2] - plan[-1, 2])
        plan[there] = (*problem.goal[:2], plan[-1, 2] + turn, 0.0, 0.0)
        return plan


def standing(pose: Pose, rows: int) -> Array:
    """Return the reference (rows, 5) at rest at a pose."""
    return np.tile([*pose, 0.0, 0.0], (rows, 1))


def inverse(pose: Pose) -> Pose:
    """Return the world's pose in the frame of ``pose``."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return -x * cos - y * sin, x * sin - y * cos, -heading
