"""Common part of predictive methods: obstacles as discs, start from the last plan."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.compiled import compiled_once, entry
from qpavoid.lab.baselines.drive import (
    FAILED,
    RELAXED_FROM,
    Baseline,
    Command,
    line_points,
    wide_discs,
)
from qpavoid.model.contact import point_contact
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Discs, Edges, Matrix, MatrixWritten, Sizes, Twist

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


class Plan(NamedTuple):
    """A plan, in the robot frame of its beginning.

    Attributes:
        poses: (N + 1, 3) x, y (m), heading (rad); the first is the robot's own.
        twists: (N, 2) v, ω between them; the first is driven.
        steps: (N,) time between them, s.
        slack: (N,) depth within r_min, m.
        cost: Of the program.
    """

    poses: Array
    twists: Array
    steps: Array
    slack: Array
    cost: float = math.inf


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


@dataclass(frozen=True)
class Predictive(Baseline, ABC):
    """A method that plans every :data:`PERIOD` from its last plan.

    The cheapest plan counts; without one the robot brakes (``stopped``).
    """

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        kept: Plan | None = None
        self.program()  # made before the first step

        def plan(
            desired: Twist, obstacles: Obstacles, context: StepContext
        ) -> Command | None:
            nonlocal kept
            discs = everything_wide(obstacles, self.settings)
            to = Situation(desired, context, discs)
            if self.is_free(to):
                kept = None
                return None
            found = [one for one in self.search(kept, to) if one is not None]
            kept = min(found, key=lambda one: one.cost, default=None)
            if kept is None:
                return FAILED
            v, omega = kept.twists[0].tolist()
            return command_of((v, omega), float(kept.slack.max()))

        return self.stepping((v, omega), plan, PERIOD)

    @abstractmethod
    def program(self) -> Any:
        """Return the solver, shared by all runs of equal settings."""

    @abstractmethod
    def is_free(self, to: Situation) -> bool:
        """Return whether the desired twist is driven, and the last plan dropped."""

    @abstractmethod
    def search(self, kept: Plan | None, to: Situation) -> Iterator[Plan | None]:
        """Yield the solver's plans, from the last one if any; None for a failure."""


NO_DISC = (1e3, 1e3, 0.0, 0.0, 0.0)
"""Absent obstacle: x, y, radius, m, and velocity."""


@entry
@compiled_once
def nearest_discs(
    edges: Edges,
    discs: Discs,
    stages: Annotated[Matrix, Sizes(1, 4)],
    near: Annotated[MatrixWritten, Sizes(0, 5)],
) -> None:
    """Fill in the discs (N·n, 5) nearest to the footprint at each stage.

    Args:
        edges: Of the footprint.
        discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        stages: (N, 4) predicted poses of the robot, and their times, s.
        near: Filled in; absent discs are :data:`NO_DISC`.
    """
    count = near.shape[0] // stages.shape[0]
    for k in range(stages.shape[0]):
        x, y, heading, time = stages[k, 0], stages[k, 1], stages[k, 2], stages[k, 3]
        cos, sin = math.cos(heading), math.sin(heading)
        last, number = -math.inf, -1
        for j in range(k * count, (k + 1) * count):
            least, found = math.inf, -1
            near[j, 0], near[j, 1], near[j, 2], near[j, 3], near[j, 4] = NO_DISC
            for i in range(discs.shape[0]):
                radius, v_x, v_y = discs[i, 2], discs[i, 3], discs[i, 4]
                d_x = discs[i, 0] + time * v_x - x
                d_y = discs[i, 1] + time * v_y - y
                touch = point_contact(
                    edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x
                )
                gap = touch.distance - radius
                # The next after the last one found, equal ones by their number: sorts
                # without an array and without repetition.
                if gap < least and (gap > last or (gap == last and i > number)):
                    least, found = gap, i
                    near[j, 0], near[j, 1], near[j, 2] = d_x + x, d_y + y, radius
                    near[j, 3], near[j, 4] = v_x, v_y
            last, number = least, found
