"""Random encounters with moving discs, measured against what is possible.

    python comparisons/encounters.py --count 10000 --seed 1 --out out/encounters

A robot stands at its station or follows a straight path at 0.5 to 1 m/s. A disc of 0 to
0.4 m at a constant velocity (0.05 to 1.5 m/s) is first seen 0.8 to 2.5 m away and aimed
at a place of the footprint where the robot will be. Families:

    parked, path   no acceleration limits; the limit is that of dynamic programming
    accelerated    half of each, with 2.0 m/s² and 2.5 rad/s²; its limit is searched
    several        two to five discs; possible is what any of the controllers reached

Writes ``table.csv`` (a row a family and controller), ``encounters.csv`` (a row a run),
``runs.csv`` (the avoidable ones, as all studies do) and two figures. An encounter
counts as avoidable where the limit allows 2 cm of clearance, and r_min as possible
where it allows r_min and 2 cm. Other methods than our four (``--methods``) run a step
at a time, so best on fewer: ``--count 200`` takes the first 200 of the same encounters.
"""

import argparse
import csv
import math
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from encounter_figures import draw
from encounter_scenes import (
    DT,
    FAMILIES,
    MARGIN,
    Encounter,
    as_scenario,
    draw_encounters,
    make_loops,
)
from limit import limit_tables
from limit_search import search_limit, with_accelerations

from qpavoid.avoidance.controllers import make_controller
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import QPAvoidError
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.motion.station import StationKeeping, StationTracker
from qpavoid.motion.tracking import Gains
from qpavoid.simulation.batch import OUTCOME, Batch, Loop
from qpavoid.simulation.methods import check_methods
from qpavoid.simulation.outcome import outcome_of
from qpavoid.simulation.run import run

ROBOT = Robot.mir100()
CONTROLLERS = ("eq5", "eq7", "qp", "qp-ahead")
UNTOUCHED = 1e-3
"""m; r_min counts as violated from here on."""


def run_method(
    method: str, batch: Batch, loops: Sequence[Loop]
) -> npt.NDArray[np.void]:
    """Return the outcome of every loop; only our four are compiled.

    The others begin with a twist of 0, where their limits of acceleration count from.
    """
    if method in ("none", *CONTROLLERS):
        return batch.run(method, loops)
    return np.concatenate(
        [outcome_of(run(as_scenario(batch, loop), method)) for loop in loops]
    )


def possible_clearance(
    family: str, encounters: Sequence[Encounter], robot: Robot
) -> Array:
    """Return the greatest clearance that any controller could keep from one disc, m."""
    rows = np.vstack([e.rows() for e in encounters])
    radius = np.array([e.discs[0, 2] for e in encounters])
    if family == "accelerated":
        return search_limit(robot, rows, radius)
    return limit_tables(robot).clearance(rows, radius)


def solve_time(
    controller: str, robot: Robot, settings: AvoidanceSettings, loops: Sequence[Loop]
) -> float:
    """Return the median time of one call from Python in the first 4 s, µs.

    That of the methods of others, which want to know more, is not taken: NaN.
    """
    if controller not in CONTROLLERS:
        return math.nan
    method, times = make_controller(controller, robot, settings), []
    tracker = station_tracker(robot)
    for loop in loops:
        pose = loop.start[:3]
        step, track = method.start(*loop.start[3:]), tracker.start()
        for k in range(round(4.0 / DT)):
            discs = loop.obstacles.discs.copy()
            discs[:, :2] += k * DT * loop.obstacles.disc_velocities
            world = Obstacles(
                discs=discs, disc_velocities=loop.obstacles.disc_velocities
            )
            target = tuple(loop.plan[min(k, len(loop.plan) - 1)].tolist())
            decision = step(*track(pose, target), world.seen_from(pose))
            times.append(decision.solve_time_s)
            pose = arc(*pose, decision.v, decision.omega, DT)
    return 1e6 * float(np.median(times))


def station_tracker(robot: Robot) -> StationTracker:
    """Return the tracking law of all controllers."""
    return StationTracker(Gains(1.0, 4.0, 2.0), StationKeeping(), robot.limits)


def needs_none(outcome: npt.NDArray[np.void]) -> npt.NDArray[np.bool_]:
    """Return where tracking alone keeps r_min, so that nothing had to be done."""
    return outcome["room"] >= 0.0


def share(part: npt.NDArray[np.bool_], whole: npt.NDArray[np.bool_]) -> float:
    """Return how much of ``whole`` is in ``part``; NaN for nothing."""
    return float(part[whole].mean()) if whole.any() else math.nan


def row(
    family: str,
    controller: str,
    outcome: npt.NDArray[np.void],
    alone: npt.NDArray[np.void],
    limit: Array,
    spare: Array,
    pace: Array,
    quiet: Array,
    solve_us: float,
) -> dict[str, Any]:
    """Return a line of the table.

    ``limit`` is the clearance that is possible, ``spare`` what it leaves beyond r_min,
    ``pace`` the speed of the fastest disc, ``quiet`` when they have left.
    """
    avoidable, possible = limit >= MARGIN, spare >= MARGIN
    contact, violated = outcome["clearance"] < 0.0, outcome["room"] < -UNTOUCHED
    back = np.isfinite(outcome["arrived"])
    delay = np.maximum(outcome["arrived"] - quiet, 0.0)[back]
    kept = outcome["clearance"][avoidable] / limit[avoidable]
    slow, free = pace <= 1.0, needs_none(alone)
    return {
        "family": family,
        "controller": controller,
        "encounters": len(outcome),
        "avoidable": int(avoidable.sum()),
        "contacts_avoidable": int((contact & avoidable).sum()),
        "contacts_unavoidable": int((contact & ~avoidable).sum()),
        "r_min_possible": int(possible.sum()),
        "r_min_violations": int((violated & possible).sum()),
        "r_min_kept_to_1_mps": 1.0 - share(violated, possible & slow),
        "r_min_kept_above_1_mps": 1.0 - share(violated, possible & ~slow),
        "clearance_share_median": float(np.median(np.clip(kept, 0.0, 1.0))),
        "deviation_median_m": float(np.median(outcome["deviation"])),
        "not_returned": int((~back).sum()),
        "return_error_p95_m": float(np.quantile(outcome["error"], 0.95)),
        "return_time_p95_s": float(np.quantile(delay, 0.95))
        if back.any()
        else math.nan,
        "needless": share(outcome["changed"] > 0.0, free),
        "changed_median_s": float(np.median(outcome["changed"])),
        "solve_median_us": solve_us,
    }


def study(
    family: str, count: int, seed: int, methods: Sequence[str] = CONTROLLERS
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the table of a family, and a line for every run."""
    robot = ROBOT
    if family == "accelerated":
        robot = with_accelerations(robot, 2.0, 2.5)
    settings = AvoidanceSettings(dt=DT)
    encounters = draw_encounters(family, count, seed, robot)
    loops = make_loops(encounters, robot)
    batch = Batch(robot, station_tracker(robot), settings)
    names = list(dict.fromkeys((*CONTROLLERS, *methods)))
    outcomes = {name: run_method(name, batch, loops) for name in ("none", *names)}
    pace = np.array([np.hypot(*e.velocities.T).max() for e in encounters])
    if family == "several":
        limit, spare = (
            np.max([outcomes[name][column] for name in names], axis=0)
            for column in ("clearance", "room")
        )
        spare = spare + MARGIN
    else:
        limit = possible_clearance(family, encounters, robot)
        spare = limit - [settings.radius.r_min(speed) for speed in pace]
    quiet = np.array([loop.quiet for loop in loops])
    rows = [
        row(
            family,
            name,
            outcomes[name],
            outcomes["none"],
            limit,
            spare,
            pace,
            quiet,
            solve_time(name, robot, settings, loops[:40]),
        )
        for name in methods
    ]
    runs = [
        {
            "family": family,
            "controller": name,
            "number": k,
            "robot_mps": encounter.speed,
            "disc_mps": float(pace[k]),
            "x_m": float(encounter.discs[0, 0]),
            "y_m": float(encounter.discs[0, 1]),
            "v_x_mps": float(encounter.velocities[0, 0]),
            "v_y_mps": float(encounter.velocities[0, 1]),
            "radius_m": float(encounter.discs[0, 2]),
            "limit_m": float(limit[k]),
            **{key: float(outcomes[name][key][k]) for key in OUTCOME.names or ()},
        }
        for name in methods
        for k, encounter in enumerate(encounters)
    ]
    return rows, runs


def write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table; floats with six significant digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for line in rows:
            writer.writerow(
                {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in line.items()}
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/encounters"))
    parser.add_argument("--methods", default=",".join(CONTROLLERS), metavar="A,B,…")
    parser.add_argument("--families", default=",".join(FAMILIES), metavar="A,B,…")
    arguments = parser.parse_args()
    families, methods = arguments.families.split(","), arguments.methods.split(",")
    if arguments.count < 1 or not set(families) <= set(FAMILIES):
        parser.error(f"--count wants 1 or more, --families some of {FAMILIES}")
    try:
        check_methods(methods)
    except QPAvoidError as error:
        parser.error(str(error))
    arguments.out.mkdir(parents=True, exist_ok=True)
    table, runs = [], []
    for family in families:
        started = perf_counter()
        lines, more = study(family, arguments.count, arguments.seed, methods)
        table += lines
        runs += more
        print(f"{family}: {perf_counter() - started:.0f} s", flush=True)
        write(arguments.out / "table.csv", table)
    write(arguments.out / "encounters.csv", runs)
    write(arguments.out / "runs.csv", as_runs(runs))
    for line in table:
        kept = line["r_min_possible"] - line["r_min_violations"]
        print(
            f"{line['family']:<12}{line['controller']:<9} contacts "
            f"{line['contacts_avoidable']}/{line['avoidable']}, r_min kept "
            f"{kept}/{line['r_min_possible']}, return error "
            f"{1000 * line['return_error_p95_m']:.0f} mm (p95), "
            f"{line['solve_median_us']:.0f} us"
        )
    if set(CONTROLLERS) <= set(methods):
        draw(runs, arguments.out)


if __name__ == "__main__":
    main()
