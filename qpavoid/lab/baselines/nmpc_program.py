"""Nonlinear program of NMPC and MPC-CBF in CasADi [Andersson2019]."""

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from qpavoid.model.robot import Limits
from qpavoid.types import Array

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
"""Vertices of the footprint, m; or discs that cover it: x of the centre, radius, m."""


class Keep(NamedTuple):
    """Barrier constraints: h(k) ≥ (1 − γ) h(k − 1) for every barrier h of a stage.

    Attributes:
        barriers: Returns all h (m) of the body at a pose and a disc x, y, R, symbolic.
        body: Of the robot.
        gamma: γ in (0, 1]; with 1 it is h ≥ 0.
    """

    barriers: Callable[[BodyPoints, Any, Any], list[Any]]
    body: BodyPoints
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


def polygon_barriers(vertices: BodyPoints, pose: Any, disc: Any) -> list[Any]:
    """Return the distance of the polygon from a disc, m."""
    return [polygon_distance(vertices, pose, disc[:2]) - disc[2]]


def disc_barriers(body: BodyPoints, pose: Any, disc: Any) -> list[Any]:
    """Return the distance of every disc of the body from a disc, m."""
    cos, sin = ca.cos(pose[2]), ca.sin(pose[2])
    off = [(pose[0] + x * cos - disc[0], pose[1] + x * sin - disc[1]) for x, _ in body]
    return [
        ca.sqrt(o_x**2 + o_y**2 + ROOT_FLOOR) - radius - disc[2]
        for (o_x, o_y), (_, radius) in zip(off, body, strict=True)
    ]


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
    # Outside the nearest edge, inside the least deep one.
    return ca.if_else(beyond > 0.0, ca.sqrt(square + ROOT_FLOOR), beyond)
