"""A path to the goal, planned on what is known, and planned anew when it is blocked.

Walls and points of the world are the map, known from the start. Discs, polygons, and
points of a sensor are known once they are within sight: what stands still is remembered
for a while, what moves is where it is now. The path is the cheapest way over the grid
(lower cost farther from obstacles), smoothed and timed like any other reference. A way
that only something that moves bars is kept, unless there is another one hardly longer:
else a robot that turned round for a person here, and for the next one there, would go
to and fro. Where there is no way the robot stands, and another look is taken soon.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST
from qpavoid.lab.planning.grid import Grid, cheapest_way, costs_of, length
from qpavoid.model.given import NO_POINTS
from qpavoid.model.kinematics import wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, check
from qpavoid.tracking.path import DISTINCT, SplinePath
from qpavoid.types import Array, Pose

DEAR = 50
"""Cost of a cell that is too near an obstacle, where the robot stands or is to go."""

ROUNDING = 1e-9
"""s: what was seen just as long ago as the memory reaches is known still."""


@dataclass(frozen=True)
class PlannerSettings:
    """Settings of a global planner.

    Attributes:
        resolution: Side of a cell, m.
        inflation: What the path keeps from obstacles beyond half of the robot's width
            and r_min, m.
        soft: m beyond that within which being near costs more.
        weight: By how many times more, at most.
        margin: m that the grid reaches beyond start, goal and map.
        sight: m; farther away the robot sees nothing, nor looks whether the way is
            free.
        memory: s for which something that stands still is remembered.
        interval: s between two looks whether the way is blocked.
        astray: m from the path from which on it is planned anew as well.
        detour: m by which a way round what moves may be longer than the way it bars.
    """

    resolution: Annotated[float, "m", POSITIVE] = 0.1
    inflation: Annotated[float, "m", NOT_NEGATIVE] = 0.0
    soft: Annotated[float, "m", POSITIVE] = 0.6
    weight: Annotated[float, NOT_NEGATIVE] = 4.0
    margin: Annotated[float, "m", POSITIVE] = 3.0
    sight: Annotated[float, "m", POSITIVE] = 8.0
    memory: Annotated[float, "s", NOT_NEGATIVE] = 10.0
    interval: Annotated[float, "s", POSITIVE] = 0.5
    astray: Annotated[float, "m", POSITIVE] = 1.0
    detour: Annotated[float, "m", NOT_NEGATIVE] = 1.0

    def __post_init__(self) -> None:
        check(self, "a planner wants")


@dataclass(frozen=True)
class PlanningProblem:
    """What is to be planned, and how it is driven.

    Attributes:
        start: x, y (m), γ (rad).
        goal: The same.
        keep: m that its middle keeps from everything.
        speed: Greatest, m/s.
        turn_rate: Greatest, rad/s.
        acceleration: Greatest, m/s².
        times: (n,) s from its beginning at which it is sampled.
    """

    start: Pose
    goal: Pose
    keep: float
    speed: float
    turn_rate: float
    acceleration: float
    times: Array


class Planner:
    """A global planner on its way.

    Args:
        search: Name of the search.
        problem: From where to where.
        settings: Of the planner.
        chart: The map, world frame: its points and walls.

    Raises:
        MissingExtraError: The search's library is not installed.
    """

    def __init__(
        self,
        search: str,
        problem: PlanningProblem,
        settings: PlannerSettings,
        chart: Obstacles,
    ) -> None:
        self.search, self.problem, self.settings = search, problem, settings
        ends = np.array([problem.start[:2], problem.goal[:2]])
        walls = chart.walls.reshape(-1, 2)
        places = np.vstack([ends, chart.points, walls])
        self._grid = Grid.around(places, settings.margin, settings.resolution)
        self._grid.mark(chart, math.inf)
        self._route: Array | None = None
        self._due = -math.inf

    def __call__(
        self, time: float, pose: Pose, speed: float, seen: Obstacles
    ) -> Array | None:
        """Return a new reference (n, 5) from now on; ``None``: the old one holds."""
        if time < self._due:
            return None
        self._due = time + self.settings.interval
        since = time - self.settings.memory - ROUNDING
        clearance, kept = self._look(time, pose, seen, since), self._route
        if kept is not None and not self._is_lost(kept, clearance, pose):
            return None
        found = self._plan(clearance, pose)
        if kept is not None and self._is_longer(found, kept, pose):
            if not self._is_lost(kept, self._grid.clearance(since), pose):
                return None
        self._route = found
        if found is not None:
            return self._timed(found, max(0.0, speed))
        return None if kept is None else standing(pose, len(self.problem.times))

    def _is_longer(self, way: Array | None, kept: Array, pose: Pose) -> bool:
        """Return whether a way is much longer than what is left of the one kept."""
        nearest = int(np.hypot(*(kept - pose[:2]).T).argmin())
        most = length(kept[nearest:]) + self.settings.detour
        return way is None or length(way) > most

    def _look(self, time: float, pose: Pose, seen: Obstacles, since: float) -> Array:
        """Return how far every cell is from what is known by now, m."""
        seen = seen.within(self.settings.sight)
        moves, back = seen.speeds > SPEED_AT_REST, _inverse(pose)
        still = seen.chosen(~moves & ~seen.is_wall).seen_from(back)
        moving = Obstacles.of(NO_POINTS, seen.capsules[moves]).seen_from(back)
        self._grid.mark(still, time)
        # In a copy: where something moves now nothing need be in a moment.
        now = self._grid.copy()
        now.mark(moving, math.inf)
        return now.clearance(since)

    def _is_lost(self, route: Array, clearance: Array, pose: Pose) -> bool:
        """Return whether the way ahead is blocked, or the robot far from it."""
        away = np.hypot(*(route - pose[:2]).T)
        nearest = int(away.argmin())
        if away[nearest] > self.settings.astray:
            return True
        ahead = route[nearest:]
        ahead = ahead[np.hypot(*(ahead - pose[:2]).T) < self.settings.sight]
        rows, columns = self._grid.nearest_cells(ahead).T
        # A cell less than it was planned with, or rounding to cells would bar it at
        # once.
        tight = self.problem.keep + self.settings.inflation - self.settings.resolution
        return bool((clearance[rows, columns] < tight).any())

    def _plan(self, clearance: Array, pose: Pose) -> Array | None:
        """Return the cells' middles (n, 2) of the cheapest way from here, or ``None``.

        Where the robot stands, and at the goal, being too near is dear, not forbidden.
        """
        keep = self.problem.keep + self.settings.inflation
        costs = costs_of(clearance, keep, self.settings.soft, self.settings.weight)
        ends = np.array([pose[:2], self.problem.goal[:2]])
        cells = self._grid.nearest_cells(ends)
        rows, columns = np.indices(costs.shape)
        for row, column in cells:
            near = np.hypot(rows - row, columns - column)
            near = near * self.settings.resolution <= keep
            # Else a robot that was pushed into the inflated zone could plan no way out
            # of it.
            costs[near & (costs == 0) & (clearance > 0.0)] = DEAR
            costs[row, column] = max(1, costs[row, column])
        start, goal = map(tuple, cells.tolist())
        way = self._grid.places(cheapest_way(self.search, costs, start, goal))
        if len(way) < 2 or np.hypot(*(ends[1] - ends[0])) < DISTINCT:
            return None
        way[0], way[-1] = ends
        return way

    def _timed(self, route: Array, speed: float) -> Array:
        """Return the reference along a route, and then standing at the goal."""
        problem = self.problem
        path = SplinePath(
            route,
            problem.speed,
            problem.turn_rate,
            problem.acceleration,
            0.5 * self.settings.resolution,
            min(speed, problem.speed),
        )
        plan = path.sample(problem.times)
        there = problem.times >= path.duration
        turn = wrap_angle(problem.goal[2] - plan[-1, 2])
        plan[there] = (*problem.goal[:2], plan[-1, 2] + turn, 0.0, 0.0)
        return plan


def standing(pose: Pose, rows: int) -> Array:
    """Return the reference (rows, 5) of standing at a pose."""
    return np.tile([*pose, 0.0, 0.0], (rows, 1))


def _inverse(pose: Pose) -> Pose:
    """Return the world's pose in the frame of ``pose``."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return -x * cos - y * sin, x * sin - y * cos, -heading
