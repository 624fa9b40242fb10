"""Stop and wait: slow zone and stop zone of a collision monitor [Macenski2023]."""

from dataclasses import dataclass

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import Command, stepping
from qpavoid.lab.baselines.stopping import brake, free_time, setup_of
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, limit_twist, stopping_time
from qpavoid.types import Twist


@dataclass(frozen=True)
class StopController:
    """Drive, drive slowly, or stop, with the curvature of the desired twist.

    The zones are swept by the footprint, inflated by ``margin``: within ``slow_time``
    on the desired twist (slow zone), and until rest on the slowed one (stop zone). A
    zone bends with the path, and obstacles beside it have no effect. Obstacles are
    taken as static. Static obstacles are never touched: the robot drives only twists
    that keep the margin until rest, and else brakes along its arc (the proof is that of
    :mod:`qpavoid.avoidance.judge`).

    Attributes:
        robot: Footprint and limits.
        settings: Control step.
        margin: Required distance, in r_min of static obstacles.
        slow_time: s.
        slow_share: Share of the desired twist that is driven in the slow zone.
    """

    robot: Robot
    settings: AvoidanceSettings
    margin: float = 1.0
    slow_time: float = 1.0
    slow_share: float = 0.3

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        return stepping(self.robot, self.settings.dt, (v, omega), self._plan)

    def _plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        dt, numbers = self.settings.dt, self.robot.limit_vector
        wanted = limit_twist(numbers, desired, context.driven, dt)
        if self._is_free(wanted, obstacles, self.slow_time):
            return None
        slow = (self.slow_share * desired[0], self.slow_share * desired[1])
        slow = limit_twist(numbers, slow, context.driven, dt)
        if self._is_free(slow, obstacles, 0.0):
            return Command(slow)
        return brake(self.robot, context.driven, dt)

    def _is_free(self, twist: Twist, obstacles: Obstacles, least: float) -> bool:
        """Return whether a twist keeps the margin until rest, and for ``least`` s."""
        setup = setup_of(self.robot, self.settings)
        time = max(least, stopping_time(setup.robot, *twist, self.settings.dt))
        margin = self.margin * self.settings.radius.r_min_slow
        return free_time(setup, obstacles.arrays, margin, twist, time) >= time
