"""Markdown of what every method did: rankings, grids, and who did not run."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

from page_cells import (
    PLANNER,
    below,
    between,
    code,
    jerk_of,
    known,
    mean_of,
    median_time,
    number,
    room_of,
    table,
    took,
    won_of,
)
from page_parts import ANOTHER_MACHINE, Part, outcomes, scene_of
from page_rivals import over, quickest
from page_runs import BEGAN, OUTCOMES, Row, by
from qpavoid.lab.simulation.methods import REGISTRY

METHODS = (
    *(name for name in REGISTRY if name not in ("qp-ahead", *ANOTHER_MACHINE)),
    "astar",
)
"""The other methods for the same robot: a ranking says which did not run."""


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
