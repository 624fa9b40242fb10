"""Tables of ``README.md`` from ``results/reliability``, a CSV file for each section.

python comparisons/reliability/page.py
"""

import csv
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.lab.study.tables import write_csv
from tables import filled, written

PAGE = Path(__file__).with_name("README.md")
RESULTS = PAGE.parents[1] / "results" / "reliability"


def rows_of(name: str) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with (RESULTS / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def add_row(name: str, row: Mapping[str, Any]) -> None:
    """Add a row to a table, in place of that with the same first column."""
    key = next(iter(row))
    kept = [one for one in rows_of(name) if one[key] != str(row[key])]
    write_csv(RESULTS / f"{name}.csv", [*kept, row])


def table(name: str) -> str:
    """Return a table in Markdown."""
    rows = rows_of(name)
    return written([*rows[0]], [[*row.values()] for row in rows], 1)


NAMES = "calls", "exported", "source", "loops", "files"
TABLES: Mapping[str, Callable[[], str]] = {x: partial(table, x) for x in NAMES}

if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text("utf-8"), TABLES), encoding="utf-8")
