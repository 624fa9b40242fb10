"""What stands in the cells of the page's tables: names, numbers, words."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from page_runs import Row, rounded
from page_statistics import LEVEL, Difference
from qpavoid.lab.study.statistics import Interval
from qpavoid.lab.study.tables import markdown_table

PLANNER = "astar+"
"""Before a method's name: it follows the path of A*."""

KEPT = -1e-3
"""m beyond r_min, from which on it counts as kept."""


def table(heads: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    """Return a table whose first column is text and all others are numbers."""
    return markdown_table(heads, lines, heads[1:])


def code(name: str, bold: bool = False) -> str:
    """Return the name of a method, in bold if it is ours."""
    return f"**`{name}`**" if bold else f"`{name}`"


def between(value: Interval | None, scale: float = 1.0, digits: int = 1) -> str:
    """Return a value with its interval, or a dash."""
    if value is None:
        return "–"
    middle, low, high = (number(scale * x, digits) for x in value)
    return f"{middle} ({low} to {high})"


def number(value: float | None, digits: int) -> str:
    """Return a number with so many digits, and a minus that is one; or a dash."""
    if value is None:
        return "–"
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def below(rows: Sequence[Row]) -> int:
    """Return in how many runs a method came nearer than r_min."""
    return sum((row["min_room_m"] or 0.0) < KEPT for row in rows)


def room_of(rows: Sequence[Row], key: str) -> str:
    """Return the least room of runs, m, by the digits that tables keep."""
    room = least(rows, key)
    return number(room, sum(abs(room or 0.0) < some for some in (0.1, 1.0, 100.0)))


def median_time(rows: Sequence[Row]) -> str:
    """Return the median time of the successes, s, or a dash."""
    won = [row["arrived_s"] for row in rows if row["success"]]
    return number(float(np.median(won)) if won else None, 1)


def known(rows: Sequence[Row], key: str) -> list[float]:
    """Return a column of the runs that have it."""
    return [row[key] for row in rows if row.get(key) is not None]


def mean_of(
    rows: Sequence[Row], key: str, digits: int = 3, of: Callable[..., Any] = np.mean
) -> str:
    """Return the mean of a column over the runs that have it."""
    values = known(rows, key)
    return number(float(of(values)) if values else None, digits)


def jerk_of(rows: Sequence[Row], key: str) -> str:
    """Return the mean of a column whose values have two digits, in three."""
    values = known(rows, key)
    return rounded(str(np.mean(values)), ".3g") if values else "–"


def took(rows: Sequence[Row], key: str) -> str:
    """Return what deciding takes: median and, where known, 99th percentile."""
    keys = [x for x in (key, "solve_p99_us") if known(rows, x)]
    return " / ".join(mean_of(rows, x, 0, np.median) for x in keys) or "–"


def least(rows: Sequence[Row], key: str) -> float | None:
    """Return the least of a column."""
    return min(known(rows, key), default=None)


def in_words(p: float) -> str:
    """Return a p."""
    return "< 0.001" if p < 1e-3 else f"{p:.3f}"


def p_of(found: Difference) -> str:
    """Return Holm's p of a difference, with that by itself where only that is below."""
    alone = f" ({in_words(found.single)})" * (found.single < LEVEL <= found.p)
    return in_words(found.p) + alone


def won_of(rows: Sequence[Row]) -> str:
    """Return successes of runs."""
    return f"{sum(row['success'] for row in rows)} of {len(rows)}"
