"""One call for all back ends: relax if infeasible, solve, certify."""

import math
from time import perf_counter

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.qp.backends import BackEnd, find_back_end
from qpavoid.qp.exact import least_slack, nearest_point, relaxation, solve_exactly
from qpavoid.qp.problem import FilterProblem, Solution, SolveStatus

RESIDUAL_TOLERANCE = 1e-6
"""Greatest violation (m/s) and suboptimality of a certified answer."""

AGREEMENT = 1e-5
"""Greatest distance of an answer from the exact one, scaled m/s: where rows are nearly
parallel, an answer can pass all residuals and still be farther off."""

ACTIVE = 1e-7
"""m/s; residual below which a row counts as active."""

SLACK_TOLERANCE = 1e-3
"""m/s; see :func:`qpavoid.qp.exact.relaxation`."""


def solve(
    problem: FilterProblem,
    solver: str | BackEnd = "exact",
    slack_tolerance: float = SLACK_TOLERANCE,
) -> Solution:
    """Solve a problem and certify the answer.

    If infeasible, all rows are relaxed; see :func:`qpavoid.qp.exact.relaxation`. The
    exact method always computes the slack, so that no back end gets an infeasible
    problem, and all agree.

    Args:
        problem: The QP.
        solver: Name of a back end, or a loaded one, which keeps its workspace.
        slack_tolerance: m/s, positive; see :func:`qpavoid.qp.exact.relaxation`.

    Raises:
        UnknownNameError: No back end of that name.
        MissingExtraError: The back end's package is not installed.
        InvalidInputError: The slack tolerance is not positive.
    """
    if not 0.0 < slack_tolerance < math.inf:
        raise InvalidInputError("slack_tolerance must be positive")
    back_end = find_back_end(solver).load() if isinstance(solver, str) else solver
    started = perf_counter()
    slack = required_slack(problem)
    relaxed = problem
    if 0.0 < slack < math.inf:
        relaxed = problem.relaxed(relaxation(slack, slack_tolerance))
    v, omega = answer(back_end, relaxed)
    solve_time = perf_counter() - started
    violation, suboptimality = relaxed.certify(v, omega)
    holds = max(violation, suboptimality) <= RESIDUAL_TOLERANCE and agrees(
        relaxed, v, omega
    )
    status = SolveStatus.RELAXED if slack > 0 else SolveStatus.OPTIMAL
    gap = np.abs(relaxed.A @ (v, omega) - relaxed.b)
    return Solution(
        u=np.array([v, omega]) if holds else np.full(2, math.nan),
        status=status if holds else SolveStatus.FAILED,
        slack=slack,
        violation=violation,
        suboptimality=suboptimality,
        active=tuple(np.flatnonzero(gap <= ACTIVE).tolist()) if holds else (),
        solver=solver if isinstance(solver, str) else type(solver).__name__,
        solve_time_s=solve_time,
    )


def required_slack(problem: FilterProblem) -> float:
    """Return the least slack, m/s, with which the problem is feasible."""
    rows, least = problem.table()
    z_1, z_2 = (problem.desired * np.sqrt(problem.weights)).tolist()
    nearest = nearest_point(rows, z_1, z_2, 0.0)
    if nearest.found and least <= 0.0:
        return 0.0
    return least_slack(rows, max(least, nearest.required), z_1, z_2)


def exact_twist(problem: FilterProblem) -> tuple[float, float]:
    """Return the exact solution; see :func:`qpavoid.qp.exact.solve_exactly`."""
    rows, _ = problem.table()
    solved = solve_exactly(rows, problem.terms, SLACK_TOLERANCE)
    return solved.v, solved.omega


def agrees(problem: FilterProblem, v: float, omega: float) -> bool:
    """Return whether a twist is within :data:`AGREEMENT` of the exact solution."""
    v_exact, omega_exact = exact_twist(problem)
    scale_v, scale_omega = np.sqrt(problem.weights)
    off = max(abs(v - v_exact) * scale_v, abs(omega - omega_exact) * scale_omega)
    return bool(off <= AGREEMENT)


def answer(back_end: BackEnd, problem: FilterProblem) -> tuple[float, float]:
    """Return the back end's twist for a feasible problem, clipped to the limits.

    Without rows the limits alone decide, and no back end is called. If it raises, the
    answer is NaN, which no certificate passes.
    """
    scaled = problem.scaled()
    if not len(scaled.offsets):
        v, omega = np.clip(problem.desired, problem.lower, problem.upper).tolist()
        return v, omega
    try:
        u = np.asarray(back_end(scaled), dtype=np.float64).reshape(2) / scaled.scale
    except KeyboardInterrupt:
        raise
    except BaseException:  # SystemExit, too: a back end must not end the control loop
        return math.nan, math.nan
    v, omega = np.clip(u, problem.lower, problem.upper).tolist()
    return v, omega
