"""BARN worlds and rule, kinematic unicycle: who gets through, and how fast.

The Jackal's footprint (0.508 × 0.430 m) follows the published reference path; success
is within 1 m of the goal in 100 s without contact. The metric is the organisers':
success · OT / clip(AT, 2 OT, 8 OT) with OT the path's length over 2 m/s and AT the time
taken. Not a BARN score, which is measured in Gazebo. Writes ``table.csv`` and
``runs.csv``, and prints the organisers' own runs where they are there.

    python comparisons/barn.py --data PATH --worlds 0:300:6 --out out/barn
"""

import argparse
import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.datasets.barn import GOAL, START, find_folder
from qpavoid.errors import QPAvoidError
from qpavoid.simulation.methods import check_methods
from qpavoid.study.sweep.engine import sweep
from qpavoid.study.sweep.sources import BarnWorlds
from qpavoid.study.sweep.store import read_rows
from qpavoid.study.sweep.study import Study

METHODS = "eq5,eq7,qp,qp-ahead,qp-ahead+detour"


def optimal_time(world: int, data: Path | None) -> float:
    """Return OT in s, by the organisers' transform of the path's cells."""
    path = find_folder(data, world) / "path_files" / f"path_{world}.npy"
    cells = 0.15 * np.load(path, allow_pickle=False) + (-4.575, 5.075)
    points = np.vstack([START[:2], cells, GOAL])
    return float(np.hypot(*np.diff(points, axis=0).T).sum()) / 2.0


def metric(row: dict[str, Any], optimal: float) -> float:
    """Return the organisers' metric of one run."""
    if not row["success"]:
        return 0.0
    return optimal / float(np.clip(row["arrived_s"], 2.0 * optimal, 8.0 * optimal))


def run_method(
    name: str, worlds: Sequence[int], speed: float, data: Path | None, out: Path
) -> list[dict[str, Any]]:
    """Return one row a world, with its metric."""
    controller, _, stage = name.partition("+")
    study = Study(
        title=f"BARN: {name}",
        text="",
        controllers=[(controller, "exact")],
        sources=[(BarnWorlds(speed), worlds)],
        variations=[{"detour": {}} if stage else {}],
        trajectories="none",
        data=None if data is None else str(data),
    )
    sweep(study, out)
    wanted = {job.run for job in study.jobs()}
    rows = [row for row in read_rows(out) if row["run"] in wanted]
    times = {world: optimal_time(world, data) for world in worlds}
    return [
        {"method": name, **row, "metric": metric(row, times[row["seed"]])}
        for row in rows
    ]


def table_row(name: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the line of one method; the mean time is over its successes."""
    times = [row["arrived_s"] for row in rows if row["success"]]
    contacts = sum(row["contact"] for row in rows)
    return {
        "method": name,
        "runs": len(rows),
        "successes": len(times),
        "contacts": contacts,
        "contacts_standing": 0,
        "timeouts": len(rows) - len(times) - contacts,
        "mean_time_s": round(sum(times) / len(times), 2) if times else "",
        "metric": round(sum(row["metric"] for row in rows) / len(rows), 4),
    }


def published(worlds: Sequence[int], data: Path | None) -> list[str]:
    """Return the organisers' DWA runs on these worlds in a line, if they are there."""
    root = data or os.environ.get("QPAVOID_DATA")
    path = Path(root or ".") / "published" / "barn_dwa_runs.txt"
    if not path.is_file():
        return []
    runs = np.loadtxt(path)
    runs = runs[np.isin(runs[:, 0], worlds)]
    if not len(runs):
        return []
    success, contact, late = runs[:, 1:4].mean(axis=0)
    return [
        f"organisers' DWA, {len(runs)} runs in Gazebo: success {success:.3f}, contact "
        f"{contact:.3f}, timeout {late:.3f}"
    ]


def write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, keys, lineterminator="\n", restval="")
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH")
    parser.add_argument("--worlds", default="0:300:6", metavar="FIRST:AFTER:STEP")
    parser.add_argument("--speed", type=float, default=0.5, metavar="MPS")
    parser.add_argument("--methods", default=METHODS, metavar="A,B,…")
    parser.add_argument("--out", type=Path, default=Path("out/barn"), metavar="DIR")
    options = parser.parse_args()
    names = options.methods.split(",")
    try:
        worlds = range(*map(int, options.worlds.split(":")))
        check_methods(name.partition("+")[0] for name in names)
        if not worlds or options.speed <= 0.0:
            raise ValueError("no worlds, or no speed")
        table, runs = [], []
        for name in names:
            folder = options.out / f"{options.speed:g}"
            rows = run_method(name, worlds, options.speed, options.data, folder)
            table.append(table_row(name, rows))
            print(" ".join(f"{k}={v}" for k, v in table[-1].items()), flush=True)
            runs += rows
    except (QPAvoidError, ValueError) as error:
        parser.error(str(error))
    print(*published(worlds, options.data), sep="\n")
    write(options.out / "table.csv", table)
    write(options.out / "runs.csv", runs)


if __name__ == "__main__":
    main()
