"""Where a robot has been of late, and where it is seen from there."""

import math
from bisect import bisect_right
from typing import NamedTuple

from qpavoid.model.kinematics import integrate, wrap_angle
from qpavoid.types import Pose, Twist

KEPT = 512
"""Poses that are remembered."""


class Leg(NamedTuple):
    """Of a trail: s, m and rad (not negative) from one pose to the next."""

    time: float
    length: float
    turn: float


class Trail:
    """The robot's poses of late, by time, in a frame fixed to the ground.

    Attributes:
        twist: (v, ω) that it drives, by the last that was recorded.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._poses: list[Pose] = []
        self.twist: Twist = (0.0, 0.0)

    def record(self, time: float, pose: Pose, twist: Twist) -> None:
        """Remember where the robot is, and what it drives from then on.

        A time before the last one begins a new trail.
        """
        if self._times and time <= self._times[-1]:
            self._times, self._poses = [], []
        self._times = [*self._times[-KEPT:], time]
        self._poses = [*self._poses[-KEPT:], pose]
        self.twist = twist

    def leg(self, time: float, pose: Pose) -> Leg:
        """Return how far a pose at a time is from the last; from none it is 0."""
        if not self._times:
            return Leg(math.inf, 0.0, 0.0)
        x, y, turn = relative(self._poses[-1], pose)
        return Leg(time - self._times[-1], math.hypot(x, y), abs(turn))

    def at(self, time: float) -> Pose:
        """Return the pose at a time: between two by share, after the last driven on.

        Before the first it is that.
        """
        i = bisect_right(self._times, time)
        if not self._times:
            return 0.0, 0.0, 0.0
        if i == len(self._times):
            return integrate(self._poses[-1], self.twist, 0.0, time - self._times[-1])
        if i == 0:
            return self._poses[0]
        before, after = self._poses[i - 1], self._poses[i]
        share = (time - self._times[i - 1]) / (self._times[i] - self._times[i - 1])
        x, y, turn = relative(before, after)
        return compose(before, (share * x, share * y, share * turn))


def relative(then: Pose, now: Pose) -> Pose:
    """Return where a robot is now in the frame that it had then."""
    x, y = now[0] - then[0], now[1] - then[1]
    cos, sin = math.cos(then[2]), math.sin(then[2])
    return cos * x + sin * y, cos * y - sin * x, wrap_angle(now[2] - then[2])


def compose(frame: Pose, pose: Pose) -> Pose:
    """Return a pose in a frame as seen from where that frame is."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    x, y = cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1]
    return frame[0] + x, frame[1] + y, frame[2] + pose[2]
