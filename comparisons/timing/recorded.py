"""QPs and scans recorded from closed loops; each QP with its certified answer.

One robot drives among moving discs, by the one-step filter's answer to a scan of them.

Run: python comparisons/timing/solvers.py
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import nnls

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import FilterProblem, ScaledProblem
from qpavoid.qp.solve import exact_twist, required_slack
from qpavoid.types import Array, Pose, Twist

DT, STEPS, NUMBER = 0.05, 100, 8
"""s, control step; steps after which a loop ends, if not at a contact; discs."""

ARENA = 4.0
"""m; a disc that is farther away in x or y comes back on the other side."""

BEAMS = 720
"""Of the scan that drives the robot; other scans start from as many."""

CLEAR = 1e-6
"""Scaled m/s. Problems that are infeasible by less are left out: a solver may call
them either way."""

DENSEST = 25
"""Beams for each row that is asked for, beyond which a scan is given up."""

Scan: TypeAlias = tuple[float, float, Array]
"""Arguments of a filter call: desired v (m/s) and ω (rad/s), and points (n, 2), m."""


class Moment(NamedTuple):
    """Arguments of the filter at one control step."""

    v: float  # desired, m/s
    omega: float  # desired, rad/s
    seen: Obstacles  # discs with their velocities, robot frame
    step: int  # number of the control step in its loop


def random_discs(rng: np.random.Generator) -> Obstacles:
    """Return discs of 0.15 to 0.5 m radius at up to 0.8 m/s round the origin."""
    bearing, course = rng.uniform(0.0, 2 * math.pi, (2, NUMBER))
    distance = rng.uniform(2.0, ARENA, NUMBER)
    speed, radius = rng.uniform(0.0, 0.8, NUMBER), rng.uniform(0.15, 0.5, NUMBER)
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    velocities = np.column_stack([speed * np.cos(course), speed * np.sin(course)])
    return Obstacles(discs=np.column_stack([x, y, radius]), disc_velocities=velocities)


def moved(discs: Obstacles, pose: Pose) -> Obstacles:
    """Return the discs a control step later, within the arena round a pose."""
    places = discs.discs
    places[:, :2] += DT * discs.disc_velocities - pose[:2]
    places[:, :2] = (places[:, :2] + ARENA) % (2 * ARENA) - ARENA + pose[:2]
    return Obstacles(discs=places, disc_velocities=discs.disc_velocities)


def drive(safety: SafetyFilter, rng: np.random.Generator) -> Iterator[Moment]:
    """Drive the filter's robot towards goals among discs, loop after loop, for ever.

    What it drives is the filter's own answer to a scan of the discs. The moments of one
    loop follow each other; a new loop starts after :data:`STEPS` or at a contact.
    """
    while True:
        pose, discs = (0.0, 0.0, 0.0), random_discs(rng)
        goal = rng.uniform(-ARENA, ARENA, 2)
        for step in range(STEPS):
            seen = discs.seen_from(pose)
            v, omega = towards(goal, pose)
            yield Moment(v, omega, seen, step)
            decision = safety.filter(v, omega, scan(seen, BEAMS))
            if decision.clearance < 0.0:
                break
            pose = arc(*pose, decision.v, decision.omega, DT)
            discs = moved(discs, pose)


def towards(goal: Array, pose: Pose) -> Twist:
    """Return a desired twist, m/s and rad/s: turn to the goal, and drive past it."""
    bearing = math.atan2(goal[1] - pose[1], goal[0] - pose[0])
    error = wrap_angle(bearing - pose[2])
    return 0.8 * max(math.cos(error), 0.0), min(max(2.0 * error, -1.2), 1.2)


def scan(seen: Obstacles, beams: int) -> Obstacles:
    """Return the nearest echoes of evenly spaced beams from the robot's origin.

    They are discs of radius 0 in the order of the bearing, with the velocities of
    those seen. A disc that covers the origin gives no echo. With a multiple of 4
    beams, two are exactly abeam of the axle.
    """
    bearing = 2 * math.pi * np.arange(beams) / beams
    beam = np.column_stack([np.cos(bearing), np.sin(bearing)])
    along = beam @ seen.discs[:, :2].T
    tangent = (seen.discs[:, :2] ** 2).sum(axis=1) - seen.discs[:, 2] ** 2
    root = along**2 - tangent
    hit = (root >= 0.0) & (along > 0.0) & (tangent > 0.0)
    ranges = np.where(hit, along - np.sqrt(np.maximum(root, 0.0)), math.inf)
    disc, shortest = ranges.argmin(axis=1), ranges.min(axis=1)
    echo = shortest < math.inf
    points = beam[echo] * shortest[echo, None]
    return Obstacles(
        discs=np.insert(points, 2, 0.0, axis=1),
        disc_velocities=seen.disc_velocities[disc[echo]],
    )


class RecordedProblem(NamedTuple):
    """A QP of a control loop and its certified answer."""

    problem: FilterProblem  # with exactly as many rows as asked for
    scaled: ScaledProblem  # argument of a back end: normalised, without null rows
    slack: float  # least one of the scaled rows, scaled m/s; 0 if feasible
    optimum: Array  # (2,) certified z; NaN if infeasible
    residual: float  # of its optimality conditions, scaled m/s


def record_problems(rows: int, count: int, seed: int = 0) -> list[RecordedProblem]:
    """Return ``count`` problems with ``rows`` rows each, in the order of closed loops.

    The paper's robot drives among moving discs, as :func:`drive` says. At every
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
