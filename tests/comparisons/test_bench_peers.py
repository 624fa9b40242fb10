"""The peers of the timing study: right where they claim to be, and truthful else."""

import contextlib
import math
import tomllib
import warnings

import numpy as np
import pytest

from places import ROOT
from qpavoid.errors import UnknownNameError
from qpavoid.qp.backend_qpsolvers import TIGHT
from timing import steps as stepping
from timing.calls import WORLDS, time_guide
from timing.contenders import CONTENDERS
from timing.figure import save_steps
from timing.peers import Daqp
from timing.recorded import Mark, polished, record_problems, softened
from timing.steps import (
    AHEAD,
    OURS,
    STEPS,
    endure,
    floors,
    machine_limits,
    one_step,
    row_evaluations,
    step_cases,
    time_steps,
)
from timing.trials import Case, Plan, of_back_end, race

PLAN = Plan(20, passes=1, budget_s=60.0, infeasible=2, scans=6, calls=1, slack_rows=20)
TINY = Plan(20, passes=1, budget_s=0.5, infeasible=2, scans=6, calls=1, slack_rows=20)

OFF = {"osqp default", "proxqp default", "piqp default", "clarabel default"}
OFF |= {"casadi:qpoases"}
"""Loose settings, and a hot start that goes astray: that is what the study shows."""

NO_WORD = {"cbfpy:elastiqp", "cbfpy:qpax"}
"""They answer infeasible problems, and have no way to say so."""


def loaded(name):
    """Return a solver; skip where it is not installed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return CONTENDERS[name].load()
        except (ImportError, UnknownNameError) as error:
            pytest.skip(f"{name} is not installed: {error}")


def test_every_extra_of_a_contender_exists_and_none_is_a_default():
    text = (ROOT / "pyproject.toml").read_text()
    project = tomllib.loads(text)["project"]
    extras = {entry.extra for entry in CONTENDERS.values() if entry.extra}
    assert extras <= set(project["optional-dependencies"])
    for peer in ("cvxpy", "cbfpy", "elastiqp", "quadprog"):
        assert not any(peer in package for package in project["dependencies"])


@pytest.fixture(scope="module")
def bank():
    problems = record_problems(5, 60)
    infeasible = [p for p in problems if p.mark is Mark.INFEASIBLE][:2]
    return [p for p in problems if p.mark is not Mark.INFEASIBLE][::6] + infeasible


def cases(problems):
    return [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]


def raced(cases):
    """Race all that are installed, and have a word for infeasible problems."""
    contenders = {}
    for name in {*CONTENDERS} - NO_WORD:
        with contextlib.suppress(pytest.skip.Exception):
            contenders[name] = of_back_end(loaded(name))
    return race(contenders, cases, PLAN)


@pytest.fixture(scope="module")
def rows(bank):
    return raced(cases(bank))


@pytest.fixture(scope="module")
def soft_rows(bank):
    return raced(cases([softened(problem) for problem in bank[-3:]]))


@pytest.mark.parametrize("name", sorted({*CONTENDERS} - NO_WORD))
def test_a_contender_is_right_and_truthful_with_two_unknowns(name, bank, rows):
    loaded(name)
    row = rows[name]
    assert row["false_infeasible"] == 0
    assert row["calls"] == len(bank) - 2 and row["infeasible_calls"] == 2
    if name not in OFF:
        assert row["wrong"] == 0
    assert row["false_ok"] == row["wrong"]


@pytest.mark.parametrize("name", sorted({*CONTENDERS} - {"exact"} - NO_WORD))
def test_a_contender_is_right_with_a_slack_as_third_unknown(name, soft_rows):
    loaded(name)
    assert soft_rows[name]["calls"] == 3
    if name not in OFF:
        assert soft_rows[name]["wrong"] == 0


@pytest.mark.parametrize("rows", [5, 100])
def test_answers_of_reference_are_certified_independently(rows):
    for recorded in record_problems(rows, 30):
        soft = softened(recorded)
        assert soft.residual < 1e-11 and soft.optimum[2] >= -1e-12
        if recorded.mark is not Mark.INFEASIBLE:
            z, residual = polished(recorded.scaled, recorded.optimum)
            assert residual < 1e-11
            np.testing.assert_allclose(z, recorded.optimum, atol=1e-9)
        else:
            assert soft.optimum[2] > 0.0


def test_a_wrong_answer_gets_no_certificate(bank):
    problem = next(p for p in bank if p.mark is Mark.ACTIVE)
    _, residual = polished(problem.scaled, problem.optimum + 1e-3)
    assert residual > 1e-5


def test_a_workspace_takes_fewer_rows_and_grows(bank):
    solver = Daqp(TIGHT["daqp"])
    for rows in (5, 3, 5, 1, 20, 5):
        problem = next(
            p for p in record_problems(rows, 30) if p.mark is not Mark.INFEASIBLE
        )
        np.testing.assert_allclose(solver(problem.scaled), problem.optimum, atol=1e-8)


# ------------------------------------------------------------------ whole steps
@pytest.mark.parametrize("name", sorted({*STEPS} - {"cbfpy"}))
def test_a_step_is_ours_whoever_makes_it(name):
    (row,) = time_steps([30], {name: STEPS[name]}, TINY)
    assert (row["step"], row["points"]) == (name, 30) and row["calls"] >= 1
    if name == AHEAD:
        assert row["wrong"] is None and row["worst_error"] is None
    else:
        assert row["wrong"] == row["false_infeasible"] == 0


def test_numpy_writes_the_rows_of_the_filter():
    step, safety = stepping.NumpyStep(np.zeros), one_step()
    for case in step_cases(100, 10):
        A, b = step.rows(case.question.points)
        problem = safety.problem(*case.question)
        np.testing.assert_allclose(A, problem.A, atol=1e-12)
        np.testing.assert_allclose(b, problem.b, atol=1e-12)


def test_steps_and_limits_are_drawn(tmp_path):
    rows = time_steps([1, 10], {name: STEPS[name] for name in (OURS, AHEAD)}, TINY)
    assert [row["target_us"] for row in rows] == [2.5, None, None, None]
    limits = machine_limits(0.01)
    assert all(value > 0.0 for value in limits.values())
    operations, bandwidth = floors(1000, limits)
    assert math.isclose(10 * operations, floors(10_000, limits)[0])
    assert bandwidth < operations
    save_steps(rows, limits, "this machine", tmp_path / "steps.png")
    assert (tmp_path / "steps.png").read_bytes()[1:4] == b"PNG"


def test_a_step_that_is_not_installed_is_left_out():
    def fail(points):
        raise ImportError

    said = []
    rows = time_steps([3], {OURS: STEPS[OURS], "peer": fail}, TINY, said.append)
    assert [row["step"] for row in rows] == [OURS]
    assert "peer is not installed" in said


@pytest.mark.long
def test_a_guide_is_timed_in_every_world():
    rows = time_guide(1.0, 2)
    assert [row["world"] for row in rows] == list(WORLDS)
    for row in rows:
        assert row["steps"] == 2 * round(1.0 / 0.02)
        assert 0.0 < row["median_us"] <= row["p99_us"] <= row["max_us"]


def test_memory_does_not_grow():
    row = endure(10, 20_000)
    assert row["calls"] == 20_000 and row["growth_mb"] < 1.0
    assert row["median_us"] <= row["p99_us"] <= row["p9999_us"] <= row["max_us"]
    assert row["row_evaluations"] == row_evaluations(row["rows"])
    assert row_evaluations(0) == 22


# ------------------------------------------------------------------ in jax, hence last
def test_cbfpy_is_right_but_answers_the_infeasible_too(bank):
    name = "cbfpy:elastiqp"
    row = race({name: of_back_end(loaded(name))}, cases(bank), PLAN)[name]
    assert row["calls"] == len(bank) - 2
    assert row["wrong"] == row["false_infeasible"] == 0
    assert row["false_ok"] == row["infeasible_calls"] == 2


def test_cbfpy_makes_our_step():
    loaded("cbfpy:elastiqp")
    (row,) = time_steps([5], {"cbfpy": STEPS["cbfpy"]}, TINY)
    assert row["calls"] >= 1 and row["wrong"] == row["false_infeasible"] == 0
