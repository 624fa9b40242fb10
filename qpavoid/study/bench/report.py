"""The report of a bench: tables, files, and what a reader must know to trust them."""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from qpavoid.qp.solve import BACK_ENDS
from qpavoid.simulation.log import provenance
from qpavoid.study.bench.figure import save_figure
from qpavoid.study.bench.recorded import Mark
from qpavoid.study.bench.trials import BLOCK, WRONG, Row, Value

SOLVER_COLUMNS = {
    "back_end": "back end",
    "calls": "calls",
    "median_us": "median µs",
    "p99_us": "p99 µs",
    "max_us": "max µs",
    "wrong": "wrong",
    "worst_error": "worst error",
    "false_infeasible": "false infeasible",
    "infeasible_calls": "infeasible calls",
    "false_ok": "false ok",
}
FILTER_COLUMNS = {
    "points": "points",
    "rows": "rows",
    "calls": "calls",
    "median_us": "median µs",
    "p99_us": "p99 µs",
    "max_us": "max µs",
    "target_us": "target: median ≤ µs",
}
START_COLUMNS = {
    "start": "fresh process",
    "seconds": "s",
    "target_s": "target: ≤ s",
    "error": "error",
}

LIMITS = (
    "Wall times of one machine, with whatever else ran on it: trust the ratios. From "
    "run to run medians move by tens of percent, maxima by much more.",
    "A call goes from numpy arrays (normalised rows) to a numpy answer and includes "
    "what the interface needs: filling parameters, sparse matrices, with qpsolvers a "
    "new workspace every time. It excludes scaling, relaxation and certificate, which "
    "are ours and the same for all.",
    "exact solves two unknowns and nothing else; the others are general solvers.",
    "The reference is the exact method's own answer. Each one carries a certificate of "
    "optimality, whose greatest residual stands above; the tests hold it to other "
    "oracles. exact can therefore not be wrong here.",
    f"wrong: an answer that the back end claims, farther than {WRONG:g} (m/s, rad/s) "
    "from the optimum. false infeasible: no answer (NaN, None, exception, or CasADi's "
    "success = False) to a feasible problem. false ok: an answer to an infeasible "
    "problem. Counted in calls, not in problems.",
    "Infeasible problems are handed over raw only here: qpavoid.solve relaxes first, "
    "certifies every answer, and turns a wrong one into a status.",
    "Tolerances are tight, since wrong answers are counted; with looser ones the "
    "first-order methods are faster and wrong more often.",
    "A back end that has used up its time gets no more problems: fewer calls. With "
    "fewer than a hundred calls p99 is the maximum.",
    f"Back ends take turns in blocks of {BLOCK} successive problems in random order; a "
    "call on the problem before each block is not counted; caches are hot, the garbage "
    "collector is off. In a control loop, calls come colder.",
    "One robot (MiR100 with tip), one setting of weights and gains, one kind of scene: "
    "discs that move straight on. Null rows never reach a back end.",
)


@dataclass
class Report:
    """What a bench has measured so far.

    Attributes:
        names: Back ends.
        plan: How much was to be measured.
        solvers: One row for each back end and number of rows.
        problems: One row for each recorded problem.
        filter: One row for each number of points.
        starts: One row for each cold start.
    """

    names: Sequence[str]
    plan: Mapping[str, Value]
    solvers: list[Row] = field(default_factory=list)
    problems: list[Row] = field(default_factory=list)
    filter: list[Row] = field(default_factory=list)
    starts: list[Row] = field(default_factory=list)


def write_report(report: Report, folder: Path) -> None:
    """Write everything that has been measured.

    ``solver_timing.csv``, ``problems.csv``, ``filter_step.csv``, ``cold_start.csv``,
    ``provenance.json``, ``report.md`` and ``solver_timing.png``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    origin = origins(report)
    text = json.dumps(origin, indent=1, ensure_ascii=False)
    (folder / "provenance.json").write_text(text + "\n", encoding="utf-8")
    tables = {
        "solver_timing": report.solvers,
        "problems": report.problems,
        "filter_step": report.filter,
        "cold_start": report.starts,
    }
    for name, rows in tables.items():
        if rows:
            with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as f:
                writer = csv.DictWriter(f, fieldnames=list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    (folder / "report.md").write_text(markdown(report, origin), encoding="utf-8")
    if report.filter:
        save_figure(report.solvers, report.filter, origin, folder / "solver_timing.png")


def origins(report: Report) -> dict[str, Any]:
    """Return machine, versions, plan, and the settings of every back end."""
    origin = provenance()
    modules = {BACK_ENDS[name].module for name in report.names if name in BACK_ENDS}
    origin["versions"] |= {name: _version(name) for name in sorted(modules)}
    origin["plan"] = dict(report.plan)
    origin["settings"] = {name: settings(name) for name in report.names}
    return origin


def settings(name: str) -> dict[str, Any]:
    """Return the settings that a back end runs with; what is not named is default."""
    family, _, plugin = name.partition(":")
    if family == "osqp":
        from qpavoid.qp.backend_osqp import SETTINGS

        return SETTINGS
    if family == "casadi":
        from qpavoid.qp.backend_casadi import OPTIONS

        return OPTIONS.get(plugin or "qrqp", {})
    if family == "qpsolvers":
        from qpavoid.qp.backend_qpsolvers import TIGHT

        return TIGHT.get(plugin, {})
    return {}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def sections(report: Report) -> Iterable[tuple[str, Mapping[str, str], list[Row]]]:
    """Yield title, columns and rows of every table that has rows."""
    for number in dict.fromkeys(row["rows"] for row in report.solvers):
        rows = [row for row in report.solvers if row["rows"] == number]
        title = f"{number} rows, {_marks(report, number)} problems"
        yield title, SOLVER_COLUMNS, rows
    if report.filter:
        title = "One SafetyFilter.filter call from Python, exact back end"
        yield title, FILTER_COLUMNS, report.filter
    if report.starts:
        yield "Cold starts, whole processes", START_COLUMNS, report.starts


def _marks(report: Report, number: Value) -> str:
    marks = Counter(row["mark"] for row in report.problems if row["rows"] == number)
    return ", ".join(f"{marks[mark]} {mark}" for mark in Mark if marks[mark])


def print_report(report: Report, console: Console) -> None:
    """Print the tables, the machine, and where the limits stand."""
    for title, columns, rows in sections(report):
        table = Table(
            title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False
        )
        for key, heading in columns.items():
            table.add_column(
                heading,
                justify="left" if _is_text(key) else "right",
                no_wrap=key == "back_end",
            )
        for row in rows:
            table.add_row(*(text(row[key]) for key in columns))
        console.print(table)
    origin = origins(report)
    console.print(f"{origin['cpu']}; Python {origin['python']}.", highlight=False)
    console.print("Versions, settings and limits: report.md.", highlight=False)


def markdown(report: Report, origin: Mapping[str, Any]) -> str:
    """Return the whole report as Markdown."""
    lines = ["# Solver timing", ""]
    for title, columns, rows in sections(report):
        rule = ["---" if _is_text(key) else "---:" for key in columns]
        body = [[text(row[key]) for key in columns] for row in rows]
        lines += [f"## {title}", ""]
        lines += [
            "| " + " | ".join(cells) + " |" for cells in (columns.values(), rule, *body)
        ]
        lines.append("")
    residual = max((_number(row["residual"]) for row in report.problems), default=0.0)
    versions = ", ".join(f"{name} {v}" for name, v in origin["versions"].items())
    lines += [
        "## Machine, versions, settings",
        "",
        f"- {origin['cpu']}; {origin['platform']}; Python {origin['python']}",
        f"- {versions}",
        f"- Greatest residual of the reference answers: {residual:.1e}",
        f"- Plan: {json.dumps(origin['plan'])}",
        "- Settings of each back end; what is not named is its default:",
        *(f"    - `{n}`: `{json.dumps(s)}`" for n, s in origin["settings"].items()),
        "",
        "## Limits of this comparison",
        "",
        *(f"- {limit}" for limit in LIMITS),
        "",
    ]
    return "\n".join(lines)


def _is_text(key: str) -> bool:
    return key in ("back_end", "start", "error")


def _number(value: Value) -> float:
    return value if isinstance(value, float) else 0.0


def text(value: Value) -> str:
    """Return a table cell: three significant digits, thousands in full."""
    if value is None:
        return "–"
    if isinstance(value, float):
        if 0.0 < value < 1e-3:
            return f"{value:.0e}"
        return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else value
