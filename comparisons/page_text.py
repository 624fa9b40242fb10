"""Markdown of the page of all comparisons: rankings, differences, where we lose."""

import re
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from page_runs import BEGAN, OUTCOMES, Row, by
from page_statistics import (
    Difference,
    Pair,
    adjust,
    compare,
    difference,
    share,
    time_ratio,
)
from qpavoid.lab.simulation.methods import solver_of
from qpavoid.lab.study.statistics import Interval
from qpavoid.lab.study.tables import markdown_table

OURS = ("qp-ahead+guide", "qp-ahead+detour", "qp-ahead")
"""Our filter: the first of these that a study ran."""

COMPARABLE = 0.9
"""Of the greatest share of successes: from here on a method's times are comparable."""

ANOTHER_MACHINE = ("omni", "orca-holonomic")
"""What drives them is ranked, and is no other method for the same robot."""

WORDS = {1: "better", 0: "level", -1: "worse"}
KEPT = -1e-3
"""m beyond r_min, from which on it counts as kept."""


class Part(NamedTuple):
    """What a study says in one ranking.

    Attributes:
        title: Setting; empty if the study has but one.
        runs: Of all methods, the best first.
        ours: Name of our filter; empty if it did not run.
        clusters: Number of that of each scene.
        pairs: Our filter less each other method, on the same scenes.
        began: Scenes that are left out: they begin in contact.
    """

    title: str
    runs: Mapping[str, Sequence[Row]]
    ours: str
    clusters: Mapping[Hashable, int]
    pairs: Mapping[str, Pair]
    began: Sequence[tuple[str, str]]

    @property
    def scenes(self) -> int:
        """How many different ones."""
        return len(self.clusters)

    def success(self, name: str) -> Interval:
        """Return the share of successes of a method, with its interval."""
        groups = [self.clusters[scene_of(row)] for row in self.runs[name]]
        hits = [row["success"] for row in self.runs[name]]
        return share(np.array(hits, float), np.array(groups))

    def won(self, name: str) -> int:
        """Return in how many runs a method succeeded."""
        return sum(row["success"] for row in self.runs[name])


def scene_of(row: Row) -> tuple[str, str]:
    """Return what two runs of the same scene have in common."""
    return row["setting"], row["scene"]


def cluster_of(scene: tuple[str, str], rule: int | str) -> Hashable:
    """Return what the scenes that are not independent have in common.

    Args:
        scene: Its setting and name.
        rule: So many numbers in a row are of one world; or a pattern whose groups are
            the cluster of ``setting scene``; empty: each scene is its own.

    Raises:
        ValueError: A scene of which the rule does not say it.
    """
    if not rule:
        return scene
    if isinstance(rule, int):
        return scene[0], int(scene[1]) // rule
    found = re.search(rule, " ".join(scene))
    if found is None:
        raise ValueError(f"no cluster of {scene}: {rule!r}")
    return found.groups()


def make_parts(rows: Sequence[Row], text: Mapping[str, Any], most: int) -> list[Part]:
    """Return a ranking for every setting, or one of all; p is Holm's over all."""
    settings, most = by(rows, "setting"), text.get("most_parts", most)
    groups = {"": rows} if len(settings) > most else settings
    parts = [make_part(title, some, text) for title, some in groups.items()]
    adjust([pair for part in parts for pair in part.pairs.values()])
    return parts


def make_part(title: str, rows: Sequence[Row], text: Mapping[str, Any]) -> Part:
    """Return ranking and differences of some runs; p as if each were the only one."""
    began = {scene_of(row): None for row in rows if row["outcome"] == BEGAN}
    runs = by((row for row in rows if scene_of(row) not in began), "method")
    runs = dict(sorted(runs.items(), key=lambda item: place(item[1])))
    scenes = {scene_of(row): None for some in runs.values() for row in some}
    groups = {x: cluster_of(x, text.get("cluster", "")) for x in scenes}
    number = {group: k for k, group in enumerate(dict.fromkeys(groups.values()))}
    clusters = {x: number[group] for x, group in groups.items()}
    own = next((name for name in text.get("ours", OURS) if name in runs), "")
    pairs, times = {}, {name: times_of(some) for name, some in runs.items()}
    for name in runs if own else ():
        pair = compare(times[own], times[name], clusters)
        if name != own and pair is not None:
            pairs[name] = pair
            scores = (column(runs[x], "metric") for x in (own, name))
            found = difference(*scores, clusters) if text.get("scored") else None
            pair.differences.update({} if found is None else {"metric": found})
    return Part(title, runs, own, clusters, pairs, [*began])


def place(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Return what rankings go by: successes, contacts, median time of a success."""
    won = [row["arrived_s"] for row in rows if row["success"]]
    touched = np.mean([row["contact"] for row in rows])
    return -len(won) / len(rows), float(touched), float(np.median(won or [np.inf]))


def times_of(rows: Sequence[Row]) -> dict[Hashable, float | None]:
    """Return the time of every success by scene.

    Raises:
        ValueError: A scene was run twice.
    """
    times = column([row for row in rows if row["success"]], "arrived_s")
    times = {scene_of(row): times.get(scene_of(row)) for row in rows}
    if len(times) < len(rows):
        raise ValueError(f"{rows[0]['method']}: a scene was run twice")
    return times


def column(rows: Sequence[Row], key: str) -> dict[Hashable, float | None]:
    """Return a column by scene."""
    return {scene_of(row): row.get(key) for row in rows}


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


def quickest(part: Part) -> str:
    """Return the quickest of the methods that succeed about as often as the best.

    By the times over ours where both succeed; without ours, over the best.
    """
    yard = part.ours or next(iter(part.runs))
    rate = {name: part.won(name) / len(rows) for name, rows in part.runs.items()}
    near = [x for x in rate if rate[x] >= COMPARABLE * max(rate.values())]
    ratios = {name: over(part, name, yard) for name in near if rate[name]}
    known = {name: found.value[0] for name, found in ratios.items() if found}
    return min(known, key=lambda name: known[name]) if known else ""


def over(part: Part, name: str, other: str) -> Difference | None:
    """Return the times of a method over those of another."""
    times = (times_of(part.runs[x]) for x in (name, other))
    return time_ratio(*times, part.clusters)


def ranking(part: Part, apart: bool = False) -> str:
    """Return the ranking as a table.

    Args:
        part: Of a study.
        apart: Whether what success asks for has columns of its own.
    """
    rows = [row for some in part.runs.values() for row in some]
    seen = {row["outcome"] for row in rows}
    shown = [key for key in list(OUTCOMES)[1:] if key in seen or key != "failed"]
    first, more = quickest(part), shown_columns(rows)
    heads = ["method", "success", "% (95 %)"]
    heads += ["contact-free", "r_min kept", "returned"] * apart
    heads += [OUTCOMES[key] for key in shown]
    heads += ["below r_min"] * (not apart) + ["median time s"]
    heads += [f"time / `{first}` (95 %)"] * bool(first) + list(more)
    lines = []
    for name, some in part.runs.items():
        became = Counter(row["outcome"] for row in some)
        below = sum((row["min_room_m"] or 0.0) < KEPT for row in some)
        won = [row["arrived_s"] for row in some if row["success"]]
        back = sum(row["arrived_s"] is not None for row in some)
        free = len(some) - sum(row["contact"] for row in some)
        ratio = over(part, name, first) if first else None
        line = [code(name, name == part.ours), f"{len(won)} of {len(some)}"]
        line += [between(part.success(name), 100.0)]
        line += [free, len(some) - below, back] if apart else []
        line += [became[key] for key in shown] + [below] * (not apart)
        line += [number(float(np.median(won)) if won else None, 1)]
        line += [between(ratio and ratio.value, digits=2)] if first else []
        lines.append([*line, *(show(some) for show in more.values())])
    return table(heads, lines)


def shown_columns(rows: Sequence[Row]) -> dict[str, Callable[[Sequence[Row]], str]]:
    """Return what else some row knows: head of the column, and what is shown in it."""
    found = {
        key.replace("_", " "): lambda some, key=key: mean_of(some, key)
        for key in rows[0]
        if key.startswith("metric")
    }
    for key, head, shown in (
        ("min_room_m", "least room m", lambda some, key: number(least(some, key), 3)),
        ("jerk_mps3", "jerk m/s³", lambda some, key: mean_of(some, key, 2)),
        ("solve_us", "solve µs", lambda some, key: mean_of(some, key, 0, np.median)),
    ):
        if any(row.get(key) is not None for row in rows):
            found[head] = lambda some, key=key, shown=shown: shown(some, key)
    return found


def known(rows: Sequence[Row], key: str) -> list[float]:
    """Return a column of the runs that have it."""
    return [row[key] for row in rows if row.get(key) is not None]


def mean_of(
    rows: Sequence[Row], key: str, digits: int = 3, of: Callable[..., Any] = np.mean
) -> str:
    """Return the mean of a column over the runs that have it."""
    values = known(rows, key)
    return number(float(of(values)) if values else None, digits)


def least(rows: Sequence[Row], key: str) -> float | None:
    """Return the least of a column."""
    return min(known(rows, key), default=None)


def in_words(p: float) -> str:
    """Return a p."""
    return "< 0.001" if p < 1e-3 else f"{p:.3f}"


def differences(part: Part, scored: bool) -> str:
    """Return our filter less each other method as a table."""
    heads = ["ours less", "only ours", "only theirs", "success, points (95 %)", "p"]
    heads += ["Cohen's g", "both", "time, ours / theirs (95 %)", "p (time)"]
    heads += ["metric (95 %)", "p (metric)"] * scored
    lines = []
    for name, pair in part.pairs.items():
        found = pair.differences
        same = pair.only_first == pair.only_second == 0
        points = between(found["success"].value, 100.0)
        line = [code(name), pair.only_first, pair.only_second]
        line += ["0, nowhere different" if same else points]
        line += [in_words(found["success"].p), "–" if same else number(pair.g, 2)]
        line += [pair.both, *both_of(found.get("time"), 2)]
        line += both_of(found.get("metric"), 3) if scored else []
        lines.append(line)
    return table(heads, lines)


def both_of(found: Difference | None, digits: int) -> list[str]:
    """Return value and p of a difference, or two dashes."""
    if found is None:
        return ["–", "–"]
    return [between(found.value, digits=digits), in_words(found.p)]


def single_runs(part: Part) -> str:
    """Return the table of a part with one scene."""
    lines = []
    for name, (row,) in part.runs.items():
        time, room = (row["arrived_s"] if row["success"] else None), row["min_room_m"]
        line = [code(name, name == part.ours), OUTCOMES[row["outcome"]]]
        lines.append([*line, number(time, 2), number(room, 3)])
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


def others(part: Part) -> list[str]:
    """Return the methods for the same robot that are not our filter, best first."""
    return [
        name
        for name in part.pairs
        if solver_of(name, "") and name not in ANOTHER_MACHINE
    ]


def rival(part: Part, key: str) -> str:
    """Return the other method that is best in a quantity; empty: there is none.

    In time: of those that succeed about as often as the best.
    """
    rate = {name: part.won(name) / len(rows) for name, rows in part.runs.items()}
    near = COMPARABLE * max(rate.values()) if key == "time" else 0.0
    names = [x for x in others(part) if key in part.pairs[x].differences]
    sign = -1.0 if key == "time" else 1.0
    return min(
        (name for name in names if rate[name] >= near),
        key=lambda name: sign * part.pairs[name].differences[key].value[0],
        default="",
    )


def standing(part: Part, key: str) -> str:
    """Return where ours stands against the best other in a quantity; p is Holm's."""
    name = rival(part, key)
    if not name:
        alone = key == "success"
        return f"{share_of(part, part.ours)}, nobody else ran" if alone else "–"
    found = part.pairs[name].differences[key]
    if key == "time":
        how = between(found.value, digits=2)
    else:
        each = (part.ours, name)
        of = [share_of(part, x) for x in each]
        if key == "metric":
            of = [mean_of(part.runs[x], "metric") for x in each]
        how = " / ".join(of)
    return f"**{WORDS[found.clear]}**: {how}, {code(name)}"


def share_of(part: Part, name: str) -> str:
    """Return successes of runs."""
    return f"{part.won(name)} of {len(part.runs[name])}"


def not_best(part: Part, scored: bool) -> str:
    """Return in words where our filter is not best, computed from the tables.

    Args:
        part: Of a study.
        scored: Whether ``metric`` says how good a method is, the more the better.
    """
    found = []
    ahead = [x for x, pair in part.pairs.items() if pair.only_first < pair.only_second]
    if ahead:
        found.append("more successes: " + ", ".join(lead(part, name) for name in ahead))
    touched = {name: moved(rows) for name, rows in part.runs.items()}
    fewer = [name for name, n in touched.items() if n < touched[part.ours]]
    if fewer:
        words = ", ".join(f"{code(name)} ({touched[name]})" for name in fewer)
        found.append(f"fewer contacts than our {touched[part.ours]}: {words}")
    quick = losses(part, "time", "ours takes {} times as long", 2)
    found += [f"quicker where both succeed: {quick}"] if quick else []
    more = losses(part, "metric", "ours less {}", 3) if scored else ""
    found += [f"a higher metric: {more}"] if more else []
    return "; ".join(found) or "nowhere in these columns"


def losses(part: Part, key: str, how: str, digits: int) -> str:
    """Return in words the methods that are clearly better than ours in a quantity."""
    found = {name: pair.differences.get(key) for name, pair in part.pairs.items()}
    return ", ".join(
        f"{code(name)} ({how.format(between(x.value, digits=digits))})"
        for name, x in found.items()
        if x is not None and x.clear < 0
    )


def lead(part: Part, name: str) -> str:
    """Return in words by how much another method is ahead of ours."""
    success = part.pairs[name].differences["success"]
    middle, low, high = success.value
    points = between((-middle, -high, -low), 100.0)
    return f"{code(name)} by {points} points" + ("" if success.clear else ", level")


def moved(rows: Sequence[Row]) -> int:
    """Return in how many runs a contact began while the robot moved."""
    return sum(row["outcome"] == "contact" for row in rows)
