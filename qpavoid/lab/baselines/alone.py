"""Tracking alone, the reference of all comparisons."""

from dataclasses import dataclass

from qpavoid.avoidance.controllers import Step
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import stepping
from qpavoid.model.robot import Robot


@dataclass(frozen=True)
class AloneController:
    """The desired twist, cut to the limits, regardless of obstacles.

    Attributes:
        robot: Footprint and limits.
        settings: Control step.
    """

    robot: Robot
    settings: AvoidanceSettings

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        return stepping(
            self.robot, self.settings.dt, (v, omega), lambda twist, seen, context: None
        )
