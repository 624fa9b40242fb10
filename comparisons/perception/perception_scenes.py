"""Simulated scenes with known movers: worlds, walks, and the scans of a LiDAR.

A scene is a world at rest (walls and discs), movers that follow a function of time, and
the true motion of the robot. :func:`record` turns it into scans, odometry with drift,
and the true state of every mover at the time of each scan.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

import qpavoid as qp
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.model.obstacles import Obstacles

BODY = 0.25
"""m; radius of a person."""

SHIN, STRIDE, SPREAD = 0.06, 0.35, 0.11
"""m; radius of a shin, its swing ahead and behind, half the distance of both."""

FAULTS = {"range": 8.0, "dropout": 0.13, "fade": 0.12, "sweep": -0.085, "delay": -0.004}
"""Of the LiDAR in two_robots, as measured by perception_real.py."""

REST = 2.0
"""s that a walker rests where it turns round."""


class Mover(NamedTuple):
    """A body in motion.

    Attributes:
        path: x, y, heading (m, m, rad) at a time in s.
        shape: ``person``, ``shins``, or the (n, 2) vertices of a polygon about the
            middle, m.
        begins: s; it is there from then on.
        ends: s; it is there until then.
    """

    path: Callable[[float], tuple[float, float, float]]
    shape: object = "person"
    begins: float = 0.0
    ends: float = math.inf

    def is_there(self, time: float) -> bool:
        """Return whether it is in the world at a time."""
        return self.begins <= time <= self.ends

    def motion(self, time: float) -> np.ndarray:
        """Return x, y, v_x, v_y, the velocity by central differences."""
        h = 1e-3
        a, b = self.path(time - h), self.path(time + h)
        x, y, _ = self.path(time)
        return np.array([x, y, (b[0] - a[0]) / (2 * h), (b[1] - a[1]) / (2 * h)])

    @property
    def reach(self) -> float:
        """Greatest distance of its outline from its place, m."""
        if isinstance(self.shape, np.ndarray):
            return float(np.hypot(*self.shape.T).max())
        return BODY

    def outline(self, time: float) -> tuple[list[Sequence[float]], list[np.ndarray]]:
        """Return its discs and polygons, world frame."""
        x, y, heading = self.path(time)
        cos, sin = math.cos(heading), math.sin(heading)
        if isinstance(self.shape, np.ndarray):
            return [], [self.shape @ np.array([[cos, sin], [-sin, cos]]) + (x, y)]
        if self.shape == "person":
            return [(x, y, BODY)], []
        speed = math.hypot(*self.motion(time)[2:])
        swing = min(STRIDE, 0.3 * speed) * math.sin(2 * math.pi * 0.9 * time)
        legs = ((swing, SPREAD), (-swing, -SPREAD))
        return [
            (x + cos * a - sin * b, y + sin * a + cos * b, SHIN) for a, b in legs
        ], []


@dataclass
class Scene:
    """A world, its movers, and the way of the robot.

    Attributes:
        walls: (n, 4) x1, y1, x2, y2, m.
        posts: (n, 3) x, y, radius of discs at rest, m.
        movers: Bodies in motion.
        robot: Its x, y, heading (m, m, rad) at a time in s.
        duration: s.
    """

    walls: list[Sequence[float]] = field(default_factory=list)
    posts: list[Sequence[float]] = field(default_factory=list)
    movers: list[Mover] = field(default_factory=list)
    robot: Callable[[float], tuple[float, float, float]] = lambda t: (0.0, 0.0, 0.0)
    duration: float = 20.0

    def obstacles(self, time: float) -> Obstacles:
        """Return everything that a LiDAR sees at a time, world frame."""
        discs, polygons = list(self.posts), []
        for mover in self.movers:
            if mover.is_there(time):
                more, shapes = mover.outline(time)
                discs += more
                polygons += shapes
        return Obstacles(
            discs=np.array(discs).reshape(-1, 3),
            walls=np.array(self.walls).reshape(-1, 4),
            polygons=polygons,
        )


class Recorded(NamedTuple):
    """Scans of a scene, and the truth.

    Attributes:
        lidar: Geometry of the sensor.
        stamps: (n,) s.
        ranges: (n, beams) m; ``inf``: no echo within range; NaN: lost.
        odometry: (n, 3) x, y, heading with drift, m, m, rad.
        poses: (n, 3) true ones.
        truth: (n, movers, 4) x, y, v_x, v_y; NaN where a mover is not there.
        reach: (movers,) greatest distance of its outline from its place, m.
    """

    lidar: qp.Lidar
    stamps: np.ndarray
    ranges: np.ndarray
    odometry: np.ndarray
    poses: np.ndarray
    truth: np.ndarray
    reach: list[float]


class Drift(NamedTuple):
    """Errors of odometry.

    Attributes:
        turn: Relative error of turns.
        way: Relative error of the distance driven.
        noise: σ of the heading per √rad turned, rad.
    """

    turn: float = 0.0
    way: float = 0.0
    noise: float = 0.0


DRIFTS = {
    "none": Drift(),
    "0.5°/turn": Drift(0.5 / 360, 0.005, 0.001),
    "1.5°/turn": Drift(1.5 / 360, 0.01, 0.002),
    "4.3°/turn": Drift(4.3 / 360, 0.02, 0.005),
    "9°/turn": Drift(9.0 / 360, 0.03, 0.01),
}
"""From a gyroscope to wheels on carpet."""


def record(
    scene: Scene, lidar: LidarSettings, drift: Drift = DRIFTS["none"], seed: int = 0
) -> Recorded:
    """Return the scans of a scene at the LiDAR's rate, times jittered by 10 %."""
    random = np.random.default_rng(seed)
    count = int(scene.duration * lidar.rate)
    stamps = (np.arange(count) + 0.1 * random.uniform(-1, 1, count)) / lidar.rate
    stamps = np.maximum(stamps, 0.0)
    sensor = Lidar(replace(lidar, seed=seed))
    poses = np.array([scene.robot(t) for t in stamps])
    rows, truth = [], np.full((count, len(scene.movers), 4), np.nan)
    for k, time in enumerate(stamps.tolist()):
        rows.append(
            sensor.measure(
                lambda s, t=time: (scene.robot(t + s), scene.obstacles(t + s))
            )
        )
        for i, mover in enumerate(scene.movers):
            if mover.is_there(time):
                truth[k, i] = mover.motion(time)
    odometry = drifted(poses, drift, random)
    reach = [mover.reach for mover in scene.movers]
    return Recorded(
        sensor.settings.geometry, stamps, np.array(rows), odometry, poses, truth, reach
    )


def drifted(poses: np.ndarray, drift: Drift, random: np.random.Generator) -> np.ndarray:
    """Return poses as odometry with errors gives them."""
    out = [poses[0]]
    for a, b in pairwise(poses):
        turn = math.remainder(b[2] - a[2], 2 * math.pi)
        c, s = math.cos(a[2]), math.sin(a[2])
        ahead = c * (b[0] - a[0]) + s * (b[1] - a[1])
        aside = -s * (b[0] - a[0]) + c * (b[1] - a[1])
        ahead, aside = (1 + drift.way) * ahead, (1 + drift.way) * aside
        x, y, heading = out[-1]
        c, s = math.cos(heading), math.sin(heading)
        turn *= 1 + drift.turn
        turn += drift.noise * math.sqrt(abs(turn)) * random.standard_normal()
        out.append(
            (x + c * ahead - s * aside, y + s * ahead + c * aside, heading + turn)
        )
    return np.array(out)


def rectangle(length: float, width: float) -> np.ndarray:
    """Return the corners of a rectangle about the origin, counter-clockwise, m."""
    x, y = 0.5 * length, 0.5 * width
    return np.array([(x, y), (-x, y), (-x, -y), (x, -y)])


def box_walls(x1: float, y1: float, x2: float, y2: float) -> list[tuple[float, ...]]:
    """Return the four walls of a box."""
    return [(x1, y1, x2, y1), (x2, y1, x2, y2), (x2, y2, x1, y2), (x1, y2, x1, y1)]


def started(time: float, ramp: float) -> float:
    """Return ∫ of a speed that rises to 1 within a ramp, s; 0 before."""
    time = max(time, 0.0)
    return 0.5 * time * time / ramp if time < ramp else time - 0.5 * ramp


def walk_line(
    begin: Sequence[float],
    end: Sequence[float],
    speed: float,
    start: float = 0.0,
    acceleration: float = math.inf,
):
    """Return the path of a walk to and fro between two places, with rests of 2 s.

    It starts and stops with an acceleration, m/s².
    """
    length = math.dist(begin, end)
    heading = math.atan2(end[1] - begin[1], end[0] - begin[0])
    ramp = min(speed / acceleration, length / speed)
    lasts = length / speed + ramp + REST

    def path(time: float) -> tuple[float, float, float]:
        phase = max(time - start, 0.0) % (2.0 * lasts)
        back = phase > lasts
        time, top = phase % lasts, length / speed
        share = (started(time, ramp) - started(time - top, ramp)) / top
        share = 1.0 - share if back else share
        x = begin[0] + share * (end[0] - begin[0])
        y = begin[1] + share * (end[1] - begin[1])
        return x, y, heading + (math.pi if back else 0.0)

    return path


def tour(corners: Sequence[Sequence[float]], speed: float = 1.0, turning: float = 1.0):
    """Return the motion along a closed polyline: straight lines, turns on the spot."""
    pieces, time = [], 0.0
    points = [*corners, corners[0]]
    heading = math.atan2(points[1][1] - points[0][1], points[1][0] - points[0][0])
    for k in range(len(points) - 1):
        a, b = points[k], points[k + 1]
        wanted = math.atan2(b[1] - a[1], b[0] - a[0])
        turn = math.remainder(wanted - heading, 2 * math.pi)
        duration = abs(turn) / turning
        pieces.append((time, duration, (*a, heading), (0.0, turn)))
        time, heading = time + duration, heading + turn
        duration = math.dist(a, b) / speed
        pieces.append((time, duration, (*a, heading), (math.dist(a, b), 0.0)))
        time += duration

    def motion(now: float) -> tuple[float, float, float]:
        rounds, now = divmod(max(now, 0.0), time)
        total = rounds * sum(piece[3][1] for piece in pieces)
        begin, duration, (x, y, angle), (way, turn) = [
            p for p in pieces if p[0] <= now
        ][-1]
        share = min((now - begin) / duration, 1.0) if duration else 1.0
        return (
            x + share * way * math.cos(angle),
            y + share * way * math.sin(angle),
            angle + share * turn + total,
        )

    return motion


def flat(seed: int = 0) -> Scene:
    """Return three furnished rooms, toured at 1 m/s and 1 rad/s; nothing moves."""
    walls = box_walls(-4, -3, 5, 4)
    walls += [(-4, 1, -1, 1), (0, 1, 2, 1), (3, 1, 5, 1), (2, 1, 2, 4)]
    walls += box_walls(-3.9, -2.9, -2.9, -2.4) + box_walls(4.2, -1.5, 4.9, 0.0)
    walls += box_walls(-2.5, 2.8, -1.3, 3.6)  # a shelf, a bench, a table's edge
    legs = [(1.2, 2.5), (1.2, 3.2), (0.4, 2.5), (0.4, 3.2), (3.4, -2.4), (4.4, -2.4)]
    posts = [(x, y, 0.025) for x, y in legs] + [(-0.5, -2.6, 0.2), (4.5, 3.6, 0.15)]
    pickets = [(-3.5 + 0.12 * k, 3.9, 0.015) for k in range(12)]
    way = [(-2.0, -1.2), (2.5, -1.2), (2.5, 0.2), (2.5, 2.2), (2.5, 0.2), (-0.5, 0.2)]
    way += [(-0.5, 2.2), (-0.5, 0.2), (-3.0, 0.2), (-3.0, -1.2)]
    return Scene(walls, posts + pickets, [], tour(way), 60.0)


def still_robot(x: float = 0.0, y: float = 0.0, heading: float = 0.0):
    """Return the motion of a parked robot."""
    return lambda time: (x, y, heading)


ROOM = [*box_walls(-5, -4, 5, 4), *box_walls(3.5, -3.5, 4.5, -2.5)]


def passer(
    begin: Sequence[float],
    end: Sequence[float],
    speed: float,
    start: float,
    shape: object = "person",
) -> Mover:
    """Return a mover that starts at a time, s, and is gone at the end of its line."""
    until = start + math.dist(begin, end) / speed
    return Mover(walk_line(begin, end, speed, start), shape, start, until)


def crossings(shape: object = "person", abreast: int = 1, seed: int = 0) -> Scene:
    """Return a parked robot in a room that people cross, alone or side by side."""
    random = np.random.default_rng(seed)
    movers = []
    for k in range(8):
        speed, angle = random.uniform(0.5, 1.5), random.uniform(-math.pi, math.pi)
        near = random.uniform(0.8, 2.5)
        c, s = math.cos(angle), math.sin(angle)
        for i in range(abreast):
            off = near + 0.65 * i
            way = 3.0 if abreast > 1 else 4.5  # a clip would bring several together
            begin = np.array((-s * off - c * way, c * off - s * way))
            end = np.array((-s * off + c * way, c * off + s * way))
            if abreast == 1:
                room = (-4.6, -3.6), (4.6, 3.6)
                begin, end = np.clip(begin, *room), np.clip(end, *room)
            movers.append(passer(begin, end, speed, 3.0 + 7.0 * k, shape))
    return Scene(list(ROOM), [(-3.0, 3.0, 0.03)], movers, still_robot(), 60.0)


def corridor(seed: int = 0) -> Scene:
    """Return a corridor of 2 m with people oncoming; the robot drives."""
    random = np.random.default_rng(seed)
    movers = []
    for k in range(6):
        y, speed = random.uniform(-0.7, 0.7), random.uniform(0.5, 1.4)
        movers.append(passer((9.0, y), (-9.0, y), speed, 2.0 + 8.0 * k))
    walls = [(-10, -1, 10, -1), (-10, 1, 2, 1), (3, 1, 10, 1)]
    walls += [(10, -1, 10, 1), (-10, -1, -10, 1)]
    return Scene(walls, [], movers, tour([(-3.0, 0.0), (3.0, 0.0)], 0.4, 0.8), 50.0)


def along_wall(seed: int = 0) -> Scene:
    """Return people who walk along a wall, 0.2 m from it."""
    line = (-4.5, 4 - 0.45), (4.5, 4 - 0.45)
    speeds = enumerate((0.6, 0.9, 1.2, 1.5))
    movers = [passer(*line, speed, 2.0 + 9.0 * k) for k, speed in speeds]
    return Scene(list(ROOM), [], movers, still_robot(0.0, 1.0), 40.0)


def occlusion(seed: int = 0) -> Scene:
    """Return people who come from behind a wall."""
    speeds = enumerate((0.8, 1.1, 1.4, 0.6))
    line = (4.5, 3.0), (-4.5, 0.8)
    movers = [passer(*line, speed, 2.0 + 9.0 * k) for k, speed in speeds]
    walls = [*ROOM, (1.0, 0.8, 1.0, 3.0), (1.0, 3.0, 3.0, 3.0)]
    return Scene(walls, [], movers, still_robot(-1.0, -1.0, 0.5), 40.0)


def stop_and_go(seed: int = 0) -> Scene:
    """Return a scene of one person: walk, 4 s at rest, walk."""

    def path(time: float) -> tuple[float, float, float]:
        phase = (time - 2.0) % 16.0
        way = min(phase, 4.0) + max(min(phase, 12.0) - 8.0, 0.0)
        x = -3.2 + 0.8 * way if time > 2.0 else -3.2
        return (x, 2.0, 0.0) if phase < 12.0 and time < 50.0 else (1e3, 1e3, 0.0)

    return Scene(list(ROOM), [], [Mover(path, "person", 2.0)], still_robot(), 50.0)


def large(kind: str) -> Scene:
    """Return a cart of 1.2 × 0.8 m, another robot, or a door leaf that swings."""
    if kind == "door":
        return door()
    shape = rectangle(1.2, 0.8) if kind == "cart" else rectangle(0.6, 0.4)
    ways = [((-4, 2.2), (4, 2.2), 0.8), ((4, -2), (-4, 1.8), 1.0)]
    ways += [((-2.2, -3), (-2.2, 3), 0.6), ((4, 1.5), (1.2, 0.2), 0.5)]
    movers = [passer(*way, 3.0 + 14.0 * k, shape) for k, way in enumerate(ways)]
    return Scene(list(ROOM), [], movers, still_robot(), 58.0)


def door() -> Scene:
    """Return a door leaf of 0.9 m that swings by 86° about a hinge at (0.05, 1.95)."""
    walls = [*box_walls(-5, -4, 5, 2), (-5, 4, 5, 4)]
    walls[2:3] = [(5, 2, 1.0, 2), (0.0, 2, -5, 2)]

    def path(time: float) -> tuple[float, float, float]:
        phase = (time - 3.0) % 12.0 if time > 3.0 else 0.0
        angle = 0.5 * max(min(phase, 3.0) - max(phase - 6.0, 0.0), 0.0)
        return 0.05 + 0.45 * math.cos(angle), 1.95 - 0.45 * math.sin(angle), -angle

    leaf = Mover(path, rectangle(0.9, 0.04))
    return Scene(walls, [], [leaf], still_robot(0.0, -1.0, 1.57), 40.0)


def spin(seed: int = 0) -> Scene:
    """Return a robot that turns on the spot beside a wall with gaps and pickets."""
    walls = [
        (-5, 1.2, -1, 1.2),
        (-0.2, 1.2, 2, 1.2),
        (2.6, 1.2, 5, 1.2),
        *box_walls(-5, -3, 5, 3),
    ]
    posts = [(-1.0 + 0.13 * k, 1.2, 0.015) for k in range(7)] + [
        (2.0 + 0.13 * k, 1.2, 0.015) for k in range(5)
    ]
    return Scene(walls, posts, [], lambda t: (0.0, 0.3, 1.0 * t), 40.0)


def pickets(seed: int = 0) -> Scene:
    """Return a drive along a wall with gaps and pickets; nothing moves."""
    scene = spin()
    scene.robot = tour([(-4.0, 0.0), (4.0, 0.0)], 1.0, 1.0)
    return scene
