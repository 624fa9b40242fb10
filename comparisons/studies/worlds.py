"""Numbers of published worlds: BARN's metric, and contacts in recorded crowds.

    python comparisons/studies/worlds.py metric --data PATH --runs out/barn
    python comparisons/studies/worlds.py crowd --data PATH     # contacts of people

BARN's metric is success · OT / clip(AT, 2 OT, 8 OT): OT is the length of the published
path over 2 m/s, AT the time taken. It is printed by scenario and method.
"""

import argparse
import math
import os
from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.lab.planning.grid import length
from qpavoid.lab.worlds.barn import GOAL, START, find_folder, read_cells
from qpavoid.lab.worlds.crowd import PERSON, SCENES, Crowd, Task


@lru_cache
def optimal_time(world: int, data: Path | None) -> float:
    """Return OT in s, by the organisers' transform of the path's cells."""
    path = find_folder(data, world) / "path_files" / f"path_{world}.npy"
    cells = 0.15 * read_cells(path) + (-4.575, 5.075)
    points = np.vstack([START[:2], cells, GOAL])
    return length(points) / 2.0


def metric(row: dict[str, Any], optimal: float) -> float:
    """Return the organisers' metric of one run."""
    if not row["success"]:
        return 0.0
    return optimal / float(np.clip(row["arrived_s"], 2.0 * optimal, 8.0 * optimal))


def print_metric(folder: Path, data: Path | None) -> None:
    """Print the mean metric of a sweep's runs by scenario and method."""
    from qpavoid.lab.scenario.methods import labelled
    from qpavoid.lab.study.sweep.store import read_rows

    found: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for row in read_rows(folder):
        value = metric(row, optimal_time(row["seed"], data))
        found[str(row["scenario"]), labelled(row)].append(value)
    for (scenario, method), values in found.items():
        print(f"{scenario}, {method}: {fmean(values):.4f} in {len(values)} runs")


def own_clearance(task: Task) -> float:
    """Return the least distance, m, of the human's disc to all others on its own way.

    Of discs of radius :data:`PERSON`, linear between the samples; below 0 is a contact.
    """
    times, least = task.human.times, math.inf
    for other in task.others:
        begin, end = max(times[0], other.times[0]), min(times[-1], other.times[-1])
        if begin > end:
            continue
        both = np.unique(np.clip([*times, *other.times], begin, end))
        x, y = (
            np.interp(both, other.times, other.positions[:, axis])
            - np.interp(both, times, task.human.positions[:, axis])
            for axis in (0, 1)
        )
        way = np.column_stack([x, y])
        leg = np.diff(way, axis=0, append=way[-1:])
        share = -(way * leg).sum(axis=1) / np.maximum((leg**2).sum(axis=1), 1e-12)
        nearest = way + np.clip(share, 0.0, 1.0)[:, None] * leg
        least = min(least, float(np.hypot(*nearest.T).min()))
    return least - 2.0 * PERSON


def print_crowd(data: Path | None) -> None:
    """Print in how many tasks recorded people touch each other."""
    for scene in SCENES:
        tasks = Crowd(scene, None if data is None else str(data)).tasks
        touched = sum(own_clearance(task) < 0.0 for task in tasks)
        print(f"crowd {scene}: contact in {touched} of {len(tasks)} tasks")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("metric", "crowd"))
    data = os.environ.get("QPAVOID_DATA")
    named = None if data is None else Path(data)
    parser.add_argument("--data", type=Path, default=named, metavar="PATH")
    parser.add_argument("--runs", type=Path, metavar="DIR", help="a sweep of BARN")
    options = parser.parse_args()
    try:
        if options.what == "metric":
            print_metric(options.runs, options.data)
        else:
            print_crowd(options.data)
    except QPAvoidError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
