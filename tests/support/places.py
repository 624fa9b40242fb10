"""Folders of the source tree, and tables of results."""

import csv
from pathlib import Path

SUPPORT = Path(__file__).resolve().parent
ROOT = SUPPORT.parents[1]
COMPARISONS = ROOT / "comparisons"
RESULTS = COMPARISONS / "results"


def table(path):
    """Rows of a table, of the results unless its path is absolute."""
    with (RESULTS / path).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, restval=""))
