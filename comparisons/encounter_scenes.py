"""Random encounters: discs aimed at a robot that stands, or drives straight on.

How they are drawn, how a method meets them, and the rows that they leave.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from limit import SPEEDS

from qpavoid.model.contact import point_contact
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.simulation.batch import Batch, Loop
from qpavoid.simulation.scenario import Scenario
from qpavoid.simulation.world import Track, World

FAMILIES = ("parked", "path", "accelerated", "several")
DT = 0.05
"""s; 20 control steps a second."""

DRIVE = 6.0
"""s that the path takes, the last of them slowing down to rest."""

RETURN = 15.0
"""s for the way back, once the discs have left."""

MARGIN = 0.02
"""m of the limit that are given away: it is a grid's, or a search's."""

STALLED = 5.0
"""s without having come 0.1 m far at the end of a run that did not return."""


@dataclass(frozen=True, eq=False)
class Encounter:
    """One encounter in the frame of the robot at time 0.

    Attributes:
        speed: Of the robot at the start, m/s; 0: parked.
        discs: (M, 3) x, y, radius.
        velocities: (M, 2) over ground.
    """

    speed: float
    discs: Array
    velocities: Array

    def rows(self) -> Array:
        """(M, 6) as the limit takes it: disc's place and velocity, robot's twist."""
        twist = np.tile((self.speed, 0.0), (len(self.discs), 1))
        return np.hstack([self.discs[:, :2], self.velocities, twist])


def inside(rng: np.random.Generator, robot: Robot) -> Array:
    """Return a random place of the footprint."""
    vertices = robot.footprint.vertices
    while True:
        place = rng.uniform(vertices.min(axis=0), vertices.max(axis=0))
        if point_contact(robot.footprint.edges, *place)[4] < 0.0:
            return place


def draw_disc(
    rng: np.random.Generator, robot: Robot, speed: float
) -> tuple[Array, Array]:
    """Return a disc (3,) and its velocity (2,), aimed at where the robot will be."""
    pace, radius = rng.choice(SPEEDS), rng.uniform(0.0, 0.4)
    seen, bearing = rng.uniform(0.8, 2.5), rng.uniform(-math.pi, math.pi)
    ray = np.array([math.cos(bearing), math.sin(bearing)])
    low, high = 0.0, seen + radius + 2.0 * robot.footprint.circumradius
    for _ in range(40):
        middle = 0.5 * (low + high)
        clearance = point_contact(robot.footprint.edges, *(middle * ray))[4] - radius
        low, high = (middle, high) if clearance < seen else (low, middle)
    place, target = low * ray, inside(rng, robot)
    times = np.linspace(0.0, DRIVE, 601)
    ways = target + np.outer(speed * times, (1.0, 0.0)) - place
    late = np.hypot(*ways.T) - pace * times
    way = ways[np.argmax(late <= 0.0) if (late <= 0.0).any() else np.argmin(late)]
    return np.array([*place, radius]), pace * way / np.hypot(*way)


def draw_encounters(
    family: str, count: int, seed: int, robot: Robot
) -> list[Encounter]:
    """Return the encounters of a family; the same for the same seed."""
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    encounters = []
    for k in range(count):
        moves = family == "path" or (family != "parked" and k % 2 == 1)
        speed = float(rng.uniform(0.5, 1.0)) if moves else 0.0
        number = int(rng.integers(2, 6)) if family == "several" else 1
        drawn = [draw_disc(rng, robot, speed) for _ in range(number)]
        discs, velocities = (np.array(part) for part in zip(*drawn, strict=True))
        encounters.append(Encounter(speed, discs, velocities))
    return encounters


def reference(speed: float, dt: float) -> Array:
    """Return the plan (n, 5): standing, or straight on and slowing down to rest."""
    if speed == 0.0:
        return np.zeros((2, 5))
    times = np.arange(0.0, DRIVE + dt, dt)
    v = speed * np.clip(DRIVE - times, 0.0, 1.0)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * dt)])
    zero = np.zeros_like(x)
    return np.column_stack([x, zero, zero, v, zero])


def time_of_leaving(encounter: Encounter, goal: Array, robot: Robot) -> float:
    """Return when no disc is near the way from start to goal any more, s."""
    last = 0.0
    way = np.linspace((0.0, 0.0), goal, 1 + math.ceil(np.hypot(*goal) / 0.1))
    for (x, y, radius), velocity in zip(
        encounter.discs, encounter.velocities, strict=True
    ):
        far = robot.footprint.circumradius + radius + 0.35
        places, square = np.array([x, y]) - way, float(velocity @ velocity)
        half = places @ velocity
        root = half**2 - square * ((places**2).sum(axis=1) - far * far)
        near = root > 0.0
        if near.any():
            last = max(last, float((np.sqrt(root[near]) - half[near]).max()) / square)
    return last


def make_loops(encounters: Sequence[Encounter], robot: Robot) -> list[Loop]:
    """Return the closed loops, with time for the return after the discs have left."""
    loops = []
    for encounter in encounters:
        plan = reference(encounter.speed, DT)
        left = time_of_leaving(encounter, plan[-1, :2], robot)
        left = max(left, DRIVE if encounter.speed else 0.0)
        world = Obstacles(discs=encounter.discs, disc_velocities=encounter.velocities)
        start = (0.0, 0.0, 0.0, encounter.speed, 0.0)
        loops.append(Loop(plan, world, start, left + RETURN, left))
    return loops


@dataclass(frozen=True)
class Plan:
    """The plan of a loop as a path."""

    rows: Array

    def sample(self, times: Array) -> Array:
        """Return the reference (n, 5) of the control steps at these times."""
        steps = np.rint(np.asarray(times) / DT).astype(int)
        return self.rows[np.minimum(steps, len(self.rows) - 1)]


def as_scenario(batch: Batch, loop: Loop) -> Scenario:
    """Return a loop of a batch as a scenario, which any method can run."""
    discs, velocities = loop.obstacles.discs, loop.obstacles.disc_velocities
    tracks = [
        Track.straight(disc[:2], velocity, disc[2])
        for disc, velocity in zip(discs, velocities, strict=True)
    ]
    return Scenario(
        name="encounter",
        title="Encounter",
        robot=batch.robot,
        settings=batch.settings,
        tracker=batch.tracker,
        path=Plan(loop.plan),
        world=World(tracks=tuple(tracks)),
        start=loop.start[:3],
        duration=loop.duration,
        dt=DT,
        arrival=batch.arrival,
    )


def as_runs(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the avoidable encounters as the rows that every study leaves.

    A success touches nothing and is back within 1 cm and 1°.
    """
    return [
        {
            "method": run["controller"],
            "setting": run["family"],
            "scenario": "encounter",
            "seed": run["number"],
            "outcome": "stalled" if run["still"] > STALLED else "off goal",
            "success": run["clearance"] >= 0.0 and math.isfinite(run["arrived"]),
            "contact": run["clearance"] < 0.0,
            "arrived_s": run["arrived"] if math.isfinite(run["arrived"]) else "",
            "min_moving_clearance_m": run["moving"],
            "min_room_m": run["room"],
        }
        for run in runs
        if run["limit_m"] >= MARGIN
    ]
