"""Nonlinear model predictive control of a unicycle with a polygon footprint."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import (
    RELAXED_FROM,
    out_of_reach,
    reference_ahead,
    wide_still,
)
from qpavoid.lab.baselines.nearest_discs import nearest_discs
from qpavoid.lab.baselines.nmpc_program import (
    Keep,
    Program,
    make_program,
    polygon_barriers,
)
from qpavoid.lab.baselines.predictive import PERIOD, Situation, replanning
from qpavoid.model.robot import Robot
from qpavoid.types import Array, Twist


class Trajectory(NamedTuple):
    """A plan, in the robot frame of its beginning.

    Attributes:
        poses: (N + 1, 3) x, y (m), heading (rad); the first is the robot's own.
        twists: (N, 2) v, ω.
        depth: Greatest within r_min, m.
        cost: Of the program.
    """

    poses: Array
    twists: Array
    depth: float = 0.0
    cost: float = math.inf


@dataclass(frozen=True)
class NmpcController:
    """NMPC with the polygon footprint: multiple shooting, solved by IPOPT.

    Minimises the tracking error of the predicted reference and the difference from its
    twist over the horizon, subject to the unicycle (midpoint rule), the limits, and to
    the exact distance of the polygon from the predicted nearest few discs of every
    stage: at least radius + r_min, minus a slack per stage that costs ``penalty`` per
    metre. Walls and polygons are points 0.2 m apart, each with its own velocity.
    Planned every 0.1 s, from the last plan, and held in between. If that plan ends too
    early, two swerves and standing still are other starts, and the cheapest solution
    counts. A solution with slack is ``relaxed``; one with a slack above r_min, which
    may touch, is rejected. Without a solution the robot brakes (``stopped``). If no
    obstacle can be reached within the horizon, the desired twist is driven.

    Solutions that may touch are rejected since a run drove through a wall, which no
    weight prevented.

    Attributes:
        robot: Footprint and limits.
        settings: Radii and control step.
        stages: N of the horizon.
        tick: s, of a stage.
        nearest: Discs per stage.
        heading: Weight of 1 − cos of the heading error, m².
        effort: Weight of the squared difference from the reference's twist (ω's part
            times 0.1 m²), s².
        last: Weight of the last stage in stages.
        penalty: Of slack, m.
        held_up: m; distance of a plan's end from its reference from which on other
            starts are tried.
    """

    robot: Robot
    settings: AvoidanceSettings
    stages: int = 28
    tick: float = 0.15
    nearest: int = 5
    heading: float = 0.1
    effort: float = 0.03
    last: float = 5.0
    penalty: float = 1000.0
    held_up: float = 1.0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        program, horizon = self.program(), self.stages * self.tick

        def is_free(to: Situation) -> bool:
            return out_of_reach(self.robot, to.discs, horizon)

        def search(
            kept: Trajectory | None, to: Situation
        ) -> Iterator[Trajectory | None]:
            reference = reference_ahead(to.context, self.robot, self.stages, self.tick)
            for start in self.starts(kept, reference, to.desired):
                yield self.solve(program, start, to.context, reference, to.discs)

        return replanning(self.robot, self.settings, (v, omega), is_free, search)

    def starts(
        self, kept: Trajectory | None, reference: Array, desired: Twist
    ) -> Iterator[Trajectory]:
        """Yield the starts: the last plan, and others if it ends too early."""
        if kept is None:
            poses = np.vstack([np.zeros(3), reference])
            yield Trajectory(poses, np.tile(desired, (self.stages, 1)))
        else:
            at = PERIOD / self.tick + np.arange(len(kept.poses), dtype=float)
            kept = Trajectory(later(kept.poses, at), kept.twists)
            yield kept
        off = (
            np.inf if kept is None else math.dist(kept.poses[-1, :2], reference[-1, :2])
        )
        if off > self.held_up:
            # A swerve to either side, and standing still: from a plan that ends before
            # the obstacle a descent method finds no path around it.
            limits, half = self.robot.limits, self.stages // 2
            for omega in (0.5 * limits.omega_min, 0.5 * limits.omega_max):
                twists = np.full((self.stages, 2), (0.5 * limits.v_max, omega))
                twists[half:, 1] = -omega
                yield driven_along(twists, self.tick)
            yield driven_along(np.zeros((self.stages, 2)), self.tick)

    def solve(
        self,
        program: Program,
        start: Trajectory,
        context: StepContext,
        reference: Array,
        discs: Array,
    ) -> Trajectory | None:
        """Return the solver's plan from a start; None if it fails.

        Args:
            program: The solver.
            start: Initial guess.
            context: Twists of reference and robot.
            reference: (N, 3) reference poses.
            discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        """
        n, near = self.stages, np.empty((self.stages * self.nearest, 5))
        times = self.tick * np.arange(1.0, n + 1.0)
        nearest_discs(self.robot.footprint.edges, discs, start.poses, times, near)
        x = [start.poses[1:].ravel(), start.twists.ravel(), np.zeros(n)]
        twists = np.array([context.reference, context.driven])
        p = [reference.ravel(), twists.ravel(), near.ravel()]
        z, cost = program.solved(x, p)
        if not len(z):
            return None
        poses = np.vstack([np.zeros(3), z[: 3 * n].reshape(n, 3)])
        twists, slack = z[3 * n : 5 * n].reshape(n, 2), float(z[5 * n :].max())
        if slack > max(wide_still(self.settings), RELAXED_FROM):
            return None
        return Trajectory(poses, twists, slack, cost)

    def program(self) -> Program:
        """Return the solver, shared by all runs of equal settings."""
        weights = self.heading, self.effort, self.last, self.penalty
        shape = self.stages, self.tick, self.nearest
        return make_program(self.keep, self.robot.limits, *shape, weights)

    @property
    def keep(self) -> Keep:
        """Barriers between the obstacles' discs and the polygon."""
        vertices = tuple(map(tuple, self.robot.footprint.vertices.tolist()))
        return Keep(polygon_barriers, vertices)


def later(poses: Array, at: Array) -> Array:
    """Return interpolated poses at fractional stages, in the frame of the first."""
    columns = [np.interp(at, np.arange(len(poses)), column) for column in poses.T]
    (x, *_), (y, *_), (heading, *_) = columns
    cos, sin = math.cos(heading), math.sin(heading)
    d_x, d_y = columns[0] - x, columns[1] - y
    seen = [cos * d_x + sin * d_y, cos * d_y - sin * d_x, columns[2] - heading]
    return np.column_stack(seen)


def driven_along(twists: Array, tick: float) -> Trajectory:
    """Return the trajectory of twists (N, 2), by the midpoint rule."""
    heading = np.concatenate([[0.0], np.cumsum(tick * twists[:, 1])])
    halfway = 0.5 * (heading[:-1] + heading[1:])
    steps = tick * twists[:, :1] * np.column_stack([np.cos(halfway), np.sin(halfway)])
    places = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return Trajectory(np.column_stack([places, heading]), twists)
