"""Compact tables of runs: what the page of all comparisons is made from.

A study's ``runs.csv`` becomes ``results/<study>.csv`` with the columns that the page
needs, rounded, one row a run; without a method it has method and setting of the row
above, and without a scene that of the same place in the last block that has so many; a
scene is told without the words that all scenarios of its setting begin with. A block
is a method in a setting, and tells once what is of all its runs: mean jerk, median
solve, means of CrowdNav's distances. A study that leaves no such runs keeps its
``table.csv``.
"""

import csv
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from itertools import chain, groupby, takewhile
from pathlib import Path
from statistics import fmean, median
from typing import Any, TypeAlias

from qpavoid.lab.study.tables import write_csv

Row: TypeAlias = dict[str, Any]

NEEDED = {"method", "setting", "scenario", "seed", "outcome", "success", "contact"}
NUMBERS = {
    "arrived_s": (".2f",),
    "min_room_m": (".4f", ".3g", ".2g"),
    "jerk_mps3": (".3g",),
    "solve_us": (".2g",),
    "solve_p99_us": (".2g",),
}
"""Columns that are kept, and how they are rounded, in turn: a clock says no more than
that, and of room two digits do, but beside r_min the tenth of a millimetre."""

OF_BLOCK: dict[str, Callable[[list[float]], float]] = {
    "jerk_mps3": fmean,
    "solve_us": median,
    "solve_p99_us": median,
    "metric_touched_disc": fmean,
    "metric_touched_footprint": fmean,
    "metric_least": fmean,
    "metric_discomfort": fmean,
    "metric_time": fmean,
    "metric_way": fmean,
    "metric_arrived": fmean,
    "metric_surprised": fmean,
    "metric_time_ratio": fmean,
}
"""Columns that are one number a block, and what that is of its runs: clocks, and what
is shown as a mean of many."""

OF_ARRIVED = "metric_time", "metric_way", "metric_time_ratio"
"""Those of them that runs have which arrive."""

EMPTY = {
    "outcome": 1,
    "scene": 2,
    "method": 3,
    "setting": 3,
    **dict.fromkeys(OF_BLOCK, 3),
}
"""Columns by how often they are empty: most those that a block tells once."""

AS_ABOVE = "method", "setting", "outcome"
"""Columns of a compact table that are empty where they are as in the row above."""

BEGAN = "began"
"""The outcome of a run that begins in contact: it says nothing of a method."""

OUTCOMES = {
    "success": "success",
    "contact": "contact moving",
    "contact_standing": "contact standing",
    "stalled": "stood still",
    "late": "late",
    "failed": "failed",
}
"""What becomes of a run: as the tables write it, and as the page does."""


def read_csv(path: Path) -> list[Row]:
    """Return the rows of a table as text."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, restval=""))


def condense(folder: Path, results: Path, beside: bool = False) -> Path | None:
    """Write the compact table of a study's folder; without one there is ``None``.

    ``beside``: what the folder has not, method or setting, keeps its rows so far.
    """
    path, lines = results / f"{folder.name}.csv", lines_of(folder)
    if not lines:
        return None
    if beside and path.is_file():
        lines = merged(whole(read_csv(path)), lines)
    write_table(path, lines)
    return path


def write_table(path: Path, lines: list[Row]) -> None:
    """Write a table as it is kept."""
    if is_runs(lines):
        lines = [fullest_first(line) for line in brief(lines)]
    write_csv(path, lines)
    rows = path.read_text(encoding="utf-8").splitlines()
    kept = [row.rstrip(",") or "," for row in rows]
    path.write_text("".join(f"{row}\n" for row in kept), encoding="utf-8")


def fullest_first(line: Row) -> Row:
    """Return a line with what is most often empty at its end, where no comma stands."""
    return dict(sorted(line.items(), key=lambda item: EMPTY.get(item[0], 0)))


def lines_of(folder: Path) -> list[Row]:
    """Return what a study's folder has to keep: runs if there are such, or a table."""
    runs, table = (
        read_csv(folder / name) if (folder / name).is_file() else []
        for name in ("runs.csv", "table.csv")
    )
    return compact(runs) if runs and runs[0].keys() >= NEEDED else table


def is_runs(lines: Sequence[Row]) -> bool:
    """Return whether these are lines of a compact table, each a run."""
    return bool(lines) and "scene" in lines[0]


def whole(lines: list[Row]) -> list[Row]:
    """Return the lines of a table as it is kept with nothing left empty."""
    return filled(lines) if is_runs(lines) else lines


def merged(kept: Sequence[Row], lines: Sequence[Row]) -> list[Row]:
    """Return the lines after those of what they have not, setting by setting."""
    ran = {(line["method"], line["setting"]) for line in lines}
    rest = [line for line in kept if (line["method"], line["setting"]) not in ran]
    return [*chain.from_iterable(by([*rest, *lines], "setting").values())]


def compact(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the columns that the page needs."""
    shared = {setting: alike(some) for setting, some in by(rows, "setting").items()}
    metrics = [key for key in rows[0] if key.startswith("metric")]
    return [
        {
            "method": row["method"],
            "setting": row["setting"],
            "scene": scene_of(row, shared[row["setting"]]),
            "outcome": what_became_of(row),
            **{
                key: as_kept(row[key], *how)
                for key, how in NUMBERS.items()
                if key in row
            },
            **{key: as_kept(row[key], ".3f") for key in metrics},
        }
        for row in rows
    ]


def words_of(row: Row) -> list[str]:
    """Return the words of a run's scenario, which commas part."""
    return str(row["scenario"]).split(", ")


def alike(rows: Iterable[Row]) -> int:
    """Return how many words the scenarios of all runs begin with."""
    places = zip(*map(words_of, rows), strict=False)
    return len([*takewhile(lambda words: len({*words}) == 1, places)])


def scene_of(row: Row, shared: int) -> str:
    """Return a run's scenario, without its first words, and the seed."""
    return " ".join([", ".join(words_of(row)[shared:]), row["seed"]]).strip()


def names_of(row: Row) -> list[str]:
    """Return what a table may call the scene of a run, the longest first."""
    return [scene_of(row, shared) for shared in range(len(words_of(row)) + 1)]


def brief(lines: list[Row]) -> list[Row]:
    """Return the lines sorted: what is as above empty, a block's numbers once."""
    settings, methods = (
        sorted(by(lines, key), key=bool) for key in ("setting", "method")
    )
    lines.sort(key=lambda x: (settings.index(x["setting"]), methods.index(x["method"])))
    above: Row = {}
    before: list[str] = []
    for _, block in groupby(lines, key=lambda x: (x["setting"], x["method"])):
        some = list(block)
        told = {key: of_block(some, key) for key in OF_BLOCK if key in some[0]}
        scenes = [line["scene"] for line in some]
        for place, line in enumerate(some):
            here = {key: line[key] for key in AS_ABOVE}
            line.update((key, "") for key in AS_ABOVE if here[key] == above.get(key))
            above = here
            if before[place : place + 1] == [line["scene"]]:
                line["scene"] = ""
            line |= dict.fromkeys(told, "") if place else told
        before[: len(scenes)] = scenes
    return lines


def of_block(lines: Iterable[Row], key: str) -> str:
    """Return what stands for a column of a block; nothing where nothing is known."""
    known = [float(x[key]) for x in lines if x[key] and x["outcome"] != BEGAN]
    how = NUMBERS.get(key, (".4f",))
    return as_kept(str(OF_BLOCK[key](known)), *how) if known else ""


def filled(rows: list[Row]) -> list[Row]:
    """Return the rows of a compact table, nothing left empty because it is as above."""
    above = rows[0]
    before: list[str] = []
    here: list[str] = []
    for row in rows:
        if row["method"] or row["setting"]:
            before[: len(here)], here = here, []
        row.update((key, above[key]) for key in AS_ABOVE if not row[key])
        row["scene"] = row["scene"] or "".join(before[len(here) : len(here) + 1])
        row.update((key, above[key]) for key in OF_BLOCK if here and key in row)
        here.append(row["scene"])
        above = row
    return rows


def what_became_of(row: Row) -> str:
    """Return the outcome of a run of ``runs.csv``."""
    if float(row["start_clearance_m"] or 0.0) < 0.0:
        return BEGAN
    if row["success"] == "True":
        return "success"
    if row["contact"] == "True":
        return "contact" if float(row["contacts_moving"]) else "contact_standing"
    return {"stalled": "stalled", "off goal": "late"}.get(row["outcome"], "failed")


def as_kept(text: str, *how: str) -> str:
    """Return a rounded number as tables keep it: .5 for 0.5, 100 kB in all."""
    return re.sub(r"^(-?)0\.", r"\1.", rounded(text, *how))


def rounded(text: str, *how: str) -> str:
    """Return a number with fewer digits, as formats say in turn; nothing stays that."""
    for one in how if text else ():
        text = f"{float(format(float(text), one)):g}"
    return text


def read_runs(path: Path) -> list[Row] | None:
    """Return the runs of a compact table; ``None`` if it holds none.

    Numbers that do not apply are ``None``.
    """
    rows = read_csv(path)
    if not is_runs(rows):
        return None
    names = [key for key in NUMBERS if key in rows[0]]
    names += [key for key in rows[0] if key.startswith("metric")]
    return [
        {
            **row,
            **{key: float(row[key]) if is_known(row, key) else None for key in names},
            "success": row["outcome"] == "success",
            "contact": row["outcome"].startswith("contact"),
        }
        for row in filled(rows)
    ]


def is_known(row: Row, key: str) -> bool:
    """Return whether a run has a number: a block's mean holds for those it is of."""
    return bool(row[key]) and (key not in OF_ARRIVED or bool(row["arrived_s"]))


def by(rows: Iterable[Row], key: str) -> dict[str, list[Row]]:
    """Return the rows by what they have in a column, in order of appearance."""
    groups: defaultdict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row[key]].append(row)
    return dict(groups)
