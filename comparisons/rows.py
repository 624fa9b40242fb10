"""Rows of the comparisons: a compact table per study, and how runs are added to one.

``results/STUDY.csv`` has a row per scene and a column per method. A cell is one run:
the time to the goal, s, if it succeeded, else a letter (:data:`ENDS`); then ``/N`` if
the robot came N mm nearer than r_min, N > 1. An empty setting is that of the row above.
``results/costs.csv`` has median and 99th percentile of the solve time, µs, and BARN's
metric, by study, setting, method. The metric is success · OT / clip(AT, 2 OT, 8 OT): OT
is the length of the published path over 2 m/s, AT the time taken.

    python comparisons/rows.py out/forest forest          # add the runs of a sweep
    python comparisons/rows.py out/barn barn --data PATH
    python comparisons/rows.py out/sensed sensing --level "noise (m) 0.1"
"""

import argparse
import csv
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from pathlib import Path
from statistics import fmean, median
from typing import Any, NamedTuple, TypeAlias

from qpavoid.errors import QPAvoidError

RESULTS = Path(__file__).resolve().parent / "results"

ENDS = {
    "c": "contact that began while the robot moved",
    "t": "contacts only while the robot stood",
    "s": "stalled",
    "l": "late: on its way when the time was over",
    "f": "failed with an error",
    "b": "began in contact: excluded",
}
"""Outcomes other than success."""

NUMBERS = (
    *("arrived_s", "min_room_m", "start_clearance_m", "contacts_moving"),
    *("solve_us", "solve_p99_us"),
)
"""Columns of a run that are kept, or tell what became of it."""

Scene: TypeAlias = tuple[str, str]
"""Setting and name."""


class Run(NamedTuple):
    """End of a run: its outcome (``""``: success), time, s, and mm inside r_min."""

    end: str
    time: float = math.nan
    inside: int = 0


Runs: TypeAlias = Mapping[Scene, Run]


class Ranking(NamedTuple):
    """Scenes on which methods are compared.

    Scenes of one cluster share what the pattern ``world`` finds in their names, or are
    so many successive numbers; empty: each scene is a cluster.
    """

    table: str  # name of its table in the page
    title: str  # for tables and the figure
    study: str  # name of its file
    settings: str = ""  # pattern of those that belong to it
    world: str | int = ""
    before: str = ""  # planner before every method


SEEN = r"(?!together)"
"""All levels of sensing but the one with all at once."""

RANKINGS = (
    Ranking("forest", "Forests", "forest"),
    Ranking("discs", "Moving discs", "discs"),
    Ranking("encounters", "Encounters, one disc", "encounters", "parked"),
    Ranking("encounters", "Encounters, 2 to 5 discs", "encounters", "several"),
    Ranking("barn", "BARN, 0.5 m/s", "barn", "0.5 m/s: known"),
    Ranking("barn", "BARN, 2 m/s", "barn", "2 m/s: known"),
    Ranking("barn", "BARN, 0.5 m/s, LiDAR", "barn", "0.5 m/s: LiDAR"),
    Ranking("barn", "BARN, 2 m/s, LiDAR", "barn", "2 m/s: LiDAR"),
    Ranking("wheels", "BARN on wheels", "barn_wheels", "2 m/s", r"\d+$"),
    Ranking("wheels", "Moving discs on wheels", "discs_wheels"),
    Ranking("crowd", "Recorded crowds", "crowd", "(eth|hotel|zara01)$"),
    Ranking("crowd", "Recorded crowds, LiDAR", "crowd", "LiDAR"),
    Ranking("crowd", "Dense crowd", "crowd", "students03"),
    Ranking("crowdnav", "CrowdNav, 5 people", "crowdnav", "^5"),
    Ranking("crowdnav", "CrowdNav, 10 people", "crowdnav", "^10"),
    Ranking("dynabarn", "DynaBARN, 1 m/s", "dynabarn", "reverse.* 1 m/s", 9),
    Ranking("dynabarn", "DynaBARN, 2 m/s", "dynabarn", "reverse.* 2 m/s", 9),
    Ranking("dynabarn", "DynaBARN, short", "dynabarn", "end", 9),
    Ranking("maps", "Maps, after A*", "maps", before="astar+"),
    *(
        Ranking("sensing", title, "sensing", f"^{scenes}: {SEEN}", r"\d+$")
        for title, scenes in {
            "Moving discs as points": "strangers as points",
            "Forests as points": "forest as points",
            "Moving discs, perception": "strangers as tracks",
        }.items()
    ),
    Ranking("together", "Discs as points, all", "sensing", "^str.* points: tog"),
    Ranking("together", "Forests as points, all", "sensing", "^for.* points: tog"),
    Ranking("together", "Discs, perception, all", "sensing", "tracks: tog"),
)
"""All that is compared."""

REACTING = (
    Ranking("reacting", "ORCA", "crowdnav_reacting", "orca"),
    Ranking("reacting", "Social force", "crowdnav_reacting", "force"),
)
"""Crowds that see the robot, all densities."""

FLEETS = tuple(
    Ranking("fleet", title, "fleet", f"/{setting}$")
    for setting, title in {
        "swap": "Two swap places",
        "carts": "Four carts",
        "door": "Door, 4 robots",
        "corridor": "Corridor, 6 robots",
        "random": "Random, 20 robots",
        **{f"circle_{n}": f"Circle of {n}" for n in (4, 8, 16, 32)},
    }.items()
)
"""Several robots with the same method each."""


def read_cell(text: str) -> Run:
    """Return the run of a cell."""
    head, _, inside = text.partition("/")
    near = int(inside or 0)
    return Run(head, math.nan, near) if head in ENDS else Run("", float(head), near)


def read_cells(study: str) -> Iterator[tuple[Scene, list[tuple[str, str]]]]:
    """Yield each scene of a study with methods and their cells."""
    with (RESULTS / f"{study}.csv").open(newline="", encoding="utf-8") as file:
        lines = csv.reader(file)
        methods, setting = next(lines)[2:], ""
        for line in lines:
            setting = line[0] or setting
            cells = zip(methods, line[2:], strict=False)
            yield (setting, "".join(line[1:2])), [x for x in cells if x[1]]


@lru_cache
def read_runs(study: str) -> Mapping[str, Runs]:
    """Return the runs of a study by method and scene.

    Those that began in contact are left out.
    """
    found: defaultdict[str, dict[Scene, Run]] = defaultdict(dict)
    for scene, cells in read_cells(study):
        for method, cell in cells:
            if (run := read_cell(cell)).end != "b":
                found[method][scene] = run
    return found


@lru_cache
def read_costs() -> Mapping[tuple[str, str, str], Sequence[float]]:
    """Return solve times, median and p99, µs, and BARN's metric by place and method."""
    found, study, setting = {}, "", ""
    with (RESULTS / "costs.csv").open(newline="", encoding="utf-8") as file:
        for first, second, method, *cells in [*csv.reader(file)][1:]:
            study, setting = first or study, second if first else second or setting
            numbers = [float(x or math.nan) for x in [*cells, "", "", ""][:3]]
            found[study, setting, method] = numbers
    return found


def chosen(ranking: Ranking) -> Mapping[str, Runs]:
    """Return the runs of a ranking by method, of those that ran in all its settings."""
    found, settings = {}, {}
    for method, runs in read_runs(ranking.study).items():
        found[method] = {
            k: x for k, x in runs.items() if re.search(ranking.settings, k[0])
        }
        settings[method] = {setting for setting, _ in found[method]}
    most = set().union(*settings.values())
    return {x: runs for x, runs in found.items() if runs and settings[x] == most}


def cluster(ranking: Ranking, scene: Scene) -> object:
    """Return what the scenes of a cluster have in common.

    Raises:
        ValueError: The pattern does not fit.
    """
    if isinstance(ranking.world, int):
        return int(scene[1]) // ranking.world
    if (found := re.search(ranking.world or ".*", scene[1])) is None:
        raise ValueError(f"no cluster of {scene}: {ranking.world!r}")
    return found.group() if ranking.world else scene


def cell_of(row: Mapping[str, Any]) -> str:
    """Return the cell of a row of a sweep."""
    room = row["min_room_m"]
    near = f"/{math.ceil(-1e3 * room)}" if room is not None and room < -1e-3 else ""
    if (row["start_clearance_m"] or 0.0) < 0.0:
        return "b"
    if row["success"]:
        return f"{row['arrived_s']:.2f}".rstrip("0").rstrip(".") + near
    if row["contact"]:
        return ("c" if row["contacts_moving"] else "t") + near
    return {"stalled": "s", "off goal": "l"}.get(row["outcome"], "f") + near


def runs_of(folder: Path) -> Iterator[tuple[Scene, str, Mapping[str, Any]]]:
    """Yield scene, method and row of every run of a sweep or a script."""
    from qpavoid.lab.scenario.methods import labelled
    from qpavoid.lab.study.sweep.store import read_rows

    if (folder / "runs").is_dir():
        for row in read_rows(folder):
            seed = "" if row["seed"] is None else str(row["seed"])
            yield (str(row["scenario"]), seed), labelled(row), row
        return
    with (folder / "runs.csv").open(newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            flags: dict[str, Any] = {
                k: line[k] == "True" for k in ("success", "contact")
            }
            numbers = {k: float(line[k]) if line.get(k) else None for k in NUMBERS}
            more = {"outcome": line["outcome"]}
            place = line["setting"], line["seed"]
            yield place, line["method"], flags | numbers | more


@lru_cache
def optimal_time(world: int, data: Path | None) -> float:
    """Return OT in s, by the organisers' transform of the path's cells."""
    from qpavoid.lab.worlds.barn import GOAL, START, find_folder, read_cells

    path = find_folder(data, world) / "path_files" / f"path_{world}.npy"
    places = [START[:2], *(0.15 * read_cells(path) + (-4.575, 5.075)).tolist(), GOAL]
    return math.fsum(map(math.dist, places, places[1:])) / 2.0


def metric(row: Mapping[str, Any], optimal: float) -> float:
    """Return BARN's metric of a run."""
    if not row["success"]:
        return 0.0
    time: float = row["arrived_s"]
    return optimal / min(max(time, 2.0 * optimal), 8.0 * optimal)


def add(folder: Path, study: str, level: str = "", data: Path | None = None) -> None:
    """Add the runs of a sweep to the table of a study, in place of those there.

    Args:
        folder: Of the sweep.
        study: Name of the table.
        level: Follows the scenario's name in the setting: ``scenario: level``.
        data: Folder of the published worlds, for BARN's metric.
    """
    path = RESULTS / f"{study}.csv"
    kept = read_cells(study) if path.is_file() else ()
    table = {place: dict(cells) for place, cells in kept}
    costs = {k: list(x) for k, x in read_costs().items()}
    times: defaultdict[tuple[str, str, str], list[list[float]]] = defaultdict(list)
    metrics: defaultdict[tuple[str, str, str], list[float]] = defaultdict(list)
    for (setting, scene), method, row in runs_of(folder):
        where = setting + (f": {level}" if level else "")
        table.setdefault((where, scene), {})[method] = cell_of(row)
        if row["solve_us"] is not None:
            times[study, where, method].append([row[k] for k in NUMBERS[-2:]])
        if study.startswith("barn"):
            found = metric(row, optimal_time(int(scene), data))
            metrics[study, where, method].append(found)
    for key, some in times.items():
        score = fmean(metrics[key]) if metrics[key] else math.nan
        costs[key] = [*(median(x) for x in zip(*some, strict=True)), score]
    methods = list(dict.fromkeys(chain.from_iterable(table.values())))
    settings = list(dict.fromkeys(where for where, _ in table))
    lines = [
        [*place, *(cells.get(x, "") for x in methods)]
        for place, cells in sorted(table.items(), key=lambda x: settings.index(x[0][0]))
    ]
    write(path, ["setting", "scene", *methods], lines, 1)
    heads = ["study", "setting", "method", "solve_us", "solve_p99_us", "metric"]
    numbers = {k: ["" if x != x else f"{x:.3g}" for x in n] for k, n in costs.items()}
    write(RESULTS / "costs.csv", heads, [[*k, *x] for k, x in numbers.items()], 2)


def write(path: Path, heads: list[str], lines: list[list[str]], above: int) -> None:
    """Write a table; of its first columns what is as in the row above stays empty."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        last: list[str] = []
        for line in lines:
            same = len(last) > 0
            short = []
            for k, text in enumerate(line):
                same = same and k < above and text == last[k]
                short.append("" if same else text)
            last = line
            while short and short[-1] == "":
                short.pop()
            writer.writerow(short)


def main() -> None:
    """Add the runs of a sweep to a table."""
    parser = argparse.ArgumentParser(description="Add the runs of a sweep to a table.")
    parser.add_argument("folder", type=Path, help="of the sweep")
    parser.add_argument("study", help="name of the table")
    parser.add_argument("--level", default="", help="of what a scenario is seen by")
    parser.add_argument("--data", type=Path, help="folder of the published worlds")
    options = parser.parse_args()
    try:
        add(options.folder, options.study, options.level, options.data)
    except QPAvoidError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
