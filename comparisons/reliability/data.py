"""Tables of the page of reliability: a CSV file per section."""

import csv
from pathlib import Path
from typing import Any

from qpavoid.lab.study.tables import write_csv

RESULTS = Path(__file__).resolve().parents[1] / "results" / "reliability"


def rows_of(name: str, folder: Path = RESULTS) -> list[dict[str, str]]:
    """Return the rows of a table; without a file none."""
    path = folder / f"{name}.csv"
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def add_row(name: str, key: str, row: dict[str, Any], folder: Path = RESULTS) -> None:
    """Add a row to a table, in place of that with the same key."""
    kept = [r for r in rows_of(name, folder) if r[key] != str(row[key])]
    write_csv(folder / f"{name}.csv", [*kept, row])
