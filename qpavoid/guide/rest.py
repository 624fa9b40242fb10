"""Smoothed pose of a parking robot.

Near its goal the pose is the prediction with the driven twist, corrected towards the
localisation: the mean over :data:`MEAN` s. At rest the robot is driven again only if
that mean is off by more than the measured noise of the localisation, and than the least
motion of the motors.
"""

import math

from qpavoid.guide.steering import AT
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Limits
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.types import Pose, Twist

REST_RADIUS = 0.3
"""m from the goal within which poses are smoothed."""

MEAN, FIRST = 3.0, 0.5
"""s; averaging time; time that a robot at rest near its goal waits for a first mean."""

JUMP = 0.1
"""m or rad; error of the prediction from which on a pose is no noise: the robot was
moved."""

SLOW = 0.01, 0.03
"""m/s and rad/s; measured twist below which the robot is at rest."""

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


class Rest:
    """Smoothed pose of a robot that parks.

    Args:
        limits: Of the robot, for the dead band.
        dt: Control step, s.
    """

    def __init__(self, limits: Limits, dt: float) -> None:
        v_dead, omega_dead = limits.dead
        self._dt, self._level = dt, (AT + dt * v_dead, AT + dt * omega_dead)
        self.forget()

    def forget(self) -> None:
        """Reset all poses."""
        self._pose, self._count = (0.0, 0.0, 0.0), 0
        self._squares: tuple[float, ...] = 0.0, 0.0

    def see(self, pose: Pose, driven: Twist, place: Pose) -> Pose:
        """Return the pose for control; ``place`` itself if the robot is to rest.

        Args:
            pose: Localised, world frame.
            driven: Twist driven since the last call, m/s and rad/s.
            place: Goal, world frame.
        """
        if math.dist(pose[:2], place[:2]) > REST_RADIUS:
            self.forget()
            return pose
        self._smooth(pose, driven)
        e_x, e_y, turn = tracking_error(self._pose, place)
        far, (level, turn_level) = math.hypot(e_x, e_y), self._level
        if abs(driven[0]) < SLOW[0] and abs(driven[1]) < SLOW[1]:
            noise, turn_noise = map(math.sqrt, self._squares)
            level, turn_level = level + noise, turn_level + 2.0 * turn_noise
            if self._count * self._dt < FIRST:
                level = turn_level = JUMP
        return place if far < level and abs(turn) < turn_level else self._pose

    def _smooth(self, pose: Pose, driven: Twist) -> None:
        """Update the mean with a pose, and the noise with its error."""
        told = arc(*self._pose, *driven, self._dt)
        e_x, e_y, turn = tracking_error(told, pose)
        off = math.hypot(e_x, e_y)
        if max(off, abs(turn)) > JUMP:
            self.forget()
        self._count += 1
        if self._count == 1 or max(off, abs(turn)) < EXACT:
            self._pose = pose
            return
        share = 1.0 / min(self._count, MEAN / self._dt)
        x, y = (a + share * (b - a) for a, b in zip(told[:2], pose[:2], strict=True))
        self._pose, squares = (x, y, told[2] + share * turn), (0.5 * off * off, turn**2)
        self._squares = tuple(
            old + share * (new - old)
            for old, new in zip(self._squares, squares, strict=True)
        )
