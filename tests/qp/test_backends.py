"""Every back end on the whole problem bank, and what happens when one fails."""

import dataclasses
import math

import numpy as np
import pytest
import qpsolvers
from numpy.testing import assert_allclose

from problem_bank import CASES, arc_of_points, qp, random_problem, ring
from qpavoid.errors import UnknownNameError
from qpavoid.qp.backends import back_end_names, find_back_end, is_installed
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import solve

SHIPPED = (
    *("exact", "osqp", "casadi", "casadi:qrqp", "casadi:osqp", "casadi:daqp"),
    *("qpsolvers:daqp", "qpsolvers:osqp"),
)
"""Installed with the package: they must answer, not only be honest."""

HARD = {
    (name, "1000 rows of a scan")
    for name in ("osqp", "qpsolvers:osqp", "casadi", "casadi:qrqp", "casadi:osqp")
}
"""Problems that a back end may report as failed: nearly parallel or very many rows."""

NAMES = [
    pytest.param(
        name,
        marks=pytest.mark.skipif(
            not is_installed(name), reason=f"{name} not installed"
        ),
    )
    for name in back_end_names()
]
others = pytest.mark.parametrize("name", NAMES[1:])


def slow_at_nonsense(parameter):
    """Put off the one that takes seconds over NaN."""
    slow = parameter.values[0] == "qpsolvers:proxqp"
    marks = (*parameter.marks, *([pytest.mark.slow] if slow else []))
    return pytest.param(*parameter.values, marks=marks)


def pairs():
    for parameter in NAMES:
        name = parameter.values[0]
        for case in CASES:
            slow = name in ("casadi", "casadi:qrqp") and len(case.problem.b) >= 1000
            marks = (*parameter.marks, *([pytest.mark.slow] if slow else []))
            yield pytest.param(name, case, marks=marks, id=f"{name}-{case}")


def check(solution, expected, name, hard=False):
    """The right answer, or an honest failure where failing is allowed."""
    u, slack = expected
    if solution.status is SolveStatus.FAILED:
        assert name not in SHIPPED or hard
        assert np.isnan(solution.u).all() and solution.active == ()
        return
    tolerance = 1e-6 if name in SHIPPED else 1e-5
    assert_allclose(solution.u, u, atol=tolerance)
    assert solution.slack == pytest.approx(slack, abs=1e-8)
    assert solution.status is (
        SolveStatus.RELAXED if slack > 0 else SolveStatus.OPTIMAL
    )
    assert max(solution.violation, solution.suboptimality) <= 1e-6


@pytest.mark.parametrize(("name", "case"), list(pairs()))
def test_problem_bank(name, case):
    solution = solve(case.problem, name)
    check(solution, case.expected, name, hard=(name, case.name) in HARD)
    assert solution.solver == name


@others
def test_a_workspace_is_reused_while_rows_come_and_go(name):
    """One object for rows growing and shrinking; right every time."""
    back_end, rng = find_back_end(name).load(), np.random.default_rng(11)
    for rows in (0, 3, 40, 2, 100, 0, 1, 7, 4, 5, 8, 9, 1, 130, 3):
        problem = qp(*ring(rows, 0.05, rows)) if rows else qp(desired=(2.0, 0.3))
        for desired in (rng.normal(size=2), rng.normal(size=2)):
            moved = qp(problem.A, problem.b, desired)
            exact = solve(moved)
            check(solve(moved, back_end), (exact.u, exact.slack), name)


@others
def test_random_problems_with_one_workspace(name):
    """Harder than any robot's: weights 1000 : 1, slivers. Few may fail, none lie."""
    back_end, rng = find_back_end(name).load(), np.random.default_rng(12)
    failed = 0
    for _ in range(60):
        problem = random_problem(rng)
        exact, solution = solve(problem), solve(problem, back_end)
        check(solution, (exact.u, exact.slack), name, hard="daqp" not in name)
        failed += solution.status is SolveStatus.FAILED
    assert failed <= (3 if name in SHIPPED else 6)


@pytest.mark.parametrize("name", [slow_at_nonsense(n) for n in NAMES[1:]])
def test_right_again_after_nonsense(name):
    """NaN, infinities and an infeasible problem leave nothing behind."""
    back_end, good = find_back_end(name).load(), qp(*arc_of_points(5))
    exact = solve(good)
    check(solve(good, back_end), (exact.u, exact.slack), name)
    for normals, offsets, target in (
        ([[math.nan, 0.0]] * 5, [0.0] * 5, [0.6, 0.0]),
        ([[1.0, 0.0]] * 5, [math.nan] * 5, [0.6, 0.0]),
        ([[1.0, 0.0]] * 5, [0.0] * 5, [math.nan, 0.0]),
        ([[1.0, 0.0], [-1.0, 0.0]], [0.5, 0.5], [0.6, 0.0]),
    ):
        broken = dataclasses.replace(
            good.scaled(),
            target=np.array(target),
            normals=np.array(normals),
            offsets=np.array(offsets),
        )
        try:
            back_end(broken)
        except Exception as error:  # whatever it raises: the next call counts
            print(f"{name}: {error!r}")
        check(solve(good, back_end), (exact.u, exact.slack), name)


@pytest.mark.parametrize("b", [1e-15, 1e-13, 5e-13, 2e-12, 1e-11])
@pytest.mark.parametrize("name", ["osqp", "casadi", "qpsolvers:daqp"])
def test_a_slack_of_rounding_size_is_the_same_for_all(name, b):
    """A null row that fails by almost nothing: relaxed for all, or for none."""
    problem = qp([[0, 0], [-1, 0]], [b, -0.2])
    exact, solution = solve(problem), solve(problem, name)
    assert solution.status is exact.status
    assert_allclose(solution.u, exact.u, atol=1e-6)


def test_any_solver_that_qpsolvers_finds_is_taken(monkeypatch):
    monkeypatch.setattr(qpsolvers, "available_solvers", ["daqp", "brand_new"])
    monkeypatch.setattr(
        qpsolvers, "solve_qp", lambda *args, lb, ub, solver: np.array([0.1, 0.2])
    )
    back_end = find_back_end("qpsolvers:brand_new").load()
    problem = qp([[-1.0, 0.3]], [-0.2])
    np.testing.assert_array_equal(back_end(problem.scaled()), [0.1, 0.2])
    with pytest.raises(UnknownNameError, match="qpsolvers:older"):
        find_back_end("qpsolvers:older")
