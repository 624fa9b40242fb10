"""The timing bench: what it records, counts and writes. No time is judged."""

import csv
import gc
import json
import math
import time
from collections import Counter
from io import StringIO
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from oracles import large_answer
from rich.console import Console

from qpavoid.errors import MissingExtraError, UnknownNameError
from qpavoid.model.obstacles import Obstacles
from qpavoid.qp.problem import FilterProblem
from qpavoid.qp.solve import BACK_ENDS, BackEndEntry, load_back_end
from qpavoid.study.bench import cold_start, run
from qpavoid.study.bench.loops import scan
from qpavoid.study.bench.recorded import (
    CLEAR,
    Mark,
    as_problem,
    classify,
    record_problems,
    record_scans,
)
from qpavoid.study.bench.report import LIMITS, markdown, origins, settings, text
from qpavoid.study.bench.trials import (
    QUICK,
    Plan,
    Trials,
    installed_back_ends,
    judge,
    time_back_ends,
)

SMALL = Plan(problems=50, passes=1, budget_s=60.0, infeasible=3, scans=4, calls=2)


@pytest.fixture(scope="module")
def bank():
    return record_problems(20, QUICK.problems)


def feasible(problems):
    return [p for p in problems if p.mark is not Mark.INFEASIBLE]


# ------------------------------------------------------------------ what is recorded
@pytest.mark.parametrize("rows", run.ROWS)
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


# ------------------------------------------------------------------ how it is counted
def trials(problems, answers, times):
    return Trials(list(problems), [np.array(z, dtype=float) for z in answers], times)


def test_judge_counts_wrong_missing_and_false_answers(bank):
    one, two, three = feasible(bank)[:3]
    scale = one.scaled.scale
    timed = trials(
        [one, two, three, one],
        [
            one.optimum,
            two.optimum + 0.9e-5 * scale,
            three.optimum + (0.0, 2e-5) * scale,
            (math.nan, math.nan),
        ],
        [1000, 2000, 4000, 3000],
    )
    impossible = [p for p in bank if p.mark is Mark.INFEASIBLE][:2]
    raw = trials(impossible, [(0.0, 0.0), (math.nan, math.nan)], [5000, 7000])
    row = judge("somebody", 20, timed, raw)
    assert row["back_end"] == "somebody" and row["rows"] == 20
    assert (row["problems"], row["calls"]) == (3, 4)
    assert (row["median_us"], row["max_us"]) == (2.5, 4.0)
    assert row["p99_us"] == pytest.approx(3.97)
    assert (row["wrong"], row["false_infeasible"]) == (1, 1)
    assert row["worst_error"] == pytest.approx(2e-5)
    assert (row["infeasible_calls"], row["false_ok"]) == (2, 1)
    assert row["infeasible_max_us"] == 7.0


def test_judge_says_where_nothing_was_measured():
    row = judge("nobody", 5, Trials(), Trials())
    for key in ("median_us", "p99_us", "max_us", "worst_error", "infeasible_max_us"):
        assert row[key] is None
    assert row["calls"] == row["wrong"] == row["false_ok"] == 0


def raising(problem):
    raise RuntimeError("no")


def test_an_exception_is_no_answer(bank):
    one = Trials()
    one.call(raising, bank[0])
    assert np.isnan(one.answers[0]).all() and one.times[0] > 0


def test_an_answer_that_casadi_disowns_is_none(bank):
    class Plugin:
        def __init__(self, success):
            self._buffer = SimpleNamespace(stats=lambda: {"success": success})

        def __call__(self, problem):
            return np.zeros(2)

    for success in (True, False):
        one = Trials()
        one.call(Plugin(success), bank[0])
        assert np.isfinite(one.answers[0]).all() == success


@pytest.fixture
def back_ends(monkeypatch):
    def register(**calls):
        for name, call in calls.items():
            entry = BackEndEntry(lambda call=call: call, "numpy", "")
            monkeypatch.setitem(BACK_ENDS, name, entry)

    return register


def test_liars_refusers_and_raisers_are_found_out(bank, back_ends):
    exact = load_back_end("exact")
    back_ends(
        liar=lambda problem: np.nan_to_num(exact(problem)) + 1e-3,
        refuser=lambda problem: np.full(2, math.nan),
        raiser=raising,
    )
    names = ("exact", "liar", "refuser", "raiser")
    rows = {r["back_end"]: r for r in time_back_ends(bank, names, SMALL)}
    count = len(feasible(bank))
    assert {row["calls"] for row in rows.values()} == {count}
    assert {row["infeasible_calls"] for row in rows.values()} == {3}
    faults = {
        name: (row["wrong"], row["false_infeasible"], row["false_ok"])
        for name, row in rows.items()
    }
    assert faults == {
        "exact": (0, 0, 0),
        "liar": (count, 0, 3),
        "refuser": (0, count, 0),
        "raiser": (0, count, 0),
    }


def test_every_block_is_led_in_by_the_problem_before_it(bank, back_ends):
    order = {id(p.scaled): i for i, p in enumerate(feasible(bank))}
    met = []

    def witness(scaled):
        met.append(order.get(id(scaled)))
        return np.zeros(2)

    back_ends(witness=witness)
    (row,) = time_back_ends(bank, ("witness",), SMALL)
    count = len(order)
    met = [i for i in met if i is not None]
    assert row["problems"] == count
    assert Counter(met) == Counter(
        [*range(count), *((i - 1) % count for i in range(0, count, 20))]
    )
    jumps = [(a, b) for a, b in pairwise(met) if b != (a + 1) % count]
    assert len(jumps) <= math.ceil(count / 20)


def test_a_slow_back_end_gets_fewer_problems_and_the_others_all(bank, back_ends):
    def slow(problem):
        time.sleep(0.01)
        return np.zeros(2)

    back_ends(slow=slow)
    plan = Plan(problems=50, passes=1, budget_s=0.03, infeasible=3, scans=1, calls=1)
    slow_row, exact_row = time_back_ends(bank, ("slow", "exact"), plan)
    assert 1 <= slow_row["calls"] <= 4
    assert exact_row["calls"] == len(feasible(bank))


def test_the_garbage_collector_is_off_meanwhile_and_on_again(bank, back_ends):
    seen = []
    back_ends(witness=lambda problem: seen.append(gc.isenabled()) or np.zeros(2))
    time_back_ends(bank, ("witness",), SMALL)
    assert gc.isenabled() and seen and not any(seen)


@pytest.mark.parametrize("rows", [5, 100])
def test_active_set_methods_are_never_wrong(rows):
    problems = record_problems(rows, 60)
    for row in time_back_ends(problems, ("exact", "qpsolvers:daqp"), SMALL):
        assert row["calls"] == len(feasible(problems))
        assert row["wrong"] == row["false_infeasible"] == row["false_ok"] == 0


# ------------------------------------------------------------------ what is written
@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(run, "ROWS", (5, 20))
    monkeypatch.setattr(run, "POINTS", (1, 10))
    monkeypatch.setattr(run, "QUICK", SMALL)


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_bench_writes_tables_figure_and_all_that_trust_needs(small, tmp_path):
    names = ["exact", "osqp", "casadi:qrqp", "qpsolvers:daqp"]
    console = Console(record=True, width=140, file=StringIO())
    report = run.bench(tmp_path, quick=True, back_ends=names, console=console)
    solvers = read(tmp_path / "solver_timing.csv")
    assert [(r["back_end"], r["rows"]) for r in solvers] == [
        (name, rows) for rows in ("5", "20") for name in names
    ]
    assert len(read(tmp_path / "problems.csv")) == 2 * SMALL.problems
    assert [r["points"] for r in read(tmp_path / "filter_step.csv")] == ["1", "10"]
    assert not (tmp_path / "cold_start.csv").exists()
    assert (tmp_path / "solver_timing.png").read_bytes()[1:4] == b"PNG"
    origin = json.loads((tmp_path / "provenance.json").read_text())
    assert origin["cpu"] and origin["versions"]["daqp"] != "absent"
    assert origin["settings"]["osqp"]["eps_abs"] == settings("osqp")["eps_abs"]
    assert origin["settings"]["qpsolvers:daqp"]["primal_tol"] == 1e-9
    written = (tmp_path / "report.md").read_text()
    for said in (*LIMITS, *names, origin["cpu"], origin["versions"]["osqp"], "eps_abs"):
        assert said in written
    assert report.filter[0]["target_us"] == 5.0
    printed = console.export_text()
    assert "5 rows, " in printed and "infeasible problems" in printed
    assert "qpsolvers:daqp" in printed and origin["cpu"] in printed


def test_an_unknown_or_absent_back_end_is_said_before_any_work(
    small, tmp_path, monkeypatch
):
    with pytest.raises(UnknownNameError, match="did you mean 'osqp'"):
        run.bench(tmp_path / "out", quick=True, back_ends=["exact", "osq"])
    monkeypatch.setattr("qpavoid.qp.solve.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"qpavoid\[piqp\]"):
        run.bench(tmp_path / "out", quick=True, back_ends=["qpsolvers:piqp"])
    assert not (tmp_path / "out").exists()


def test_what_is_finished_is_written_when_interrupted(small, tmp_path, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "time_filter", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run.bench(tmp_path, quick=True, back_ends=["exact"])
    assert len(read(tmp_path / "solver_timing.csv")) == 2
    assert "Limits of this comparison" in (tmp_path / "report.md").read_text()


def test_all_installed_back_ends_are_timed_once_each():
    names = installed_back_ends()
    assert names[0] == "exact" and "casadi" not in names
    assert {"osqp", "casadi:qrqp", "qpsolvers:daqp"} <= set(names)


def test_cold_starts_tell_what_failed(monkeypatch, tmp_path):
    monkeypatch.setattr(
        cold_start,
        "STARTS",
        (
            ("nothing", cold_start.NOTHING, None),
            ("import", cold_start.IMPORT, 1.0),
            ("broken", ("-c", "raise SystemExit('it broke')"), 2.0),
        ),
    )
    nothing, imported, broken = cold_start.cold_starts()
    assert nothing["seconds"] > 0 and imported["seconds"] > 0
    assert imported["error"] == ""
    assert (broken["seconds"], broken["error"]) == (None, "it broke")
    report = run.Report(("exact",), {}, starts=[broken])
    assert "| broken | – | 2 | it broke |" in markdown(report, origins(report))


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        (None, "–"),
        (1234567.8, "1,234,568"),
        (12.345, "12.3"),
        (0.0, "0"),
        (2.34e-9, "2e-09"),
        (1020, "1,020"),
        ("exact", "exact"),
    ],
)
def test_cells(value, cell):
    assert text(value) == cell
