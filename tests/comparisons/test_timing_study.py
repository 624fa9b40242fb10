"""The timing study: recorded problems, counted answers, tables. No time is judged."""

import json
import math

import numpy as np
import pytest

from qpavoid.qp.backends import find_back_end
from timing import solvers, steps
from timing.recorded import record_problems
from timing.trials import (
    Case,
    Contender,
    Plan,
    Trials,
    judge,
    of_back_end,
    quantile,
    race,
)

SMALL = Plan(50, passes=1, budget_s=60.0, infeasible=3, scans=4, calls=2)
TINY = Plan(20, passes=1, budget_s=0.5, infeasible=2, scans=6, calls=1)


@pytest.fixture(scope="module")
def problems():
    return record_problems(20, 100)


@pytest.fixture(scope="module")
def bank(problems):
    return cases(problems)


def cases(problems):
    return [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]


def feasible(cases):
    return [case for case in cases if np.isfinite(case.answer).all()]


def contend(answer):
    return Contender(answer, np.asarray)


@pytest.mark.parametrize("rows", solvers.ROWS)
def test_problems_have_exactly_the_rows_asked_for(rows):
    found = record_problems(rows, 60)
    assert len({p.problem.A.tobytes() + p.problem.b.tobytes() for p in found}) == 60
    assert all(p.problem.A.shape == (rows, 2) for p in found)
    assert {p.slack > 0.0 for p in found} == {True, False}


def test_judge_counts_wrong_missing_and_false_answers():
    timed = Trials([0.0, 0.9e-5, 2e-5, math.nan], [1000, 2000, 4000, 3000], {1, 2, 3})
    row = judge(timed, Trials([math.inf, math.nan], [5000, 7000]))
    assert (row["problems"], row["calls"]) == (3, 4)
    assert (row["median_us"], row["max_us"], row["p99_us"]) == (2.5, 4.0, None)
    assert (row["wrong"], row["false_ok"], row["false_infeasible"]) == (1, 2, 1)
    assert row["worst_error"] == 2e-5 and row["infeasible_max_us"] == 7.0
    assert quantile(np.arange(98.0), 0.99) is None
    assert quantile(np.arange(99.0), 0.99) == pytest.approx(97.02)


def test_liars_refusers_and_raisers_are_found_out(bank):
    def raising(problem):
        raise RuntimeError("no")

    exact = find_back_end("exact").load()
    contenders = {
        "exact": of_back_end(exact),
        "liar": contend(lambda problem: np.nan_to_num(exact(problem)) + 1e-3),
        "refuser": contend(lambda problem: np.full(2, math.nan)),
        "raiser": contend(raising),
    }
    rows, count = race(contenders, bank, SMALL), len(feasible(bank))
    faults = {
        name: (row["wrong"], row["false_infeasible"], row["false_ok"])
        for name, row in rows.items()
    }
    assert faults == {
        "exact": (0, 0, 0),
        "liar": (count, 0, count + 3),
        "refuser": (0, count, 0),
        "raiser": (0, count, 0),
    }
    assert {row["calls"] for row in rows.values()} == {count}


@pytest.mark.long
def test_the_study_of_solvers(tmp_path, monkeypatch):
    monkeypatch.setattr(solvers, "ROWS", (5, 20))
    table = solvers.bench(tmp_path, SMALL, ["exact", "qpsolvers:daqp", "daqp"])
    assert "| exact |" in table and "÷ daqp at 20" in table
    origin = json.loads((tmp_path / "provenance.json").read_text())
    assert origin["settings"]["qpsolvers:daqp"]["primal_tol"] == 1e-9
    assert len((tmp_path / "solvers.csv").read_text().splitlines()) == 7


@pytest.mark.parametrize("name", sorted(steps.STEPS))
def test_a_step_is_that_of_the_filter(name):
    (row,) = steps.time_steps([30], [name], TINY)
    assert (row["step"], row["points"]) == (name, 30) and row["calls"] >= 1
    if name == steps.AHEAD:
        assert row["wrong"] is None and row["worst_error"] is None
    else:
        assert row["wrong"] == row["false_infeasible"] == 0
