"""The report of a study: one HTML file that opens from disk and asks for nothing.

``results`` reads a folder of runs, ``ranking`` turns its rows into tables, ``payload``
packs its logs for the replay, and ``page`` puts all of it into one file with the
scripts. ``pen``, ``panels`` and ``charts`` draw plain frames, here and in the live
page; ``unpack`` makes frames of packed logs and ``replay`` plays them; ``tables`` shows
the ranking; ``report`` puts them together.
"""

import tomllib
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from qpavoid.lab.study.report.page import report_page
from qpavoid.lab.study.report.payload import Group, pack_groups
from qpavoid.lab.study.report.ranking import Row, name_methods, rank, read_results

MOST_FAILURES, MOST_LETTERS = 300, 300
"""Rows of the table of runs that did not succeed, and letters of an error in it."""

MOST_RECORDS = 2000
"""Rows of all ranking tables together, at least 20 a table."""

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
    groups, left_out = pack_groups(rows, found.logs)
    data = {
        "name": _title(found.provenance) or results.resolve().name,
        "facts": _facts(rows),
        "provenance": found.provenance,
        "tables": _tables(rows),
        "failures": _failures(rows, groups),
        "replay": {"groups": groups, "left_out": left_out},
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


def _failures(rows: list[Row], groups: list[Group]) -> dict[str, object]:
    """Return the runs that did not succeed, with their place in the replay."""
    places = {
        run["run"]: [i, j]
        for i, group in enumerate(groups)
        for j, run in enumerate(group["runs"])
    }
    failed = [row for row in rows if not row["success"]]
    failed.sort(key=lambda row: row["run"] not in places)
    shown = [
        {key: row.get(key) for key in FAILURE}
        | {"error": (row.get("error") or "")[:MOST_LETTERS]}
        | {"replay": places.get(row["run"])}
        for row in failed[:MOST_FAILURES]
    ]
    return {"count": len(failed), "rows": shown}
