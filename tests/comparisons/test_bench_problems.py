"""The problems and scans that the timing bench records, and their marks."""

import math
from collections import Counter

import numpy as np
import pytest

from oracles import large_answer
from qpavoid.model.obstacles import Obstacles
from qpavoid.qp.problem import FilterProblem
from timing.loops import scan
from timing.recorded import (
    CLEAR,
    Mark,
    as_problem,
    classify,
    record_problems,
    record_scans,
)
from timing.run import ROWS
from timing.trials import QUICK


@pytest.fixture(scope="module")
def bank():
    return record_problems(20, QUICK.problems)


@pytest.mark.parametrize("rows", ROWS)
def test_problems_have_exactly_the_rows_asked_for_and_every_mark(rows):
    problems = record_problems(rows, QUICK.problems)
    assert len(problems) == QUICK.problems
    assert all(p.problem.A.shape == (rows, 2) for p in problems)
    assert set(Counter(p.mark for p in problems)) == set(Mark)
    assert all((p.mark is Mark.DEGENERATE) == bool(p.reasons) for p in problems)


def test_no_problem_is_recorded_twice(bank):
    assert len({p.problem.A.tobytes() + p.problem.b.tobytes() for p in bank}) == len(
        bank
    )


def test_the_seed_decides(bank):
    def data(problems):
        return [(p.problem.A.tolist(), p.problem.b.tolist()) for p in problems]

    assert data(record_problems(20, 30)) == data(bank[:30])
    assert data(record_problems(20, 30, seed=1)) != data(bank[:30])


def test_marks_and_answers_agree_with_linear_programming_and_qhull(bank):
    for recorded in bank[::2]:
        u, slack = large_answer(as_problem(recorded.scaled))
        if recorded.mark is Mark.INFEASIBLE:
            assert slack == pytest.approx(recorded.slack, rel=1e-6)
            assert recorded.slack > CLEAR
            assert np.isnan(recorded.optimum).all()
            continue
        assert slack == 0.0
        assert recorded.slack == 0.0
        assert recorded.residual < 1e-9
        np.testing.assert_allclose(recorded.optimum, u, atol=1e-7)
        moved = np.abs(u - recorded.scaled.target).max() > 1e-5
        assert not (recorded.mark is Mark.FEASIBLE and moved)
        assert not (recorded.mark is Mark.ACTIVE and not moved)


def test_every_tenth_scan_has_each_echo_twice():
    doubled = 0
    for recorded in record_problems(20, 60):
        A = recorded.problem.A
        doubled += bool((A[::2] == A[1::2]).all())
    assert 4 <= doubled <= 8


def problem(A, b, desired=(1.0, 0.0)):
    A = np.reshape(np.array(A, dtype=float), (-1, 2))
    box = np.array([1.0, 1.0])
    return FilterProblem(
        np.array(desired), np.ones(2), A, np.array(b), -box, box, np.arange(len(A))
    )


TILT = (-math.cos(1e-3), math.sin(1e-3))


@pytest.mark.parametrize(
    ("A", "b", "mark", "reasons"),
    [
        ([(-1, 0)], [-2.0], Mark.FEASIBLE, ()),
        ([(-1, 0)], [-0.5], Mark.ACTIVE, ()),
        ([(-1, 0), (1, 0)], [-0.5, 0.6], Mark.INFEASIBLE, ()),
        ([(-1, 0), (-2, 0)], [-0.5, -1.0], Mark.DEGENERATE, ("duplicate",)),
        ([(-1, 0), TILT], [-0.5, 0.5 * TILT[0]], Mark.DEGENERATE, ("parallel",)),
        ([(-1, 0), (-1e-4, 0)], [-0.5, -1.0], Mark.DEGENERATE, ("short",)),
        ([(-1, 0), (0, 0)], [-0.5, 0.2], Mark.DEGENERATE, ("short", "null")),
        (
            [(-1, 1), (-1, -1), (-1, 0.5)],
            [-0.5, -0.5, -0.5],
            Mark.DEGENERATE,
            ("corner",),
        ),
    ],
)
def test_marks(A, b, mark, reasons):
    recorded = classify(problem(A, b))
    assert (recorded.mark, recorded.reasons) == (mark, reasons)


def test_echoes_lie_on_the_nearest_disc_and_move_with_it():
    discs = np.array([(2.0, 0.0, 0.5), (4.0, 0.0, 1.5), (0.0, 3.0, 1.0)])
    velocities = np.array([(0.1, 0.0), (0.2, 0.0), (0.3, 0.0)])
    echoes, moves = scan(Obstacles(discs=discs, disc_velocities=velocities), 360)
    assert (echoes[:, 2] == 0.0).all()
    for (x, y, _), (v_x, _) in zip(echoes, moves, strict=True):
        owner = {0.1: 0, 0.2: 1, 0.3: 2}[v_x]
        centre, radius = discs[owner, :2], discs[owner, 2]
        assert np.hypot(x - centre[0], y - centre[1]) == pytest.approx(radius)
        for t in np.linspace(0.0, 0.999, 50):  # nothing in between
            gaps = np.hypot(*(discs[:, :2] - (t * x, t * y)).T) - discs[:, 2]
            assert (gaps > -1e-12).all()
    np.testing.assert_allclose(echoes[0], (1.5, 0.0, 0.0))
    np.testing.assert_allclose(echoes[moves[:, 0] == 0.3, 1].min(), 2.0)


def test_a_disc_over_the_origin_gives_no_echo():
    assert scan(Obstacles(discs=[(0.1, 0.0, 1.0)]), 360)[0].shape == (0, 3)


@pytest.mark.parametrize("points", [1, 10, 1000])
def test_scans_have_exactly_the_points_asked_for(points, robot):
    scans = record_scans(points, 5)
    assert [one.points.shape for one in scans] == [(points, 2)] * 5
    assert all(one.points.flags.c_contiguous for one in scans)


def test_scans_keep_the_nearest_echo():
    for few, many in zip(record_scans(1, 20), record_scans(100, 20), strict=True):
        assert np.hypot(*few.points[0]) <= np.hypot(*many.points.T).min() + 1e-3
