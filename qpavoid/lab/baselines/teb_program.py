"""Nonlinear program of the timed elastic band in CasADi."""

import math
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from qpavoid.lab.baselines.nmpc import later
from qpavoid.lab.baselines.nmpc_program import (
    IPOPT,
    BodyPoints,
    Program,
    limited_by,
    polygon_distance,
)
from qpavoid.model.robot import Limits
from qpavoid.types import Array, Pose

OPTIONS = {**IPOPT, "mu_strategy": "monotone", "nlp_scaling_method": "none"}
"""IPOPT's options; from the last band they take two thirds of NMPC's iterations."""


LONGEST_TICKS = 3.0
"""Greatest ΔT in ticks: a longer one could skip a moving obstacle."""

SLOWEST_GUESS = 0.1
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
    body: BodyPoints, limits: Limits, shape: Shape, weights: Weights
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
        there = discs[:2, i] + times[k] * discs[3:, i]
        room.append(polygon_distance(body, poses[:, k], there) - discs[2, i] + slack[k])
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
    speed = max(min(limits.v_max, limits.wheel_speed), SLOWEST_GUESS)
    times = np.abs(turns) / max(limits.omega_max, SLOWEST_GUESS)
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
