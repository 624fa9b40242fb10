"""Timed elastic band [Roesmann2012], [Roesmann2017], with the polygon footprint."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from qpavoid.avoidance.controllers import Step
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import (
    RELAXED_FROM,
    out_of_reach,
    reference_ahead,
    wide_still,
)
from qpavoid.lab.baselines.nmpc import (
    IPOPT,
    BodyParts,
    Program,
    body_parts,
    later,
    limited_by,
    polygon_barriers,
)
from qpavoid.lab.baselines.predictive import (
    PERIOD,
    Situation,
    nearest_discs,
    replanning,
)
from qpavoid.model.contact import point_contact
from qpavoid.model.robot import Limits, Robot
from qpavoid.types import Array, Pose, Twist

OPTIONS = {**IPOPT, "mu_strategy": "monotone", "nlp_scaling_method": "none"}
"""IPOPT's options; from the last band they take two thirds of NMPC's iterations."""

LONGEST_TICKS = 3.0
"""Greatest ΔT in ticks: a longer one could skip a moving obstacle."""

SLOWEST = 0.1
"""m/s and rad/s; least speeds of an initial guess."""


class Shape(NamedTuple):
    """Shape of a band.

    Attributes:
        stages: n.
        tick: Least ΔT, s.
        nearest: Discs per pose.
    """

    stages: int
    tick: float
    nearest: int

    def within(self, steps: Array) -> Array:
        """Return ΔT clipped to its bounds."""
        return np.clip(steps, self.tick, LONGEST_TICKS * self.tick)


class Weights(NamedTuple):
    """Weights of the cost, s² per unit given.

    Attributes:
        end: Square of the distance of the last pose from the end, m².
        gather: Sum of the squares of that of all poses, m².
        heading: 1 − cos of the last pose's error of heading.
        smooth: Sum of the squares of the changes of the twist, m²/s² and 1/s².
        penalty: Depth within r_min, m.
    """

    end: float
    gather: float
    heading: float
    smooth: float
    penalty: float


class Band(NamedTuple):
    """Timed poses, in the robot frame of the time of planning.

    Attributes:
        poses: (n + 1, 3) x, y (m), heading (rad); the first is the robot's own.
        twists: (n, 2) v, ω between them.
        steps: (n,) ΔT between them, s.
        slack: (n,) depth within r_min, m.
        cost: s².
    """

    poses: Array
    twists: Array
    steps: Array
    slack: Array
    cost: float = math.inf

    @property
    def depth(self) -> float:
        """Greatest depth within r_min, m."""
        return float(self.slack.max())


@lru_cache(maxsize=8)
def make_band_program(
    body: BodyParts, limits: Limits, shape: Shape, weights: Weights
) -> Program:
    """Return IPOPT for the problem of :class:`TebController`.

    Unknowns: poses 1 … n, twists of the pieces before them, one slack per pose, ΔT, and
    the times of the poses. Parameters: target pose, the twist driven last, the discs of
    all poses at their present positions.
    """
    n, tick, near = shape
    poses, twists = ca.SX.sym("poses", 3, n), ca.SX.sym("twists", 2, n)
    slack, steps = ca.SX.sym("slack", 1, n), ca.SX.sym("steps", 1, n)
    times = ca.SX.sym("times", 1, n)
    end, driven = ca.SX.sym("end", 3), ca.SX.sym("driven", 2)
    discs = ca.SX.sym("discs", 5, n * near)
    before = ca.horzcat(ca.SX.zeros(3), poses[:, :-1])
    halfway = before[2, :] + 0.5 * steps * twists[1, :]
    moved = ca.vertcat(
        steps * twists[0, :] * ca.cos(halfway),
        steps * twists[0, :] * ca.sin(halfway),
        steps * twists[1, :],
    )
    room = []
    for i in range(n * near):
        k = i // near
        disc = ca.vertcat(discs[:2, i] + times[k] * discs[3:, i], discs[2, i])
        room += [h + slack[k] for h in polygon_barriers(body, poses[:, k], disc)]
    pieces = ca.horzcat(driven, twists), ca.horzcat(twists, ca.SX.zeros(2))
    # Twists belong to the middles of their pieces, so they change over half of either;
    # the first from the twist driven, the last to rest, each over its whole piece.
    between = 0.5 * (steps[:, 1:] + steps[:, :-1])
    between = ca.horzcat(steps[:, 0], between, steps[:, -1])
    changes = (pieces[1] - pieces[0]) / ca.repmat(between, 2, 1)
    limited, most = limited_by(limits, pieces[1], changes)
    off = poses[:2, :] - ca.repmat(end[:2], 1, n)
    cost = n * ca.sumsqr(steps) + weights.penalty * ca.sum2(slack)
    cost += weights.end * ca.sumsqr(off[:, -1])
    cost += weights.smooth * ca.sumsqr(pieces[1] - pieces[0])
    cost += weights.heading * (1.0 - ca.cos(poses[2, -1] - end[2]))
    cost += weights.gather * ca.sumsqr(off)
    # Times are unknowns of their own: as sums of all steps before them they would fill
    # the Jacobian, which is banded so.
    reached = times - ca.horzcat(0.0, times[:, :-1]) - steps
    problem = {
        "x": ca.veccat(poses, twists, slack, steps, times),
        "p": ca.veccat(end, driven, discs),
        "f": cost,
        "g": ca.veccat(poses - before - moved, reached, ca.vertcat(*room), limited),
    }
    options = {"ipopt": dict(OPTIONS), "print_time": False, "error_on_fail": False}
    free, none, rest = np.full(3 * n, np.inf), np.zeros(n), np.full(n, np.inf)
    least = np.tile([limits.v_min, limits.omega_min], n)
    greatest = np.tile([limits.v_max, limits.omega_max], n)
    return Program(
        ca.nlpsol("teb", "ipopt", problem, options),
        np.concatenate([-free, least, none, np.full(n, tick), none]),
        np.concatenate([free, greatest, rest, np.full(n, LONGEST_TICKS * tick), rest]),
        np.concatenate([np.zeros(4 * n + len(room)), -most]),
        np.concatenate([np.zeros(4 * n), np.full(len(room), np.inf), most]),
    )


def bow(limits: Limits, shape: Shape, end: Pose, height: float) -> Band:
    """Return a sine bow of a height (m, to the left) to a pose, at full speed."""
    share = np.linspace(0.0, 1.0, shape.stages + 1)
    along, aside = math.hypot(*end[:2]) * share, height * np.sin(math.pi * share)
    direction = math.atan2(end[1], end[0])
    cos, sin = math.cos(direction), math.sin(direction)
    places = np.array([cos * along - sin * aside, sin * along + cos * aside])
    moves = np.diff(places)
    lengths, facing = np.hypot(*moves), np.arctan2(moves[1], moves[0])
    back = end[0] < 0.0 and limits.v_min < 0.0
    headings = np.unwrap(np.append(0.0, facing + math.pi * back))
    turns = np.diff(headings)
    speed = max(min(limits.v_max, limits.wheel_speed), SLOWEST)
    times = np.abs(turns) / max(limits.omega_max, SLOWEST)
    steps = shape.within(np.maximum(lengths / speed, times))
    twists = np.array([-lengths if back else lengths, turns]).T / steps[:, None]
    return Band(np.vstack([places, headings]).T, twists, steps, np.zeros_like(steps))


def shortened(band: Band, shape: Shape, time: float) -> Band:
    """Return the rest of a band after a time, in as many pieces, in the new frame."""
    times = np.append(0.0, np.cumsum(band.steps))
    left = np.linspace(min(time, 0.5 * times[-1]), times[-1], len(times))
    at = np.interp(left, times, np.arange(len(times), dtype=float))
    twists = band.twists[np.minimum(at[:-1].astype(int), shape.stages - 1)]
    return Band(later(band.poses, at), twists, shape.within(np.diff(left)), band.slack)


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
        """Return a first guess, see :func:`qpavoid.lab.baselines.teb.bow`."""
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
        weights = Weights(
            self.end, self.gather, self.heading, self.smooth, self.penalty
        )
        return make_band_program(
            body_parts(self.robot), self.robot.limits, self.shape, weights
        )

    @property
    def shape(self) -> Shape:
        """Shape of the band."""
        return Shape(self.stages, self.tick, self.nearest)
