"""Controllers × scenarios under identical conditions: runs, tables, files."""

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from rich.table import Table

from qpavoid.lab.simulation.log import Log, provenance
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.study.metrics import Metrics, Value, metrics

COLUMNS = {
    "controller": "controller",
    "outcome": "outcome",
    "zone_entry_s": "zone entered s",
    "zone_exit_s": "zone left s",
    "min_clearance_m": "least distance m",
    "time_below_r_min_s": "below r_min s",
    "rms_error_m": "rms error m",
    "final_error_m": "final error m",
    "final_heading_error_rad": "final heading error rad",
    "v_min_mps": "v min m/s",
    "v_max_mps": "v max m/s",
    "omega_max_radps": "ω max rad/s",
    "solve_median_us": "solve median µs",
}
"""Columns of the printed table; the files hold all metrics."""


def compare(
    scenarios: Iterable[Scenario],
    controllers: Sequence[str],
    solver: str = "exact",
    out: Path | None = None,
    progress: Callable[[Scenario, str, int], None] = lambda *_: None,
) -> tuple[list[Log], list[Metrics]]:
    """Run every controller on every scenario; save each log as soon as it is done.

    Args:
        scenarios: What to run.
        controllers: Names of the controllers.
        solver: Back end of the QP.
        out: Folder for logs, ``summary.csv`` and ``summary.json``; none are written
            without it.
        progress: Called with scenario, controller and steps done.
    """
    logs: list[Log] = []
    summary: list[Metrics] = []
    for scenario in scenarios:
        for name in controllers:
            log = run(
                scenario,
                name,
                solver,
                lambda n: progress(scenario, name, n),  # noqa: B023
                explain=out is not None,
            )
            logs.append(log)
            summary.append(metrics(log))
            if out is not None:
                save_log(log, out)
                save_summary(summary, out)
    return logs, summary


def run_name(scenario: object, controller: object) -> str:
    """Return what the files of a run are called, on every file system."""
    return f"{scenario}-{controller}".replace("/", "-").replace(":", ".")


def save_log(log: Log, out: Path) -> Path:
    """Write a log to ``out/logs/<scenario>-<controller>.npz`` and return the path."""
    folder = out / "logs"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{run_name(log.meta['scenario'], log.meta['controller'])}.npz"
    log.save(path)
    return path


def save_summary(summary: Sequence[Metrics], out: Path) -> None:
    """Write ``summary.csv``, ``summary.json`` and ``provenance.json``."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(summary, indent=1, allow_nan=False)
    (out / "summary.json").write_text(text + "\n", encoding="utf-8")
    (out / "provenance.json").write_text(json.dumps(provenance(), indent=1) + "\n")
    with (out / "summary.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(summary[0]))
        writer.writeheader()
        writer.writerows(summary)


def table(scenario: Scenario, summary: Sequence[Metrics]) -> Table:
    """Return the table of one scenario, a column a controller.

    Published numbers stand in brackets beside ours.
    """
    rows = [row for row in summary if row["scenario"] == scenario.name]
    result = Table("", title=scenario.title, title_justify="left")
    for row in rows:
        result.add_column(str(row["controller"]), justify="right")
    for key, heading in list(COLUMNS.items())[1:]:
        result.add_row(heading, *(cell(scenario, row, key) for row in rows))
    return result


SHORT = (
    "controller",
    "outcome",
    "zone_entry_s",
    "zone_exit_s",
    "min_clearance_m",
    "time_below_r_min_s",
    "rms_error_m",
    "final_error_m",
    "v_min_mps",
)
"""Columns of the Markdown table: those that do not depend on the machine."""


def markdown(scenarios: Sequence[Scenario], summary: Sequence[Metrics]) -> str:
    """Return the runs as a Markdown table, the paper's numbers in brackets."""
    lines = [
        "| scenario | " + " | ".join(COLUMNS[key] for key in SHORT) + " |",
        "| --- " * (len(SHORT) + 1) + "|",
    ]
    for scenario in scenarios:
        for row in summary:
            if row["scenario"] == scenario.name:
                cells = [cell(scenario, row, key) for key in SHORT]
                lines.append(f"| {scenario.name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def cell(scenario: Scenario, row: Metrics, key: str) -> str:
    """Return a value as text, with the paper's in brackets where it gives one."""
    text = _text(row[key])
    paper = scenario.published.get(str(row["controller"]))
    stated = getattr(paper, key, None) if paper else None
    if paper is None or stated is None:
        return text
    about = "about " if paper.about else ""
    return f"{text} (paper: {about}{stated:g})"


def _text(value: Value) -> str:
    if value is None:
        return "–"
    return f"{round(value, 3) + 0.0:g}" if isinstance(value, float) else str(value)
