"""Simulated scenes with known movers: worlds, walks, and the scans of a LiDAR.

A scene is a world at rest (walls and discs), movers that follow a function of time, and
the true motion of the robot. :func:`record` turns it into scans, odometry with drift,
and the true state of every mover at the time of each scan.

Run: python comparisons/perception/perception_bench.py
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np

import qpavoid as qp
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.model.kinematics import to_world
from qpavoid.types import Array, Pose

Path: TypeAlias = Callable[[float], Pose]
"""From a time in s to x, y, heading: m, m, rad."""

Line: TypeAlias = Sequence[float]

BODY = 0.25
"""m; radius of a person."""

SHIN, STRIDE, SPREAD = 0.06, 0.35, 0.11
"""m; radius of a shin, its swing ahead and behind, half the distance of both."""

FAULTS = {"range": 8.0, "dropout": 0.13, "fade": 0.12, "sweep": -0.085, "delay": -0.004}
"""Of the LiDAR in two_robots, as measured by perception_real.py."""

DRIFTS = {
    "none": (0.0, 0.0, 0.0),
    "0.5°/turn": (0.5 / 360, 0.005, 0.001),
    "1.5°/turn": (1.5 / 360, 0.01, 0.002),
    "4.3°/turn": (4.3 / 360, 0.02, 0.005),
    "9°/turn": (9.0 / 360, 0.03, 0.01),
}
"""Errors of odometry, from a gyroscope to wheels on carpet: relative ones of turns and
of distances, and σ of the heading per √rad turned, rad."""


class Mover(NamedTuple):
    """A body in motion, in the world from a time to another one, s."""

    path: Path
    shape: str | Array = "person"  # or "shins", or the vertices (n, 2) of a polygon, m
    begins: float = 0.0
    ends: float = math.inf

    def is_there(self, time: float) -> bool:
        """Return whether it is in the world at a time."""
        return self.begins <= time <= self.ends

    def motion(self, time: float) -> Array:
        """Return x, y, v_x, v_y, the velocity by central differences."""
        h = 1e-3
        places = [self.path(t)[:2] for t in (time - h, time, time + h)]
        return np.append(places[1], np.subtract(places[2], places[0]) / (2 * h))

    @property
    def reach(self) -> float:
        """Greatest distance of its outline from its place, m."""
        if isinstance(self.shape, str):
            return BODY
        return float(np.hypot(*self.shape.T).max())

    def outline(self, time: float) -> tuple[list[Line], list[Array]]:
        """Return its discs (x, y, radius) and polygons, world frame."""
        pose = self.path(time)
        if not isinstance(self.shape, str):
            return [], [to_world(self.shape, pose)]
        if self.shape == "person":
            return [(*pose[:2], BODY)], []
        speed = math.hypot(*self.motion(time)[2:])
        swing = min(STRIDE, 0.3 * speed) * math.sin(2 * math.pi * 0.9 * time)
        legs = to_world(np.array([(swing, SPREAD), (-swing, -SPREAD)]), pose)
        return [(x, y, SHIN) for x, y in legs.tolist()], []


@dataclass
class Scene:
    """A world, its movers, and the way of the robot."""

    walls: Sequence[Line]  # x1, y1, x2, y2, m
    posts: Sequence[Line] = ()  # discs at rest: x, y, radius, m
    movers: list[Mover] = field(default_factory=list)
    robot: Path = lambda time: (0.0, 0.0, 0.0)
    duration: float = 20.0  # s

    def obstacles(self, time: float) -> qp.Obstacles:
        """Return everything that a LiDAR sees at a time, world frame."""
        there = [one.outline(time) for one in self.movers if one.is_there(time)]
        discs = [*self.posts, *(disc for discs, _ in there for disc in discs)]
        polygons = [one for _, polygons in there for one in polygons]
        discs = np.reshape(discs, (-1, 3))
        return qp.Obstacles(discs=discs, walls=self.walls, polygons=polygons)


class Recorded(NamedTuple):
    """Scans of a scene, and the truth."""

    lidar: qp.Lidar
    stamps: Array  # (n,) s
    ranges: Array  # (n, beams) m; inf: no echo within range; NaN: lost
    odometry: Array  # (n, 3) x, y, heading with drift, m, m, rad
    poses: Array  # (n, 3), true
    truth: Array  # (n, movers, 4) x, y, v_x, v_y; NaN where a mover is not there
    reach: list[float]  # of movers: distance of the outline from the place, m


def record(
    scene: Scene,
    lidar: LidarSettings,
    drift: tuple[float, float, float] = DRIFTS["none"],
    seed: int = 0,
) -> Recorded:
    """Return the scans of a scene at the LiDAR's rate, times jittered by 10 %."""
    random = np.random.default_rng(seed)
    count = int(scene.duration * lidar.rate)
    stamps = (np.arange(count) + 0.1 * random.uniform(-1, 1, count)) / lidar.rate
    stamps = np.maximum(stamps, 0.0)
    sensor, rows = Lidar(replace(lidar, seed=seed)), []
    truth = np.full((count, len(scene.movers), 4), np.nan)
    for k, time in enumerate(stamps.tolist()):

        def world(after: float, time: float = time) -> tuple[Pose, qp.Obstacles]:
            return scene.robot(time + after), scene.obstacles(time + after)

        rows.append(sensor.measure(world))
        for i, mover in enumerate(scene.movers):
            if mover.is_there(time):
                truth[k, i] = mover.motion(time)
    poses = np.array([scene.robot(time) for time in stamps.tolist()])
    scans = lidar.geometry, stamps, np.array(rows), drifted(poses, drift, random)
    return Recorded(*scans, poses, truth, [mover.reach for mover in scene.movers])


def drifted(
    poses: Array, drift: tuple[float, float, float], random: np.random.Generator
) -> Array:
    """Return poses (continuous headings) as odometry with errors gives them."""
    turn_error, way_error, noise = drift
    turns = (1.0 + turn_error) * np.diff(poses[:, 2])
    turns += noise * np.sqrt(np.abs(turns)) * random.standard_normal(len(turns))
    headings = np.cumsum(np.append(poses[0, 2], turns))
    places = poses[:, 0] + 1j * poses[:, 1]
    turned = np.exp(1j * (headings - poses[:, 2]))
    ways = (1.0 + way_error) * np.diff(places) * turned[:-1]
    places = np.cumsum(np.append(places[0], ways))
    return np.column_stack([places.real, places.imag, headings])


def box_walls(x1: float, y1: float, x2: float, y2: float) -> list[Line]:
    """Return the four walls of a box."""
    return [(x1, y1, x2, y1), (x2, y1, x2, y2), (x2, y2, x1, y2), (x1, y2, x1, y1)]


def between(times: Line, poses: Sequence[Pose]) -> Path:
    """Return a path linear between poses at times; before and after it rests."""
    columns = np.transpose(poses)
    return lambda time: tuple(float(np.interp(time, times, one)) for one in columns)


def passer(
    begin: Line, end: Line, speed: float, start: float, shape: str | Array = "person"
) -> Mover:
    """Return a mover that starts at a time, s, and is gone at the end of its line."""
    heading = math.atan2(end[1] - begin[1], end[0] - begin[0])
    until = start + math.dist(begin, end) / speed
    ends = (begin[0], begin[1], heading), (end[0], end[1], heading)
    return Mover(between((start, until), ends), shape, start, until)


def one_by_one(begin: Line, end: Line, speeds: Line) -> list[Mover]:
    """Return people on one line, who start 9 s apart."""
    return [passer(begin, end, one, 2.0 + 9.0 * k) for k, one in enumerate(speeds)]


def tour(corners: Sequence[Line], speed: float, turning: float) -> Path:
    """Return a path along a closed polyline: straight lines, turns on the spot.

    The robot does not turn at the end of a round: the next one may be driven backwards.
    """
    (x1, y1), (x2, y2) = corners[:2]
    heading = math.atan2(y2 - y1, x2 - x1)
    times, poses = [0.0], [(x1, y1, heading)]
    for (x1, y1), (x2, y2) in pairwise([*corners, corners[0]]):
        wanted = math.atan2(y2 - y1, x2 - x1)
        turn = math.remainder(wanted - heading, 2 * math.pi)
        heading += turn
        times.append(times[-1] + abs(turn) / turning)
        times.append(times[-1] + math.dist((x1, y1), (x2, y2)) / speed)
        poses += [(x1, y1, heading), (x2, y2, heading)]
    once, round_turn = between(times, poses), poses[-1][2] - poses[0][2]

    def path(time: float) -> Pose:
        rounds, time = divmod(max(time, 0.0), times[-1])
        x, y, heading = once(time)
        return x, y, heading + rounds * round_turn

    return path


ROOM = [*box_walls(-5, -4, 5, 4), *box_walls(3.5, -3.5, 4.5, -2.5)]


def crossings(seed: int, shape: str = "person", abreast: int = 1) -> Scene:
    """Return a parked robot in a room that people cross, alone or side by side."""
    random = np.random.default_rng(seed)
    movers = []
    for k in range(8):
        speed, angle = random.uniform(0.5, 1.5), random.uniform(-math.pi, math.pi)
        near = random.uniform(0.8, 2.5)
        for off in near + 0.65 * np.arange(abreast):
            way = 3.0 if abreast > 1 else 4.5  # a clip would bring several together
            ends = to_world(np.array([(-way, off), (way, off)]), (0.0, 0.0, angle))
            if abreast == 1:
                ends = np.clip(ends, (-4.6, -3.6), (4.6, 3.6))
            movers.append(passer(*ends.tolist(), speed, 3.0 + 7.0 * k, shape))
    return Scene(ROOM, [(-3.0, 3.0, 0.03)], movers, duration=60.0)


def corridor(seed: int) -> Scene:
    """Return a corridor of 2 m with people oncoming; the robot drives."""
    random = np.random.default_rng(seed)
    movers = []
    for k in range(6):
        y, speed = random.uniform(-0.7, 0.7), random.uniform(0.5, 1.4)
        movers.append(passer((9.0, y), (-9.0, y), speed, 2.0 + 8.0 * k))
    walls = [(-10, -1, 10, -1), (-10, 1, 2, 1), (3, 1, 10, 1)]
    walls += [(10, -1, 10, 1), (-10, -1, -10, 1)]
    return Scene(walls, [], movers, tour([(-3.0, 0.0), (3.0, 0.0)], 0.4, 0.8), 50.0)


def along_wall(seed: int) -> Scene:
    """Return people who walk along a wall, 0.2 m from it."""
    movers = one_by_one((-4.5, 4 - 0.45), (4.5, 4 - 0.45), (0.6, 0.9, 1.2, 1.5))
    return Scene(ROOM, [], movers, lambda time: (0.0, 1.0, 0.0), 40.0)


def occlusion(seed: int) -> Scene:
    """Return people who come from behind a wall."""
    walls = [*ROOM, (1.0, 0.8, 1.0, 3.0), (1.0, 3.0, 3.0, 3.0)]
    movers = one_by_one((4.5, 3.0), (-4.5, 0.8), (0.8, 1.1, 1.4, 0.6))
    return Scene(walls, [], movers, lambda time: (-1.0, -1.0, 0.5), 40.0)


def stop_and_go(seed: int) -> Scene:
    """Return a person in a cycle: walk, rest, walk and absence, of 4 s each."""
    places = [(-3.2, 2.0, 0.0), (0.0, 2.0, 0.0), (0.0, 2.0, 0.0), (3.2, 2.0, 0.0)]
    walk = between((0.0, 4.0, 8.0, 12.0), places)

    def path(time: float) -> Pose:
        phase = (time - 2.0) % 16.0
        return walk(phase) if phase < 12.0 else (1e3, 1e3, 0.0)

    return Scene(ROOM, [], [Mover(path, begins=2.0)], duration=50.0)


def large(length: float, width: float) -> Scene:
    """Return a rectangle that crosses four times: a cart, or another robot."""
    shape = qp.Footprint.rectangle(length, width).vertices
    ways = [((-4, 2.2), (4, 2.2), 0.8), ((4, -2), (-4, 1.8), 1.0)]
    ways += [((-2.2, -3), (-2.2, 3), 0.6), ((4, 1.5), (1.2, 0.2), 0.5)]
    movers = [passer(*way, 3.0 + 14.0 * k, shape) for k, way in enumerate(ways)]
    return Scene(ROOM, [], movers, duration=58.0)


def door(seed: int) -> Scene:
    """Return a door leaf of 0.9 m that swings by 86° about a hinge at (0.05, 1.95)."""
    walls = [*box_walls(-5, -4, 5, 2), (-5, 4, 5, 4)]
    walls[2:3] = [(5, 2, 1.0, 2), (0.0, 2, -5, 2)]

    def path(time: float) -> Pose:
        phase = max(time - 3.0, 0.0) % 12.0
        angle = float(np.interp(phase, (0.0, 3.0, 6.0, 9.0), (0.0, 1.5, 1.5, 0.0)))
        return 0.05 + 0.45 * math.cos(angle), 1.95 - 0.45 * math.sin(angle), -angle

    leaf = Mover(path, qp.Footprint.rectangle(0.9, 0.04).vertices)
    return Scene(walls, [], [leaf], lambda time: (0.0, -1.0, 1.57), 40.0)


def flat(seed: int) -> Scene:
    """Return three furnished rooms, toured at 1 m/s and 1 rad/s; nothing moves."""
    walls = box_walls(-4, -3, 5, 4)
    walls += [(-4, 1, -1, 1), (0, 1, 2, 1), (3, 1, 5, 1), (2, 1, 2, 4)]
    walls += box_walls(-3.9, -2.9, -2.9, -2.4) + box_walls(4.2, -1.5, 4.9, 0.0)
    walls += box_walls(-2.5, 2.8, -1.3, 3.6)  # a shelf, a bench, a table's edge
    legs = [(1.2, 2.5), (1.2, 3.2), (0.4, 2.5), (0.4, 3.2), (3.4, -2.4), (4.4, -2.4)]
    posts = [(x, y, 0.025) for x, y in legs] + [(-0.5, -2.6, 0.2), (4.5, 3.6, 0.15)]
    posts += [(-3.5 + 0.12 * k, 3.9, 0.015) for k in range(12)]
    way = [(-2.0, -1.2), (2.5, -1.2), (2.5, 0.2), (2.5, 2.2), (2.5, 0.2), (-0.5, 0.2)]
    way += [(-0.5, 2.2), (-0.5, 0.2), (-3.0, 0.2), (-3.0, -1.2)]
    return Scene(walls, posts, [], tour(way, 1.0, 1.0), 60.0)


def beside_pickets(robot: Path) -> Scene:
    """Return a robot beside a wall with gaps and pickets; nothing moves."""
    walls = [(-5, 1.2, -1, 1.2), (-0.2, 1.2, 2, 1.2), (2.6, 1.2, 5, 1.2)]
    places = [*(-1.0 + 0.13 * np.arange(7)), *(2.0 + 0.13 * np.arange(5))]
    posts = [(x, 1.2, 0.015) for x in places]
    return Scene([*walls, *box_walls(-5, -3, 5, 3)], posts, [], robot, 40.0)


MOVING: dict[str, Callable[[int], Scene]] = {
    "alone": crossings,
    "two abreast": partial(crossings, abreast=2),
    "three abreast": partial(crossings, abreast=3),
    "shins": partial(crossings, shape="shins"),
    "corridor": corridor,
    "along a wall": along_wall,
    "out of an occlusion": occlusion,
    "stop and go": stop_and_go,
    "cart": lambda seed: large(1.2, 0.8),
    "robot": lambda seed: large(0.6, 0.4),
    "door": door,
}
STATIC: dict[str, Callable[[int], Scene]] = {
    "furnished flat": flat,
    "turning": lambda seed: beside_pickets(lambda time: (0.0, 0.3, time)),
    "pickets": lambda seed: beside_pickets(tour([(-4.0, 0.0), (4.0, 0.0)], 1.0, 1.0)),
}
SCENES = MOVING | STATIC
"""Scenes of the bench by name, of a seed."""
