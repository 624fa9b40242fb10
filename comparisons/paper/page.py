"""Tables of the paper's own page, from ``comparisons/results``.

python comparisons/paper/page.py
"""

import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from rows import ENDS, RESULTS, read_cells
from tables import filled, written

PAGE = Path(__file__).resolve().parent / "README.md"


def statements() -> str:
    """Return what the paper says, and in how many of 120 calibrations it holds."""
    with (RESULTS / "calibrations.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    heads = ["case", "section", "the paper says", "read as", "measured in ours"]
    heads += ["ours", "holds in 120 (95 %)"]
    lines = []
    for row in rows:
        low, high = (100.0 * float(row[k] or "nan") for k in ("low", "high"))
        count = f"{row['holds']} ({low:.0f}–{high:.0f} %)" if row["holds"] else "–"
        words = [row[k] for k in ("case", "section", "statement", "read", "measured")]
        lines.append([*words, row["ours"], count])
    return written(heads, lines, 6)


def cases() -> str:
    """Return how every method ends in the paper's two test cases."""
    runs = dict(read_cells("paper"))
    names = ["paper/test_case_1", "paper/test_case_2"]
    ends = [{name: ended(cell) for name, cell in runs[case, ""]} for case in names]
    rows = [[f"`{x}`", ends[0][x], ends[1].get(x, "–")] for x in ends[0]]
    rows = [row for row in rows if not row[0].startswith("`astar+")]
    return written(["method", "test case 1", "test case 2"], rows, 3)


def ended(cell: str) -> str:
    """Return the end of a run in words."""
    head = cell.partition("/")[0]
    short = {"c": "contact, moving", "t": "contact, standing", "l": "late"}
    return short.get(head, ENDS[head]) if head in ENDS else f"{head} s"


if __name__ == "__main__":
    tables = {"statements": statements, "cases": cases}
    PAGE.write_text(filled(PAGE.read_text("utf-8"), tables), encoding="utf-8")
