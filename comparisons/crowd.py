"""Crowds: one recorded pedestrian is taken out, and a robot goes in its place.

ETH seq_eth and seq_hotel, UCY zara01: every track with at least 10 samples and 6 m
between its ends, 660 tasks. For training there are 105 more, of a dense crowd: UCY
students03, its first half (``--scenes students03``). A robot of 0.25 m circumradius
(|v| ≤ 1.6 m/s, |ω| ≤ 2 rad/s, 3 m/s²) starts at the first position for the last, on the
same clock; others are discs of 0.25 m that walk on as recorded and do not yield, so
that contacts while it stands are counted apart. It has arrived within 0.3 m, in 3 times
the human's time. Metrics: time, way and arrivals, over those of the human; surprised:
the share of tasks in which the moving robot touched somebody who had been on record for
less than the 0.53 s that it takes to stop. The human's own contacts, by the same rule,
are in ``human.csv``.

The record shows people from some place on, at times where the robot is; with
``--seen-before 1`` they walk in from 1 s before.

    python comparisons/crowd.py --data PATH --scenes eth,hotel,zara01
    python comparisons/crowd.py --tracks obsmat.txt --fps 25
"""

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.errors import DataError
from qpavoid.lab.simulation.log import NO_BACK_END
from qpavoid.lab.simulation.outcome import contacts_moving
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.crowd import (
    PERSON,
    SCENES,
    Crowd,
    Task,
)
from studies import Row, Scenes, count, main_of, make_parser, run_study

STOPPING = 1.6 / 3.0
"""s from full speed."""

TESTED = "eth,hotel,zara01"
"""Scenes; the dense ``students03`` is for training."""

METHODS = "qp-ahead+guide,qp-ahead,qp,eq5,eq7,stop,apf,vfh,dwa,orca,c3bf,mppi"


def known_for(row: dict[str, Any], source: Crowd) -> float:
    """Return for how long, s, the first person touched in motion was on record.

    ∞ where nobody was. The run is repeated to see who it was; NaN where it is another,
    or fails.
    """
    if not row["contacts_moving"]:
        return math.inf
    scene = make_scenario(source.sample(row["seed"]), source.name, Path(), source.data)
    solver = "exact" if row["solver"] in NO_BACK_END else row["solver"]
    try:
        log = run(scene, row["controller"], solver)
    except (Exception, SystemExit):  # of a method that does not do the same again
        return math.nan
    pace = np.abs(log["v_mps"]) + np.abs(log["omega_radps"]) * PERSON
    touched = contacts_moving(log["least_clearance_m"], pace)
    if not len(touched):
        return math.nan
    k = int(touched[0])
    x, y = log["x_m"][k], log["y_m"][k]
    near = int(np.hypot(log.discs[k, :, 0] - x, log.discs[k, :, 1] - y).argmin())
    return float(log["t_s"][k] - scene.world.tracks[near].times[0])


def ratios(row: dict[str, Any], task: Task, source: Crowd) -> dict[str, Any]:
    """Return what the study adds to a run: ratios, arrival, surprise."""
    arrived, seen = row["arrived_s"] is not None, known_for(row, source)
    return {
        "metric_time": row["arrived_s"] / task.time if arrived else None,
        "metric_way": row["length_m"] / task.length if arrived else None,
        "metric_arrived": float(arrived),
        "metric_surprised": None if math.isnan(seen) else float(seen < STOPPING),
    }


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


def human(scene: str, tasks: tuple[Task, ...]) -> dict[str, Any]:
    """Return in how many tasks the human's own way touches somebody's."""
    contacts = sum(own_clearance(task) < 0.0 for task in tasks)
    return {"method": "human", "runs": len(tasks), "contacts": contacts} | {
        "mean_time_s": round(sum(task.time for task in tasks) / len(tasks), 2),
        "setting": scene,
    }


def duration(text: str) -> float:
    """Return seconds, finite and not negative; others raise ValueError."""
    if not 0.0 <= float(text) < math.inf:
        raise ValueError
    return float(text)


def study(options: argparse.Namespace) -> list[Row]:
    """Run all tasks of the scenes, and those of the humans; return the runs."""
    data = None if options.data is None else str(options.data)
    fps = dict.fromkeys(options.scenes) | options.tracks
    sources = {name: Crowd(name, data, options.seen_before, fps[name]) for name in fps}
    tasks = {name: source.tasks for name, source in sources.items()}
    scenes = [
        Scenes(source, range(options.seed, len(tasks[name]), options.every), name)
        for name, source in sources.items()
    ]
    for scene in scenes:
        if not scene.seeds:
            most = len(tasks[scene.setting])
            told = f"there is no such seed, {options.seed} of {most} tasks"
            raise DataError(f"{scene.setting}: {told}")
    runs = run_study(
        "Crowds: in place of a pedestrian",
        scenes,
        options,
        lambda row: ratios(
            row, tasks[row["setting"]][row["seed"]], sources[row["setting"]]
        ),
    )
    chosen = slice(options.seed, None, options.every)
    rows = [human(name, tasks[name][chosen]) for name in tasks]
    for row in rows:
        print(" ".join(f"{key}={value}" for key, value in row.items()))
    write_csv(options.out / "human.csv", rows)
    return runs


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/crowd")
    parser.add_argument("--scenes", metavar="A,B,…", help=f"{TESTED} if no --tracks")
    add = parser.add_argument
    add(
        "--tracks",
        nargs="+",
        default=[],
        metavar="FILE",
        help="as obsmat.txt, or of frame, id, x, y",
    )
    add("--fps", type=float, nargs="+", default=[], metavar="F", help="of the tracks")
    parser.add_argument("--every", type=count, default=1, metavar="N")
    parser.add_argument("--seen-before", type=duration, default=0.0, metavar="S")
    options = parser.parse_args()
    named = options.scenes or ("" if options.tracks else TESTED)
    options.scenes = [*filter(None, named.split(","))]
    unknown = set(options.scenes) - set(SCENES)
    if unknown:
        parser.error(f"unknown scenes: {', '.join(sorted(unknown))}")
    if options.tracks and len(options.fps) not in (1, len(options.tracks)):
        parser.error("--tracks wants --fps, one for all files or one for each")
    same = options.fps * (len(options.tracks) if len(options.fps) == 1 else 1)
    files = [str(Path(file).resolve()) for file in options.tracks]
    if len({*files}) < len(files):
        parser.error("--tracks names a file twice")
    options.tracks = dict(zip(files, same, strict=False))
    main_of(lambda: study(options), parser)


if __name__ == "__main__":
    main()
