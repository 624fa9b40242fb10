"""Tables of computing times, and the machine and versions that belong to them."""

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from qpavoid.lab.simulation.log import provenance
from qpavoid.lab.study.tables import markdown_table, write_csv
from timing.trials import Row, Value

TEXTS = "solver step world start controller error scene what unit".split()
"""Columns of words; all others have numbers."""

PEERS = "piqp proxsuite clarabel highspy scs quadprog cbfpy elastiqp jax"

FAULTS = {
    "wrong": "wrong",
    "false_ok": "false ok",
    "false_infeasible": "false infeasible",
}


def origins(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return machine, versions of all that is installed, and plan."""
    origin = provenance()
    origin["versions"] |= {name: _version(name) for name in PEERS.split()}
    return origin | {"plan": dict(plan)}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def write_tables(
    folder: Path, tables: Mapping[str, Sequence[Row]], origin: Mapping[str, Any]
) -> None:
    """Write a CSV file for each table that has rows, and ``provenance.json``."""
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(origin, indent=1, ensure_ascii=False, default=dict)
    (folder / "provenance.json").write_text(text + "\n", encoding="utf-8")
    for name, rows in tables.items():
        if rows:
            write_csv(folder / f"{name}.csv", rows)


def pivot(rows: Sequence[Row], name: str, size: str, peer: str) -> str:
    """Return a table of medians by size, p99, the ratio to a peer, and faults.

    p99 and the ratio of medians are those of the middle size.

    Args:
        rows: Results of :func:`timing.trials.race` by name and size.
        name: Column of the names.
        size: Column of the sizes.
        peer: Name of the contender that the others are divided by.
    """
    sizes = sorted({float(row[size] or 0) for row in rows})
    middle = sizes[len(sizes) // 2]
    medians = {(row[name], row[size]): row["median_us"] for row in rows}
    unit = medians.get((peer, middle))
    columns = {name: f"{name}: median µs by {size}"}
    columns |= {f"{n:g}": f"{n:,.0f}" for n in sizes}
    columns |= {"p99": f"p99 at {middle:,.0f}", "ratio": f"÷ {peer} at {middle:,.0f}"}
    table: list[Row] = []
    for who in dict.fromkeys(row[name] for row in rows):
        own = [row for row in rows if row[name] == who]
        line: Row = {name: who, **{f"{row[size]:g}": row["median_us"] for row in own}}
        line["p99"] = next((x["p99_us"] for x in own if x[size] == middle), None)
        median = medians.get((who, middle))
        line["ratio"] = float(median) / float(unit) if median and unit else None
        calls = total(own, "calls")
        every = calls + total(own, "infeasible_calls")
        asked = {"wrong": calls, "false_ok": every, "false_infeasible": calls}
        for key, count in asked.items():
            counted = any(row[key] is not None for row in own)
            line[key] = percent(total(own, key), count) if counted else None
        table.append(line)
    return table_text(columns | FAULTS, table)


def total(rows: Iterable[Row], key: str) -> float:
    """Return the sum of a column."""
    return sum(float(row[key] or 0) for row in rows)


def percent(part: float, whole: float) -> str:
    """Return a share in %; 0 only if there is none at all."""
    share = 100.0 * part / max(whole, 1.0)
    return f"{share:.2g} %".replace("1e+02", "100") if part else "0"


def table_text(columns: Mapping[str, str], rows: Iterable[Row]) -> str:
    """Return a Markdown table of some columns by their headings."""
    numbers = [head for key, head in columns.items() if key not in TEXTS]
    body = [[text(row.get(key)) for key in columns] for row in rows]
    return markdown_table(list(columns.values()), body, numbers)


def text(value: Value) -> str:
    """Return a table cell: three significant digits, thousands in full."""
    if value is None:
        return "–"
    if isinstance(value, float):
        if 0.0 < value < 1e-3:
            return f"{value:.0e}"
        return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else value
