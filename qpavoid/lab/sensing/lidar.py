"""Planar LiDAR: exact rays to discs, walls and polygons.

A scan ends when it is due. Its beams are taken at once or, with a sweep, one after the
other while robot and obstacles move. The output is the newest scan at least as old as
the latency, moved into the present robot frame by the robot's true motion.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Protocol, TypeAlias

import numpy as np

from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.lab.sensing.clock import SOON, Clock
from qpavoid.model.capsules import (
    RADIUS,
    X1,
    Y1,
    chain_end,
    has_length,
    holds_point,
    in_robot_frame,
    like,
)
from qpavoid.model.kinematics import to_world, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.perception import settings as perceived
from qpavoid.perception.perception import Perception
from qpavoid.settings import FINITE, NO_KEY, NOT_NEGATIVE, SHARE, Range, check
from qpavoid.types import Array, Arrays, Points, Pose, VectorWritten

ROUND = Range(gt=0.0, le=2 * math.pi + 1e-9, allow_inf_nan=False)
SOME = Range(gt=0.0, le=1e6, allow_inf_nan=False)
NONE_OR_SOME = Range(ge=0.0, le=1e6, allow_inf_nan=False)

SLICES = 8
"""Parts of a sweep, each taken at once."""


@dataclass(frozen=True)
class LidarSettings:
    """Settings of a LiDAR.

    Attributes:
        field_of_view: rad, symmetric about the sensor's x axis. Each beam points to the
            middle of one of ``beams`` equal sectors.
        beams: Number of beams.
        range: Greatest distance of an echo, m.
        rate: Scans a second, Hz.
        latency: s from a scan to its output.
        noise: σ of a range, m.
        dropout: Probability that an echo is lost.
        fade: Share of echoes lost besides: 1 − exp(−fade · r / (range · cos ι)) at a
            distance r and an incidence ι.
        sweep: s from the first to the last beam; negative: the last comes first.
        delay: s by which stamps are later than the first beam.
        seed: Of noise and dropouts.
        mount: x, y (m), γ (rad) of the sensor in the robot frame.
        point_radius: Radius of points of the world, m, since a ray never hits a point.
        perception: Whether scans become static and moving obstacles by
            :class:`~qpavoid.perception.perception.Perception`; else all are points.
    """

    field_of_view: Annotated[float, "rad", ROUND] = 2 * math.pi
    beams: Annotated[int, Range(ge=1, le=100_000)] = 360
    range: Annotated[float, "m", SOME] = 10.0
    rate: Annotated[float, "hz", SOME] = 10.0
    latency: Annotated[float, "s", NONE_OR_SOME] = 0.0
    noise: Annotated[float, "m", NONE_OR_SOME] = 0.01
    dropout: Annotated[float, SHARE] = 0.0
    fade: Annotated[float, NOT_NEGATIVE] = 0.0
    sweep: Annotated[float, "s", perceived.SHORT] = 0.0
    delay: Annotated[float, "s", perceived.SHORT] = 0.0
    seed: Annotated[int, NO_KEY, Range(ge=0)] = 0
    mount: Annotated[Pose, FINITE, perceived.MOUNT] = (0.0, 0.0, 0.0)
    point_radius: Annotated[float, "m", NONE_OR_SOME] = 0.02
    perception: bool = True

    def __post_init__(self) -> None:
        check(self, "a LiDAR needs")

    @property
    def geometry(self) -> perceived.Lidar:
        """Geometry of the sensor for perception, whose beams span the whole view."""
        wide, step = self.field_of_view, self.field_of_view / self.beams
        is_round, (x, y, heading) = wide > perceived.ALL_ROUND, self.mount
        return perceived.Lidar(
            field_of_view=wide if is_round else wide - step,
            mount=(x, y, heading + 0.5 * step if is_round else heading),
            range_max=self.range,
            range_min=0.0,
            sweep=self.sweep,
            delay=self.delay,
            no_echo="auto" if self.fade else "free",
        )


class Lidar:
    """State of a LiDAR.

    Attributes:
        settings: Of the sensor.
        taken: Stamp of the last scan that was output, s; NaN before.
        pose: True pose of the robot then, m and rad.
        last: (n,) its ranges, m; ``inf`` without an echo or after a dropout.
    """

    def __init__(self, settings: LidarSettings | None = None) -> None:
        self.settings = settings if settings is not None else LidarSettings()
        self.taken, self.last = math.nan, np.empty(0)
        self.pose: Pose = (0.0, 0.0, 0.0)
        n, view = self.settings.beams, self.settings.field_of_view
        angles = view * ((np.arange(n) + 0.5) / n - 0.5)
        self._beams: Array = np.column_stack([np.cos(angles), np.sin(angles)])
        self._random = np.random.default_rng(self.settings.seed)
        self._scans: deque[tuple[float, Pose, Array]] = deque()
        self._clock = Clock(self.settings.rate)
        self._before = (-math.inf, self.pose)

    def scan(
        self,
        pose: Pose,
        time: float,
        obstacles: Obstacles,
    ) -> Array:
        """Return the echoes available at ``time`` as points (n, 2), robot frame.

        Call it in every control step: a scan is taken at the first call at or after
        k/rate. The first one is output at once, as if all had been at rest before.

        Args:
            pose: True x, y (m), γ (rad) of the robot.
            time: s; never runs backwards.
            obstacles: At ``time``, world frame.

        Raises:
            InvalidInputError: Time runs backwards.
        """
        s, (before, old) = self.settings, self._before
        self._before = time, pose
        if self._clock.ticks(time):
            back = s.delay - abs(s.sweep)  # from the end of the scan to its stamp
            moved = pose[0] - old[0], pose[1] - old[1], wrap_angle(pose[2] - old[2])
            rate = np.array(moved) / max(time - before, SOON)

            def world(after: float) -> tuple[Pose, Obstacles]:
                x, y, heading = np.add(pose, (after + back) * rate).tolist()
                return (x, y, heading), obstacles.moved(after + back)

            self._scans.append((time + back, world(0.0)[0], self.measure(world)))
        known = time - self.settings.latency + SOON
        while len(self._scans) > 1 and self._scans[1][0] <= known:
            self._scans.popleft()
        self.taken, self.pose, self.last = self._scans[0]
        echo = np.isfinite(self.last)
        places = self.last[echo, None] * self._beams[echo]
        echoes = Obstacles(to_world(places, self._sensor(self.pose)))
        return echoes.seen_from(pose).points

    def ranges(
        self, pose: Pose, obstacles: Obstacles, beams: slice = slice(None)
    ) -> Array:
        """Return the exact length (m) of beams; without an echo the range."""
        x, y, heading = self._sensor(pose)
        rays = self._beams[beams]
        ranges = np.full(len(rays), float(self.settings.range))
        seen = like(obstacles.arrays)
        in_robot_frame((x, y, heading), 0.0, obstacles.arrays, seen)
        cast_rays(rays, seen, self.settings.point_radius, ranges)
        return ranges

    def measure(self, world: Callable[[float], tuple[Pose, Obstacles]]) -> Array:
        """Return the ranges of a scan with its errors; ``inf`` without an echo.

        Args:
            world: True pose of the robot, and obstacles in the world frame, at a time
                after the stamp, s.
        """
        s = self.settings
        ends = np.linspace(0, s.beams, 1 + (SLICES if s.sweep else 1)).astype(int)
        first, parts = 0.5 * abs(s.sweep) - s.delay, []
        for low, high in pairwise(ends.tolist()):
            share = 0.5 * (low + high) / s.beams - 0.5
            seen = world(first + s.sweep * share)
            parts.append(self.ranges(*seen, slice(low, high)))
        ranges = np.concatenate(parts)
        # Noise is drawn for every beam, with an echo or without, so that beams are
        # independent of each other.
        none, lost = ranges >= s.range, np.full(len(ranges), s.dropout)
        if s.fade and len(ranges) > 1:
            step = s.field_of_view / s.beams
            tan = np.gradient(ranges, step) / np.maximum(ranges, 0.1)
            fade = s.fade * ranges / s.range
            lost = 1.0 - (1.0 - lost) * np.exp(-fade * np.hypot(1.0, tan))
        if s.noise:
            noise = self._random.standard_normal(len(ranges))
            ranges = np.maximum(ranges + s.noise * noise, 0.0)
        if s.dropout or s.fade:
            none |= self._random.random(len(ranges)) < lost
        return np.where(none, np.inf, ranges)

    def _sensor(self, pose: Pose) -> Pose:
        (x, y, heading), (ahead, left, turned) = pose, self.settings.mount
        cos, sin = math.cos(heading), math.sin(heading)
        return (
            x + cos * ahead - sin * left,
            y + sin * ahead + cos * left,
            heading + turned,
        )


Sensor: TypeAlias = Callable[[float, Obstacles, Pose], Obstacles]
"""From time, obstacles (world frame) and the true pose to obstacles, robot frame."""


class AnySensor(Protocol):
    """A sensor that is given from Python."""

    def start(self) -> Sensor:
        """Return the function of a new run."""
        ...


def scanner(
    robot: Robot,
    settings: LidarSettings,
    bodies: perceived.PerceptionSettings | None = None,
) -> Sensor:
    """Return a LiDAR on a robot: points, or what perception makes of its scans."""
    lidar = Lidar(settings)
    perception = Perception(robot, settings.geometry, bodies)
    taken = math.nan

    def see(time: float, obstacles: Obstacles, pose: Pose) -> Obstacles:
        nonlocal taken
        points = lidar.scan(pose, time, obstacles)
        if not settings.perception:
            return Obstacles(points)
        if lidar.taken != taken:
            taken = lidar.taken
            perception.update(lidar.last, taken, lidar.pose)
        return perception.obstacles(time, pose)

    return see


@entry
@compiled_once
def _cast_rays_fits(
    beams: Points, seen: Arrays, point_radius: float, ranges: VectorWritten
) -> bool:
    """Return whether all beams have a range."""
    all_fit: bool = ranges.shape[0] >= beams.shape[0]
    return all_fit


@entry_if(_cast_rays_fits)
@compiled_once
def cast_rays(
    beams: Points, seen: Arrays, point_radius: float, ranges: VectorWritten
) -> None:
    """Shorten ``ranges`` to the nearest obstacle along each beam; 0 within one.

    Args:
        beams: (n, 2) unit directions, sensor frame.
        seen: Obstacles in the sensor frame, m.
        point_radius: Radius of points, m.
        ranges: (n,) m, changed in place.
    """
    points, capsules = seen
    for i in range(points.shape[0]):
        _meet_disc(beams, points[i, 0], points[i, 1], point_radius, ranges)
    for i in range(capsules.shape[0]):
        if has_length(capsules, i):
            _meet_wall(beams, capsules[i], ranges)
        else:
            x, y = capsules[i, X1], capsules[i, Y1]
            _meet_disc(beams, x, y, capsules[i, RADIUS], ranges)
    end = 0
    while end < capsules.shape[0]:
        begin, end = end, chain_end(capsules, end)
        if end > begin + 1 and holds_point(capsules[begin:end], 0.0, 0.0):
            _see_nothing(ranges)


@compiled
def _see_nothing(ranges: Array) -> None:
    for k in range(ranges.shape[0]):
        ranges[k] = 0.0


@compiled
def _meet_disc(beams: Array, x: float, y: float, radius: float, ranges: Array) -> None:
    if math.hypot(x, y) <= radius:
        _see_nothing(ranges)
        return
    square = radius * radius
    for k in range(beams.shape[0]):
        cos, sin = beams[k, 0], beams[k, 1]
        aside = x * sin - y * cos
        half_chord = square - aside * aside
        along = x * cos + y * sin
        if half_chord >= 0.0 and along > 0.0:
            ranges[k] = min(ranges[k], along - math.sqrt(half_chord))


@compiled
def _meet_wall(beams: Array, wall: Array, ranges: Array) -> None:
    x_1, y_1, x_2, y_2 = wall[0], wall[1], wall[2], wall[3]
    for k in range(beams.shape[0]):
        cos, sin = beams[k, 0], beams[k, 1]
        left_1, left_2 = y_1 * cos - x_1 * sin, y_2 * cos - x_2 * sin
        # Both ends on one side of the beam.
        if left_1 * left_2 > 0.0:
            continue
        along_1, along_2 = x_1 * cos + y_1 * sin, x_2 * cos + y_2 * sin
        if left_1 != left_2:
            along = along_1 + (along_2 - along_1) * (left_1 / (left_1 - left_2))
        elif along_1 * along_2 <= 0.0:
            along = 0.0  # the beam lies in the wall and starts in it
        else:
            along = min(along_1, along_2)
        if along >= 0.0:
            ranges[k] = min(ranges[k], along)
