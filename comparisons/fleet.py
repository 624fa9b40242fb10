"""Fleets: every robot runs the same method, and sees the others as they move.

The scenarios of ``configs/fleet``; the seed draws or shifts the starts. A row of the
table has, over all seeds: runs in which all robots arrived and none touched anything
(successes), robots, how many of them arrived, pairs of robots that touched each other
(contacts, each pair once), robots that touched anything (touched), the least distance
of two robots and the least room (distance less r_min), m, and the time of those that
arrived over that of the same robot tracking its reference alone in an empty world
(ratio). ``runs.csv`` has a row a run; runs that stand there, of the same code, are not
done again.

    python comparisons/fleet.py --scenes swap,circle_16 --seeds 0:10
"""

import argparse
import csv
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from hashlib import sha256
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.lab.simulation.config import builtin_configs, read_document
from qpavoid.lab.simulation.fleet import least_between
from qpavoid.lab.simulation.methods import check_methods, find_method
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run, run_fleet
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.simulation.world import World
from qpavoid.lab.study.sweep.study import code_stamp, own_stamp
from qpavoid.lab.study.tables import write_csv
from studies import main_of, make_parser, numbers

METHODS = "qp-ahead+guide,qp-ahead,qp,eq5,orca"

SCENES = [name[6:] for name in builtin_configs() if name.startswith("fleet/")]

LEAST = ("least_m", "room_m")

Row = dict[str, Any]


def run_once(task: tuple[str, str, int]) -> Row:
    """Run a scene with a method and a seed, and return its row; an error is one too."""
    scene, method, seed = task
    try:
        return {**numbers_of(scene, method, seed), "error": ""}
    except (Exception, SystemExit) as error:  # of a method of one's own: any
        row = {"method": method, "setting": scene, "seed": seed}
        return row | {"error": f"{type(error).__name__}: {error}"}


def numbers_of(scene: str, method: str, seed: int) -> Row:
    """Run a scene with a method and a seed, and return what came of it."""
    name = f"fleet/{scene}"
    path = builtin_configs()[name]
    document = read_document(path)[0] | {"seed": seed}
    scenario = make_scenario(document, name, path)
    logs = run_fleet(scenario, method)
    noted = np.concatenate([outcome_of(log) for log in logs])
    there, least = np.isfinite(noted["arrived"]), least_between(logs)
    alone = [
        outcome_of(run(replace(one, world=World()), "alone"))["arrived"][0]
        for one in scenario.robots
    ]
    ratios = (noted["arrived"] / alone)[there]
    touched = noted["clearance"] < 0.0
    return {
        "method": method,
        "setting": scene,
        "seed": seed,
        "robots": len(logs),
        "arrived": int(there.sum()),
        "success": int(there.all() and not touched.any()),
        "contacts": int((np.triu(least, 1) < 0.0).sum()),
        "touched": int(touched.sum()),
        "least_m": round(float(least.min()), 4),
        "room_m": round(float(noted["room"].min()), 4),
        "ratio": round(float(ratios.mean()), 4) if len(ratios) else "",
    }


def table(rows: list[Row]) -> Iterator[Row]:
    """Yield a row a scene and method: sums, worst and mean over the seeds."""
    groups: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["setting"], row["method"]].append(row)
    for (setting, method), group in groups.items():
        sums, runs = ("robots", "arrived", "contacts", "touched"), len(group)
        group = [row for row in group if not row.get("error")]
        ratios = [float(row["ratio"]) for row in group if row["ratio"] != ""]
        yield {
            "method": method,
            "setting": setting,
            "runs": runs,
            "failed": runs - len(group),
            "successes": sum(int(row["success"]) for row in group),
            **{key: sum(int(row[key]) for row in group) for key in sums},
            **{k: min(float(row[k]) for row in group) for k in LEAST if group},
            "ratio": round(float(np.mean(ratios)), 3) if ratios else "",
        }


def done(path: Path) -> list[Row]:
    """Return the rows of a file that is there."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@cache
def code_of(method: str) -> str:
    """Return a hash of the code that a run of a method depends on."""
    try:
        text = code_stamp() + own_stamp(find_method(method).controller)
    except QPAvoidError:  # not asked for, and not to be found any more
        text = ""
    return sha256(text.encode()).hexdigest()[:16]


def study(options: argparse.Namespace) -> list[Row]:
    """Do the runs that are missing, failed or of other code, write the tables."""
    methods, scenes = options.methods.split(","), options.scenes.split(",")
    check_methods(methods)
    path = options.out / "runs.csv"
    rows = [row for row in done(path) if row.get("code") == code_of(row["method"])]
    known = {(row["setting"], row["method"], int(row["seed"])) for row in rows}
    tasks = [t for t in product(scenes, methods, options.seeds) if t not in known]
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        for row in pool.map(run_once, tasks):
            rows.append(row | {"code": "" if row["error"] else code_of(row["method"])})
            write_csv(path.with_suffix(".part"), rows)
            path.with_suffix(".part").replace(path)
    lines = list(table(rows))
    write_csv(options.out / "table.csv", lines)
    for line in lines:
        print(" ".join(f"{key}={value}" for key, value in line.items()))
    return [{"error": "", **row} for row in rows]


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/fleet", rows=False)
    parser.add_argument("--scenes", default=",".join(SCENES), metavar="A,B,…")
    parser.add_argument("--seeds", type=numbers, default=range(10), metavar="A:B")
    options = parser.parse_args()
    unknown = set(options.scenes.split(",")) - set(SCENES)
    if unknown:
        parser.error(f"unknown scenes: {', '.join(sorted(unknown))}")
    main_of(lambda: study(options), parser)


if __name__ == "__main__":
    main()
