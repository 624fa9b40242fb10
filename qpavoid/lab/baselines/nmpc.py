"""Nonlinear model predictive control of a unicycle with a polygon footprint.

And with discrete-time control barrier functions [Zeng2021]; both in CasADi
[Andersson2019].
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import (
    RELAXED_FROM,
    body_discs,
    out_of_reach,
    reference_ahead,
    wide_still,
)
from qpavoid.lab.baselines.predictive import (
    PERIOD,
    Situation,
    nearest_discs,
    replanning,
)
from qpavoid.model.robot import Limits, Robot
from qpavoid.types import Array, Twist

IPOPT: Mapping[str, Any] = {
    "print_level": 0,
    "sb": "yes",
    "max_iter": 100,
    "tol": 1e-4,
    "constr_viol_tol": 1e-4,
    "acceptable_tol": 1e-3,
    "acceptable_iter": 3,
    "mu_strategy": "adaptive",
}

ROOT_FLOOR = 1e-12
"""m², added below a root, which has no derivative at 0: for a point on an edge, or the
centres of two discs at one point."""

BodyPoints: TypeAlias = tuple[tuple[float, float], ...]
BodyParts: TypeAlias = tuple[BodyPoints, ...]
"""Vertices of the footprint, m; or discs that cover it: x of the centre, radius, m."""


class Keep(NamedTuple):
    """Barrier constraints: h(k) ≥ (1 − γ) h(k − 1) for every barrier h of a stage.

    Attributes:
        barriers: Returns all h (m) of the body at a pose and a disc x, y, R, symbolic.
        body: Of the robot.
        gamma: γ in (0, 1]; with 1 it is h ≥ 0.
    """

    barriers: Callable[[Any, Any, Any], list[Any]]
    body: BodyPoints | BodyParts
    gamma: float = 1.0


class Program(NamedTuple):
    """A solver with the bounds of its unknowns and of its constraints.

    Unknowns: poses 1 … N, twists 0 … N − 1, one slack per stage. Parameters: the
    reference's poses, its twist, the twist driven last, the discs of all stages.
    """

    solver: ca.Function
    lower: Array
    upper: Array
    least: Array
    most: Array

    def solved(self, start: list[Array], given: list[Array]) -> tuple[Array, float]:
        """Return unknowns and cost from a start; no unknowns where it fails."""
        found = self.solver(
            x0=np.concatenate(start),
            p=np.concatenate(given),
            lbx=self.lower,
            ubx=self.upper,
            lbg=self.least,
            ubg=self.most,
        )
        z = np.asarray(found["x"]).ravel()
        good = self.solver.stats()["success"] and np.isfinite(z).all()
        return z if good else z[:0], float(found["f"])


@lru_cache(maxsize=8)
def make_program(
    keep: Keep,
    limits: Limits,
    stages: int,
    tick: float,
    nearest: int,
    weights: tuple[float, float, float, float],
) -> Program:
    """Return IPOPT for the problem of :class:`NmpcController`.

    Args:
        keep: Barrier constraints.
        limits: Of the robot.
        stages: N of the horizon.
        tick: s, of a stage.
        nearest: Discs per stage.
        weights: Of heading, effort, last stage and slack.
    """
    poses, twists = ca.SX.sym("poses", 3, stages), ca.SX.sym("twists", 2, stages)
    slack, reference = ca.SX.sym("slack", stages), ca.SX.sym("reference", 3, stages)
    twist, driven = ca.SX.sym("twist", 2), ca.SX.sym("driven", 2)
    discs = ca.SX.sym("discs", 5, stages * nearest)
    heading, effort, last, penalty = weights
    before = ca.horzcat(ca.SX.zeros(3), poses[:, :-1])
    halfway = before[2, :] + 0.5 * tick * twists[1, :]
    rate = ca.vertcat(
        twists[0, :] * ca.cos(halfway), twists[0, :] * ca.sin(halfway), twists[1, :]
    )
    cost = penalty * ca.sum1(slack)
    for k in range(stages):
        error, off = poses[:, k] - reference[:, k], twists[:, k] - twist
        share = last if k == stages - 1 else 1.0
        cost += share * (ca.sumsqr(error[:2]) + heading * (1.0 - ca.cos(error[2])))
        cost += effort * (off[0] ** 2 + 0.1 * off[1] ** 2)
    around = (poses, before, discs)
    room = [
        h + slack[i // nearest]
        for i in range(stages * nearest)
        for h in kept_clear(keep, around, i // nearest, i, tick)
    ]
    changes = (twists - ca.horzcat(driven, twists[:, :-1])) / tick
    limited, most = limited_by(limits, twists, changes)
    problem = {
        "x": ca.veccat(poses, twists, slack),
        "p": ca.veccat(reference, twist, driven, discs),
        "f": cost,
        "g": ca.veccat(poses - before - tick * rate, ca.vertcat(*room), limited),
    }
    options = {"ipopt": dict(IPOPT), "print_time": False, "error_on_fail": False}
    free, none = np.full(3 * stages, np.inf), np.zeros(3 * stages)
    v_omega = np.tile([[limits.v_min, limits.omega_min]], stages).ravel()
    v_omega_most = np.tile([[limits.v_max, limits.omega_max]], stages).ravel()
    return Program(
        ca.nlpsol("nmpc", "ipopt", problem, options),
        np.concatenate([-free, v_omega, np.zeros(stages)]),
        np.concatenate([free, v_omega_most, np.full(stages, np.inf)]),
        np.concatenate([none, np.zeros(len(room)), -most]),
        np.concatenate([none, np.full(len(room), np.inf), most]),
    )


def kept_clear(
    keep: Keep, around: tuple[Any, Any, Any], k: int, i: int, tick: float
) -> list[Any]:
    """Return the constraints of a stage, m: h(k) − (1 − γ) h(k − 1) ≥ 0.

    Args:
        keep: Barrier constraints.
        around: Poses of all stages, the poses before them, and the discs.
        k: The stage.
        i: The disc.
        tick: s, of a stage.
    """
    poses, before, discs = around
    clear = keep.barriers(keep.body, poses[:, k], discs[:3, i])
    if keep.gamma == 1.0:
        return clear
    there = ca.vertcat(discs[:2, i] - tick * discs[3:, i], discs[2, i])
    earlier = keep.barriers(keep.body, before[:, k], there)
    decay = 1.0 - keep.gamma
    return [h - decay * h_0 for h, h_0 in zip(clear, earlier, strict=True)]


def limited_by(limits: Limits, twists: Any, changes: Any) -> tuple[Any, Array]:
    """Return accelerations and speeds of the wheels, and their bounds, where finite."""
    turn, stages = 0.5 * limits.track * twists[1, :], twists.shape[1]
    wheels = ca.vertcat(twists[0, :] + turn, twists[0, :] - turn)
    most = np.tile((limits.acceleration, limits.angular_acceleration), stages)
    most = np.concatenate([most, np.full(2 * stages, limits.wheel_speed)])
    real = np.flatnonzero(np.isfinite(most))
    return ca.veccat(changes, wheels)[real.tolist()], most[real]


def polygon_barriers(parts: BodyParts, pose: Any, disc: Any) -> list[Any]:
    """Return the distance of every convex part from a disc, m."""
    return [polygon_distance(part, pose, disc[:2]) - disc[2] for part in parts]


def disc_barriers(body: BodyPoints, pose: Any, disc: Any) -> list[Any]:
    """Return the distance of every disc of the body from a disc, m."""
    cos, sin = ca.cos(pose[2]), ca.sin(pose[2])
    off = [(pose[0] + x * cos - disc[0], pose[1] + x * sin - disc[1]) for x, _ in body]
    return [
        ca.sqrt(o_x**2 + o_y**2 + ROOT_FLOOR) - radius - disc[2]
        for (o_x, o_y), (_, radius) in zip(off, body, strict=True)
    ]


def body_parts(robot: Robot) -> BodyParts:
    """Return the corners of the footprint's convex parts, m."""
    return tuple(tuple(map(tuple, x.tolist())) for x in robot.footprint.parts)


def polygon_distance(vertices: BodyPoints, pose: Any, p: Any) -> Any:
    """Return the exact distance (m) of a point from the polygon at a pose, symbolic.

    Outside it is the least distance from an edge, continuously differentiable; inside
    minus the depth.
    """
    cos, sin = ca.cos(pose[2]), ca.sin(pose[2])
    d_x, d_y = p[0] - pose[0], p[1] - pose[1]
    x, y = cos * d_x + sin * d_y, cos * d_y - sin * d_x
    square, beyond = math.inf, -math.inf
    for (a_x, a_y), (b_x, b_y) in zip(
        vertices, vertices[1:] + vertices[:1], strict=True
    ):
        length = math.hypot(b_x - a_x, b_y - a_y)
        t_x, t_y = (b_x - a_x) / length, (b_y - a_y) / length
        along = t_x * (x - a_x) + t_y * (y - a_y)
        across = t_y * (x - a_x) - t_x * (y - a_y)
        past = along - ca.fmin(ca.fmax(along, 0.0), length)
        square = ca.fmin(square, across**2 + past**2)
        beyond = ca.fmax(beyond, across)
    # Outside the nearest edge counts, inside the least deep one.
    return ca.if_else(beyond > 0.0, ca.sqrt(square + ROOT_FLOOR), beyond)


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
        return Keep(polygon_barriers, body_parts(self.robot))


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


@dataclass(frozen=True)
class MpcCbfController(NmpcController):
    """MPC-CBF: over a short horizon no barrier may decay faster than by a share.

    The program is that of NMPC (cost, unicycle, limits, slack, IPOPT), but for the
    constraints: h(k) ≥ (1 − γ) h(k − 1) at every stage, for the distance h of each disc
    of the body from the nearest few obstacles' discs inflated by r_min. In the original
    h is the squared distance minus the squared radii; γ = 1 requires h ≥ 0 only. One
    start, the last plan, as in the original. There is no slack in the original; here it
    costs ``penalty`` per metre, as in NMPC.

    Attributes:
        stages: N of the horizon, shorter than that of NMPC.
        tick: s, of a stage.
        held_up: ∞: no other start is tried.
        gamma: γ, of a stage.
        discs: Number of discs that cover the body.

    The others are those of :class:`NmpcController`; values as found on the training
    scenes (``comparisons/results/tuned.toml``), γ = 1 among them.
    """

    stages: int = 12
    tick: float = 0.2
    held_up: float = float("inf")
    gamma: float = 1.0
    discs: int = 2
    heading: float = 0.1
    effort: float = 0.3
    last: float = 20.0

    @property
    def keep(self) -> Keep:
        """Barriers between the obstacles' discs and those of the body."""
        return Keep(disc_barriers, body_discs(self.robot, self.discs), self.gamma)
