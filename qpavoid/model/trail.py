"""Where a robot has been of late, and where it is seen from there."""

import math
from bisect import bisect_left, bisect_right
from operator import add, sub
from typing import NamedTuple

import numpy as np

from qpavoid.model.kinematics import integrate, wrap_angle
from qpavoid.types import Array, Pose, Twist

KEPT = 512
"""Poses that are remembered."""

APART, WINDOW, GAP = 0.04, 1.0, 0.25
"""s: least time between two poses that give a twist; time over which twists and poses
are compared; most between two records that are compared."""


class Leg(NamedTuple):
    """Of a trail: s, m and rad (not negative) from one pose to the next."""

    time: float
    length: float
    turn: float


class Drift(NamedTuple):
    """Sums over time, m and rad: twists less poses, and the path of the poses."""

    ahead: float = 0.0
    turn: float = 0.0
    length: float = 0.0
    turned: float = 0.0


class Trail:
    """The robot's poses of late, by time, in a frame fixed to the ground.

    Attributes:
        twist: (v, ω) that it drives, by the last that was recorded.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._poses: list[Pose] = []
        self._drifts: list[Drift] = []
        self.twist: Twist = (0.0, 0.0)

    def record(self, time: float, pose: Pose, twist: Twist) -> None:
        """Remember where the robot is, and what it drives from then on.

        A time before the last one begins a new trail.
        """
        if self._times and time <= self._times[-1]:
            self._times, self._poses, self._drifts = [], [], []
        drift = self._drifted(time, pose, twist)
        self._drifts = [*self._drifts[-KEPT:], drift]
        self._times = [*self._times[-KEPT:], time]
        self._poses = [*self._poses[-KEPT:], pose]
        self.twist = twist

    def leg(self, time: float, pose: Pose) -> Leg:
        """Return how far a pose at a time is from the last; from none it is 0."""
        if not self._times:
            return Leg(math.inf, 0.0, 0.0)
        x, y, turn = relative(self._poses[-1], pose)
        return Leg(time - self._times[-1], math.hypot(x, y), abs(turn))

    def _drifted(self, time: float, pose: Pose, twist: Twist) -> Drift:
        """Return the sums with one more record; a gap adds no difference."""
        if not self._times:
            return Drift()
        lasted = time - self._times[-1]
        ahead, turn = _moved(self._poses[-1], pose)
        mean = [0.5 * lasted * (a + b) for a, b in zip(self.twist, twist, strict=True)]
        off = (mean[0] - ahead, mean[1] - turn) if lasted <= GAP else (0.0, 0.0)
        return Drift(*map(add, self._drifts[-1], (*off, abs(ahead), abs(turn))))

    def drift(self) -> Drift:
        """Return the sums of the last :data:`WINDOW` s."""
        if not self._times:
            return Drift()
        i = bisect_left(self._times, self._times[-1] - WINDOW)
        return Drift(*map(sub, self._drifts[-1], self._drifts[i]))

    def twist_to(self, time: float, pose: Pose) -> Twist:
        """Return the mean (v, ω) to a pose, from one :data:`APART` before or the first.

        Without a pose before it is 0.
        """
        i = max(bisect_right(self._times, time - APART) - 1, 0)
        if not self._times or self._times[i] >= time:
            return 0.0, 0.0
        ahead, turn = _moved(self._poses[i], pose)
        lasted = time - self._times[i]
        return ahead / lasted, turn / lasted

    def along(self, times: Array) -> Array:
        """Return the poses (n, 3) at some times (n,), as :meth:`at` does."""
        if not self._times or not len(times):
            return np.zeros((len(times), 3))
        i = max(bisect_right(self._times, float(times.min())) - 1, 0)
        known, poses = np.array(self._times[i:]), np.array(self._poses[i:])
        poses[:, 2] = np.unwrap(poses[:, 2])
        made = np.column_stack([np.interp(times, known, column) for column in poses.T])
        after = np.maximum(times - known[-1], 0.0)
        half = 0.5 * self.twist[1] * after
        chord = self.twist[0] * after * np.sinc(half / np.pi)
        made[:, 0] += chord * np.cos(made[:, 2] + half)
        made[:, 1] += chord * np.sin(made[:, 2] + half)
        made[:, 2] += 2.0 * half
        return made

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


def _moved(then: Pose, now: Pose) -> tuple[float, float]:
    """Return the chord ahead (m) and the turn (rad) from one pose to another."""
    x, y, turn = relative(then, now)
    return x * math.cos(0.5 * turn) + y * math.sin(0.5 * turn), turn


def placed(points: Array, poses: Array) -> Array:
    """Return points (n, 2), each seen from its own pose (n, 3), in the poses' frame."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + cos * points[:, 0] - sin * points[:, 1]
    return np.column_stack([x, poses[:, 1] + sin * points[:, 0] + cos * points[:, 1]])


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
