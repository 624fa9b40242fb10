"""Common part of predictive methods: obstacles as discs, start from the last plan."""

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, TypeVar

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import (
    FAILED,
    RELAXED_FROM,
    Command,
    line_points,
    stepping,
    wide_discs,
)
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import Array, Twist

PERIOD = 0.1
"""s; period of planning."""


class Situation(NamedTuple):
    """Input of a planning step, robot frame.

    Attributes:
        desired: Twist of the tracking law.
        context: Reference and goal, and the twist driven last.
        discs: (m, 5) of :func:`everything_wide`.
    """

    desired: Twist
    context: StepContext
    discs: Array


class Plan(Protocol):
    """Solution of a planning step."""

    @property
    def twists(self) -> Array:
        """(N, 2) v, ω; the first is driven."""

    @property
    def depth(self) -> float:
        """Greatest depth within r_min, m."""

    @property
    def cost(self) -> float:
        """Cost of the plan."""


P = TypeVar("P", bound=Plan)


def everything_wide(obstacles: Obstacles, settings: AvoidanceSettings) -> Array:
    """Return all obstacles as :func:`qpavoid.lab.baselines.drive.wide_discs` (m, 5).

    Walls and polygons are points 0.2 m apart, each with its own velocity.
    """
    return wide_discs(obstacles, settings, line_points(obstacles))


def command_of(twist: Twist, depth: float) -> Command:
    """Return a planned twist, ``relaxed`` if its plan comes within r_min (m)."""
    if depth > RELAXED_FROM:
        return Command(twist, Status.RELAXED, shortfall=depth)
    return Command(twist)


def replanning(
    robot: Robot,
    settings: AvoidanceSettings,
    last: Twist,
    is_free: Callable[[Situation], bool],
    search: Callable[[P | None, Situation], Iterable[P | None]],
) -> Step:
    """Return the step of a method that plans every :data:`PERIOD` from its last plan.

    The cheapest plan counts; without one the robot brakes (``stopped``).

    Args:
        robot: Footprint and limits.
        settings: Radii and control step.
        last: Twist driven last.
        is_free: Whether no plan is needed: the desired twist is then driven, and the
            last plan dropped.
        search: Function from the last plan, or None, to the solver's plans; None for a
            failure.
    """
    kept: P | None = None

    def plan(
        desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        nonlocal kept
        discs = everything_wide(obstacles, settings)
        situation = Situation(desired, context, discs)
        if is_free(situation):
            kept = None
            return None
        found = [answer for answer in search(kept, situation) if answer is not None]
        kept = min(found, key=lambda answer: answer.cost, default=None)
        if kept is None:
            return FAILED
        v, omega = kept.twists[0].tolist()
        return command_of((v, omega), kept.depth)

    return stepping(robot, settings.dt, last, plan, PERIOD)
