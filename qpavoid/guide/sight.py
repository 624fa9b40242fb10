"""Obstacles of a guide's step: given, or perceived from scans, which may fail."""

import math
from typing import Any

from qpavoid.avoidance.inputs import Fault, FaultError
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.perception.perception import Perception
from qpavoid.settings import want
from qpavoid.types import Pose

LONGEST_BLIND = 0.5
"""s without a new and valid scan after which a step is a fault."""


class Sight:
    """Perception of a guide, and the time since its last valid scan.

    Args:
        robot: Its footprint.
        perception: Of scans; default one LiDAR all round, at the first scan.
        dt: Control step, s.
    """

    def __init__(self, robot: Robot, perception: Perception | None, dt: float) -> None:
        self.robot, self.perception, self._dt = robot, perception, dt
        self.forget()

    def fit(self, robot: Robot) -> None:
        """Set the robot, that of the perception too."""
        self.robot = robot
        if self.perception is not None:
            self.perception.fit(robot)

    def forget(self) -> None:
        """Expect scans only after the next one."""
        self._valid, self._blind = -math.inf, math.inf

    def see(self, pose: Pose, given: Any, scan: Any, stamp: Any) -> Obstacles:
        """Return the given obstacles, or those perceived.

        After a first scan a step without obstacles and scan has those known so far.

        Raises:
            FaultError: No scan has been new and valid for :data:`LONGEST_BLIND`.
        """
        none = isinstance(given, tuple) and not given
        expected = math.isfinite(self._valid)
        if scan is None and stamp is None and not (none and expected):
            return given if isinstance(given, Obstacles) else Obstacles(given)
        want(none, "a step has obstacles, or else a scan or its stamp, not both")
        if self.perception is None:
            self.perception = Perception(self.robot)
        time, perception = math.nan if stamp is None else stamp, self.perception
        if scan is not None:
            seen = perception.update(scan, time, pose)
        else:
            if stamp is None:
                time = self._valid + self._blind + self._dt
            seen = perception.obstacles(time, pose)
        new, self._valid = perception.last_valid > self._valid, perception.last_valid
        self._blind = 0.0 if new else self._blind + self._dt
        # Counted by steps, too: a scan may come again with its old stamp.
        blind = max(self._blind, 0.0 if stamp is None else time - self._valid)
        if blind > LONGEST_BLIND:
            never = math.isinf(self._valid)
            raise FaultError({"scan": Fault.NEVER if never else Fault.STALE})
        return seen
