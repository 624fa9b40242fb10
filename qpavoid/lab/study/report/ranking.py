"""Rows of runs to rankings: pure functions, the same answer every time."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.errors import DataError
from qpavoid.files import read_json
from qpavoid.lab.simulation.log import PLAIN
from qpavoid.lab.study.compare import read_summary
from qpavoid.lab.study.statistics import wilson
from qpavoid.types import Array

Row: TypeAlias = dict[str, Any]


class Results(NamedTuple):
    """Results of a study.

    Attributes:
        rows: One a run, with the keys of a sweep; ``run`` names it.
        provenance: Versions and machine.
        logs: Paths of the logs that were kept, by the name of the run.
    """

    rows: list[Row]
    provenance: Mapping[str, Any]
    logs: Mapping[str, Path]


def read_results(folder: Path) -> Results:
    """Read a folder made by ``qpavoid sweep``, or ``compare`` or ``run``.

    Raises:
        DataError: It is neither, is damaged, or holds no runs.
    """
    if (folder / "runs").is_dir():
        from qpavoid.lab.study.sweep.store import read_provenance, read_rows

        rows, provenance = read_rows(folder), read_provenance(folder)
    elif (folder / "summary.json").is_file():
        rows = [
            {"run": name, "success": word == "arrived", "contact": word == "touched"}
            | row
            for name, row in read_summary(folder).items()
            for word in [row.get("outcome")]
        ]
        origin = folder / "provenance.json"
        provenance = read_json(origin) if origin.exists() else {}
    else:
        raise DataError(
            f"{folder}: no results of qpavoid sweep (runs/*.parquet) or of qpavoid "
            "compare (summary.json)"
        )
    if not rows:
        raise DataError(f"{folder}: no runs yet")
    logs = {path.stem: path for path in sorted((folder / "logs").glob("*.npz"))}
    return Results(rows, provenance, logs)


def settings_of(row: Row) -> dict[str, Any]:
    """Return the settings that a sweep varied; their keys have dots."""
    return {key: row[key] for key in row if "." in key and row[key] is not None}


def name_methods(rows: Iterable[Row]) -> list[Row]:
    """Return the rows with ``method``: controller, solver if it matters, settings."""
    named, rows = [], list(rows)
    keys = sorted({key for row in rows for key in row if "." in key})
    last = Counter(key.rsplit(".", 1)[1] for key in keys)
    short = {
        key: key if last[key.rsplit(".", 1)[1]] > 1 else key.rsplit(".", 1)[1]
        for key in keys
    }
    for row in rows:
        parts = [who(row)]
        parts += [f"{short[key]} {_text(x)}" for key, x in settings_of(row).items()]
        named.append(row | {"method": ", ".join(parts)})
    return named


def who(row: Row) -> str:
    """Return controller and solver, the latter if it does not go without saying."""
    solver = row.get("solver")
    return str(row["controller"]) + ("" if solver in PLAIN else f" ({solver})")


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def rank(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return one record a method, the best first.

    Ordered by success rate, then contacts, then median time of the runs that arrived.
    """
    by_method = defaultdict(list)
    for row in rows:
        by_method[row["method"]].append(row)
    records = [_record(name, group) for name, group in by_method.items()]
    return sorted(records, key=_place)


def _place(record: dict[str, Any]) -> tuple[float, float, float]:
    time = record["time"]
    time = np.inf if time is None else time
    return -record["success"][0], record["contact"][0], time


def _record(method: str, rows: list[Row]) -> dict[str, Any]:
    n = len(rows)
    arrived = [row for row in rows if row["success"]]
    room = _numbers(rows, "min_room_m")
    return {
        "method": method,
        "controller": rows[0]["controller"],
        "runs": n,
        "success": wilson(len(arrived), n),
        "contact": wilson(sum(bool(row["contact"]) for row in rows), n),
        "below": wilson(int((room < -1e-3).sum()), len(room)) if len(room) else None,
        "time": _median(_numbers(arrived, "arrived_s")),
        "clearance": _median(_numbers(rows, "min_clearance_m")),
        "error": _median(_numbers(rows, "max_error_m")),
        "changed": _median(_numbers(rows, "changed_s")),
    }


def _numbers(rows: Sequence[Row], key: str) -> Array:
    """Return the finite values of a column."""
    values = np.array([row[key] for row in rows if row.get(key) is not None], float)
    found: Array = values[np.isfinite(values)]
    return found


def _median(values: Array) -> float | None:
    return float(np.median(values)) if len(values) else None
