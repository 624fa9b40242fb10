"""The exact solver and the certificate against exact fractions, linprog and qhull."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from oracles import exact_answer, exact_slack, large_answer
from problem_bank import CASES, arc_of_points, qp, random_problem, ring
from problem_bank import small_integer_problem as small_integers
from qpavoid.errors import InvalidInputError
from qpavoid.qp.exact import ROW_WIDTH, TAKEN, nearest_point
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import required_slack, solve

seeds = st.integers(0, 2**32 - 1)


def assert_solves(problem, expected, atol=1e-8):
    u, slack = expected
    solution = solve(problem)
    assert solution.status is (
        SolveStatus.RELAXED if slack > 0 else SolveStatus.OPTIMAL
    )
    assert solution.slack == pytest.approx(slack, abs=1e-9)
    assert_allclose(solution.u, u, atol=atol)
    assert solution.violation <= 1e-9 and solution.suboptimality <= 1e-9
    return solution


@pytest.mark.parametrize("case", CASES, ids=str)
def test_problem_bank(case):
    solution = assert_solves(case.problem, case.expected)
    assert solution.solver == "exact" and solution.solve_time_s > 0


@pytest.mark.parametrize("kind", [random_problem, small_integers])
@given(seeds)
def test_random_and_degenerate_problems(kind, seed):
    problem = kind(np.random.default_rng(seed))
    assert_solves(problem, exact_answer(problem))


@pytest.mark.parametrize("rows", [10, 60, 300])
@pytest.mark.parametrize("gap", [0.2, 1e-3, -0.1])
@pytest.mark.parametrize("seed", range(4))
def test_many_rows(rows, gap, seed):
    problem = qp(*ring(rows, gap, seed), desired=(0.9, 1.2))
    assert_solves(problem, large_answer(problem), atol=1e-7)


@pytest.mark.parametrize("exponent", range(-14, -2))
def test_nearly_parallel_rows(exponent):
    """A fan of rows round one direction: the answer keeps them all, and is nearest."""
    rng = np.random.default_rng(exponent + 20)
    angles = math.pi + rng.normal(size=60) * 10.0**exponent
    A = np.column_stack([np.cos(angles), np.sin(angles)])
    b = -0.3 + rng.normal(size=60) * 10.0**exponent
    solution = solve(qp(A, b))
    assert solution.status is SolveStatus.OPTIMAL
    assert (A @ solution.u >= b - 1e-11).all()
    feasible = large_answer(qp(A, b))[0]
    weighted = [1.0, 0.1] @ (np.array([solution.u, feasible]) - [0.6, 0]).T ** 2
    assert weighted[0] == pytest.approx(weighted[1], abs=1e-9)


@pytest.mark.parametrize("gap", [0.0, *10.0 ** np.arange(-17.0, -6.0)])
@pytest.mark.parametrize("share", [-1.0, 0.3, 0.7, 1.0, 1.1, 1.3, 1.6, 1.7, 2.2])
def test_two_rows_that_just_meet_or_just_miss(gap, share):
    """Whatever rounding says, there is an answer, and it violates almost nothing."""
    problem = qp([[1, 0], [-1, 0]], [0.5, -0.5 + share * gap], desired=(0.0, 0.3))
    solution = solve(problem)
    assert solution.status is not SolveStatus.FAILED
    assert solution.u == pytest.approx((0.5, 0.3), abs=2e-3)
    assert solution.slack == pytest.approx(max(share, 0) * gap / 2, abs=1e-11)


@given(seeds, st.floats(-4, 4))
@example(284, 3.0)
def test_rows_through_one_point_up_to_rounding(seed, share):
    """Six rows that share one point or miss it by some 1e-12: never without answer."""
    rng = np.random.default_rng(seed)
    A, u = rng.normal(size=(6, 2)), rng.uniform(-0.9, 0.9, 2)
    b = A @ u + share * 1e-12 * rng.uniform(0, 1, 6)
    solution = solve(qp(A, b, rng.normal(size=2)))
    assert solution.status is not SolveStatus.FAILED
    assert solution.slack <= 1e-11


def test_rows_of_opposite_directions_without_limits():
    """The common points lie 1e5 m/s away: an answer or an honest failure."""
    n = np.array([[0.99505551, 0.09932039], [0.99505802, 0.09929516]])
    A = np.vstack([n[0], n[1], -n[1], [0.99505802, 0.09929519]])
    problem = qp(
        A,
        [-2.81361892, -1.48585086, 2.09962656, -1.05791245],
        lower=(-np.inf, -np.inf),
        upper=(np.inf, np.inf),
    )
    solution = solve(problem)
    if solution.status is not SolveStatus.FAILED:
        violation = (problem.b - solution.slack - A @ solution.u).max()
        assert violation <= 1.001e-3


@given(seeds)
def test_slack_grows_with_rows_and_bounds(seed):
    rng = np.random.default_rng(seed)
    problem = random_problem(rng)
    slack = required_slack(problem)
    assert slack == pytest.approx(float(exact_slack(problem)), abs=1e-9)
    if len(problem.b):
        higher = problem.relaxed(-0.1)
        assert required_slack(higher) >= slack
        assert required_slack(problem.relaxed(slack)) <= 1e-11


def test_slack_tolerance_is_given_way_to():
    problem = qp([[1, 0], [-1, 0]], [0.4, -0.1])
    for tolerance in (1e-6, 1e-3, 0.1):
        solution = solve(problem, slack_tolerance=tolerance)
        assert solution.u[0] == pytest.approx(0.25 + tolerance)
    for bad in (0.0, -1e-3, math.nan, math.inf):
        with pytest.raises(InvalidInputError, match="slack_tolerance"):
            solve(problem, slack_tolerance=bad)


@pytest.mark.parametrize("rows", [0, 1, 7, 100, 1000])
def test_rounds_are_bounded_and_few(rows):
    """A problem of m rows names at most m + 4 half-planes; usually two to five."""
    problem = qp(*arc_of_points(rows)) if rows else qp()
    table, _ = problem.table()
    table[:, TAKEN] = -1.0
    found, *_ = nearest_point(table, 0.6, 0.0, 0.0)
    assert found and table.shape == (rows + 4, ROW_WIDTH)
    assert np.count_nonzero(table[:, TAKEN] >= 0.0) <= 5


def test_active_rows_are_named():
    problem = qp([[-1, 0.3], [-1, -0.4], [1, 0]], [-0.2, -0.1, -9.0])
    assert solve(problem).active == (0, 1)
    assert solve(qp([[-1, 0.2]], [-0.9])).active == ()
