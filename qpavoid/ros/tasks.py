"""Tasks of the guide role: goal, path, or stay."""

import math
from typing import Any

import numpy as np

from qpavoid.guide.guide import Guide
from qpavoid.ros.frames import Frames
from qpavoid.ros.messages import Poses, read_poses
from qpavoid.ros.odometry import Odometry
from qpavoid.settings import want
from qpavoid.types import Array, Pose

LATEST = math.inf
"""s; time of the newest transform."""

PARKS_WITHIN, GOAL_MOVED = 0.1, 0.02
"""m: distance of a path's end from which on the robot parks there; motion on the ground
(m or rad) with which a task is given again."""


class Tasks:
    """The task of a guide, which is given again after it has moved on the ground.

    Without a task the robot stays where it is.

    Args:
        frames: Frames by tf.
        odometry: Pose history of the robot.
        frame: Of odometry.
    """

    def __init__(self, frames: Frames, odometry: Odometry, frame: str) -> None:
        self._frames, self._odometry, self._frame = frames, odometry, frame
        self._task: tuple[str, Poses] | None = None
        self._sent: Array | None = None

    def take(self, guide: Guide, kind: str, message: Any, speed: float) -> None:
        """Give another task to the guide; on any exception the last one is kept.

        Args:
            guide: Of the robot.
            kind: ``goal_pose``, ``path`` or ``stay``.
            message: PoseStamped or Path.
            speed: Greatest, m/s.
        """
        before, self._sent = self._task, None
        try:
            self._task = kind, read_poses(message)
            self.send(guide, speed)
        except BaseException:
            self._task = before
            raise

    def rest(self) -> None:
        """Replace the task by a stay at the present pose."""
        self._task = self._sent = None

    def renew(self) -> None:
        """Give the task again in the next step: to another guide."""
        self._sent = None

    def send(self, guide: Guide, speed: float) -> None:
        """Give the task to a guide, again after it has moved on the ground."""
        pose = self._here
        here = Poses(0.0, self._frame, np.array([pose]))
        self._task = kind, known = self._task or ("stay", here)
        rows = self._frames.poses_in(self._frame, known._replace(stamp=LATEST))
        x, y, heading = rows[-1].tolist()
        near = math.dist(pose[:2], (x, y)) < PARKS_WITHIN
        rows = rows if kind == "path" and not near else rows[-1:]
        old = self._sent
        if old is not None and old.shape == rows.shape:
            if np.abs(rows - old).max() < GOAL_MOVED:
                return
        if len(rows) > 1:
            guide.follow(rows[:, :2], speed)
        elif kind == "goal_pose":
            guide.go_to(pose, (x, y, heading), speed)
        else:
            guide.stay((x, y, heading))
        self._sent = rows

    def left(self, guide: Guide) -> tuple[float, float]:
        """Return the distance to the end of the task, m and rad; NaN without one."""
        return (math.nan, math.nan) if self._sent is None else guide.left(self._here)

    @property
    def _here(self) -> Pose:
        pose = self._odometry.pose
        want(pose is not None, "there is no odometry yet")
        assert pose is not None
        return pose
