"""Results of all studies: rates, as CSV, as Markdown, and as JSON."""

import csv
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

Interval: TypeAlias = tuple[float, float, float]
"""A value and its 95 % interval."""


def wilson(hits: int, n: int) -> Interval:
    """Return the rate and its 95 % interval (Wilson), for n of at least 1."""
    from scipy import stats  # a second

    low, high = stats.binomtest(hits, n).proportion_ci(method="wilson")
    return hits / n, float(low), float(high)


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


def plain(value: Any) -> Any:
    """Return what JSON can say: of numbers that are not finite it is null."""
    if isinstance(value, Mapping):
        return {str(key): plain(value[key]) for key in value}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
