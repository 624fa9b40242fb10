"""Tables of ``README.md`` from ``results/reliability``.

python comparisons/reliability/page.py
"""

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.data import rows_of
from tables import filled, written

PAGE = Path(__file__).with_name("README.md")
HIDDEN = "solver", "s", "filter", "sanitizer"
"""Columns that the tables of calls leave out."""


def table(name: str) -> str:
    """Return a table in Markdown."""
    rows = rows_of(name)
    heads = [x for x in rows[0] if name == "source" or x not in HIDDEN]
    return written(heads, [[row[key] for key in heads] for row in rows], 1)


NAMES = "calls", "exported", "source", "loops", "files"
TABLES: Mapping[str, Callable[[], str]] = {x: partial(table, x) for x in NAMES}

if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text("utf-8"), TABLES), encoding="utf-8")
