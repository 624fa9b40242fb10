"""Markdown of the page of all comparisons: rankings, differences, where we lose."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from page_runs import OUTCOMES, Row, by
from qpavoid.lab.study.report.ranking import rank
from qpavoid.lab.study.statistics import Interval, Paired, bootstrap, paired
from qpavoid.lab.study.tables import markdown_table

OURS = ("qp-ahead+guide", "qp-ahead+detour", "qp-ahead")
"""Our filter: the first of these that a study ran."""

FEW = 8
"""Scenes in which both succeed, from which on their times are compared."""

LEVEL = 0.05
"""Of McNemar's p: below it ours and another method are told apart."""


class Part(NamedTuple):
    """What a study says in one ranking.

    Attributes:
        title: Setting; empty if the study has but one.
        rows: Of all methods.
        records: One a method, the best first.
        ours: Name of our filter; empty if it did not run.
        pairs: Our filter less each other method, on the same scenes.
    """

    title: str
    rows: Sequence[Row]
    records: Sequence[Mapping[str, Any]]
    ours: str
    pairs: Mapping[str, Paired]

    @property
    def scenes(self) -> int:
        """How many different ones."""
        return len({scene_of(row) for row in self.rows})


def scene_of(row: Row) -> tuple[str, str]:
    """Return what two runs of the same scene have in common."""
    return row["setting"], row["scene"]


def make_part(title: str, rows: Sequence[Row], ours: Sequence[str] = OURS) -> Part:
    """Return ranking and differences of some runs."""
    methods = by(rows, "method")
    own = next((name for name in ours if name in methods), "")
    times = {name: times_of(runs) for name, runs in methods.items()}
    records, pairs = rank(rows), {}
    for name in (record["method"] for record in records if own):
        pair = paired(times[own], times[name])
        if name != own and pair is not None:
            pairs[name] = pair
    return Part(title, rows, records, own, pairs)


def times_of(rows: Sequence[Row]) -> dict[Any, float | None]:
    """Return the time of every success by scene.

    Raises:
        ValueError: A scene was run twice.
    """
    times = {
        scene_of(row): row["arrived_s"] if row["success"] else None for row in rows
    }
    if len(times) < len(rows):
        raise ValueError(f"{rows[0]['method']}: a scene was run twice")
    return times


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


def number(value: float, digits: int) -> str:
    """Return a number with so many digits, and a minus that is one."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def ranking(part: Part) -> str:
    """Return the ranking as a table."""
    groups = by(part.rows, "method")
    metrics = [key for key in part.rows[0] if key.startswith("metric")]
    seen = {row["outcome"] for row in part.rows}
    shown = [key for key in list(OUTCOMES)[1:] if key in seen or key != "failed"]
    heads = ["method", "success", "% (95 %)", *(OUTCOMES[key] for key in shown)]
    heads += ["below r_min", "median time s (95 %)", "mean time s (95 %)"]
    heads += [key.replace("_", " ") for key in metrics]
    lines = []
    for record in part.records:
        name, rows = record["method"], groups[record["method"]]
        became = Counter(row["outcome"] for row in rows)
        room = [row["min_room_m"] for row in rows if row["min_room_m"] is not None]
        times = np.array([row["arrived_s"] for row in rows if row["success"]])
        lines.append(
            [
                code(name, name == part.ours),
                f"{became['success']} of {len(rows)}",
                between(record["success"], 100.0),
                *(became[key] for key in shown),
                sum(x < -1e-3 for x in room),
                between(record["time"]),
                between(bootstrap(times, np.mean)),
                *(mean(rows, key) for key in metrics),
            ]
        )
    return table(heads, lines)


def mean(rows: Sequence[Row], key: str) -> str:
    """Return the mean of a column over the runs that have it."""
    values = [row[key] for row in rows if row[key] is not None]
    return f"{np.mean(values):.3f}" if values else "–"


def differences(part: Part) -> str:
    """Return our filter less each other method as a table."""
    heads = ["ours less", "only ours", "only theirs", "success, points (95 %)"]
    heads += ["p", "both", "time where both succeed, s (95 %)"]
    lines = []
    for name, pair in part.pairs.items():
        same = pair.only_first == pair.only_second == 0
        points = "0, nowhere different" if same else between(pair.success, 100.0)
        wins = pair.only_first, pair.only_second
        p = "< 0.001" if pair.p < 1e-3 else f"{pair.p:.3f}"
        time = between(pair.time) if pair.both >= FEW else "–"
        lines.append([code(name), *wins, points, p, pair.both, time])
    return table(heads, lines)


def single_runs(part: Part) -> str:
    """Return the table of a part with one scene."""
    groups = by(part.rows, "method")
    lines = []
    for record in part.records:
        name = record["method"]
        (row,) = groups[name]
        time, room = (row["arrived_s"] if row["success"] else None), row["min_room_m"]
        numbers = [(time, 2), (room, 3)]
        lines.append(
            [code(name, name == part.ours), OUTCOMES[row["outcome"]]]
            + ["–" if x is None else number(x, digits) for x, digits in numbers]
        )
    return table(
        ["method", "outcome", "time s", "least distance beyond r_min m"], lines
    )


def grid(rows: Sequence[Row]) -> str:
    """Return the successes of every method (columns) in every setting (rows)."""
    settings, methods = by(rows, "setting"), list(by(rows, "method"))
    lines = []
    for setting, some in settings.items():
        runs = by(some, "method")
        counts = [sum(row["success"] for row in runs.get(name, [])) for name in methods]
        most = max(len(found) for found in runs.values())
        lines.append([f"{setting} ({most} scenes)", *counts])
    return table(["successes", *map(code, methods)], lines)


def clearly(pair: Paired) -> int:
    """Return 1 where ours succeeds more often, −1 where less, 0 if it is not known."""
    if pair.p >= LEVEL:
        return 0
    return 1 if pair.only_first > pair.only_second else -1


def not_best(part: Part, scored: bool) -> str:
    """Return in words where our filter is not best, computed from the tables.

    Args:
        part: Of a study.
        scored: Whether ``metric`` says how good a method is, the more the better.
    """
    found = []
    ahead = [name for name, pair in part.pairs.items() if pair.success[0] < 0.0]
    if ahead:
        found.append("more successes: " + ", ".join(lead(part, name) for name in ahead))
    groups = by(part.rows, "method")
    touched = {name: moved(rows) for name, rows in groups.items()}
    fewer = [name for name, n in touched.items() if n < touched[part.ours]]
    if fewer:
        words = ", ".join(f"{code(name)} ({touched[name]})" for name in fewer)
        found.append(f"fewer contacts than our {touched[part.ours]}: {words}")
    quick = {
        name: pair.time
        for name, pair in part.pairs.items()
        if pair.time is not None and pair.both >= FEW and pair.time[1] > 0.0
    }
    if quick:
        words = ", ".join(f"{code(k)} by {between(v)} s" for k, v in quick.items())
        found.append(f"quicker where both succeed: {words}")
    if scored:
        scores = {name: mean(rows, "metric") for name, rows in groups.items()}
        more = [name for name, score in scores.items() if score > scores[part.ours]]
        if more:
            words = ", ".join(f"{code(name)} ({scores[name]})" for name in more)
            found.append(f"a higher metric than our {scores[part.ours]}: {words}")
    return "; ".join(found) or "nowhere in these columns"


def lead(part: Part, name: str) -> str:
    """Return in words by how much another method is ahead of ours."""
    middle, low, high = part.pairs[name].success
    points = between((-middle, -high, -low), 100.0)
    known = "" if clearly(part.pairs[name]) else ", not told apart"
    return f"{code(name)} by {points} points{known}"


def moved(rows: Sequence[Row]) -> int:
    """Return in how many runs something was touched by a robot that moved."""
    return sum(row["outcome"] == "contact" for row in rows)
