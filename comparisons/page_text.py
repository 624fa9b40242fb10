"""Markdown of the page of all comparisons: rankings, differences, where we lose."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from page_parts import (
    ANOTHER_MACHINE,
    CONTACTS,
    Part,
    on_both,
    outcomes,
    scene_of,
    shared,
)
from page_rivals import others, over, quickest, rival, unclear
from page_runs import BEGAN, OUTCOMES, Row, by, rounded
from page_statistics import LEVEL, Difference
from qpavoid.lab.simulation.methods import REGISTRY
from qpavoid.lab.study.statistics import Interval
from qpavoid.lab.study.tables import markdown_table

WORDS = {1: "better", 0: "level", -1: "worse"}
PLANNER = "astar+"
"""Before a method's name: it follows the path of A*."""

METHODS = (
    *(name for name in REGISTRY if name not in ("qp-ahead", *ANOTHER_MACHINE)),
    "astar",
)
"""The other methods for the same robot: a ranking says which did not run."""

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
        became = outcomes(part, name)
        nearer = below(some)
        back = sum(row["arrived_s"] is not None for row in some)
        ended = len(some) - became["failed"]
        free = ended - sum(row["contact"] for row in some)
        ratio = over(part, name, first) if first else None
        line: list[object] = [code(name, name == part.ours)]
        line += [won_of(some)]
        line += [between(part.success(name), 100.0)]
        line += [free, ended - nearer, back] if apart else []
        line += [became[key] for key in shown] + [nearer] * (not apart)
        line += [median_time(some)]
        line += [between(ratio and ratio.value, digits=2)] if first else []
        lines.append([*line, *(show(some) for show in more.values())])
    return table(heads, lines)


def shown_columns(rows: Sequence[Row]) -> dict[str, Callable[[Sequence[Row]], str]]:
    """Return what else some row knows: head of the column, and what is shown in it."""
    metrics = [key for key in rows[0] if key.startswith("metric")]
    columns: list[tuple[str, str, Callable[..., str]]] = [
        *((key, key.replace("_", " "), mean_of) for key in metrics),
        ("min_room_m", "least room m", room_of),
        ("jerk_mps3", "jerk m/s³", jerk_of),
        ("solve_us", "solve µs", took),
    ]
    return {
        head: partial(shown, key=key)
        for key, head, shown in columns
        if key in metrics or known(rows, key)
    }


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


def differences(part: Part, scored: bool) -> str:
    """Return our filter less each other method as a table."""
    heads = ["ours less", "only ours", "only theirs", "success, points (95 %)", "p"]
    heads += ["Cohen's g"]
    heads += [head for key in CONTACTS for head in (key, f"p ({key})")]
    heads += ["both", "time, ours / theirs (95 %)", "p (time)"]
    heads += ["metric (95 %)", "p (metric)"] * scored
    lines = []
    for name, pair in part.pairs.items():
        found = pair.differences
        same = pair.only_first == pair.only_second == 0
        points = between(found["success"].value, 100.0)
        line = [code(name), pair.only_first, pair.only_second]
        line += ["0, nowhere different" if same else points]
        line += [p_of(found["success"]), "–" if same else number(pair.g, 2)]
        for key in CONTACTS:
            line += [struck(part, name, key), p_of(found[key])]
        line += [pair.both, *both_of(found.get("time"), 2)]
        line += both_of(found.get("metric"), 3) if scored else []
        lines.append(line)
    return table(heads, lines)


def struck(part: Part, name: str, key: str) -> str:
    """Return in how many of the scenes of both ours and another have a contact."""
    ours, theirs, _ = on_both(part, (part.ours, name), CONTACTS[key])
    return f"{ours} / {theirs}"


def both_of(found: Difference | None, digits: int) -> list[str]:
    """Return value and p of a difference, or two dashes."""
    if found is None:
        return ["–", "–"]
    return [between(found.value, digits=digits), p_of(found)]


def single_runs(part: Part) -> str:
    """Return the table of a part with one scene."""
    more = shown_columns([row for (row,) in part.runs.values()])
    lines = []
    for name, some in part.runs.items():
        (row,) = some
        time = number(row["arrived_s"] if row["success"] else None, 2)
        line = [code(name, name == part.ours), OUTCOMES[row["outcome"]], time]
        lines.append([*line, *(show(some) for show in more.values())])
    return table(["method", "outcome", "time s", *more], lines)


def grid(rows: Sequence[Row]) -> str:
    """Return the successes of every method (columns) in every setting (rows)."""
    rows = [row for row in rows if row["outcome"] != BEGAN]
    settings, methods = by(rows, "setting"), list(by(rows, "method"))
    lines = []
    for setting, some in settings.items():
        runs = by(some, "method")
        most = max(len(found) for found in runs.values())
        counts = [cell_of(runs.get(name, []), most) for name in methods]
        lines.append([f"{setting} ({most} scenes)", *counts])
    return table(["successes", *map(code, methods)], lines)


def cell_of(rows: Sequence[Row], scenes: int) -> str:
    """Return the successes, of how many if not of all scenes, or a dash."""
    return won_of(rows).removesuffix(f" of {scenes}") if rows else "–"


def absent(part: Part, why: str) -> str:
    """Return which of the methods did not run, and why, in a sentence, or nothing."""
    before = PLANNER * part.ours.startswith(PLANNER)
    ran = {name.removeprefix(before) for name in part.runs}
    names = [code(name) for name in METHODS if name not in ran]
    where = f" (of those {code(f'{PLANNER}…')})" * bool(before)
    return f"Did not run here{where}: {', '.join(names)}{why}." * bool(names)


def unplanned(part: Part) -> str:
    """Return which methods did not run behind A*, in a sentence, or nothing."""
    if part.ours.startswith(PLANNER):
        return ""
    every = dict.fromkeys((*METHODS, "qp-ahead", part.ours))
    names = [name for name in every if name not in ("alone", "astar")]
    without = [code(name) for name in names if PLANNER + name not in part.runs]
    if without and len(without) == len(names):
        return "Nobody ran behind A\\*."
    return f"Not behind A\\*: {', '.join(without)}." * bool(without)


def partly(part: Part) -> str:
    """Return which methods ran which scenes, if not all, in a sentence, or nothing."""
    most = max(part.runs.values(), key=len)
    of: defaultdict[str, list[str]] = defaultdict(list)
    for name, some in part.runs.items():
        if len(some) < len(most):
            of[which(some, most)].append(code(name))
    told = (f"{some}: {', '.join(names)}" for some, names in of.items())
    return f"Ran some of the {len(most)} scenes: {'; '.join(told)}." * bool(of)


def which(some: Sequence[Row], most: Sequence[Row]) -> str:
    """Return which of the scenes of many runs those of some are, as far as it is plain.

    The first of each setting, or one in so many from its first on, or how many.
    """
    ran, every = {scene_of(row) for row in some}, by(most, "setting").values()
    places = [[k for k, x in enumerate(of) if scene_of(x) in ran] for of in every]
    steps = {b - a for of in places for a, b in pairwise(of)} or {1}
    sizes = {len(of) for of in places}
    if all(of[:1] == [0] for of in places) and len(steps) == 1:
        if steps != {1}:
            return f"one in {steps.pop()} ({len(some)})"
        if len(sizes) == 1:
            return f"the first {sizes.pop()}" + " of each setting" * (len(places) > 1)
    return f"{len(some)}"


MOST_NAMED = 4
"""Others with whom ours is level that are named; of more only how many there are."""


def standing(part: Part, key: str) -> str:
    """Return where ours stands against the best other in a quantity; p is Holm's.

    Both in the scenes that both ran, of the ranking with most.
    """
    name = rival(part, key)
    if not name:
        return "–"
    one, found = part.most(name), part.versus(name)[key]
    if key == "time":
        how = between(found.value, digits=2)
    elif key in CONTACTS:
        how = struck(one, name, key)
    else:
        each = shared(one, (part.ours, name))
        of = [won_of(some) for some in each]
        if key == "metric":
            of = [mean_of(some, "metric") for some in each]
        how = " / ".join(of)
    runs = part.pair(name).scenes
    some = f" in {runs} scenes" * (key != "success" and runs != part.scenes)
    ahead = leads(part, name) if key == "success" else ""
    also = alike(part, key) if found.clear > 0 else ""
    return f"**{WORDS[found.clear]}**: {how}, {code(name)}{some}{ahead}{also}"


def alike(part: Part, key: str) -> str:
    """Return with whom ours is level in a quantity, where it is with anybody."""
    rest = unclear(part, key)
    told = f"{len(rest)} others"
    if len(rest) <= MOST_NAMED:
        told = ", ".join(map(code, rest))
    return f"; level with {told}" * bool(rest)


def leads(part: Part, named: str) -> str:
    """Return who succeeds most often, where that is more often than ours, and level.

    With the p of that comparison by itself.
    """
    found = {name: part.versus(name)["success"] for name in others(part)}
    most = min(found, key=lambda name: (found[name].value[0], name != named))
    if found[most].clear or found[most].value[0] >= 0.0:
        return ""
    both = " / ".join(map(won_of, shared(part.most(most), (part.ours, most))))
    who = f"; level: {both}, {code(most)}" * (most != named)
    return f"{who} (p {in_words(found[most].single)} by itself)"


def won_of(rows: Sequence[Row]) -> str:
    """Return successes of runs."""
    return f"{sum(row['success'] for row in rows)} of {len(rows)}"


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
    fewer = [told for name in part.pairs if (told := struck_less(part, name))]
    if fewer:
        ours = outcomes(part, part.ours)["contact"]
        found.append(f"fewer contacts than our {ours}: {', '.join(fewer)}")
    quick = losses(part, "time", "ours takes {} times as long", 2)
    found += [f"quicker where both succeed: {quick}"] if quick else []
    more = losses(part, "metric", "ours less {}", 3) if scored else ""
    found += [f"a higher metric: {more}"] if more else []
    seen = ["success", "contacts begun in motion", "time", *["metric"] * scored]
    return "; ".join(found) or f"nowhere in {', '.join(seen[:-1])} and {seen[-1]}"


def struck_less(part: Part, name: str) -> str:
    """Return who begins fewer contacts than ours, in the scenes of both, or nothing."""
    hit = CONTACTS["contacts in motion"]
    theirs, ours, both = on_both(part, (name, part.ours), hit)
    some = f", ours {ours} in the same {both}" * (both < part.scenes)
    return f"{code(name)} ({theirs}{some})" * (theirs < ours)


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
