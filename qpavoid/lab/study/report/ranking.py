"""Rows of runs to rankings: pure functions, the same answer every time."""

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from math import comb, sqrt
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.lab.simulation.log import NO_BACK_END
from qpavoid.lab.study.report.results import Row
from qpavoid.model.footprint import Array

Interval: TypeAlias = tuple[float, float, float]
"""A value and its 95 % interval."""

PLAIN = ("exact", *NO_BACK_END)
"""Solvers that go without saying."""

Z = 1.959964
RESAMPLES = 400
BLOCK = 2_000_000
"""Numbers drawn at a time."""


def wilson(hits: int, n: int) -> Interval:
    """Return the rate and its 95 % interval (Wilson), for n of at least 1."""
    rate, square = hits / n, Z * Z / n
    middle = (rate + square / 2) / (1 + square)
    half = Z / (1 + square) * sqrt(rate * (1 - rate) / n + square / (4 * n))
    return rate, min(rate, max(0.0, middle - half)), max(rate, min(1.0, middle + half))


def bootstrap(
    values: Array, statistic: Callable[..., Any] = np.median
) -> Interval | None:
    """Return a statistic and its 95 % percentile bootstrap interval, always the same.

    Args:
        values: Finite numbers; without any the answer is ``None``.
        statistic: ``np.median`` or ``np.mean``, along an axis.
    """
    if not len(values):
        return None
    generator = np.random.default_rng(0)
    drawn: list[float] = []
    while len(drawn) < RESAMPLES:
        count = min(RESAMPLES - len(drawn), max(1, BLOCK // len(values)))
        chosen = generator.integers(len(values), size=(count, len(values)))
        drawn += statistic(values[chosen], axis=1).tolist()
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(statistic(values, axis=0)), float(low), float(high)


class Paired(NamedTuple):
    """Two methods on the same scenes.

    Attributes:
        scenes: That both ran.
        only_first: Scenes in which only the first succeeded.
        only_second: Scenes in which only the second did.
        success: First less second, share of the scenes, with its 95 % interval.
        both: Scenes in which both succeeded.
        time: First less second, mean over these, s, with its 95 % interval.
    """

    scenes: int
    only_first: int
    only_second: int
    success: Interval
    both: int
    time: Interval | None

    @property
    def p(self) -> float:
        """McNemar's exact p: how likely so uneven a split is between equal methods."""
        alone = self.only_first, self.only_second
        ways = sum(comb(sum(alone), k) for k in range(min(alone) + 1))
        return min(1.0, 2 * ways / (1 << sum(alone)))


def paired(
    first: Mapping[Hashable, float | None], second: Mapping[Hashable, float | None]
) -> Paired | None:
    """Return how two methods differ on the scenes that both ran, if there are any.

    The intervals are a bootstrap over scenes.

    Args:
        first: Time of every success by scene, s; ``None`` for a failure.
        second: The same of the other method.
    """
    pairs = [(time, second[scene]) for scene, time in first.items() if scene in second]
    won = np.array([(a is not None, b is not None) for a, b in pairs], float)
    late = np.array([a - b for a, b in pairs if a is not None and b is not None])
    if not pairs:
        return None
    gained = won[:, 0] - won[:, 1]
    success = bootstrap(gained, np.mean)
    assert success is not None
    return Paired(
        len(pairs),
        int((gained > 0).sum()),
        int((gained < 0).sum()),
        success,
        len(late),
        bootstrap(late, np.mean),
    )


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
    return f"{row['controller']}" + ("" if solver in (None, *PLAIN) else f" ({solver})")


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
    return -record["success"][0], record["contact"][0], time[0] if time else np.inf


def _record(method: str, rows: list[Row]) -> dict[str, Any]:
    n = len(rows)
    arrived = [row for row in rows if row["success"]]
    times, clearance = _numbers(arrived, "arrived_s"), _numbers(rows, "min_clearance_m")
    room = _numbers(rows, "min_room_m")
    return {
        "method": method,
        "controller": rows[0]["controller"],
        "runs": n,
        "success": wilson(len(arrived), n),
        "contact": wilson(sum(bool(row["contact"]) for row in rows), n),
        "below": wilson(int((room < -1e-3).sum()), len(room)) if len(room) else None,
        "time": bootstrap(times),
        "clearance": bootstrap(clearance),
        "error": bootstrap(_numbers(rows, "max_error_m"), np.mean),
        "changed": bootstrap(_numbers(rows, "changed_s"), np.mean),
        "outcomes": dict(Counter(str(row["outcome"]) for row in rows).most_common()),
        "clearance_box": _box(clearance),
        "time_box": _box(times),
    }


def _numbers(rows: Sequence[Row], key: str) -> Array:
    """Return the finite values of a column."""
    values = np.array([row[key] for row in rows if row.get(key) is not None], float)
    found: Array = values[np.isfinite(values)]
    return found


def _box(values: Array) -> list[float] | None:
    """Return least, quartiles and greatest."""
    return np.percentile(values, [0, 25, 50, 75, 100]).tolist() if len(values) else None


def effects(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return success over each setting that was varied, for every controller.

    All other settings are pooled.
    """
    hits: defaultdict[str, defaultdict[tuple[str, Any], list[bool]]]
    hits = defaultdict(lambda: defaultdict(list))
    for row in rows:
        for key, value in settings_of(row).items():
            hits[key][who(row), value].append(bool(row["success"]))
    return [
        {
            "setting": key,
            "points": [
                {"who": name, "value": value, "success": wilson(sum(won), len(won))}
                for (name, value), won in sorted(found.items(), key=lambda x: str(x[0]))
            ],
        }
        for key, found in hits.items()
    ]
