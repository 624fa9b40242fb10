"""Timed elastic band [Roesmann2012], [Roesmann2017], with the polygon footprint."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

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
    ipopt,
    later,
    limited_by,
    polygon_barriers,
    twist_bounds,
)
from qpavoid.lab.baselines.predictive import (
    PERIOD,
    Plan,
    Predictive,
    Situation,
    nearest_discs,
)
from qpavoid.model.contact import point_contact
from qpavoid.model.robot import Limits
from qpavoid.types import Array, Pose

OPTIONS = {**IPOPT, "mu_strategy": "monotone", "nlp_scaling_method": "none"}
"""IPOPT's options; from the last band they take two thirds of NMPC's iterations."""

LONGEST_TICKS = 3.0
"""Greatest ΔT in ticks: a longer one could skip a moving obstacle."""

SLOWEST = 0.1
"""m/s and rad/s; least speeds of an initial guess."""


@lru_cache(maxsize=8)
def make_band_program(
    body: BodyParts,
    limits: Limits,
    shape: tuple[int, float, int],
    weights: tuple[float, ...],
) -> Program:
    """Return IPOPT for the problem of :class:`TebController`.

    Unknowns: poses 1 … n, twists of the pieces before them, one slack per pose, ΔT, and
    the times of the poses. Parameters: target pose, the twist driven last, the discs of
    all poses at their present positions.

    Args:
        body: Vertices of the footprint, m.
        limits: Of the robot.
        shape: n, least ΔT (s), discs per pose.
        weights: w_e, w_g, w_θ, w_s, w_r.
    """
    (n, tick, near), (w_end, gather, heading, smooth, penalty) = shape, weights
    poses, twists = ca.SX.sym("poses", 3, n), ca.SX.sym("twists", 2, n)
    slack, steps = ca.SX.sym("slack", 1, n), ca.SX.sym("steps", 1, n)
    times, discs = ca.SX.sym("times", 1, n), ca.SX.sym("discs", 5, n * near)
    end, driven = ca.SX.sym("end", 3), ca.SX.sym("driven", 2)
    before = ca.horzcat(ca.SX.zeros(3), poses[:, :-1])
    made = poses - before - moved(before, twists, steps)
    room = [
        h + slack[i // near]
        for i in range(n * near)
        for h in kept_clear(body, poses[:, i // near], discs[:, i], times[i // near])
    ]
    pieces = ca.horzcat(driven, twists), ca.horzcat(twists, ca.SX.zeros(2))
    # Twists belong to the middles of their pieces: they change over half of either; the
    # first from the twist driven, the last to rest, each over its whole piece.
    halves = 0.5 * (steps[:, 1:] + steps[:, :-1])
    between = ca.horzcat(steps[:, 0], halves, steps[:, -1])
    changes = (pieces[1] - pieces[0]) / ca.repmat(between, 2, 1)
    limited, most = limited_by(limits, pieces[1], changes)
    off = poses[:2, :] - ca.repmat(end[:2], 1, n)
    cost = n * ca.sumsqr(steps) + penalty * ca.sum2(slack)
    cost += w_end * ca.sumsqr(off[:, -1])
    cost += smooth * ca.sumsqr(pieces[1] - pieces[0])
    cost += heading * (1.0 - ca.cos(poses[2, -1] - end[2]))
    cost += gather * ca.sumsqr(off)
    # Not sums of all steps before them, which would fill the banded Jacobian.
    reached = times - ca.horzcat(0.0, times[:, :-1]) - steps
    problem = {
        "x": ca.veccat(poses, twists, slack, steps, times),
        "p": ca.veccat(end, driven, discs),
        "f": cost,
        "g": ca.veccat(made, reached, ca.vertcat(*room), limited),
    }
    free, none, rest = np.full(3 * n, np.inf), np.zeros(n), np.full(n, np.inf)
    least, greatest = twist_bounds(limits, n)
    return Program(
        ipopt(problem, OPTIONS),
        np.concatenate([-free, least, none, np.full(n, tick), none]),
        np.concatenate([free, greatest, rest, np.full(n, LONGEST_TICKS * tick), rest]),
        np.concatenate([np.zeros(4 * n + len(room)), -most]),
        np.concatenate([np.zeros(4 * n), np.full(len(room), np.inf), most]),
    )


def moved(before: Any, twists: Any, steps: Any) -> Any:
    """Return the motions of twists from poses, by the midpoint rule, symbolic."""
    halfway = before[2, :] + 0.5 * steps * twists[1, :]
    return ca.vertcat(
        steps * twists[0, :] * ca.cos(halfway),
        steps * twists[0, :] * ca.sin(halfway),
        steps * twists[1, :],
    )


def kept_clear(body: BodyParts, pose: Any, disc: Any, time: Any) -> list[Any]:
    """Return the margins of the parts at a pose to a disc after a time, m, symbolic."""
    there = ca.vertcat(disc[:2] + time * disc[3:], disc[2])
    return polygon_barriers(body, pose, there)


BOWS = (0.4, 0.8, 1.2, 1.8, 2.6)
"""m to a side; heights of the bows of other starts."""

WITH_REFERENCE = 0.1
"""m; distance from the reference within which the desired twist may be driven."""


@dataclass(frozen=True)
class TebController(Predictive):
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

    stages: int = 16
    tick: float = 0.125
    nearest: int = 3
    horizon: float = 3.0
    end: float = 50.0
    gather: float = 0.2
    heading: float = 2.0
    smooth: float = 0.02
    penalty: float = 1000.0

    def is_free(self, to: Situation) -> bool:
        """Return whether no obstacle can be reached, and the robot is at its place."""
        with_it = math.hypot(*to.context.target[:2]) <= WITH_REFERENCE
        return with_it and out_of_reach(self.robot, to.discs, self.horizon)

    def search(self, kept: Plan | None, to: Situation) -> Iterator[Plan | None]:
        """Yield the solver's bands from all starts; None for a failure."""
        ((x, y, turn),) = reference_ahead(to.context, self.robot, 1, self.horizon)
        for start in self.starts(kept, (x, y, turn), to):
            yield self.solve(start, (x, y, turn), to)

    def starts(self, kept: Plan | None, end: Pose, to: Situation) -> Iterator[Plan]:
        """Yield the starts of the search: the last band, and the other passing side."""
        straight = self.bow(end, 0.0)
        if kept is not None:
            kept = self.shortened(kept)
        if self.room(straight, to.discs) >= 0.0:
            yield kept or straight
            return
        sides = [1.0, -1.0]
        if kept is not None:
            yield kept
            # Side of the last band: the sign of the summed cross products.
            (x, y, _), (x_k, y_k, _) = end, kept.poses.sum(axis=0)
            sides.remove(1.0 if x * y_k >= y * x_k else -1.0)
        for side in sides:
            bows = [self.bow(end, side * height) for height in BOWS]
            free = (bow for bow in bows if self.room(bow, to.discs) >= 0.0)
            yield next(free, bows[-1])

    def within(self, steps: Array) -> Array:
        """Return ΔT clipped to its bounds."""
        return np.clip(steps, self.tick, LONGEST_TICKS * self.tick)

    def bow(self, end: Pose, height: float) -> Plan:
        """Return a sine bow of a height (m, to the left) to a pose, at full speed."""
        limits, share = self.robot.limits, np.linspace(0.0, 1.0, self.stages + 1)
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
        steps = self.within(np.maximum(lengths / speed, times))
        twists = np.array([-lengths if back else lengths, turns]).T / steps[:, None]
        poses = np.vstack([places, headings]).T
        return Plan(poses, twists, steps, np.zeros_like(steps))

    def shortened(self, band: Plan) -> Plan:
        """Return the rest of a band after :data:`PERIOD`, in as many pieces."""
        times = np.append(0.0, np.cumsum(band.steps))
        left = np.linspace(min(PERIOD, 0.5 * times[-1]), times[-1], len(times))
        at = np.interp(left, times, np.arange(len(times), dtype=float))
        twists = band.twists[np.minimum(at[:-1].astype(int), self.stages - 1)]
        steps = self.within(np.diff(left))
        return Plan(later(band.poses, at), twists, steps, band.slack)

    def near(self, band: Plan, discs: Array, count: int) -> Array:
        """Return the ``count`` discs nearest to each pose, (n · count, 5)."""
        near = np.empty((self.stages * count, 5))
        stages = np.empty((self.stages, 4))
        stages[:, :3], stages[:, 3] = band.poses[1:], np.cumsum(band.steps)
        nearest_discs(self.robot.footprint.edges, discs, stages, near)
        return near

    def room(self, band: Plan, discs: Array) -> float:
        """Return the least margin of a band (clearance − r_min), m."""
        edges, least = self.robot.footprint.edges, math.inf
        near = self.near(band, discs, 1)[:, :3].tolist()
        for pose, (x, y, radius) in zip(band.poses[1:].tolist(), near, strict=True):
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            x, y = x - pose[0], y - pose[1]
            contact = point_contact(edges, cos * x + sin * y, cos * y - sin * x)
            least = min(least, contact.distance - radius)
        return least

    def solve(self, start: Plan, end: Pose, to: Situation) -> Plan | None:
        """Return the solver's band from a start; None if it fails."""
        n, times = self.stages, np.cumsum(start.steps)
        near = self.near(start, to.discs, self.nearest)
        # At their present positions: the program moves them by its own times.
        near[:, :2] -= np.repeat(times, self.nearest)[:, None] * near[:, 3:]
        x = start.poses[1:], start.twists, start.slack, start.steps, times
        given = [np.array(end), np.array(to.context.driven), near.ravel()]
        z, cost = self.program().solved([part.ravel() for part in x], given)
        if not len(z):
            return None
        poses, twists, slack, steps, _ = np.split(z, np.cumsum([3, 2, 1, 1]) * n)
        if slack.max() > max(wide_still(self.settings), RELAXED_FROM):
            return None
        poses = np.vstack([np.zeros(3), poses.reshape(n, 3)])
        return Plan(poses, twists.reshape(n, 2), steps, slack, cost)

    def program(self) -> Program:
        """Return the solver, shared by all runs of equal settings."""
        shape = self.stages, self.tick, self.nearest
        weights = self.end, self.gather, self.heading, self.smooth, self.penalty
        return make_band_program(
            body_parts(self.robot), self.robot.limits, shape, weights
        )
