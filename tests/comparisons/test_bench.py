"""The timing bench: what it writes."""

import csv
import json
from io import StringIO

import pytest
from rich.console import Console

from qpavoid.errors import MissingExtraError, UnknownNameError
from small_bench import SMALL
from timing import cold_start, run
from timing.report import LIMITS, Report, markdown, origins, text


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(run, "ROWS", (5, 20))
    monkeypatch.setattr(run, "QUICK", SMALL)


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.long
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
    calls = read(tmp_path / "calls.csv")
    assert len(calls) == 13 and all(float(row["least_us"]) > 0 for row in calls)
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


@pytest.mark.long
def test_what_is_not_installed_is_listed(small, tmp_path, monkeypatch):
    lacks = ["cvxpy:osqp", "qpsolvers:quadprog"]
    chosen = {name: run.CONTENDERS[name] for name in ("exact", "daqp", *lacks)}
    monkeypatch.setattr(run, "CONTENDERS", chosen)
    absent(monkeypatch, "cvxpy:osqp")
    monkeypatch.setattr("qpsolvers.available_solvers", ["daqp"])
    monkeypatch.setattr(run, "FULL", SMALL)
    for drawn in ("save_times", "save_accuracy"):
        monkeypatch.setattr(f"timing.report.{drawn}", lambda *a: None)
    report = run.bench(tmp_path, console=Console(file=StringIO()))
    assert report.absent == lacks
    assert {row["solver"] for row in report.solvers} == {"exact", "daqp"}
    said = "Not installed: cvxpy:osqp, qpsolvers:quadprog."
    assert said in (tmp_path / "report.md").read_text()
    with pytest.raises(MissingExtraError, match=r"qpavoid\[quadprog\]"):
        run.bench(tmp_path, back_ends=["qpsolvers:quadprog"])


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
    assert imported["error"] == "" and 0.0 < imported["processor_s"]
    assert (broken["seconds"], broken["error"]) == (None, "it broke")
    report = Report({}, starts=[broken])
    assert "| broken | – | – | 2 | it broke |" in markdown(report, origins({}))


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
