"""The report of a study: one HTML file that opens from disk and asks for nothing.

``ranking`` reads a folder of runs and turns its rows into tables; ``page`` puts them
and figures of the kept logs into one file with the scripts: ``tables`` shows the
tables, ``report`` puts all together. ``pen``, ``panels`` and ``charts`` are of the live
page.
"""

import tomllib
from base64 import b64encode
from collections import defaultdict
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.plots import paths
from qpavoid.lab.study.report.page import report_page
from qpavoid.lab.study.report.ranking import Row, name_methods, rank, read_results

MOST_FAILURES, MOST_LETTERS = 300, 300
"""Rows of the table of runs that did not succeed, and letters of an error in it."""

MOST_RECORDS = 2000
"""Rows of all ranking tables together, at least 20 a table."""

MOST_FIGURES, MOST_PANELS, PAGE_DPI = 24, 12, 100
"""Figures in a report, runs in a figure, and its dots per inch."""

FAILURE = "scenario seed method outcome min_clearance_m time_s error".split()


def write_report(results: Path, out: Path) -> Path:
    """Write the report of a folder of runs, and return its path.

    Args:
        results: Made by ``qpavoid sweep`` or ``qpavoid compare``.
        out: The HTML file.

    Raises:
        DataError: The folder holds no runs.
    """
    found = read_results(results)
    rows = name_methods(found.rows)
    figures, places = _figures(rows, found.logs)
    data = {
        "name": _title(found.provenance) or results.resolve().name,
        "facts": _facts(rows),
        "provenance": found.provenance,
        "tables": _tables(rows),
        "failures": _failures(rows, places),
        "figures": figures,
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(report_page(f"Report: {data['name']}", data), encoding="utf-8")
    return out


def _title(provenance: Mapping[str, Any]) -> str:
    """Return the title of the study; empty where there was none."""
    try:
        return str(tomllib.loads(provenance["study"])["title"])
    except (KeyError, TypeError, tomllib.TOMLDecodeError):
        return ""


def _facts(rows: list[Row]) -> dict[str, int]:
    """Return how much was run."""
    facts = {
        name: len({row.get(name) for row in rows} - {None})
        for name in ("method", "scenario", "seed")
    }
    return {"run": len(rows), **facts}


def _tables(rows: list[Row]) -> list[dict[str, object]]:
    """Return the ranking over all scenarios, and one for each if there are several."""
    by_scenario = defaultdict(list)
    for row in rows:
        by_scenario[str(row["scenario"])].append(row)
    parts: list[tuple[str | None, list[Row]]] = sorted(by_scenario.items())
    if len(parts) > 1:
        parts.insert(0, (None, rows))
    most = max(20, MOST_RECORDS // len(parts))
    tables: list[dict[str, object]] = []
    for scenario, chosen in parts:
        records = rank(chosen)
        shown = {"methods": records[:most], "count": len(records)}
        tables.append({"scenario": scenario, **shown})
    return tables


def _figures(
    rows: Sequence[Row], logs: Mapping[str, Path]
) -> tuple[list[dict[str, str]], dict[str, int]]:
    """Return figures of scenes as data URIs with titles, and the figure of each run.

    A figure has the ways of all kept runs of a scenario and seed. First come those in
    which the outcomes of the methods differ.
    """
    outcomes, kept = defaultdict(set), defaultdict(list)
    for row in rows:
        place = row["scenario"], row.get("seed")
        outcomes[place].add(row["outcome"])
        if row["run"] in logs:
            kept[place].append(row)
    figures: list[dict[str, str]] = []
    places: dict[str, int] = {}
    ordered = sorted(kept, key=lambda x: (-len(outcomes[x]), -len(kept[x])))
    for scenario, seed in ordered[:MOST_FIGURES]:
        runs, png = kept[scenario, seed][:MOST_PANELS], BytesIO()
        places |= {run["run"]: len(figures) for run in runs}
        figure = paths([Log.load(logs[run["run"]]) for run in runs])
        if len(figure.axes) == len(runs):  # not of several robots
            for axes, run in zip(figure.axes, runs, strict=True):
                when = "".join(axes.get_title().partition("\n")[1:])
                axes.set_title(f"{run['method']}: {run['outcome']}{when}", fontsize=10)
        figure.savefig(png, dpi=PAGE_DPI)
        image = f"data:image/png;base64,{b64encode(png.getvalue()).decode('ascii')}"
        title = scenario if seed is None else f"{scenario}, seed {seed}"
        figures.append({"title": title, "image": image})
    return figures, places


def _failures(rows: list[Row], places: Mapping[str, int]) -> dict[str, object]:
    """Return the runs that did not succeed, with the numbers of their figures."""
    failed = [row for row in rows if not row["success"]]
    failed.sort(key=lambda row: row["run"] not in places)
    shown = [
        {key: row.get(key) for key in FAILURE}
        | {"error": (row.get("error") or "")[:MOST_LETTERS]}
        | {"figure": places.get(row["run"])}
        for row in failed[:MOST_FAILURES]
    ]
    return {"count": len(failed), "rows": shown}
