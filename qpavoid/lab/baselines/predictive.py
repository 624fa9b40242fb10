"""What predictive methods share: obstacles as discs, planning from the last plan."""

import math
from collections.abc import Callable, Iterable
from typing import Annotated, NamedTuple, Protocol, TypeVar

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.compiled import compiled_once, entry, entry_if
from qpavoid.lab.baselines.drive import (
    FAILED,
    VIOLATED,
    Command,
    line_points,
    stepping,
    wide_discs,
)
from qpavoid.model.contact import point_contact
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import (
    Array,
    Discs,
    Edges,
    Matrix,
    MatrixWritten,
    Sizes,
    Twist,
    Vector,
)

PERIOD = 0.1
"""s between two plans."""


class Situation(NamedTuple):
    """What is planned for, robot frame.

    Attributes:
        desired: Twist of the tracking law.
        context: Reference and goal, and the twist driven last.
        discs: (m, 5) as :func:`everything_wide` gives them.
    """

    desired: Twist
    context: StepContext
    discs: Array


class Plan(Protocol):
    """What a solver finds."""

    @property
    def twists(self) -> Array:
        """(N, 2) v, ω; the first is driven."""

    @property
    def depth(self) -> float:
        """Greatest depth within r_min, m."""

    @property
    def cost(self) -> float:
        """What it costs."""


P = TypeVar("P", bound=Plan)


def everything_wide(obstacles: Obstacles, settings: AvoidanceSettings) -> Array:
    """Return all obstacles as :func:`qpavoid.lab.baselines.drive.wide_discs` (m, 5).

    Walls and polygons are points 0.2 m apart, each with its own velocity.
    """
    return wide_discs(obstacles, settings, line_points(obstacles))


def command_of(twist: Twist, depth: float) -> Command:
    """Return a planned twist, ``relaxed`` where its plan comes within r_min (m)."""
    if depth > VIOLATED:
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

    The cheapest plan counts; where there is none the robot brakes (``stopped``).

    Args:
        robot: Footprint and limits.
        settings: Radii and control step.
        last: Twist driven last.
        is_free: Whether nothing need be planned: the desired twist is then driven, and
            the last plan forgotten.
        search: From the last plan, if there is one, to what the solver finds; None
            where it fails.
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


FAR = (1e3, 1e3, 0.0, 0.0, 0.0)
"""An obstacle that is none: x, y, radius, m, and its velocity."""


@entry
@compiled_once
def _nearest_discs_fits(
    edges: Edges,
    discs: Discs,
    poses: Annotated[Matrix, Sizes(2, 3)],
    at: Vector,
    near: Annotated[MatrixWritten, Sizes(0, 5)],
) -> bool:
    """Return whether each stage has its time."""
    all_fit: bool = at.shape[0] >= poses.shape[0] - 1
    return all_fit


@entry_if(_nearest_discs_fits)
@compiled_once
def nearest_discs(
    edges: Edges,
    discs: Discs,
    poses: Annotated[Matrix, Sizes(2, 3)],
    at: Vector,
    near: Annotated[MatrixWritten, Sizes(0, 5)],
) -> None:
    """Fill the discs (N·n, 5) nearest to the footprint, as they will be at each stage.

    Args:
        edges: Of the footprint.
        discs: (m, 5) as :func:`qpavoid.lab.baselines.drive.wide_discs` gives them.
        poses: (N + 1, 3) where the robot is expected; the first is that of now.
        at: (N,) when, s.
        near: Filled; discs that are not there lie far away.
    """
    stages = poses.shape[0] - 1
    count = near.shape[0] // stages
    for k in range(stages):
        x, y, time = poses[k + 1, 0], poses[k + 1, 1], at[k]
        heading = poses[k + 1, 2]
        cos, sin = math.cos(heading), math.sin(heading)
        last, number = -math.inf, -1
        for j in range(k * count, (k + 1) * count):
            least, found = math.inf, -1
            near[j, 0], near[j, 1], near[j, 2], near[j, 3], near[j, 4] = FAR
            for i in range(discs.shape[0]):
                radius, v_x, v_y = discs[i, 2], discs[i, 3], discs[i, 4]
                d_x = discs[i, 0] + time * v_x - x
                d_y = discs[i, 1] + time * v_y - y
                touch = point_contact(
                    edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x
                )
                gap = touch.distance - radius
                # The next after the last one found, equal ones by their number: what is
                # nearest in order, without an array to sort and without taking a disc
                # twice.
                if gap < least and (gap > last or (gap == last and i > number)):
                    least, found = gap, i
                    near[j, 0], near[j, 1], near[j, 2] = d_x + x, d_y + y, radius
                    near[j, 3], near[j, 4] = v_x, v_y
            last, number = least, found
