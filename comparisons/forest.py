"""Forests: how many random static scenes does each controller cross to the goal?

Scenes of discs and walls with a straight reference through them, each passable without
backing up (``qpavoid/study/sweep/forest.py`` says how that is checked). A run succeeds
if the goal pose is reached within 3 × the time of the free reference, without contact.
``qp-ahead`` is the default filter with the detour stage before it, ``qp-ahead-alone``
the same without. A sweep: started again it does what is missing. Writes ``table.csv``
and ``runs.csv``.

    python comparisons/forest.py --count 1000 --seed 5 --out out/forest
"""

import argparse
import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from qpavoid.simulation.methods import BASELINES
from qpavoid.study.sweep.engine import sweep
from qpavoid.study.sweep.forest import PATIENCE
from qpavoid.study.sweep.sources import Forest
from qpavoid.study.sweep.store import read_rows
from qpavoid.study.sweep.study import Study

OURS = {
    "eq5": ("eq5", False),
    "eq7": ("eq7", False),
    "qp": ("qp", False),
    "qp-ahead-alone": ("qp-ahead", False),
    "qp-ahead": ("qp-ahead", True),
}
"""Controller, and whether the detour stage stands before it; by default."""

METHODS = OURS | {name: (name, False) for name in BASELINES}


def make_study(method: str, count: int, seed: int, waiting: bool) -> Study:
    """Return the runs of one method."""
    controller, detour = METHODS[method]
    return Study(
        title=f"Forest: {method}",
        text="",
        controllers=[(controller, "exact")],
        sources=[(Forest(seed, detour), range(count))],
        variations=[{"tracking.waiting": waiting}],
        trajectories="none",
        data=None,
    )


def table_row(name: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the line of one method; the mean time is over its successes."""
    ratios = [
        PATIENCE * row["arrived_s"] / row["duration_s"]
        for row in rows
        if row["success"]
    ]
    lost = [row for row in rows if not row["success"]]
    return {
        "controller": name,
        "scenes": len(rows),
        "contacts": sum(row["contact"] for row in rows),
        "successes": len(ratios),
        "stalls": sum(row["outcome"] == "stalled" for row in rows),
        "mean_time_ratio": round(sum(ratios) / len(ratios), 3) if ratios else "",
        "r_min_violations": sum(row["min_room_m"] < -1.1e-3 for row in rows),
        "blocked": sum(row["blocked_s"] > 0.0 for row in lost),
    }


def write(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write a table."""
    lines = list(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, metavar="N")
    parser.add_argument("--seed", type=int, default=2, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/forest"), metavar="DIR")
    parser.add_argument(
        "--waiting", action="store_true", help="the reference waits for the robot"
    )
    parser.add_argument("--controllers", default=",".join(OURS), metavar="A,B,…")
    options = parser.parse_args()
    methods = options.controllers.split(",")
    if options.count < 1 or options.seed < 0:
        parser.error("--count wants 1 or more, --seed 0 or more")
    if not set(methods) <= set(METHODS):
        parser.error(f"--controllers wants some of {', '.join(METHODS)}")
    table, runs = [], []
    for method in methods:
        study = make_study(method, options.count, options.seed, options.waiting)
        sweep(study, options.out / method)
        wanted = {job.run for job in study.jobs()}
        rows = [row for row in read_rows(options.out / method) if row["run"] in wanted]
        table.append(table_row(method, rows))
        print(" ".join(f"{k}={v}" for k, v in table[-1].items()), flush=True)
        runs += [{**row, "controller": method} for row in rows]
    write(options.out / "table.csv", table)
    write(options.out / "runs.csv", runs)


if __name__ == "__main__":
    main()
