"""Random encounters with what moves and stands, measured against what is possible.

    python comparisons/encounters/encounters.py --count 10000 --out out/encounters

A robot stands at its station or follows a straight path at 0.5 to 1 m/s, and something
is aimed at a place of the footprint where the robot will be, first seen 0.8 to 2.5 m
away. Families of discs of 0 to 0.4 m at a constant velocity (0.05 to 1.5 m/s):

    parked, path   no acceleration limits; the limit is that of dynamic programming
    accelerated    half of each, with 2.0 m/s² and 2.5 rad/s²; its limit is searched
    several        two to five discs

and, every other one on a path, two of four with these limits of acceleration:

    mixed          points, walls, and one or two discs
    corridor       between two walls, somebody behind or ahead
    doorway        a wall with a door, and somebody who goes through it
    turning        a disc that turns at up to 1 rad/s
    stop-and-go    a disc that stops and goes on
    accelerating   a disc that goes over from one speed to another
    carts          a moving rectangle

An encounter counts as avoidable where 2 cm of clearance can be kept, and r_min as
possible where r_min and 2 cm can. From several on, a search of plans decides it that
asks none of the controllers; ``oracle.csv`` has what it misses. Families whose movers
change their velocity are run without margins and with :data:`MARGINS`.

Writes ``table.csv`` (a row a family, margins and controller), ``encounters.csv`` (a row
a run), ``runs.csv`` (the avoidable ones, as all studies do), ``oracle.csv``,
``readme.md`` and two figures. Other methods than our four (``--methods``) run a step at
a time, so best on fewer: ``--count 300`` takes the first 300 of the same encounters.
One that raises has a row that says how many runs failed, and makes the exit status 1.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from encounter_families import CHANGING
from encounter_figures import draw
from encounter_loop import Map, Met, chatter, meet_all, together
from encounter_oracle import misses, search_limits
from encounter_scenes import (
    DISCS,
    DT,
    FAMILIES,
    Encounter,
    as_scenario,
    draw_encounters,
    make_loops,
)
from encounter_table import Limit, Runs, as_runs, fallen, lines, readme, row, setting
from limit import limit_tables
from limit_search import search_limit, with_accelerations
from qpavoid.avoidance.settings import AvoidanceSettings, Margins
from qpavoid.errors import QPAvoidError
from qpavoid.lab.simulation.batch import Batch, Loop
from qpavoid.lab.simulation.methods import check_methods
from qpavoid.lab.simulation.outcome import OUTCOME, outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.robot import Robot
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.station import StationKeeping, StationTracker

ROBOT = Robot.mir100()
CONTROLLERS = ("eq5", "eq7", "qp", "qp-ahead")

MARGINS = Margins(error=0.3, acceleration=0.5)
"""What a user would set who knows that people do not keep their velocities."""

CHATTERING, CHATTER_TIME = 100, 20.0
"""How many of the compiled runs are run once more, a step at a time, for their chatter
and what deciding takes; and the s of each, for slow discs take minutes to leave."""

FEW = 20
"""Encounters that are not worth processes of their own."""


def run_method(
    method: str,
    batch: Batch,
    encounters: Sequence[Encounter],
    loops: Sequence[Loop],
    family: str,
    each: Map,
) -> Met:
    """Return the outcome of every loop, and chatter and times of the first of them.

    Only our four are compiled, and only for constant velocities. In families of
    discs the others begin with a twist of 0, where their limits of acceleration count
    from.

    Args:
        method: Name of the controller.
        batch: Robot, settings and tracking law.
        encounters: What the robot meets.
        loops: The same as loops.
        family: Of the encounters.
        each: ``map``, or that of a pool of processes.
    """
    ours = method in ("alone", *CONTROLLERS)
    if family in CHANGING or (not ours and family not in DISCS):
        return meet_all(method, batch, encounters, loops, each)
    if ours:
        brief = [
            replace(loop, duration=min(loop.duration, CHATTER_TIME))
            for loop in loops[:CHATTERING]
        ]
        stepped = meet_all(method, batch, encounters[:CHATTERING], brief, each)
        return stepped._replace(outcome=batch.run(method, loops))
    return together(each(by_steps, [method] * len(loops), [batch] * len(loops), loops))


def by_steps(method: str, batch: Batch, loop: Loop) -> Met:
    """Return what becomes of a loop that any method is driven in."""
    log = run(as_scenario(batch, loop), method)
    twists = np.column_stack([log["v_mps"], log["omega_radps"]])
    return Met(outcome_of(log), np.array([chatter(twists, DT)]), log["solve_time_s"])


def possible(
    family: str, encounters: Sequence[Encounter], robot: Robot, folder: Path | None
) -> Limit:
    """Return what some plan could keep, whatever the controller."""
    radius = AvoidanceSettings().radius
    if family not in DISCS or family == "several":
        return Limit(*search_limits(robot, encounters, radius), is_greatest=False)
    rows = np.vstack([e.rows() for e in encounters])
    radii = np.array([e.discs[0, 2] for e in encounters])
    if family == "accelerated":
        limit = search_limit(robot, rows, radii)
    else:
        limit = limit_tables(robot, folder=folder).clearance(rows, radii)
    return Limit(limit, limit - [radius.r_min(e.pace) for e in encounters])


def limit_of(
    family: str,
    encounters: Sequence[Encounter],
    parts: Sequence[tuple[Robot, npt.NDArray[np.intp]]],
    folder: Path | None,
) -> Limit:
    """Return what some plan could keep where some encounters are of another robot."""
    clearance, spare = (np.empty(len(encounters)) for _ in range(2))
    is_greatest = True
    for robot, places in parts:
        some = [encounters[k] for k in places]
        limit = possible(family, some, robot, folder)
        clearance[places], spare[places] = limit.clearance, limit.spare
        is_greatest = limit.is_greatest
    return Limit(clearance, spare, is_greatest)


def station_tracker(robot: Robot) -> StationTracker:
    """Return the tracking law of all controllers."""
    return StationTracker(Gains(1.0, 4.0, 2.0), StationKeeping(), robot.limits)


def study(
    family: str,
    count: int,
    seed: int,
    methods: Sequence[str] = CONTROLLERS,
    folder: Path | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the table of a family, and a line for every run.

    Args:
        family: One of :data:`encounter_scenes.FAMILIES`.
        count: Encounters.
        seed: Of the encounters.
        methods: Names of the controllers.
        folder: Where the tables of the limit are kept.
    """
    drawn = draw_encounters(family, count, seed, ROBOT)
    limited = np.array([encounter.limited for encounter in drawn])
    robots = (ROBOT, with_accelerations(ROBOT, 2.0, 2.5))
    parts = [(robots[k], np.flatnonzero(limited == k)) for k in (0, 1)]
    parts = [(robot, places) for robot, places in parts if len(places)]
    limit, loops, quiet = limit_of(family, drawn, parts, folder), {}, np.empty(count)
    for robot, places in parts:
        loops[robot] = make_loops([drawn[k] for k in places], robot)
        quiet[places] = [loop.quiet for loop in loops[robot]]
    table, runs, alone = [], [], np.zeros(count, OUTCOME)
    with workers() if count > FEW else nullcontext() as pool:
        each = pool.map if pool else map
        for margins in (Margins(), MARGINS) if family in CHANGING else (Margins(),):
            settings = AvoidanceSettings(dt=DT, margins=margins)
            driven = ("alone", *methods) if margins == Margins() else methods
            for name in dict.fromkeys(driven):
                outcome, done = np.zeros(count, OUTCOME), []
                for robot, places in parts:
                    batch = Batch(robot, station_tracker(robot), settings)
                    some = [drawn[k] for k in places]
                    try:
                        met = run_method(name, batch, some, loops[robot], family, each)
                    except (Exception, SystemExit) as error:  # of one's own method
                        told = f"{family}, {name}: {type(error).__name__}: {error}"
                        print(told, file=sys.stderr)
                        table.append(fallen(family, name, margins, count))
                        break
                    outcome[places] = met.outcome
                    done.append(met)
                if name == "alone":
                    alone = outcome
                if name not in methods or len(done) < len(parts):
                    continue
                found = Runs(name, margins, together(done)._replace(outcome=outcome))
                line = row(family, found, alone, limit, drawn, quiet)
                table.append(line | {"failed": 0})
                runs += lines(family, found, limit, drawn)
    return table, runs


def workers() -> ProcessPoolExecutor:
    """Return processes for loops that are taken a step at a time."""
    return ProcessPoolExecutor(mp_context=get_context("spawn"))


def write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a table; floats with six significant digits."""
    write_csv(
        path,
        (
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()}
            for row in rows
        ),
    )


def said(line: dict[str, Any]) -> str:
    """Return a line of the table in words."""
    kept = line["r_min_possible"] - line["r_min_violations"]
    return (
        f"{setting(line)} {line['controller']}: contacts "
        f"{line['contacts_avoidable']}/{line['avoidable']}, r_min kept "
        f"{kept}/{line['r_min_possible']}, not back {line['not_returned']}, "
        f"needless {line['needless']:.3f}, chatter {line['chatter_v_per_s']:.2f} "
        f"and {line['chatter_omega_per_s']:.2f} 1/s, back after "
        f"{line['arrived_median_s']:.1f} s, {line['solve_us']:.0f} us"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/encounters"))
    names = "--methods", "--controllers"
    parser.add_argument(*names, default=",".join(CONTROLLERS), metavar="A,B,…")
    parser.add_argument("--families", default=",".join(FAMILIES), metavar="A,B,…")
    parser.add_argument("--oracle", type=int, default=1000, metavar="N")
    arguments = parser.parse_args()
    families, methods = arguments.families.split(","), arguments.methods.split(",")
    if arguments.count < 1 or not set(families) <= set(FAMILIES):
        parser.error(f"--count wants 1 or more, --families some of {FAMILIES}")
    try:
        check_methods(methods)
    except QPAvoidError as error:
        parser.error(str(error))
    arguments.out.mkdir(parents=True, exist_ok=True)
    table, broken, runs = [], [], []
    for family in families:
        started = perf_counter()
        given = arguments.count, arguments.seed, methods, arguments.out
        found, more = study(family, *given)
        table += [line for line in found if not line["failed"]]
        broken += [line for line in found if line["failed"]]
        runs += more
        print(f"{family}: {perf_counter() - started:.0f} s", flush=True)
        write(arguments.out / "table.csv", [*table, *broken])
    write(arguments.out / "encounters.csv", runs)
    write(arguments.out / "runs.csv", as_runs(runs))
    if arguments.oracle and {"parked", "path"} & set(families):
        asked = arguments.oracle, arguments.seed, AvoidanceSettings().radius
        oracle = misses(ROBOT, *asked, arguments.out)
        write(arguments.out / "oracle.csv", oracle)
        for line in oracle:
            print(
                f"search, {line['family']}, {line['asked']}: misses {line['missed']} "
                f"of {line['possible']}; {line['beyond']} beyond the limit"
            )
    for line in table:
        print(said(line))
    text = readme(table)
    (arguments.out / "readme.md").write_text(text, encoding="utf-8")
    print(text, end="")
    if set(CONTROLLERS) <= set(methods):
        draw(runs, arguments.out)
    if broken:
        sys.exit(1)


if __name__ == "__main__":
    main()
