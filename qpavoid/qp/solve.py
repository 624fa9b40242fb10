"""One call for all back ends: relax if infeasible, solve, certify. Their registry."""

import math
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from qpavoid.errors import InvalidInputError, MissingExtraError, UnknownNameError
from qpavoid.qp.exact import least_slack, nearest_point, relaxation, solve_exactly
from qpavoid.qp.problem import FilterProblem, ScaledProblem, Solution, SolveStatus
from qpavoid.types import Array

RESIDUAL_TOLERANCE = 1e-6
"""Greatest violation (m/s) and suboptimality of a certified answer."""

AGREEMENT = 1e-5
"""Greatest distance of an answer from the exact one, scaled m/s: where rows are nearly
parallel, an answer can pass all residuals and still be farther off."""

ACTIVE = 1e-7
"""m/s; residual below which a row counts as active."""

SLACK_TOLERANCE = 1e-3
"""m/s; see :func:`qpavoid.qp.exact.relaxation`."""


class BackEnd(Protocol):
    """Solver of feasible scaled problems; it may keep its workspace between calls."""

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z; anything, NaN too, if the solver failed: it is certified."""
        ...


class BackEndEntry(NamedTuple):
    """Registry entry of a back end: loader, required module, extra that installs it."""

    load: Callable[[], BackEnd]
    module: str
    extra: str


def _exact() -> BackEnd:
    def project(problem: ScaledProblem) -> Array:
        target_1, target_2 = problem.target.tolist()
        p = nearest_point(problem.table, target_1, target_2, 0.0)
        return np.array([p.z_1, p.z_2] if p.found else [math.nan, math.nan])

    return project


def _load(kind: str, *solver: str) -> BackEnd:
    """Return a fresh ``BACK_END`` of the module ``qpavoid.qp.backend_kind``."""
    made: BackEnd = import_module(f"qpavoid.qp.backend_{kind}").BACK_END(*solver)
    return made


BACK_ENDS = {
    "exact": BackEndEntry(_exact, "numpy", ""),
    "osqp": BackEndEntry(partial(_load, "osqp"), "osqp", ""),
    "casadi": BackEndEntry(partial(_load, "casadi", "qrqp"), "casadi", ""),
    **{
        f"casadi:{plugin}": BackEndEntry(partial(_load, "casadi", plugin), "casadi", "")
        for plugin in ("qrqp", "osqp", "daqp", "piqp")
    },
    **{
        f"qpsolvers:{name}": BackEndEntry(
            partial(_load, "qpsolvers", name), module, extra
        )
        for name, module, extra in (
            ("daqp", "daqp", ""),
            ("osqp", "osqp", ""),
            ("piqp", "piqp", "piqp"),
            ("proxqp", "proxsuite", "proxqp"),
            ("clarabel", "clarabel", "clarabel"),
            ("highs", "highspy", "highs"),
            ("scs", "scs", "scs"),
            ("quadprog", "quadprog", "quadprog"),
        )
    },
}
_MODULES = {
    file.stem.removeprefix("backend_")
    for file in Path(__file__).parent.glob("backend_*.py")
}
BACK_ENDS |= {
    kind: BackEndEntry(partial(_load, kind), kind, kind)
    for kind in sorted(_MODULES - {name.partition(":")[0] for name in BACK_ENDS})
}
"""All back ends by name. A module ``backend_NAME`` that is not named above is a back
end of that name, package and extra."""


def back_end_names() -> tuple[str, ...]:
    """Return the names of all back ends, installed or not; the first is the default.

    In addition ``qpsolvers:<name>`` is any other solver that qpsolvers finds.
    """
    return tuple(BACK_ENDS)


def is_installed(name: str) -> bool:
    """Return whether a back end's package is installed, without importing it."""
    return find_spec(BACK_ENDS[name].module) is not None


def find_back_end(name: str) -> BackEndEntry:
    """Return the entry of a known and installed back end.

    Raises:
        UnknownNameError: No such back end; the message lists them.
        MissingExtraError: Its package is absent; the message names the extra.
    """
    kind, _, solver = name.partition(":")
    if kind == "qpsolvers" and name not in BACK_ENDS:
        import qpsolvers

        if solver in qpsolvers.available_solvers:
            return BackEndEntry(partial(_load, "qpsolvers", solver), "qpsolvers", "")
    if name not in BACK_ENDS:
        raise UnknownNameError("back end", name, BACK_ENDS)
    if not is_installed(name):
        raise MissingExtraError(f"back end {name!r}", BACK_ENDS[name].extra)
    return BACK_ENDS[name]


def load_back_end(name: str) -> BackEnd:
    """Return a fresh back end by name; errors as :func:`find_back_end`."""
    return find_back_end(name).load()


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
    name = solver if isinstance(solver, str) else type(solver).__name__
    back_end = load_back_end(solver) if isinstance(solver, str) else solver
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
        solver=name,
        solve_time_s=solve_time,
    )


def required_slack(problem: FilterProblem) -> float:
    """Return the least slack, m/s, with which the problem is feasible."""
    rows, least = problem.table()
    z_1, z_2 = (problem.desired * np.sqrt(problem.weights)).tolist()
    nearest = nearest_point(rows, z_1, z_2, 0.0)
    if nearest.found and least <= 0.0:
        return 0.0
    return least_slack(rows, max(least, nearest.wanted), z_1, z_2)


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
