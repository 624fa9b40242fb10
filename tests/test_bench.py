"""The timing bench: what it counts and writes. No time is judged."""

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
from qpavoid.qp.solve import load_back_end
from qpavoid.study.bench import cold_start, run
from qpavoid.study.bench.recorded import record_problems
from qpavoid.study.bench.report import (
    LIMITS,
    Report,
    markdown,
    origins,
    pivot,
    text,
)
from qpavoid.study.bench.trials import (
    BLOCK,
    QUICK,
    Case,
    Contender,
    Plan,
    Trials,
    judge,
    of_back_end,
    quantile,
    race,
)

SMALL = Plan(50, passes=1, budget_s=60.0, infeasible=3, scans=4, calls=2, slack_rows=5)


@pytest.fixture(scope="module")
def bank():
    problems = record_problems(20, QUICK.problems)
    return [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]


def feasible(cases):
    return [case for case in cases if np.isfinite(case.answer).all()]


def contend(answer):
    return Contender(answer, np.asarray)


# ------------------------------------------------------------------ how it is counted
def test_an_answer_is_compared_in_metres_and_radians(bank):
    one, trials = feasible(bank)[0], Trials()
    trials.call(contend(lambda q: one.answer + (0.0, 2e-5) * one.scale), one)
    trials.call(contend(lambda q: np.full(2, math.nan)), one)
    impossible = next(case for case in bank if np.isnan(case.answer).any())
    trials.call(contend(lambda q: np.zeros(2)), impossible)
    assert trials.errors[0] == pytest.approx(2e-5, rel=1e-6)
    assert math.isnan(trials.errors[1]) and trials.errors[2] == math.inf
    assert len(trials.cases) == 2 and min(trials.times) > 0
    assert trials.spent_s == pytest.approx(1e-9 * sum(trials.times))


def test_judge_counts_wrong_missing_and_false_answers():
    timed = Trials([0.0, 0.9e-5, 2e-5, math.nan], [1000, 2000, 4000, 3000], {1, 2, 3})
    row = judge(timed, Trials([math.inf, math.nan], [5000, 7000]))
    assert (row["problems"], row["calls"]) == (3, 4)
    assert (row["median_us"], row["max_us"]) == (2.5, 4.0)
    assert row["p99_us"] is None and row["p999_us"] is None
    assert (row["wrong"], row["false_ok"], row["false_infeasible"]) == (1, 2, 1)
    assert row["worst_error"] == 2e-5 and row["error_p99"] == pytest.approx(2e-5, 0.05)
    assert (row["infeasible_calls"], row["infeasible_max_us"]) == (2, 7.0)


def test_judge_says_where_nothing_was_measured():
    row = judge(Trials(), Trials())
    for key in ("median_us", "p99_us", "max_us", "worst_error", "infeasible_max_us"):
        assert row[key] is None
    assert row["calls"] == row["wrong"] == row["false_ok"] == 0


def test_a_table_has_no_faults_where_none_were_counted():
    row = {"median_us": 1.0, "p999_us": 2.0, "rows": 5, "calls": 200}
    faults = "wrong", "false_ok", "false_infeasible"
    counted = row | {"who": "a", "infeasible_calls": 0} | dict.fromkeys(faults, 1)
    uncounted = row | {"who": "b", "infeasible_calls": 0} | dict.fromkeys(faults)
    *_, first, second, _ = pivot("QP", [counted, uncounted], "who", "rows")
    assert first.endswith("| 0.5 % | 0.5 % | 0.5 % |")
    assert second.endswith("| – | – | – |")


def test_a_quantile_takes_enough_calls():
    assert quantile(np.arange(98.0), 0.99) is None
    assert quantile(np.arange(99.0), 0.99) == pytest.approx(97.02)
    assert quantile(np.arange(900.0), 0.999) is None
    assert quantile(np.array([3.0]), 0.5) == 3.0


def raising(problem):
    raise RuntimeError("no")


def test_an_answer_that_casadi_disowns_is_none(bank):
    class Plugin:
        def __init__(self, success):
            self._buffer = SimpleNamespace(stats=lambda: {"success": success})

        def __call__(self, problem):
            return np.zeros(2)

    for success in (True, False):
        one = Trials()
        one.call(of_back_end(Plugin(success)), bank[0])
        assert math.isnan(one.errors[0]) != success


def test_liars_refusers_and_raisers_are_found_out(bank):
    exact = load_back_end("exact")
    contenders = {
        "exact": of_back_end(exact),
        "liar": contend(lambda problem: np.nan_to_num(exact(problem)) + 1e-3),
        "refuser": contend(lambda problem: np.full(2, math.nan)),
        "raiser": contend(raising),
    }
    rows = race(contenders, bank, SMALL)
    count = len(feasible(bank))
    assert {row["calls"] for row in rows.values()} == {count}
    assert {row["infeasible_calls"] for row in rows.values()} == {3}
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


def test_every_block_is_led_in_by_the_case_before_it(bank):
    cases = feasible(bank)
    order = {id(case.question): i for i, case in enumerate(cases)}
    met = []

    def witness(question):
        met.append(order[id(question)])
        return np.zeros(2)

    row = race({"witness": contend(witness)}, cases, SMALL)["witness"]
    count = len(order)
    assert row["problems"] == count
    assert Counter(met) == Counter(
        [*range(count), *((i - 1) % count for i in range(0, count, BLOCK))]
    )
    jumps = [(a, b) for a, b in pairwise(met) if b != (a + 1) % count]
    assert len(jumps) <= math.ceil(count / BLOCK)


def test_contenders_take_turns(bank):
    said = []
    names = ("one", "two", "three")
    contenders = {
        n: contend(lambda q, n=n: said.append(n) or np.zeros(2)) for n in names
    }
    race(contenders, feasible(bank), SMALL)
    turn = (BLOCK + 1) * len(names)
    for start in range(0, 3 * turn, turn):
        assert set(said[start : start + turn]) == set(names)


def test_a_slow_contender_gets_fewer_cases_and_the_others_all(bank):
    slow = contend(lambda problem: time.sleep(0.01) or np.zeros(2))
    plan = Plan(
        50, passes=1, budget_s=0.03, infeasible=3, scans=1, calls=1, slack_rows=5
    )
    rows = race(
        {"slow": slow, "exact": of_back_end(load_back_end("exact"))}, bank, plan
    )
    assert 1 <= rows["slow"]["calls"] <= 2 * BLOCK
    assert rows["exact"]["calls"] == len(feasible(bank))


def test_the_garbage_collector_is_off_meanwhile_and_on_again(bank):
    seen = []
    witness = contend(lambda problem: seen.append(gc.isenabled()) or np.zeros(2))
    race({"witness": witness}, bank, SMALL)
    assert gc.isenabled() and seen and not any(seen)


# ------------------------------------------------------------------ what is written
@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(run, "ROWS", (5, 20))
    monkeypatch.setattr(run, "QUICK", SMALL)


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_bench_writes_tables_figures_and_all_that_trust_needs(small, tmp_path):
    names = ["exact", "osqp 1e-6", "casadi:qrqp", "qpsolvers:daqp"]
    console = Console(record=True, width=240, file=StringIO())
    report = run.bench(tmp_path, quick=True, back_ends=names, console=console)
    solvers = read(tmp_path / "solver_timing.csv")
    assert [(r["solver"], r["unknowns"], r["rows"]) for r in solvers] == [
        *((name, "2", "5") for name in names),
        *((name, "3", "5") for name in names[1:]),
        *((name, "2", "20") for name in names),
    ]
    assert len(read(tmp_path / "problems.csv")) == 3 * SMALL.problems
    assert all(float(r["residual"]) < 1e-9 for r in read(tmp_path / "problems.csv"))
    steps = read(tmp_path / "solver_steps.csv")
    whole = [(n, r) for r in ("5", "20") for n in names if n != "osqp 1e-6"]
    assert [(r["step"], r["points"]) for r in steps] == whole
    assert {r["wrong"] for r in steps} == {"0"}
    assert not (tmp_path / "cold_start.csv").exists()
    for name in ("solver_timing.png", "solver_accuracy.png"):
        assert (tmp_path / name).read_bytes()[1:4] == b"PNG"
    origin = json.loads((tmp_path / "provenance.json").read_text())
    assert origin["cpu"] and origin["versions"]["daqp"] != "not installed"
    assert origin["settings"]["osqp 1e-6"]["eps_abs"] == 1e-6
    assert origin["settings"]["qpsolvers:daqp"]["primal_tol"] == 1e-9
    written = (tmp_path / "report.md").read_text()
    for said in (*LIMITS, *names, origin["cpu"], origin["versions"]["osqp"], "eps_abs"):
        assert said in written
    printed = console.export_text()
    for said in (
        "| 2 unknowns: median µs by rows | 5 | 20 |",
        "| 3 unknowns",
        "p99.9",
        "false infeasible",
        "| exact |",
    ):
        assert said in printed
    assert len(report.solvers) == len(solvers)


def test_an_unknown_or_absent_solver_is_said_before_any_work(
    small, tmp_path, monkeypatch
):
    with pytest.raises(UnknownNameError, match="did you mean 'osqp'"):
        run.bench(tmp_path / "out", quick=True, back_ends=["exact", "osq"])
    absent(monkeypatch, "qpsolvers:piqp")
    with pytest.raises(MissingExtraError, match=r"qpavoid\[piqp\]"):
        run.bench(tmp_path / "out", quick=True, back_ends=["qpsolvers:piqp"])
    assert not (tmp_path / "out").exists()


def absent(monkeypatch, *names):
    def fail():
        raise ImportError

    for name in names:
        entry = run.CONTENDERS[name]._replace(load=fail)
        monkeypatch.setitem(run.CONTENDERS, name, entry)


def test_what_is_not_installed_is_listed(small, tmp_path, monkeypatch):
    chosen = {name: run.CONTENDERS[name] for name in ("exact", "daqp", "cvxpy:osqp")}
    monkeypatch.setattr(run, "CONTENDERS", chosen)
    absent(monkeypatch, "cvxpy:osqp")
    monkeypatch.setattr(run, "FULL", SMALL)
    for drawn in ("save_times", "save_accuracy"):
        monkeypatch.setattr(f"qpavoid.study.bench.report.{drawn}", lambda *a: None)
    report = run.bench(tmp_path, console=Console(file=StringIO()))
    assert report.absent == ["cvxpy:osqp"]
    assert {row["solver"] for row in report.solvers} == {"exact", "daqp"}
    assert "Not installed: cvxpy:osqp." in (tmp_path / "report.md").read_text()


def test_what_is_finished_is_written_when_interrupted(small, tmp_path, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "time_steps", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run.bench(tmp_path, quick=True, back_ends=["exact"])
    assert len(read(tmp_path / "solver_timing.csv")) == 2
    assert "Limits of this comparison" in (tmp_path / "report.md").read_text()


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
    report = Report({}, starts=[broken])
    assert "| broken | – | 2 | it broke |" in markdown(report, origins({}))


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
