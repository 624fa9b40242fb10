"""QPs and scans recorded from closed loops; each QP with its certified answer.

Run: python comparisons/timing/solvers.py
"""

import math
from dataclasses import replace
from itertools import islice
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import nnls

from qpavoid.avoidance.filter import SafetyFilter
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

Scan: TypeAlias = tuple[float, float, Array]
"""Arguments of a filter call: desired v (m/s) and ω (rad/s), and points (n, 2), m."""


class RecordedProblem(NamedTuple):
    """A QP of a control loop and its certified answer."""

    problem: FilterProblem  # with exactly as many rows as asked for
    scaled: ScaledProblem  # argument of a back end: normalised, without null rows
    slack: float  # least one of the scaled rows, scaled m/s; 0 if feasible
    optimum: Array  # (2,) certified z; NaN if infeasible
    residual: float  # of its optimality conditions, scaled m/s


def record_problems(rows: int, count: int, seed: int = 0) -> list[RecordedProblem]:
    """Return ``count`` problems with ``rows`` rows each, in the order of closed loops.

    The paper's robot drives among moving discs, as :mod:`timing.loops` says. At every
    step a scan samples the facing arcs. It is so dense that at least ``rows`` of its
    echoes give a row that can matter (the filter leaves out all others), and an even
    subset of those rows is kept: a coarser scan. Every tenth scan has each echo twice,
    as sensors with double returns give, hence duplicate rows.

    Steps without so many rows are left out, and problems that are infeasible by less
    than :data:`CLEAR`. The same arguments give the same problems.
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
    moments = drive(safety, np.random.default_rng(seed))
    scans = (scan_at(safety, moment, points) for moment in moments)
    return list(islice((one for one in scans if one is not None), count))


def scan_at(safety: SafetyFilter, moment: Moment, points: int) -> Scan | None:
    """Return the scan of a moment; None if no echo gives a row."""
    echoes = scan(moment.seen, BEAMS).discs[:, :2]
    if not len(echoes) or not len(safety.problem(0.0, 0.0, echoes).b):
        return None
    beams = 4 * math.ceil(0.3 * BEAMS * max(1.0, points / len(echoes)))
    echoes = scan(moment.seen, beams).discs[:, :2]
    total = len(echoes)
    if total < points:
        return None
    nearest = int(np.hypot(*echoes.T).argmin())
    kept = echoes[(nearest + np.arange(points) * total // points) % total]
    return moment.v, moment.omega, np.ascontiguousarray(kept)


def problem_at(safety: SafetyFilter, moment: Moment, rows: int) -> FilterProblem | None:
    """Return the QP of a moment, scanned to ``rows`` rows; None if it has too few."""
    beams, found = BEAMS, 0
    while found < rows:
        if beams > max(DENSEST * rows, BEAMS):
            return None
        full = safety.problem(moment.v, moment.omega, scan(moment.seen, beams))
        found = len(full.b)
        beams = 4 * math.ceil(0.3 * beams * max(rows / max(found, 1), 1.0))
    twice = 2 if moment.step % 10 == 9 else 1
    places = np.linspace(0, found - 1, math.ceil(rows / twice)).round().astype(int)
    kept = np.repeat(places, twice)[:rows]
    return replace(full, A=full.A[kept], b=full.b[kept], obstacle=full.obstacle[kept])


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
    n, target = len(z), problem.target
    G = np.vstack([problem.normals, np.eye(n), -np.eye(n)])
    c = np.concatenate([problem.offsets, problem.lower, -problem.upper])
    best = target, float((c - G @ target).max(initial=0.0))
    for near in (1e-7, 1e-9, 1e-11):
        touched = np.flatnonzero(G @ z - c <= near)
        if not len(touched) or best[1] <= 1e-12:  # nnls aborts without columns
            break
        active = touched[nnls(G[touched].T, z - target)[0] > 0.0]
        rows = G[active]
        exact = np.linalg.lstsq(rows @ rows.T, c[active] - rows @ target, rcond=None)[0]
        tried = target + rows.T @ exact
        residual = max((c - G @ tried).max(), -exact.min(initial=0.0))
        best = min(best, (tried, float(residual)), key=lambda pair: pair[1])
    return best


def as_problem(scaled: ScaledProblem) -> FilterProblem:
    """Return the scaled problem as a problem of its own, with unit weights."""
    rows, box = (scaled.normals, scaled.offsets), (scaled.lower, scaled.upper)
    obstacle = np.arange(len(scaled.offsets))
    return FilterProblem(scaled.target, np.ones(2), *rows, *box, obstacle)
