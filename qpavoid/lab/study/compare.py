"""Controllers × scenarios under identical conditions: runs, tables, files."""

import json
import math
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from pathlib import Path

from rich.table import Table

from qpavoid.avoidance.cbf_rows import R_MIN_TOLERANCE
from qpavoid.lab.scenario.scenario import Scenario
from qpavoid.lab.simulation.log import Log, provenance
from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.study.metrics import (
    BELOW,
    Metrics,
    Value,
    by_fleet,
    metrics,
    run_name,
    tally,
)
from qpavoid.lab.study.tables import write_csv

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

LEAST_OF_ROBOTS = {"zone_entry_s", "min_clearance_m", "v_min_mps"}
"""Of several robots the worst is the least of these."""


def compare(
    scenarios: Iterable[Scenario],
    controllers: Sequence[str],
    solver: str = "exact",
    out: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, skipped: None,
) -> tuple[list[Log], list[Metrics]]:
    """Run every controller on every scenario; save each log as soon as it is done.

    Of a scenario with several robots that of each of them.

    Args:
        scenarios: What to run.
        controllers: Names of the controllers.
        solver: Back end of the QP.
        out: Folder for logs and summary, see :func:`save`; none are written without it.
        progress: Called with the steps done and those of runs that ended before their
            time.
    """
    logs: list[Log] = []
    rows: list[Metrics] = []
    done = skipped = 0
    for scenario, name in product(scenarios, controllers):
        found = run_fleet(
            scenario,
            name,
            solver,
            lambda n: progress(done + n, skipped),  # noqa: B023
        )
        steps = len(found[0])
        done, skipped = done + steps, skipped + scenario.steps - steps
        logs += found
        rows += map(metrics, found)
        if out is not None:
            save(found, rows, out)
    return logs, rows


def save(logs: Sequence[Log], summary: Sequence[Metrics], out: Path) -> None:
    """Write logs to ``out/logs/<scenario>-<controller>.npz``, and the rows so far."""
    (out / "logs").mkdir(parents=True, exist_ok=True)
    for log in logs:
        log.save(out / "logs" / f"{run_name(log.meta)}.npz")
    for file, content in (("summary", summary), ("provenance", provenance())):
        text = json.dumps(content, indent=1, allow_nan=False)
        (out / f"{file}.json").write_text(text + "\n", encoding="utf-8")
    write_csv(out / "summary.csv", summary)


def table(scenario: Scenario, summary: Sequence[Metrics]) -> Table:
    """Return the table of one scenario, a column a controller.

    Of several robots it says what became of how many, and of all else the worst.
    """
    mine = [row for row in summary if row["scenario"] == scenario.name]
    rows = [worst_robot(robots) for robots in by_fleet(mine, dict)]
    result = Table("", title=scenario.title, title_justify="left")
    if any(row["time_below_r_min_s"] for row in rows):
        radius = scenario.settings.radius
        result.caption_justify = "left"
        result.caption = (
            f"r_min is {radius.r_min():g} m ({radius.r_min(math.inf):g} m of fast "
            "obstacles); qp-ahead and the guide keep it to a tolerance of "
            f"{1e3 * R_MIN_TOLERANCE:g} mm, and all below it by more than "
            f"{1e3 * BELOW:g} mm is counted."
        )
    for row in rows:
        result.add_column(str(row["controller"]), justify="right")
    for key, heading in list(COLUMNS.items())[1:]:
        result.add_row(heading, *(cell(row[key]) for row in rows))
    return result


def worst_robot(rows: Sequence[Metrics]) -> Metrics:
    """Return of the rows of all robots what became of how many, and the worst."""
    worst = dict(rows[0])
    for key in COLUMNS:
        found = [v for v in (row[key] for row in rows) if isinstance(v, float)]
        if found:
            worst[key] = min(found) if key in LEAST_OF_ROBOTS else max(found)
    if len(rows) > 1:
        worst["outcome"] = tally([row["outcome"] for row in rows])
    return worst


def cell(value: Value) -> str:
    """Return a value as text; what does not apply is a dash."""
    if value is None:
        return "–"
    return f"{round(value, 3) + 0.0:g}" if isinstance(value, float) else str(value)
