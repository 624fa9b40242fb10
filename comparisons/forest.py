"""Forests: how many random static scenes does each controller cross to the goal?

Scenes of discs and walls with a straight reference through them, each passable without
backing up (``forest_scenes.py`` says how that is checked). A run succeeds if the goal
pose is reached within 3 × the time of the free reference, without contact. Station
keeping is on. ``qp-ahead`` is the default filter with the detour stage before it,
``qp-ahead-alone`` the same without. Writes ``table.csv`` and ``runs.csv``.

    python comparisons/forest.py --count 1000 --seed 2 --out out/forest
"""

import argparse
import csv
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from forest_scenes import Scene, make_scene

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.detour.settings import DetourSettings
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.motion.station import StationKeeping, StationTracker
from qpavoid.motion.tracking import Gains
from qpavoid.motion.waiting import NEVER, Waiting
from qpavoid.simulation.batch import OUTCOME, Batch, Loop

ROBOT = Robot.mir100()
TRACKER = StationTracker(Gains(1.0, 1.0, 2.0), StationKeeping(), ROBOT.limits)
SETTINGS = AvoidanceSettings(dt=0.02)
METHODS = {
    "eq5": ("eq5", None),
    "eq7": ("eq7", None),
    "qp": ("qp", None),
    "qp-ahead-alone": ("qp-ahead", None),
    "qp-ahead": ("qp-ahead", DetourSettings()),
}
PATIENCE = 3.0
"""Time allowed, in times of the free reference."""

ARRIVAL = 0.1, 0.1
"""m and rad from the goal pose that count as reached."""

STALLED = 5.0
"""s without progress at the end of a run that did not succeed."""


def scene(job: tuple[int, int]) -> Scene:
    """Return one scene of a seed."""
    return make_scene(ROBOT.footprint, *job)


def make_loop(forest: Scene) -> Loop:
    """Return a forest as a closed loop."""
    duration = PATIENCE * forest.path.duration
    times = np.arange(0.0, duration + SETTINGS.dt, SETTINGS.dt)
    return Loop(
        plan=forest.path.sample(times),
        obstacles=Obstacles(discs=forest.discs, walls=forest.walls),
        start=(*forest.start, 0.0, 0.0),
        duration=duration,
    )


def row(
    name: str, scenes: Sequence[Scene], outcomes: npt.NDArray[np.void]
) -> dict[str, Any]:
    """Return the line of one method; the mean time is over its successes."""
    contact = outcomes["clearance"] < 0.0
    success = np.isfinite(outcomes["arrived"]) & ~contact
    stalled = ~success & ~contact & (outcomes["still"] > STALLED)
    free = np.array([forest.path.duration for forest in scenes])
    ratio = (outcomes["arrived"] / free)[success]
    return {
        "controller": name,
        "scenes": len(scenes),
        "contacts": int(contact.sum()),
        "successes": int(success.sum()),
        "stalls": int(stalled.sum()),
        "mean_time_ratio": round(float(ratio.mean()), 3) if len(ratio) else "",
        "r_min_violations": int((outcomes["room"] < -1.1e-3).sum()),
        "blocked": int((outcomes["blocked"][~success] > 0.0).sum()),
    }


def write(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write a table."""
    lines = list(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(lines[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def compare(
    methods: Sequence[str], count: int, seed: int, out: Path, waiting: Waiting
) -> list[dict[str, Any]]:
    """Run every method in every scene; write the tables and return the first."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        scenes = list(pool.map(scene, product([seed], range(count)), chunksize=10))
    loops, rows, runs = [make_loop(forest) for forest in scenes], [], []
    for name in methods:
        controller, detour = METHODS[name]
        batch = Batch(ROBOT, TRACKER, SETTINGS, waiting, detour, ARRIVAL)
        outcomes = batch.run(controller, loops)
        rows.append(row(name, scenes, outcomes))
        print(" ".join(f"{key}={value}" for key, value in rows[-1].items()), flush=True)
        runs += [
            {
                "controller": name,
                "scene": k,
                **{key: float(outcomes[key][k]) for key in OUTCOME.names or ()},
            }
            for k in range(count)
        ]
    out.mkdir(parents=True, exist_ok=True)
    write(out / "table.csv", rows)
    write(out / "runs.csv", runs)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, metavar="N")
    parser.add_argument("--seed", type=int, default=2, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/forest"), metavar="DIR")
    parser.add_argument(
        "--waiting", action="store_true", help="the reference waits for the robot"
    )
    parser.add_argument("--controllers", default=",".join(METHODS), metavar="A,B,…")
    options = parser.parse_args()
    methods = options.controllers.split(",")
    if options.count < 1 or options.seed < 0:
        parser.error("--count wants 1 or more, --seed 0 or more")
    if not set(methods) <= set(METHODS):
        parser.error(f"--controllers wants some of {', '.join(METHODS)}")
    waiting = Waiting() if options.waiting else NEVER
    compare(methods, options.count, options.seed, options.out, waiting)


if __name__ == "__main__":
    main()
