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
from rich.console import Console

from qpavoid.errors import MissingExtraError, UnknownNameError
from qpavoid.qp.solve import BACK_ENDS, BackEndEntry, load_back_end
from qpavoid.study.bench import cold_start, run
from qpavoid.study.bench.recorded import (
    Mark,
    record_problems,
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
