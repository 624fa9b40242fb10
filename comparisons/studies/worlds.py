"""Numbers of published worlds: BARN's metric, contacts in crowds, DynaBARN.

    python comparisons/studies/worlds.py metric --data PATH --runs out/barn
    python comparisons/studies/worlds.py crowd --data PATH     # contacts of people
    python comparisons/studies/worlds.py dynabarn --data PATH  # impossible episodes

BARN's metric is success · OT / clip(AT, 2 OT, 8 OT): OT is the length of the published
path over 2 m/s, AT the time taken. It is printed by scenario and method.
"""

import argparse
import math
import os
from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation

from qpavoid.errors import QPAvoidError
from qpavoid.lab.planning.grid import length
from qpavoid.lab.worlds.barn import GOAL, START, find_folder, read_cells
from qpavoid.lab.worlds.crowd import PERSON, SCENES, Crowd, Task
from qpavoid.lab.worlds.dynabarn import DynaBarn, DynaBarnWorld, Restart
from qpavoid.model.robot import Robot
from qpavoid.types import Array

EPISODES: tuple[tuple[Restart, float], ...] = (
    ("reverse", 1.0),
    ("reverse", 2.0),
    ("end", 2.0),
)
"""Of the study of DynaBARN: jumps and speed, m/s."""


@lru_cache
def optimal_time(world: int, data: Path | None) -> float:
    """Return OT in s, by the organisers' transform of the path's cells."""
    path = find_folder(data, world) / "path_files" / f"path_{world}.npy"
    cells = 0.15 * read_cells(path) + (-4.575, 5.075)
    points = np.vstack([START[:2], cells, GOAL])
    return length(points) / 2.0


def metric(row: dict[str, Any], optimal: float) -> float:
    """Return the organisers' metric of one run."""
    if not row["success"]:
        return 0.0
    return optimal / float(np.clip(row["arrived_s"], 2.0 * optimal, 8.0 * optimal))


def print_metric(folder: Path, data: Path | None) -> None:
    """Print the mean metric of a sweep's runs by scenario and method."""
    from qpavoid.lab.study.report.ranking import who
    from qpavoid.lab.study.sweep.store import read_rows

    found: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for row in read_rows(folder):
        value = metric(row, optimal_time(row["seed"], data))
        found[str(row["scenario"]), who(row)].append(value)
    for (scenario, method), values in found.items():
        print(f"{scenario}, {method}: {fmean(values):.4f} in {len(values)} runs")


def own_clearance(task: Task) -> float:
    """Return the least distance, m, of the human's disc to all others on its own way.

    Of discs of radius :data:`PERSON`, linear between the samples; below 0 is a contact.
    """
    times, least = task.human.times, math.inf
    for other in task.others:
        begin, end = max(times[0], other.times[0]), min(times[-1], other.times[-1])
        if begin > end:
            continue
        both = np.unique(np.clip([*times, *other.times], begin, end))
        x, y = (
            np.interp(both, other.times, other.positions[:, axis])
            - np.interp(both, times, task.human.positions[:, axis])
            for axis in (0, 1)
        )
        way = np.column_stack([x, y])
        leg = np.diff(way, axis=0, append=way[-1:])
        share = -(way * leg).sum(axis=1) / np.maximum((leg**2).sum(axis=1), 1e-12)
        nearest = way + np.clip(share, 0.0, 1.0)[:, None] * leg
        least = min(least, float(np.hypot(*nearest.T).min()))
    return least - 2.0 * PERSON


def print_crowd(data: Path | None) -> None:
    """Print in how many tasks recorded people touch each other."""
    for scene in SCENES:
        tasks = Crowd(scene, None if data is None else str(data)).tasks
        touched = sum(own_clearance(task) < 0.0 for task in tasks)
        print(f"crowd {scene}: contact in {touched} of {len(tasks)} tasks")


def print_dynabarn(data: Path | None, worlds: int) -> None:
    """Print in how many episodes no robot can reach the goal in time."""
    for jumps, speed in EPISODES:
        source = DynaBarn(jumps, speed, None if data is None else str(data))
        seeds = range(source.phases * worlds)
        count = sum(is_impossible(*source.episode(k), speed) for k in seeds)
        print(f"{source.name}: impossible in {count} of {len(seeds)} episodes")


Cells = npt.NDArray[np.bool_]

CELL = 0.1
"""Width of a cell, and distance that the robot drives between two instants, m."""

AROUND = 4.0
"""Margin of the grid around start and goal, m."""


class Field(NamedTuple):
    """A world as a grid in time; the robot's start is a node.

    Attributes:
        world: Cylinders and walls.
        start: When the robot starts on the world's clock, s.
        x: (n,) m.
        y: (m,) m.
        dt: s between two instants.
    """

    world: DynaBarnWorld
    start: float
    x: Array
    y: Array
    dt: float

    @property
    def origin(self) -> tuple[int, int]:
        """The node at which the robot starts."""
        return int(abs(self.x - self.world.start[0]).argmin()), int(
            abs(self.y - self.world.start[1]).argmin()
        )

    def goal(self, slack: float) -> Cells:
        """Return the nodes within the goal's radius and a slack, m."""
        x, y = self.world.goal
        off = np.hypot(self.x[:, None] - x, self.y[None, :] - y)
        return np.asarray(off <= self.world.goal_radius + slack)

    def free(self, radius: float) -> Iterator[Cells]:
        """Yield the nodes at which a circle, m, is free at each instant."""
        still = np.ones((len(self.x), len(self.y)), dtype=bool)
        for wall in self.world.walls:
            still &= self._wall_distance(wall) >= radius
        times = np.arange(self.start, self.world.duration + 1e-9, self.dt)
        places = [
            np.column_stack([np.interp(times, c.times, p) for p in c.positions.T])
            for c in self.world.cylinders
        ]
        reach = radius + self.world.radius
        for here in zip(*places, strict=True):
            free = still.copy()
            for x, y in here:
                i, j = self._near(self.x, x, reach), self._near(self.y, y, reach)
                apart = (self.x[i, None] - x) ** 2 + (self.y[None, j] - y) ** 2
                free[i, j] &= apart >= reach**2
            yield free

    def _near(self, values: Array, middle: float, reach: float) -> slice:
        low, high = np.searchsorted(values, (middle - reach, middle + reach))
        return slice(low, high)

    def _wall_distance(self, wall: Array) -> Array:
        """Return the distance of every node to a wall, m."""
        along = wall[2:] - wall[:2]
        d_x, d_y = self.x[:, None] - wall[0], self.y[None, :] - wall[1]
        share = np.clip((d_x * along[0] + d_y * along[1]) / (along @ along), 0.0, 1.0)
        off = np.hypot(d_x - share * along[0], d_y - share * along[1])
        return np.asarray(off)


def make_field(world: DynaBarnWorld, start: float, speed: float) -> Field:
    """Return the grid for a robot of a greatest speed, m/s, that starts then, s."""
    ends = np.array([world.start[:2], world.goal])
    low, high = ends.min(axis=0) - AROUND, ends.max(axis=0) + AROUND
    corners = world.walls.reshape(-1, 2)
    low = np.minimum(low, corners.min(axis=0, initial=math.inf))
    high = np.maximum(high, corners.max(axis=0, initial=-math.inf))
    x, y = (
        middle + CELL * np.arange(math.floor((a - middle) / CELL), (b - middle) / CELL)
        for middle, a, b in zip(world.start[:2], low, high, strict=True)
    )
    return Field(world, start, x, y, CELL / speed)


def fastest_crossing(field: Field, inscribed: float) -> float:
    """Return a lower bound of the time to the goal, s; inf: it is out of reach."""
    slack = CELL / math.sqrt(2.0)
    goal = field.goal(slack)
    reached = np.zeros(goal.shape, dtype=bool)
    reached[field.origin] = True
    for step, free in enumerate(field.free(max(inscribed - slack, 0.0))):
        if step:
            reached = binary_dilation(reached, np.ones((3, 3)))
        reached &= free
        if (reached & goal).any():
            return step * field.dt
    return math.inf


def is_impossible(world: DynaBarnWorld, start: float, speed: float) -> bool:
    """Return whether no robot of a greatest speed, m/s, can reach the goal in time.

    The inscribed circle of the Jackal is searched on the grid, any way at that speed.
    """
    vertices = Robot.jackal().footprint.vertices
    inscribed = float(np.abs(vertices).min())
    return fastest_crossing(make_field(world, start, speed), inscribed) == math.inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("metric", "crowd", "dynabarn"))
    data = os.environ.get("QPAVOID_DATA")
    named = None if data is None else Path(data)
    parser.add_argument("--data", type=Path, default=named, metavar="PATH")
    parser.add_argument("--runs", type=Path, metavar="DIR", help="a sweep of BARN")
    parser.add_argument("--worlds", type=int, default=60, metavar="N")
    options = parser.parse_args()
    try:
        if options.what == "metric":
            print_metric(options.runs, options.data)
        elif options.what == "crowd":
            print_crowd(options.data)
        else:
            print_dynabarn(options.data, options.worlds)
    except QPAvoidError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
