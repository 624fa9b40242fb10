"""Solver timings through pytest-benchmark: ``pytest -m timing``.

Times are reported, never asserted; what is asserted is the answers. One round is one
call on the next recorded problem, so that warm starts meet what they meet in a loop.
"""

from functools import cache

import numpy as np
import pytest

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.qp.exact import relaxation
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import (
    RESIDUAL_TOLERANCE,
    SLACK_TOLERANCE,
    back_end_names,
    is_installed,
    load_back_end,
    solve,
)
from timing.recorded import record_problems, record_scans
from timing.solvers import ROWS
from timing.steps import POINTS
from timing.trials import WRONG, Case, Trials, judge, of_back_end

pytestmark = pytest.mark.timing

EXACT = ("exact", "casadi:daqp", "qpsolvers:daqp", "qpsolvers:quadprog")
"""Active-set methods that never miss an answer on these problems."""

INSTALLED = [
    name for name in back_end_names() if name != "casadi" and is_installed(name)
]


@cache
def bank(rows):
    return record_problems(rows, 100)


@pytest.mark.parametrize("rows", ROWS)
@pytest.mark.parametrize("name", INSTALLED)
def test_back_end(benchmark, name, rows):
    problems = [p for p in bank(rows) if not p.slack][:20]
    contender, trials = of_back_end(load_back_end(name)), Trials()
    cases = [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]
    turns = iter(cases)
    contender.ask(problems[0].scaled)

    def next_case():
        return (contender, next(turns)), {}

    benchmark.group = f"{rows} rows"
    benchmark.pedantic(trials.call, setup=next_case, rounds=len(cases))
    row = judge(trials, Trials())
    missed = row["false_infeasible"]
    benchmark.extra_info.update(wrong=row["wrong"], false_infeasible=missed)
    assert row["calls"] == len(problems)
    if name in EXACT:
        assert row["wrong"] == missed == 0


@pytest.mark.parametrize("rows", ROWS)
@pytest.mark.parametrize("name", INSTALLED)
def test_what_leaves_solve_holds_or_is_a_failure(name, rows):
    """An answer is the nearest twist that satisfies the rows, or a failure: NaN."""
    back_end = load_back_end(name)
    for recorded in bank(rows)[:: 20 if name == "casadi:qrqp" else 5]:
        problem = recorded.problem
        solution, expected = solve(problem, back_end), solve(problem)
        if solution.status is SolveStatus.FAILED:
            assert name not in EXACT
            assert np.isnan(solution.u).all()
            continue
        assert solution.status is expected.status
        assert solution.slack == expected.slack
        b = problem.b - relaxation(solution.slack, SLACK_TOLERANCE)
        assert (problem.A @ solution.u >= b - RESIDUAL_TOLERANCE).all()
        off = recorded.scaled.scale * (solution.u - expected.u)
        assert np.abs(off).max() <= WRONG + 1e-9


@pytest.mark.parametrize("points", POINTS)
def test_filter(benchmark, robot, points):
    alone = AvoidanceSettings(braking_room=False)
    safety = SafetyFilter(robot, alone, ahead=False)
    scans = record_scans(points, 50)
    turns = iter(scans * 10)
    benchmark.group = "SafetyFilter.filter, points"
    benchmark.pedantic(
        safety.filter, setup=lambda: (next(turns), {}), rounds=10 * len(scans)
    )
    for one in scans:
        decision = safety.filter(*one)
        expected = solve(safety.problem(*one), "qpsolvers:daqp")
        assert decision.slack == pytest.approx(expected.slack, abs=1e-9)
        np.testing.assert_allclose(decision[:2], expected.u, atol=WRONG)
