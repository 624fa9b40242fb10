"""QPs and scans recorded from closed loops; each QP with its certified answer."""

import math
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import FilterProblem, ScaledProblem
from qpavoid.qp.solve import exact_twist, required_slack
from qpavoid.types import Array
from timing.loops import BEAMS, Moment, drive, scan

CLEAR = 1e-6
"""Scaled m/s. Problems that are infeasible by less are left out: a solver may call
them either way."""

DENSEST = 25
"""Beams for each row that is asked for, beyond which a scan is given up."""


@dataclass(frozen=True, eq=False)
class RecordedProblem:
    """A QP of a control loop and its certified answer.

    Attributes:
        problem: The QP, with exactly as many rows as asked for.
        scaled: Argument of a back end: rows normalised, null rows left out.
        slack: Least slack of the scaled rows, scaled m/s; 0 if feasible.
        optimum: (2,) certified z; NaN if infeasible.
        residual: Of its optimality conditions, scaled m/s; see :func:`polished`.
    """

    problem: FilterProblem
    scaled: ScaledProblem
    slack: float
    optimum: Array
    residual: float


class Scan(NamedTuple):
    """A scan and the twist that is desired meanwhile: the arguments of a filter call.

    Attributes:
        v: m/s.
        omega: rad/s.
        points: (N, 2) echoes, robot frame, m.
    """

    v: float
    omega: float
    points: Array


def record_problems(rows: int, count: int, seed: int = 0) -> list[RecordedProblem]:
    """Return ``count`` problems with ``rows`` rows each, in the order of closed loops.

    The paper's robot drives among moving discs, as :mod:`timing.loops`
    says. At every step a scan samples the facing arcs; an echo is a disc of radius 0
    that moves with its disc. The scan is so dense that at least ``rows`` of its echoes
    give a row that can matter (the filter leaves out all others), and an even subset
    of those rows is kept: a coarser scan. Every tenth scan has each echo twice, as
    sensors with double returns give, hence duplicate rows.

    Steps without so many rows are left out, and problems that are infeasible by less
    than :data:`CLEAR`. The same arguments give the same problems.

    Args:
        rows: Rows of each problem.
        count: How many problems.
        seed: Of discs and goals.
    """
    safety = SafetyFilter(Robot.mir100(), ahead=False)
    moments = drive(safety, np.random.default_rng(seed))
    problems = (problem_at(safety, moment, rows) for moment in moments)
    known = (answered(problem) for problem in problems if problem is not None)
    return list(islice((p for p in known if not 0.0 < p.slack <= CLEAR), count))


def record_scans(points: int, count: int, seed: int = 0) -> list[Scan]:
    """Return ``count`` scans of ``points`` echoes each, from the same closed loops.

    An even subset of a denser scan, the nearest echo always among it. Only steps at
    which some echo gives a row.
    """
    safety = SafetyFilter(Robot.mir100(), ahead=False)
    scans: list[Scan] = []
    for moment in drive(safety, np.random.default_rng(seed)):
        echoes, _ = scan(moment.seen, BEAMS)
        if not len(echoes) or not len(safety.problem(0.0, 0.0, echoes[:, :2]).b):
            continue
        beams = 4 * math.ceil(0.3 * BEAMS * max(1.0, points / len(echoes)))
        echoes, _ = scan(moment.seen, beams)
        total = len(echoes)
        if total < points:
            continue
        nearest = int(np.hypot(echoes[:, 0], echoes[:, 1]).argmin())
        places = (nearest + np.arange(points) * total // points) % total
        kept = np.ascontiguousarray(echoes[places, :2])
        scans.append(Scan(moment.v, moment.omega, kept))
        if len(scans) == count:
            break
    return scans


def problem_at(safety: SafetyFilter, moment: Moment, rows: int) -> FilterProblem | None:
    """Return the QP of a moment, scanned to ``rows`` rows; None if it has too few."""
    beams, found = BEAMS, 0
    while found < rows:
        if beams > max(DENSEST * rows, BEAMS):
            return None
        echoes, velocities = scan(moment.seen, beams)
        full = safety.problem(
            moment.v, moment.omega, Obstacles(discs=echoes, disc_velocities=velocities)
        )
        found = len(full.b)
        beams = 4 * math.ceil(0.3 * beams * max(rows / max(found, 1), 1.0))
    twice = moment.step % 10 == 9
    kept = math.ceil(rows / 2) if twice else rows
    places = np.linspace(0, found - 1, kept).round().astype(int)
    if twice:
        places = np.repeat(places, 2)[:rows]
    return replace(
        full, A=full.A[places], b=full.b[places], obstacle=full.obstacle[places]
    )


def answered(problem: FilterProblem) -> RecordedProblem:
    """Return the problem with its exact answer."""
    scaled = problem.scaled()
    normal_form = as_problem(scaled)
    slack = required_slack(normal_form)
    if slack > 0.0:
        return RecordedProblem(problem, scaled, slack, np.full(2, math.nan), 0.0)
    optimum, residual = polished(scaled, np.array(exact_twist(normal_form)))
    return RecordedProblem(problem, scaled, 0.0, optimum, residual)


def polished(problem: ScaledProblem, z: Array) -> tuple[Array, float]:
    """Return an answer with its active rows solved exactly, and its KKT residual.

    Multipliers λ of the rows that z nearly touches come from non-negative least squares
    of target + Gᵀλ = z; the rows with λ > 0 are then solved as equations. What remains
    of the optimality conditions is the greatest violation and −min λ.
    """
    n = len(z)
    G = np.vstack([problem.normals, np.eye(n), -np.eye(n)])
    c = np.concatenate([problem.offsets, problem.lower, -problem.upper])
    best = problem.target, float((c - G @ problem.target).max(initial=0.0))
    for near in (1e-7, 1e-9, 1e-11):
        touched = np.flatnonzero(G @ z - c <= near)
        if not len(touched) or best[1] <= 1e-12:  # nnls aborts without columns
            break
        multipliers = nnls(G[touched].T, z - problem.target)[0]
        active = touched[multipliers > 0.0]
        rows = G[active]
        exact = np.linalg.lstsq(
            rows @ rows.T, c[active] - rows @ problem.target, rcond=None
        )[0]
        tried = problem.target + rows.T @ exact
        residual = max((c - G @ tried).max(), -exact.min(initial=0.0))
        best = min(best, (tried, float(residual)), key=lambda pair: pair[1])
    return best


def as_problem(scaled: ScaledProblem) -> FilterProblem:
    """Return the scaled problem as a problem of its own, with unit weights."""
    return FilterProblem(
        desired=scaled.target,
        weights=np.ones(2),
        A=scaled.normals,
        b=scaled.offsets,
        lower=scaled.lower,
        upper=scaled.upper,
        obstacle=np.arange(len(scaled.offsets)),
    )
