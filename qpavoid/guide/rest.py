"""Smoothed pose of a parking robot.

Near its goal the pose is the prediction with the driven twist, corrected towards the
localisation: the mean over a time T. At rest the robot is driven again only if that
mean is off by more than its own error, which falls with √T, and than the least motion
of the motors.
"""

import math
from typing import NamedTuple

from qpavoid.guide.rollout import AT
from qpavoid.model.contact import point_contact
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Limits, limit_twist
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.types import Array, Pose, Twist

REST_RADIUS = 0.3
"""m from the goal within which poses are smoothed."""

MEAN, MEAN_AT_REST, FIRST = 3.0, 20.0, 0.5
"""s; greatest T while driving, and at rest; time that a robot at rest near its goal
waits for a first mean."""

NOISE, NOISE_FIRST, NOISE_TIME = (0.02, 0.01), 0.5, 10.0
"""m and rad; assumed noise of the localisation of a robot that is at rest from the
beginning, the time for which that counts, and the averaging time, s."""

UNSURE, DRIVEN_UNSURE = 5.0, 0.5
"""√s; error of the mean at rest, times √T and relative to the noise of the
localisation, which may be correlated over a second; and the share of the noise within
which a driven robot has arrived."""

STAYS = 1.25
"""Hysteresis of arriving and leaving, relative."""

OUTLIER = 6.0
"""Error of the prediction relative to the noise from which on the robot was moved."""

JUMP = 0.1
"""m; the same anywhere on its path."""

EXACT = 1e-6
"""m or rad; tolerance for rounding."""


def beyond_band(v: float, omega: float, limits: Limits) -> Twist:
    """Return a twist scaled up along its arc to the edge of the dead band.

    If only one component has a dead band, it is rounded to zero or the edge.
    """
    v_dead, omega_dead = limits.dead
    if v_dead > 0.0 and omega_dead > 0.0:
        share = max(abs(v) / v_dead, abs(omega) / omega_dead)
        return (v / share, omega / share) if 0.0 < share < 1.0 else (v, omega)
    parts = ((v, v_dead), (omega, omega_dead))
    v, omega = (
        x if abs(x) >= d else math.copysign(d, x) * round(abs(x) / d) for x, d in parts
    )
    return v, omega


CHECKED_WAY = 0.01
"""m; greatest way between two checks of an area within a control step."""


class Bounds(NamedTuple):
    """Area that the origin of a robot must not leave while it gives way.

    Attributes:
        place: Its station, world frame.
        max_away: Greatest distance from that, m.
        edges: (n, 6) of the convex parts of a polygon, world frame, as of
            :attr:`qpavoid.model.footprint.Footprint.edges`; n = 0: none.
    """

    place: Pose
    max_away: float
    edges: Array

    def beyond(self, x: float, y: float) -> float:
        """Return the distance of a point from the area, m; 0 inside."""
        away = max(math.dist((x, y), self.place[:2]) - self.max_away, 0.0)
        if len(self.edges):
            away = max(away, float(point_contact(self.edges, x, y).distance))
        return away

    def is_left(self, robot: Array, pose: Pose, twist: Twist, dt: float) -> bool:
        """Return whether a robot that drives a twist, then stops, gets farther out.

        Args:
            robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
            pose: World frame.
            twist: m/s and rad/s, driven for dt.
            dt: Control step, s.
        """
        most = self.beyond(*pose[:2]) + EXACT
        while twist != (0.0, 0.0):
            many = max(1, math.ceil(abs(twist[0]) * dt / CHECKED_WAY))
            for k in range(1, many + 1):
                if self.beyond(*arc(*pose, *twist, dt * k / many)[:2]) > most:
                    return True
            pose = arc(*pose, *twist, dt)
            twist = limit_twist(robot, (0.0, 0.0), twist, dt)
        return False


class Rest:
    """Smoothed pose of a robot that parks.

    Args:
        limits: Of the robot, for the dead band.
        dt: Control step, s.
    """

    def __init__(self, limits: Limits, dt: float) -> None:
        v_dead, omega_dead = limits.dead
        self._dt, self._least = dt, (AT + dt * v_dead, AT + dt * omega_dead)
        self.begin(True)

    def begin(self, rests: bool) -> None:
        """Begin with a robot that rests at its goal, or drives to it."""
        self._squares: tuple[float, ...] = 0.0, 0.0
        self._steps, self._there, self._rests = 0, rests, rests
        if rests:
            self._squares = NOISE[0] ** 2, NOISE[1] ** 2
            self._steps = math.ceil(NOISE_FIRST / self._dt)
        self.forget()

    def forget(self) -> None:
        """Forget all poses, but not their noise."""
        self._pose, self._count = (0.0, 0.0, 0.0), 0

    def see(self, pose: Pose, driven: Twist, place: Pose) -> Pose:
        """Return the pose for control.

        ``place`` if the robot is to rest, its position if the robot is only to turn.

        Args:
            pose: Localised, world frame.
            driven: Twist driven since the last call, m/s and rad/s.
            place: Goal, world frame.
        """
        if math.dist(pose[:2], place[:2]) > REST_RADIUS:
            self.begin(False)
            return pose
        self._smooth(pose, driven)
        e_x, e_y, turn = tracking_error(self._pose, place)
        time = self._count * self._dt
        wide = (1.0, DRIVEN_UNSURE), (STAYS, UNSURE / math.sqrt(time))
        level, turn_level = (
            wide[is_at][0] * least + wide[is_at][1] * math.sqrt(square)
            for is_at, least, square in zip(
                (self._there, self._rests), self._least, self._squares, strict=True
            )
        )
        waits = self._rests and time < FIRST
        self._there = waits or math.hypot(e_x, e_y) < level
        is_turned = waits or abs(turn) < turn_level
        self._rests = self._there and is_turned
        if self._rests:
            return place
        return (*place[:2], self._pose[2]) if self._there else self._pose

    def _smooth(self, pose: Pose, driven: Twist) -> None:
        """Update the mean with a pose, and the noise with its error."""
        told = arc(*self._pose, *driven, self._dt)
        e_x, e_y, turn = tracking_error(told, pose)
        squares = 0.5 * (e_x * e_x + e_y * e_y), turn * turn
        bounds = (OUTLIER**2 * x + EXACT**2 for x in self._squares)
        moved = any(x > y for x, y in zip(squares, bounds, strict=True))
        if moved and min(self._count, self._steps) * self._dt > FIRST:
            self.forget()
        most = (MEAN_AT_REST if self._rests else MEAN) / self._dt
        self._count = min(self._count + 1, math.ceil(most))
        share = 1.0 / self._count
        x, y = (a + share * (b - a) for a, b in zip(told[:2], pose[:2], strict=True))
        self._pose = (x, y, told[2] + share * turn) if share < 1.0 else pose
        if share == 1.0:
            return
        self._steps = min(self._steps + 1, math.ceil(NOISE_TIME / self._dt))
        self._squares = tuple(
            old + (new - old) / self._steps
            for old, new in zip(self._squares, squares, strict=True)
        )
