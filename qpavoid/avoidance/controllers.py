"""Controllers: all methods behind one call, with a new state for every run."""

from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.decision import INVALID, STATUSES, Decision
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.laws import repulsion_step
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.contacts import empty_contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot


class StepContext(NamedTuple):
    """State of robot and reference, for methods that plan themselves.

    Attributes:
        pose: Of the robot, world frame: x, y (m), γ (rad).
        target: Pose of the reference, robot frame.
        reference: Twist of the reference: v (m/s), ω (rad/s).
        goal: Last pose of the reference, robot frame.
        driven: Twist driven last: v (m/s), ω (rad/s).
    """

    pose: tuple[float, float, float]
    target: tuple[float, float, float]
    reference: tuple[float, float]
    goal: tuple[float, float, float]
    driven: tuple[float, float]


class Step(Protocol):
    """Step function of a method."""

    def __call__(
        self,
        v: float,
        omega: float,
        obstacles: Obstacles,
        context: StepContext | None = None,
    ) -> Decision:
        """Return the decision for a desired twist among obstacles, robot frame."""
        ...


class Controller(Protocol):
    """A method with its settings, without the state of a run."""

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        ...


@dataclass(frozen=True)
class RepulsionController:
    """Eq. 5 or Eq. 7 added to the desired twist, cut to the robot's limits.

    Attributes:
        law: 5 or 7.
        robot: Footprint and limits.
        settings: Radii and repulsion; the rest is unused.
    """

    law: int
    robot: Robot
    settings: AvoidanceSettings

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        setup, state = Setup.of(self.robot, self.settings), np.array([v, omega])

        def step(
            v: float,
            omega: float,
            obstacles: Obstacles,
            context: StepContext | None = None,
        ) -> Decision:
            started = perf_counter()
            arrays, wanted = obstacles.arrays, (float(v), float(omega))
            contacts = empty_contacts(setup.edges, arrays)
            request = Request(arrays, 0.0, False, wanted)
            o = repulsion_step(self.law, setup, request, state, contacts)
            if o.code == INVALID:
                raise InvalidInputError("the desired twist (v, omega) must be finite")
            active = (o.first,) if o.first >= 0 else ()
            elapsed = perf_counter() - started
            status = STATUSES[o.code]
            return Decision(
                o.v, o.omega, status, o.clearance, 0.0, 0.0, active, elapsed
            )

        return step


@dataclass(frozen=True)
class FilterController:
    """The QP filter as a controller.

    Attributes:
        robot: Footprint and limits.
        settings: All settings of the filter.
        solver: Name of the back end.
        ahead: Whether it looks ahead.
    """

    robot: Robot
    settings: AvoidanceSettings
    solver: str = "exact"
    ahead: bool = True

    def fresh(self) -> SafetyFilter:
        """Return a filter of a robot at rest."""
        return SafetyFilter(self.robot, self.settings, self.solver, self.ahead)

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        safety = self.fresh()
        safety.reset(v, omega)

        def step(
            v: float,
            omega: float,
            obstacles: Obstacles,
            context: StepContext | None = None,
        ) -> Decision:
            return safety.filter(v, omega, obstacles)

        return step
