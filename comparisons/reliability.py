"""The page of what does not break: a section a promise, each from a table of figures.

    python comparisons/reliability.py

The tables are made by the commands that the page names, run in this folder.
"""

import tomllib
from pathlib import Path
from typing import Any

from qpavoid.lab.study.tables import markdown_table
from reliable.data import RESULTS, rows_of

HERE = Path(__file__).resolve().parent

HEAD = """# What does not break

Made by `python comparisons/reliability.py` from the tables in `results/reliability`.
What each promise means for a robot is in `docs/reliability.md`, what is not promised in
`SECURITY.md`.
"""


def page(folder: Path = RESULTS) -> str:
    """Return the page; a section without a table says that there is none."""
    texts = tomllib.loads((HERE / "reliability.toml").read_text(encoding="utf-8"))
    return "\n".join([HEAD, *(section(one, folder) for one in texts["section"])])


def section(told: dict[str, Any], folder: Path) -> str:
    """Return the title, text and table of a promise."""
    rows = rows_of(told["table"], folder)
    lines = [[*row.values()] for row in rows]
    table = markdown_table([*rows[0]], lines) if rows else "Not measured yet.\n"
    ends = f"Held by {told['test']}; made by `{told['make']}`."
    return f"## {told['title']}\n\n{told['text'].strip()}\n\n{table}\n{ends}\n"


def main() -> None:
    (HERE / "reliability.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
