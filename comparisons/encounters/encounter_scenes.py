"""Random encounters: what is aimed at a robot that stands, or drives straight on.

How they are drawn, what is known of them at a time, and the closed loops they make.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from encounter_families import CHANGING, DRIVE, WORLDS, inside, seen_at
from encounter_movers import Mover, last_near, straight
from limit import SPEEDS
from plan_room import GONE, Scene, make_scene
from qpavoid.lab.simulation.batch import Batch, Loop
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.simulation.world import Track, World
from qpavoid.model.given import NO_DISCS, NO_POINTS, NO_WALLS
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import Array, Pose

DISCS = ("parked", "path", "accelerated", "several")
"""Families of discs alone, all of constant velocity."""

FAMILIES = (*DISCS, *WORLDS)
"""All of them; where one stands here is part of its seed."""

DT = 0.05
"""s; 20 control steps a second."""

RETURN = 15.0
"""s for the way back, once the movers have left."""

MARGIN = 0.02
"""m of the limit that are given away: it is a grid's, or a search's."""


@dataclass(frozen=True, eq=False)
class Encounter:
    """One encounter in the frame of the robot at time 0.

    Attributes:
        speed: Of the robot at the start, m/s; 0: parked.
        discs: (M, 3) x, y, radius of those that keep their velocity.
        velocities: (M, 2) over ground.
        points: (N, 2) that are seen, m.
        walls: (K, 4) that are seen, m.
        movers: Discs that change their velocity, and carts.
        limited: Whether accelerations are limited.
        posts: (N, 2) points that stand, m.
        solid: (K, 4) walls that stand, those that are seen as points among them, m.
    """

    speed: float
    discs: Array = field(default_factory=lambda: NO_DISCS)
    velocities: Array = field(default_factory=lambda: NO_POINTS)
    points: Array = field(default_factory=lambda: NO_POINTS)
    walls: Array = field(default_factory=lambda: NO_WALLS)
    movers: tuple[Mover, ...] = ()
    limited: bool = False
    posts: Array = field(default_factory=lambda: NO_POINTS)
    solid: Array = field(default_factory=lambda: NO_WALLS)

    def rows(self) -> Array:
        """(M, 6) as the limit takes it: disc's place and velocity, robot's twist."""
        twist = np.tile((self.speed, 0.0), (len(self.discs), 1))
        return np.hstack([self.discs[:, :2], self.velocities, twist])

    @cached_property
    def all_movers(self) -> tuple[Mover, ...]:
        """Everything that moves, those of constant velocity first."""
        known = zip(self.discs, self.velocities, strict=True)
        return (*(straight(disc, velocity) for disc, velocity in known), *self.movers)

    @property
    def pace(self) -> float:
        """Greatest speed of a mover, m/s."""
        return max(mover.fastest for mover in self.all_movers)

    @cached_property
    def scene(self) -> Scene:
        """What the search of plans looks at."""
        here = np.zeros((1, 2))
        until = max(last_near(m, here, GONE + m.size) for m in self.all_movers)
        return make_scene(self.posts, self.solid, self.all_movers, until)

    def at(self, time: float, pose: Pose = (0.0, 0.0, 0.0)) -> Obstacles:
        """Return what is there at a time, with present velocities, seen from a pose."""
        discs, velocities = [self.discs], [self.velocities]
        if len(self.discs):
            discs = [self.discs + time * np.pad(self.velocities, ((0, 0), (0, 1)))]
        carts, rates = [], []
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        turned = np.array([[cos, -sin], [sin, cos]])
        for mover in self.movers:
            if mover.is_cart:
                carts.append((mover.corners(time) - pose[:2]) @ turned)
                rates.append([*(mover.velocity(time) @ turned), mover.turn(time)])
            else:
                discs.append(np.array([[*mover.at(time)[:2], mover.radius]]))
                velocities.append(mover.velocity(time)[None])
        known = np.concatenate(discs)
        known[:, :2] = (known[:, :2] - pose[:2]) @ turned
        ends = self.walls.reshape(-1, 2) - pose[:2]
        return Obstacles(
            (self.points - pose[:2]) @ turned,
            known,
            np.concatenate(velocities) @ turned,
            (ends @ turned).reshape(-1, 4),
            **({"polygons": carts, "polygon_velocities": rates} if carts else {}),
        )


def draw_disc(
    rng: np.random.Generator, robot: Robot, speed: float
) -> tuple[Array, Array]:
    """Return a disc (3,) and its velocity (2,), aimed at where the robot will be."""
    pace, radius = rng.choice(SPEEDS), rng.uniform(0.0, 0.4)
    seen, bearing = rng.uniform(0.8, 2.5), rng.uniform(-math.pi, math.pi)
    place, target = seen_at(robot, bearing, seen + radius), inside(rng, robot)
    times = np.linspace(0.0, DRIVE, 601)
    ways = target + np.outer(speed * times, (1.0, 0.0)) - place
    late = np.hypot(*ways.T) - pace * times
    way = ways[np.argmax(late <= 0.0) if (late <= 0.0).any() else np.argmin(late)]
    return np.array([*place, radius]), pace * way / np.hypot(*way)


def draw_world(
    rng: np.random.Generator, family: str, robot: Robot, speed: float, limited: bool
) -> Encounter:
    """Return an encounter of one of the :data:`encounter_families.WORLDS`.

    Args:
        rng: Draws it.
        family: Key of the world.
        robot: Whom it is aimed at.
        speed: Of the robot on its path, m/s; 0: it is parked.
        limited: Whether the robot's accelerations are.
    """
    world = WORLDS[family](rng, robot, speed)
    steady = [m for m in world.movers if family not in CHANGING and not m.is_cart]
    others = tuple(mover for mover in world.movers if mover not in steady)
    discs = np.array([(*m.at(0.0)[:2], m.radius) for m in steady]).reshape(-1, 3)
    velocities = np.array([m.velocity(0.0) for m in steady]).reshape(-1, 2)
    standing = (*world.seen(), others, limited, world.points, world.walls)
    return Encounter(speed, discs, velocities, *standing)


def draw_encounters(
    family: str, count: int, seed: int, robot: Robot
) -> list[Encounter]:
    """Return the encounters of a family; the same for the same seed.

    Every other one has the robot on a path. In families of :data:`WORLDS` the third and
    fourth of four have limits of acceleration.
    """
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    encounters = []
    for k in range(count):
        moves = family == "path" or (family != "parked" and k % 2 == 1)
        speed = float(rng.uniform(0.5, 1.0)) if moves else 0.0
        if family in WORLDS:
            limited = k // 2 % 2 == 1
            encounters.append(draw_world(rng, family, robot, speed, limited))
            continue
        number = int(rng.integers(2, 6)) if family == "several" else 1
        drawn = [draw_disc(rng, robot, speed) for _ in range(number)]
        discs, velocities = (np.array(part) for part in zip(*drawn, strict=True))
        limited = family == "accelerated"
        encounters.append(Encounter(speed, discs, velocities, limited=limited))
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
    """Return when no mover is near the way from start to goal any more, s."""
    way = np.linspace((0.0, 0.0), goal, 1 + math.ceil(np.hypot(*goal) / 0.1))
    near = robot.footprint.circumradius + 0.35
    movers = encounter.all_movers
    return max(last_near(mover, way, near + mover.size) for mover in movers)


def make_loops(encounters: Sequence[Encounter], robot: Robot) -> list[Loop]:
    """Return the closed loops, with time for the return after the movers have left."""
    loops = []
    for encounter in encounters:
        plan = reference(encounter.speed, DT)
        left = time_of_leaving(encounter, plan[-1, :2], robot)
        left = max(left, DRIVE if encounter.speed else 0.0)
        start = (0.0, 0.0, 0.0, encounter.speed, 0.0)
        loops.append(Loop(plan, encounter.at(0.0), start, left + RETURN, left))
    return loops


@dataclass(frozen=True)
class Plan:
    """The plan of a loop as a path."""

    rows: Array

    def sample(self, times: Array) -> Array:
        """Return the reference (n, 5) of the control steps at these times."""
        steps = np.rint(np.asarray(times) / DT).astype(int)
        found: Array = self.rows[np.minimum(steps, len(self.rows) - 1)]
        return found


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
        world=World(
            tracks=tuple(tracks),
            points=loop.obstacles.points,
            walls=loop.obstacles.walls,
        ),
        start=loop.start[:3],
        duration=loop.duration,
        dt=DT,
        arrival=batch.arrival,
    )
