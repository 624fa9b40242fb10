"""Pose history of a robot, by odometry with checks of its poses and twists."""

import math
from bisect import bisect_left, bisect_right

import numpy as np

from qpavoid.model.kinematics import arc, relative, wrap_angle
from qpavoid.model.robot import Limits
from qpavoid.types import Array, Pair, Pose, Twist

MOST_POSES = 512
"""Number of poses stored."""

BASELINE, DRIFT_TIME, GAP = 0.04, 1.0, 0.25
"""s: least time between two poses for a twist; period over which twists and poses are
compared; greatest gap between two records compared."""

FASTER, SPARE = 1.5, np.array([0.1, 0.2])
"""Tolerances of odometry: factor of the robot's limits, and m and rad (m/s and rad/s of
its twist), for overshoot, slip and jitter."""

SLIP = 0.25
"""Tolerated difference of twists and poses relative to the path of the poses, in
addition to :data:`SPARE`."""


class Trail:
    """Poses of a robot over time, in a frame fixed to the ground.

    Attributes:
        twist: (v, ω) last recorded.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew, at rest."""
        self._times, self._poses = list[float](), list[Pose]()
        self._drifts: list[tuple[Pair, Pair]] = []
        self.twist = self._recorded = (0.0, 0.0)

    def record(self, time: float, pose: Pose, twist: Twist) -> None:
        """Store a pose and the twist driven from then on.

        A time before the last one starts a new history.
        """
        if self._times and time <= self._times[-1]:
            self.forget()
        moved, off = (0.0, 0.0), (0.0, 0.0)
        if self._times:
            half, moved = 0.5 * (time - self._times[-1]), leg(self._poses[-1], pose)
            if 2.0 * half <= GAP:
                (v, omega), (w, turn) = self._recorded, twist
                off = half * (v + w) - moved[0], half * (omega + turn) - moved[1]
        self._drifts.append((off, (abs(moved[0]), abs(moved[1]))))
        self._times.append(time)
        self._poses.append(pose)
        for one in (self._drifts, self._times, self._poses):
            del one[: -MOST_POSES - 1]
        self.twist = self._recorded = twist

    def drift(self) -> Array:
        """Return (2, 2) distances (m) and turns (rad) in :data:`DRIFT_TIME` s.

        First row: integrated twists minus motion of the poses; second row: path length
        and total turn of the poses.
        """
        i = bisect_left(self._times, self._times[-1] - DRIFT_TIME) + 1
        return np.asarray(np.array(self._drifts[i:]).reshape(-1, 2, 2).sum(axis=0))

    def twist_to(self, time: float, pose: Pose) -> Array:
        """Return the mean (v, ω) to a pose, from :data:`BASELINE` s before it.

        From the first pose if that is later; 0 without an earlier pose.
        """
        i = max(bisect_right(self._times, time - BASELINE) - 1, 0)
        if not self._times or self._times[i] >= time:
            return np.zeros(2)
        return np.array(leg(self._poses[i], pose)) / (time - self._times[i])

    def at(self, time: float) -> Pose:
        """Return the pose at a time; see :meth:`along`."""
        times, poses = self._times, self._poses
        i = bisect_right(times, time)
        if i == 0:
            return poses[0] if times else (0.0, 0.0, 0.0)
        then, (x, y, heading) = times[i - 1], poses[i - 1]
        if i == len(times):
            return arc(x, y, heading, *self.twist, time - then)
        share, (to_x, to_y, to_heading) = (time - then) / (times[i] - then), poses[i]
        turn = wrap_angle(to_heading - heading)
        return x + share * (to_x - x), y + share * (to_y - y), heading + share * turn

    def along(self, times: Array) -> Array:
        """Return the poses (n, 3) at times (n,), s.

        Interpolated between records, extrapolated by the last twist; before the first
        record it is the first pose.
        """
        if not self._times or not len(times):
            return np.zeros((len(times), 3))
        i = max(bisect_right(self._times, float(times.min())) - 1, 0)
        j = bisect_left(self._times, float(times.max())) + 1
        known, poses = np.array(self._times[i:j]), np.array(self._poses[i:j])
        poses[:, 2] = np.unwrap(poses[:, 2])
        made = np.column_stack([np.interp(times, known, column) for column in poses.T])
        after = np.maximum(times - known[-1], 0.0)
        half = 0.5 * self.twist[1] * after
        chord = self.twist[0] * after * np.sinc(half / np.pi)
        made[:, 0] += chord * np.cos(made[:, 2] + half)
        made[:, 1] += chord * np.sin(made[:, 2] + half)
        made[:, 2] += 2.0 * half
        return made


class Odometry(Trail):
    """Pose history by odometry, in its frame.

    Attributes:
        pose: The last one measured; None: none yet.
    """

    def __init__(self, limits: Limits) -> None:
        super().__init__()
        self._filled = np.zeros(2, dtype=np.bool_)
        self.pose: Pose | None = None
        self.fit(limits)

    def fit(self, limits: Limits) -> None:
        """Set other limits of the robot."""
        most = np.abs(np.reshape(limits.numbers[:4], (2, 2))).max(axis=1)
        self._fastest = np.array([-most, most])

    def jump(self, stamp: float, pose: Pose) -> str:
        """Return the description of a jump to a pose; empty if there is none."""
        if not self._times or stamp <= self._times[-1]:
            return ""
        x, y, turn = relative(self._poses[-1], pose)
        time, way = stamp - self._times[-1], math.hypot(x, y)
        most = FASTER * self._fastest[1] * time + SPARE
        if way <= most[0] and abs(turn) <= most[1]:
            return ""
        return f"{way:.3g} m, {abs(turn):.3g} rad in {time:.3g} s"

    def measure(self, stamp: float, pose: Pose, twist: Twist) -> str:
        """Store a pose; return what is wrong with its twist, or an empty string.

        A twist is wrong beyond the limits, or unlike the poses. Components that were
        always exactly 0 count as not filled in: the poses' replace them, and all of
        them after a wrong twist.
        """
        by_poses = np.clip(self.twist_to(stamp, pose), *self._fastest)
        self._filled |= np.array(twist) != 0.0
        measured, self.pose = np.where(self._filled, twist, by_poses), pose
        near = np.clip(measured, *(FASTER * self._fastest + (-SPARE, SPARE)))
        self.record(stamp, pose, (float(near[0]), float(near[1])))
        off, path = self.drift()
        if (near == measured).all() and (np.abs(off) <= SLIP * path + SPARE).all():
            return ""
        self.twist = float(by_poses[0]), float(by_poses[1])
        return f"its twist is {measured} (m/s, rad/s), that of its poses {by_poses}"


def leg(before: Pose, pose: Pose) -> Pair:
    """Return chord ahead (m) and turn (rad) from one pose to the next."""
    x, y, turn = relative(before, pose)
    return x * math.cos(0.5 * turn) + y * math.sin(0.5 * turn), turn


def placed(points: Array, poses: Array) -> Array:
    """Transform points (n, 2) by a pose each, (n, 3), into the poses' frame."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + cos * points[:, 0] - sin * points[:, 1]
    return np.column_stack([x, poses[:, 1] + sin * points[:, 0] + cos * points[:, 1]])
