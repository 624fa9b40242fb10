"""Timed elastic band [Roesmann2012], [Roesmann2017], with the polygon footprint."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import Step
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import (
    RELAXED_FROM,
    out_of_reach,
    reference_ahead,
    wide_still,
)
from qpavoid.lab.baselines.nearest_discs import nearest_discs
from qpavoid.lab.baselines.nmpc_program import Program
from qpavoid.lab.baselines.predictive import PERIOD, Situation, replanning
from qpavoid.lab.baselines.teb_program import (
    Band,
    Shape,
    Weights,
    bow,
    make_band_program,
    shortened,
)
from qpavoid.model.contact import point_contact
from qpavoid.model.robot import Robot
from qpavoid.types import Array, Pose, Twist

BOWS = (0.4, 0.8, 1.2, 1.8, 2.6)
"""m to a side; heights of the bows of other starts."""

WITH_REFERENCE = 0.1
"""m; distance from the reference within which the desired twist may be driven."""


class Task(NamedTuple):
    """Task of a band.

    Attributes:
        end: Target pose, robot frame.
        driven: Twist driven last.
        discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
    """

    end: Pose
    driven: Twist
    discs: Array


@dataclass(frozen=True)
class TebController:
    """TEB: the quickest band of timed poses to a future pose of the reference.

    Minimises over poses p_k and times ΔT_k ≥ ``tick``, k = 1 … n,

        n Σ ΔT_k² + w_e |p_n − e|² + w_g Σ |p_k − e|² + w_θ (1 − cos(θ_n − θ_e))
        + w_s Σ |u_k − u_(k−1)|² + w_r Σ max_j(0, R_j − d(p_k, o_j + t_k ȯ_j)),

    with u_k the twist between poses, t_k = ΔT_1 + … + ΔT_k, and ΔT_k ≤ 3 ``tick``, so
    that no band skips a moving obstacle; subject to the unicycle between the poses
    (midpoint rule), and to the limits of v, ω, wheels and accelerations, from the twist
    driven last to rest at the end. d is the exact distance of the polygon from the
    nearest few discs of every pose, R = radius + r_min; walls and polygons are points
    0.2 m apart. e is the pose of the reference in ``horizon`` s, or the goal: the robot
    may be ahead of the reference by that. Planned every 0.1 s from the last band; if an
    obstacle is in the straight path, also from a bow to the other side of it (to both,
    without a last band), and the cheaper solution counts: at most two homotopy classes.
    A band within r_min is ``relaxed``, one that may touch is rejected; without a
    solution the robot brakes (``stopped``). If no obstacle can be reached and the robot
    is at its reference, the desired twist is driven.

    The original turns all constraints into penalties, for Levenberg-Marquardt, which
    was tried and was slower; IPOPT solves the problem with hard constraints but for the
    obstacles. Left out: insertion and removal of poses (n is fixed for the solver;
    ΔT_k ≥ ``tick`` keeps the preview of a short band, and w_g gathers its poses at the
    end), more classes, via-points and the preference for driving forwards (weights to
    tune, off or small by default), and costmaps (it uses the obstacles themselves).

    Attributes:
        robot: Footprint and limits.
        settings: Radii and control step.
        stages: n.
        tick: Least ΔT_k, s.
        nearest: Discs per pose.
        horizon: Of the reference, s.
        end: w_e, s²/m².
        gather: w_g, s²/m².
        heading: w_θ, s².
        smooth: w_s, of the twists u.
        penalty: w_r, s²/m.
    """

    robot: Robot
    settings: AvoidanceSettings
    stages: int = 16
    tick: float = 0.125
    nearest: int = 3
    horizon: float = 3.0
    end: float = 50.0
    gather: float = 0.2
    heading: float = 2.0
    smooth: float = 0.02
    penalty: float = 1000.0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        program = self.program()

        def is_free(to: Situation) -> bool:
            with_it = math.hypot(*to.context.target[:2]) <= WITH_REFERENCE
            return with_it and out_of_reach(self.robot, to.discs, self.horizon)

        def search(kept: Band | None, to: Situation) -> Iterator[Band | None]:
            ((x, y, turn),) = reference_ahead(to.context, self.robot, 1, self.horizon)
            task = Task((x, y, turn), to.context.driven, to.discs)
            for start in self.starts(kept, task):
                yield self.solve(program, start, task)

        return replanning(self.robot, self.settings, (v, omega), is_free, search)

    def starts(self, kept: Band | None, task: Task) -> Iterator[Band]:
        """Yield the starts of the search: the last band, and the other passing side."""
        straight = self.bow(task.end, 0.0)
        if kept is not None:
            kept = shortened(kept, self.shape, PERIOD)
        if self.room(straight, task) >= 0.0:
            yield kept or straight
            return
        sides = [1.0, -1.0]
        if kept is not None:
            yield kept
            # Side of the last band: the sign of the summed cross products.
            (x, y, _), (x_k, y_k, _) = task.end, kept.poses.sum(axis=0)
            sides.remove(1.0 if x * y_k >= y * x_k else -1.0)
        for side in sides:
            bows = [self.bow(task.end, side * height) for height in BOWS]
            free = (bow for bow in bows if self.room(bow, task) >= 0.0)
            yield next(free, bows[-1])

    def bow(self, end: Pose, height: float) -> Band:
        """Return a first guess, see :func:`qpavoid.lab.baselines.teb_program.bow`."""
        return bow(self.robot.limits, self.shape, end, height)

    def near(self, band: Band, task: Task, count: int) -> Array:
        """Return the ``count`` discs nearest to each pose, (n · count, 5)."""
        near = np.empty((self.stages * count, 5))
        edges, times = self.robot.footprint.edges, np.cumsum(band.steps)
        nearest_discs(edges, task.discs, band.poses.copy(), times, near)
        return near

    def room(self, band: Band, task: Task) -> float:
        """Return the least margin of a band (clearance − r_min), m."""
        edges, least = self.robot.footprint.edges, math.inf
        near = self.near(band, task, 1)[:, :3].tolist()
        for pose, (x, y, radius) in zip(band.poses[1:].tolist(), near, strict=True):
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            x, y = x - pose[0], y - pose[1]
            contact = point_contact(edges, cos * x + sin * y, cos * y - sin * x)
            least = min(least, contact.distance - radius)
        return least

    def solve(self, program: Program, start: Band, task: Task) -> Band | None:
        """Return the solver's band from a start; None if it fails."""
        n, times = self.stages, np.cumsum(start.steps)
        near = self.near(start, task, self.nearest)
        # At their present positions: the program moves them by its own times.
        near[:, :2] -= np.repeat(times, self.nearest)[:, None] * near[:, 3:]
        x = start.poses[1:], start.twists, start.slack, start.steps, times
        given = [np.array(task.end), np.array(task.driven), near.ravel()]
        z, cost = program.solved([part.ravel() for part in x], given)
        if not len(z):
            return None
        poses, twists, slack, steps, _ = np.split(z, np.cumsum([3, 2, 1, 1]) * n)
        if slack.max() > max(wide_still(self.settings), RELAXED_FROM):
            return None
        poses = np.vstack([np.zeros(3), poses.reshape(n, 3)])
        return Band(poses, twists.reshape(n, 2), steps, slack, cost)

    def program(self) -> Program:
        """Return the solver, shared by all runs of equal settings."""
        vertices = tuple(map(tuple, self.robot.footprint.vertices.tolist()))
        weights = Weights(
            self.end, self.gather, self.heading, self.smooth, self.penalty
        )
        return make_band_program(vertices, self.robot.limits, self.shape, weights)

    @property
    def shape(self) -> Shape:
        """Shape of the band."""
        return Shape(self.stages, self.tick, self.nearest)
