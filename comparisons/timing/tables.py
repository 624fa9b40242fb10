"""Tables of computing times, and the machine and versions that belong to them.

Run: python comparisons/timing/solvers.py, or steps.py beside it
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from qpavoid.lab.simulation.log import provenance
from qpavoid.lab.study.tables import markdown_table, write_csv
from timing.trials import Plan, Row, Value

FAULTS = "wrong", "false_ok", "false_infeasible"


def write_tables(
    folder: Path, tables: Mapping[str, Sequence[Row]], plan: Plan, **more: Any
) -> None:
    """Write a CSV file for each table, and ``provenance.json`` with all versions."""
    versions = {one.name: one.version for one in distributions()}
    origin = provenance() | {"versions": versions, "plan": plan._asdict()} | more
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(origin, indent=1, ensure_ascii=False, default=dict)
    (folder / "provenance.json").write_text(text + "\n", encoding="utf-8")
    for name, rows in tables.items():
        write_csv(folder / f"{name}.csv", rows)


def pivot(rows: Sequence[Row], name: str, size: str, peer: str) -> str:
    """Return a table of medians by size, p99, the ratio to a peer, and faults.

    p99 and the ratio of medians are those of the middle size. ``name`` and ``size`` are
    columns of the rows.
    """
    sizes = sorted({row[size] for row in rows})
    middle = sizes[len(sizes) // 2]
    found = {(row[name], row[size]): row for row in rows}
    unit = found.get((peer, middle), {}).get("median_us")
    heads = [f"{name}: median µs by {size}", *(f"{n:,}" for n in sizes)]
    heads += [f"p99 at {middle:,}", f"÷ {peer} at {middle:,}"]
    lines = []
    for who in dict.fromkeys(row[name] for row in rows):
        own = [found.get((who, n), {}) for n in sizes]
        among = found.get((who, middle), {})
        line = [one.get("median_us") for one in own] + [among.get("p99_us")]
        median = among.get("median_us")
        line.append(median / unit if median and unit else None)
        calls = total(own, "calls")
        asked = calls, calls + total(own, "infeasible_calls"), calls
        faults = [
            percent(total(own, key), count)
            if any(one.get(key) is not None for one in own)
            else None
            for key, count in zip(FAULTS, asked, strict=True)
        ]
        lines.append([str(who), *map(text, line + faults)])
    heads += [name.replace("_", " ") for name in FAULTS]
    return markdown_table(heads, lines, heads[1:])


def total(rows: Iterable[Row], key: str) -> float:
    """Return the sum of a column."""
    return sum(float(row.get(key) or 0) for row in rows)


def percent(part: float, whole: float) -> str:
    """Return a share in %; 0 only if there is none at all."""
    share = 100.0 * part / max(whole, 1.0)
    return f"{share:.2g} %".replace("1e+02", "100") if part else "0"


def text(value: Value) -> str:
    """Return a table cell: three significant digits, thousands in full."""
    if value is None or isinstance(value, str):
        return value or "–"
    if 0.0 < value < 1e-3:
        return f"{value:.0e}"
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
