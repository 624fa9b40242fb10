"""The report of a sweep: rankings and failures in Markdown, figures of kept logs."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from qpavoid.errors import DataError
from qpavoid.lab.scenario.methods import labelled
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.plots import paths
from qpavoid.lab.study.tables import Interval, markdown_table, wilson
from qpavoid.types import Array

Row: TypeAlias = dict[str, Any]

MOST_FAILURES, MOST_FIGURES, MOST_PANELS = 300, 24, 12
"""Rows of the table of failures; figures, and runs in a figure."""

HEADS = (
    *("n", "success, % (95 %)", "contact, % (95 %)", "below r_min, %"),
    *("median time, s", "median least distance, m", "median s changed"),
)
"""Columns of a ranking, after the method."""

FAILURE = "scenario seed method outcome min_clearance_m time_s error".split()


def write_report(results: Path, out: Path) -> Path:
    """Write the report of a sweep as Markdown, figures beside it; return its path.

    Args:
        results: Folder of ``qpavoid sweep``.
        out: The file.

    Raises:
        DataError: The folder holds no runs.
    """
    from qpavoid.lab.study.sweep.store import read_provenance, read_rows

    rows = read_rows(results) if (results / "runs").is_dir() else []
    if not rows:
        raise DataError(f"{results}: no results of qpavoid sweep (runs/*.parquet)")
    out.parent.mkdir(parents=True, exist_ok=True)
    scenarios = sorted({str(row["scenario"]) for row in rows})
    origin = read_provenance(results)
    made = f"qpavoid {origin['versions']['qpavoid']}, commit {origin['commit']}"
    parts = [f"# {results.resolve().name}\n\n{len(rows):,} runs, {made}\n"]
    for scenario in [None, *scenarios] if len(scenarios) > 1 else scenarios:
        some = [row for row in rows if scenario in (None, str(row["scenario"]))]
        parts += [f"## {scenario or 'All scenarios'}\n", ranking(some)]
    failed = [row for row in rows if not row["success"]]
    if failed:
        parts.append(f"## {len(failed):,} runs without success\n")
        shown = [row | {"method": method_of(row)} for row in failed[:MOST_FAILURES]]
        lines = [[_text(row.get(key)) for key in FAILURE] for row in shown]
        parts.append(markdown_table(FAILURE, lines))
    for title, file in figures(rows, results / "logs", out):
        parts.append(f"![{title}]({file.name})\n")
    out.write_text("\n".join(parts), encoding="utf-8")
    return out


def method_of(row: Row) -> str:
    """Return controller, solver if it matters, and varied settings of a row."""
    settings = (f"{k} {_text(x)}" for k, x in row.items() if "." in k and x is not None)
    return ", ".join([labelled(row), *settings])


def ranking(rows: Sequence[Row]) -> str:
    """Return the table of the methods, the best first.

    Ordered by success, then contacts, then median time of the runs that arrived.
    """
    by_method = defaultdict(list)
    for row in rows:
        by_method[method_of(row)].append(row)
    lines = sorted((_line(*one) for one in by_method.items()), key=lambda x: x[0])
    return markdown_table(["method", *HEADS], [line for _, line in lines], HEADS)


def _line(method: str, rows: list[Row]) -> tuple[tuple[float, ...], list[str]]:
    """Return the line of a method, and by what it is ordered."""
    arrived, n = [row for row in rows if row["success"]], len(rows)
    success = wilson(len(arrived), n)
    contact = wilson(sum(bool(row["contact"]) for row in rows), n)
    room = _numbers(rows, "min_room_m")
    below = f"{100.0 * np.mean(room < -1e-3):.1f}" if len(room) else "–"
    times = _numbers(arrived, "arrived_s")
    numbers = times, _numbers(rows, "min_clearance_m"), _numbers(rows, "changed_s")
    medians = [f"{np.median(x):.3g}" if len(x) else "–" for x in numbers]
    order = -success[0], contact[0], float(np.median(times)) if len(times) else np.inf
    shares = [_share(success), _share(contact)]
    return order, [method, str(n), *shares, below, *medians]


def _share(interval: Interval) -> str:
    rate, low, high = (100.0 * x for x in interval)
    return f"{rate:.1f} ({low:.0f}–{high:.0f})"


def _numbers(rows: Sequence[Row], key: str) -> Array:
    """Return the finite values of a column."""
    values = np.array([row[key] for row in rows if row.get(key) is not None], float)
    return np.asarray(values[np.isfinite(values)])


def _text(value: object) -> str:
    """Return a cell, on one line and without the table's bars."""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return "" if value is None else " ".join(text.replace("|", "/").split())[:300]


def figures(rows: Sequence[Row], logs: Path, out: Path) -> list[tuple[str, Path]]:
    """Write a figure of each scene whose logs were kept; return titles and files.

    First come those in which the outcomes of the methods differ.
    """
    outcomes, kept = defaultdict(set), defaultdict(list)
    for row in rows:
        place = row["scenario"], row.get("seed")
        outcomes[place].add(row["outcome"])
        if (file := logs / f"{row['run']}.npz").exists():
            kept[place].append(file)
    ordered = sorted(kept, key=lambda x: (-len(outcomes[x]), -len(kept[x])))
    made = []
    for k, (scenario, seed) in enumerate(ordered[:MOST_FIGURES]):
        file = out.with_name(f"{out.stem}-{k}.png")
        found = kept[scenario, seed][:MOST_PANELS]
        paths([Log.load(one) for one in found]).savefig(file)
        made.append((scenario if seed is None else f"{scenario}, seed {seed}", file))
    return made
