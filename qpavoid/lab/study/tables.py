"""Tables of all studies: as CSV, and as Markdown."""

import csv
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write rows by column; what a row lacks is empty. The folder is made."""
    lines = list(rows)
    keys = list(dict.fromkeys(key for row in lines for key in row))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, keys, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows(lines)


def markdown_table(
    heads: Sequence[str],
    lines: Iterable[Sequence[object]],
    right: Collection[str] = (),
) -> str:
    """Return a table; the columns of the heads in ``right`` are numbers."""
    rows = [heads, ["---:" if head in right else "---" for head in heads], *lines]
    return "".join(f"| {' | '.join(map(str, row))} |\n" for row in rows)
