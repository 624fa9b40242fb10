"""The report of the bench: tables, files, and what a reader must know to trust them."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from qpavoid.lab.simulation.log import provenance
from qpavoid.lab.study.tables import markdown_table, write_csv
from timing.figure import save_accuracy, save_times
from timing.recorded import PENALTY, Mark
from timing.trials import BLOCK, WRONG, Row, Value

TIMES = {
    "calls": "calls",
    "median_us": "median µs",
    "p99_us": "p99",
    "p999_us": "p99.9",
    "max_us": "max",
}
FAULTS = {
    "wrong": "wrong",
    "false_ok": "false ok",
    "false_infeasible": "false infeasible",
    "worst_error": "worst error",
}
RAW = {"infeasible_calls": "infeasible calls", "infeasible_max_us": "their max µs"}
SOLVER_COLUMNS = {"solver": "solver", **TIMES, **FAULTS, **RAW}
STEP_COLUMNS = {"step": "whole step", "points": "points", **TIMES, **FAULTS}
CALL_COLUMNS = {
    "call": "a call of the filter",
    "points": "points",
    "median_us": "median µs",
    "least_us": "least",
}
START_COLUMNS = {
    "start": "fresh process",
    "seconds": "s",
    "processor_s": "of the processor",
    "target_s": "target: ≤ s",
    "error": "error",
}

LIMITS = (
    "Wall times of one machine, with whatever else ran on it: trust the ratios. From "
    "run to run medians move by tens of percent, maxima by much more. A quantile for "
    "which there were too few calls is left out.",
    "A call goes from numpy arrays (normalised rows) to a numpy answer and "
    "includes what the interface needs: filling parameters, sparse matrices, with "
    "qpsolvers and 'afresh' a new workspace every time. It excludes scaling, "
    "relaxation and certificate, which are ours and the same for all; whole steps "
    "include them.",
    "exact solves two unknowns and nothing else; the others are general solvers.",
    "The reference: the active rows of the exact method's answer (of DAQP's with three "
    "unknowns) are solved as equations, and certified by the residual of the "
    "optimality conditions alone, whose greatest value stands above.",
    "Three unknowns: the third is a slack of all rows, m/s, at a cost of "
    f"{PENALTY:g} s², scaled to a projection with unit rows (which favours first-order "
    "methods).",
    f"wrong: an answer that the solver claims, farther than {WRONG:g} (m/s, rad/s) "
    "from the certified one. false ok: it says success and the answer is wrong or the "
    "problem infeasible. false infeasible: no answer (failure status, NaN, exception) "
    "to a feasible problem. Counted in calls, not in problems.",
    "Infeasible problems are handed over raw only here: qpavoid.solve relaxes first, "
    "certifies every answer, and turns a wrong one into a status. Whole steps are "
    "timed on scans that need no relaxation.",
    "ProxQP's iterations are capped (see its settings), which cost it no answer where "
    "that was compared: with 1000 outer ones one infeasible problem of 1000 rows takes "
    "minutes.",
    "cbfpy gets the same rows as barriers of ż = u at z = 0, and the limits as further "
    "ones; but every row may be broken at a cost of 1000 a unit, and it has no status: "
    "all its finite answers count as claims.",
    "cvxpy: all data are parameters (DPP), the problem is compiled once for a size.",
    "A slow solver gets fewer problems, of all blocks alike: fewer calls.",
    f"Solvers take turns in blocks of {BLOCK} successive problems in random order; a "
    "call on the problem before each block is not counted; caches are hot, the garbage "
    "collector is off, the process keeps to one core. In a control loop, calls come "
    "colder. Reading the clock (about 0.05 µs) is in every time.",
    "One robot (MiR100 with tip), one setting of weights and gains, one kind of scene: "
    "discs that move straight on. Null rows never reach a solver.",
)


@dataclass
class Report:
    """What a bench has measured so far.

    Attributes:
        plan: How much was to be measured.
        settings: Of each solver; what is not named is its default.
        absent: Solvers that are not installed.
        solvers: One row for each number of unknowns and rows, and solver.
        problems: One row for each recorded problem.
        steps: One row for each number of points and back end.
        starts: One row for each cold start.
        calls: One row for each kind of call of the filter.
    """

    plan: Mapping[str, Value]
    settings: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)
    solvers: list[Row] = field(default_factory=list)
    problems: list[Row] = field(default_factory=list)
    steps: list[Row] = field(default_factory=list)
    starts: list[Row] = field(default_factory=list)
    calls: list[Row] = field(default_factory=list)


def write_report(report: Report, folder: Path) -> None:
    """Write everything that has been measured; figures when all has been.

    ``solver_timing.csv``, ``problems.csv``, ``solver_steps.csv``, ``cold_start.csv``,
    ``calls.csv``, ``provenance.json``, ``report.md``, ``solver_timing.png``,
    ``solver_accuracy.png``.
    """
    origin = origins(report.plan) | {"settings": report.settings}
    tables = {
        "solver_timing": report.solvers,
        "problems": report.problems,
        "solver_steps": report.steps,
        "cold_start": report.starts,
        "calls": report.calls,
    }
    write_tables(folder, tables, origin)
    (folder / "report.md").write_text(markdown(report, origin), encoding="utf-8")
    if report.steps:
        machine = machine_line(origin)
        save_times(report.solvers, machine, folder / "solver_timing.png")
        save_accuracy(report.solvers, machine, folder / "solver_accuracy.png")


def write_tables(
    folder: Path, tables: Mapping[str, Sequence[Row]], origin: Mapping[str, Any]
) -> None:
    """Write a CSV file for each table that has rows, and ``provenance.json``."""
    folder.mkdir(parents=True, exist_ok=True)
    said = json.dumps(origin, indent=1, ensure_ascii=False, default=dict)
    (folder / "provenance.json").write_text(said + "\n", encoding="utf-8")
    for name, rows in tables.items():
        if rows:
            write_csv(folder / f"{name}.csv", rows)


def origins(plan: Mapping[str, Value]) -> dict[str, Any]:
    """Return machine, versions of all that is installed, and plan."""
    origin = provenance()
    names = "piqp proxsuite clarabel highspy scs quadprog cvxpy cbfpy elastiqp qpax jax"
    origin["versions"] |= {name: _version(name) for name in names.split()}
    return origin | {"plan": dict(plan)}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def machine_line(origin: Mapping[str, Any]) -> str:
    """Return the machine in a line, for captions."""
    versions = origin["versions"]
    return (
        f"{origin['cpu']}, Python {origin['python']}, numpy {versions['numpy']}, "
        f"numba {versions['numba']}"
    )


def pivot(title: str, rows: Sequence[Row], who: str, size: str) -> list[str]:
    """Return a table for a README: medians by size, and all faults in percent.

    Args:
        title: Of the first column.
        rows: Results; several for each of ``who``.
        who: Column of the names.
        size: Column of the sizes.
    """
    sizes = list(dict.fromkeys(row[size] for row in rows))
    columns = {who: f"{title}: median µs by {size}"}
    columns |= {f"{n}": f"{n:,}" for n in sizes}
    columns |= {"p999": f"p99.9 at {sizes[-1]:,}"} | dict(list(FAULTS.items())[:3])
    table: list[Row] = []
    for name in dict.fromkeys(row[who] for row in rows):
        own = [row for row in rows if row[who] == name]
        calls = total(own, "calls")
        every = calls + total(own, "infeasible_calls")
        last = own[-1]["p999_us"] if own[-1][size] == sizes[-1] else None
        asked = {"wrong": calls, "false_ok": every, "false_infeasible": calls}
        shares: Row = {key: percent(total(own, key), n) for key, n in asked.items()}
        shares |= {key: None for key in asked if all(row[key] is None for row in own)}
        medians = {f"{row[size]}": row["median_us"] for row in own}
        table.append({who: name, "p999": last, **medians, **shares})
    return table_lines(columns, table)


def total(rows: Iterable[Row], key: str) -> float:
    """Return the sum of a column."""
    return sum(float(row[key] or 0) for row in rows)


def percent(part: float, whole: float) -> str:
    """Return a share as it stands in a table; 0 only if there is none at all."""
    share = 100.0 * part / max(whole, 1.0)
    return f"{share:.2g} %".replace("1e+02", "100") if part else "0"


def table_lines(columns: Mapping[str, str], rows: Iterable[Row]) -> list[str]:
    """Return a Markdown table, with an empty line after it."""
    numbers = [head for key, head in columns.items() if not _is_text(key)]
    body = [[text(row.get(key)) for key in columns] for row in rows]
    table = markdown_table(list(columns.values()), body, numbers)
    return [*table.splitlines(), ""]


def summary_lines(report: Report) -> list[str]:
    """Return what is printed, and goes into the README."""
    lines: list[str] = []
    for unknowns in dict.fromkeys(row["unknowns"] for row in report.solvers):
        rows = [row for row in report.solvers if row["unknowns"] == unknowns]
        lines += pivot(f"{unknowns} unknowns", rows, "solver", "rows")
    if report.steps:
        lines += pivot("whole step", report.steps, "step", "points")
    if report.calls:
        lines += table_lines(CALL_COLUMNS, report.calls)
    if report.starts:
        lines += table_lines(START_COLUMNS, report.starts)
    if report.absent:
        lines += [f"Not installed: {', '.join(report.absent)}.", ""]
    return lines


def markdown(report: Report, origin: Mapping[str, Any]) -> str:
    """Return the whole report as Markdown."""
    lines = ["# Solver timing", "", *summary_lines(report)]
    groups: dict[tuple[Value, Value], list[Row]] = {}
    for row in report.solvers:
        groups.setdefault((row["unknowns"], row["rows"]), []).append(row)
    for (unknowns, number), rows in groups.items():
        size = unknowns, number
        kinds = Counter(
            row["mark"]
            for row in report.problems
            if (row["unknowns"], row["rows"]) == size
        )
        marks = ", ".join(f"{kinds[mark]} {mark}" for mark in Mark if kinds[mark])
        lines += [f"## {unknowns} unknowns, {number} rows, {marks} problems", ""]
        lines += table_lines(SOLVER_COLUMNS, rows)
    residual = max(
        (float(row["residual"] or 0.0) for row in report.problems), default=0
    )
    versions = ", ".join(f"{name} {v}" for name, v in origin["versions"].items())
    lines += [
        "## Machine, versions, settings",
        "",
        f"- {origin['cpu']}; {origin['platform']}; Python {origin['python']}",
        f"- {versions}",
        f"- Greatest residual of the reference answers: {residual:.1e}",
        f"- Plan: {json.dumps(origin['plan'])}",
        "- Settings of each solver; what is not named is its default:",
        *(f"    - `{n}`: `{dict(s)}`" for n, s in report.settings.items()),
        "",
        "## Limits of this comparison",
        "",
        *(f"- {limit}" for limit in LIMITS),
        "",
    ]
    return "\n".join(lines)


def _is_text(key: str) -> bool:
    return key in ("solver", "step", "start", "call", "error")


def text(value: Value) -> str:
    """Return a table cell: three significant digits, thousands in full."""
    if value is None:
        return "–"
    if isinstance(value, float):
        if 0.0 < value < 1e-3:
            return f"{value:.0e}"
        return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else value
