"""Pose history of the robot by odometry, with checks of its poses and twists."""

import numpy as np

from qpavoid.model.robot import Limits
from qpavoid.ros.trail import Trail
from qpavoid.types import Pose, Twist

FASTER, SPARE = 1.5, np.array([0.1, 0.2])
"""Tolerances of odometry: factor of the robot's limits, and m and rad (m/s and rad/s of
its twist), for overshoot, slip and jitter."""

SLIP = 0.25
"""Tolerated difference of twists and poses relative to the path of the poses, in
addition to :data:`SPARE`."""


class Odometry:
    """Pose history of the robot, in the odometry frame.

    Attributes:
        trail: Poses and twists.
        pose: The last one measured; None: none yet.
    """

    def __init__(self, limits: Limits) -> None:
        self.trail, self._filled = Trail(), np.zeros(2, dtype=np.bool_)
        self.pose: Pose | None = None
        self.fit(limits)

    def fit(self, limits: Limits) -> None:
        """Set other limits of the robot."""
        most = np.abs(np.reshape(limits.numbers[:4], (2, 2))).max(axis=1)
        self._fastest = np.array([-most, most])

    def jump(self, stamp: float, pose: Pose) -> str:
        """Return the description of a jump to a pose; empty if there is none."""
        leg = self.trail.leg(stamp, pose)
        most = FASTER * self._fastest[1] * leg.time + SPARE
        if leg.time <= 0.0 or (leg.length <= most[0] and leg.turn <= most[1]):
            return ""
        return f"{leg.length:.3g} m, {leg.turn:.3g} rad in {leg.time:.3g} s"

    def record(self, stamp: float, pose: Pose, twist: Twist) -> str:
        """Store a pose; return what is wrong with its twist, or an empty string.

        A twist is wrong beyond the limits, or unlike the poses. Components that were
        always exactly 0 count as not filled in: the poses' replace them, and all of
        them after a wrong twist.
        """
        by_poses = np.clip(self.trail.twist_to(stamp, pose), *self._fastest)
        self._filled |= np.array(twist) != 0.0
        measured, self.pose = np.where(self._filled, twist, by_poses), pose
        near = np.clip(measured, *(FASTER * self._fastest + (-SPARE, SPARE)))
        self.trail.record(stamp, pose, (float(near[0]), float(near[1])))
        off, path = self.trail.drift()
        if (near == measured).all() and (np.abs(off) <= SLIP * path + SPARE).all():
            return ""
        self.trail.twist = float(by_poses[0]), float(by_poses[1])
        return f"its twist is {measured} (m/s, rad/s), that of its poses {by_poses}"
