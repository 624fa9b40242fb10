"""CrowdNav's test cases [Chen2019]: across a circle of people steered by ORCA.

Case i of a phase has the people of the original's case i (``crowdnav_world.py``).
Success, collision and timeout are its own, checked every 0.25 s: within 0.3 m of the
goal by 24 s, and never a disc of 0.3 m within 0.6 m of another, if people kept the
velocities of the tick before. The row ``orca-holonomic`` is the original's: a disc that
moves in any direction, steered by ORCA with its parameters.

All others drive a differential drive: |v| ≤ 1 m/s, |ω| ≤ π rad/s (the original's
unicycle turns by at most π/4 in 0.25 s), no limits of acceleration. It starts with
heading π/2, towards the goal. Its footprint is a regular dodecagon in the disc. Control
steps are of 0.05 s. At the beginning of a tick of 0.25 s it sees the previous
velocities of people, from the next step on the present ones.

    python comparisons/crowdnav/crowdnav.py --people 5,10 --out out/crowdnav

With ``--changing`` people and rules are those of CrowdNav++ (``crowdnav_changing.py``):
the robot starts towards its goal and sees true discs within 5 m, or, as
``METHOD@lidar``, by 360 beams at 10 Hz, σ 1 cm, range 5.3 m, and perception, which
takes people for 0.4 m in radius: chosen among 0.25 and 0.4 on 60 cases of ``val``.
With ``METHOD@wide`` r_min is 0.10 to 0.25 m, else 0.05 to 0.10 m.

    python comparisons/crowdnav/crowdnav.py --changing circle --people 20 --count 250 \
        --methods orca-holonomic,qp-ahead,qp-ahead+guide,qp-ahead+guide@lidar

With ``--reacting`` people see the robot (``crowdnav_reacting.py``), steered by ORCA or
by the social force model; ``--people`` is their number in 64 m². The robot sees true
discs. ``METHOD@still`` has a guide with ``yielding``: no velocities, and filter and
guide look 0.5 s ahead, not 3 s. It was chosen on 6 to 10 cases of ``val``.

    python comparisons/crowdnav/crowdnav.py --reacting orca --people 32,64,102,147 \
        --count 40 --methods qp-ahead+guide,qp-ahead+guide@still,mppi,orca,ttc,stop
"""

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import product, zip_longest
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from crowdnav_cases import Crowd, make_scene
from crowdnav_reacting import EFFECT
from crowdnav_robots import FEET, Driven, Holonomic, Row
from crowdnav_world import CASES, FIRST_SEED, RADIUS
from qpavoid.errors import ConfigError, QPAvoidError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.scenario.methods import check_methods
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.simulation.outcome import CRAWL, PROGRESS, STALLED
from qpavoid.lab.study.tables import write_csv
from qpavoid.types import Array

HOLONOMIC = "orca-holonomic"
VARIANTS = {"lidar", "wide", "still"}
METHODS = f"{HOLONOMIC},alone,eq5,eq7,qp,qp-ahead,qp-ahead+guide,orca,mppi"


def run_case(method: str, crowd: Crowd, case: int) -> Row:
    """Return the row of a case; an error becomes a row with outcome ``failed``."""
    row: Row = {"method": method, "setting": crowd.name, "scenario": crowd.name}
    row |= {"seed": case}
    try:
        return row | episode(method, crowd, case) | {"error": ""}
    except (Exception, SystemExit) as error:  # of a method of one's own: any
        return row | {
            **{"outcome": "failed", "success": False, "contact": False},
            **{"arrived_s": None, "contacts_moving": 0},
            **dict.fromkeys(FEET),
            "intrusion_percent": 0.0,
            "error": f"{type(error).__name__}: {error}",
        }


def episode(method: str, crowd: Crowd, case: int) -> Row:
    """Return the outcome of a case; of :data:`VARIANTS` as ``METHOD@VARIANT``."""
    people, (name, *variants) = crowd.meet(case), method.split("@")
    if name == HOLONOMIC:
        robot: Holonomic | Driven = Holonomic(crowd, people)
    else:
        scene = make_scene(people, crowd.ticks, "wide" in variants)
        if "lidar" in variants:
            scene = replace(scene, lidar=LidarSettings(range=crowd.sight, seed=case))
        if "still" in variants:
            scene = replace(scene, guide=GuideSettings(yielding=True))
        robot = Driven(name, crowd, people, scene)
    ends, event, intrusions = [people.start], "", 0
    for k in range(crowd.ticks):
        people.decide()
        way = robot.drive(k * people.tick, people)
        event = people.judge(way)
        ends.append(way[-1])
        people.move()
        if event:
            break
        away = np.linalg.norm(people.future()[0] - way[-1], axis=-1)
        intrusions += int((away < 2 * RADIUS).any())
    share = 100.0 * intrusions / (len(ends) - 1)
    more = {"intrusion_percent": share} | people.effect()
    return judged(event, np.array(ends), people.tick) | more | robot.row()


def judged(event: str, ends: Array, tick: float) -> Row:
    """Return the outcome of an episode by the original's rule.

    Args:
        event: Of the last tick; see :func:`judge_tick`.
        ends: (n + 1, 2) m, the robot's places from the beginning on.
        tick: s between two of them.
    """
    late = ends[-1 - round(STALLED / tick) :]
    stalled = bool((np.linalg.norm(late - ends[-1], axis=1) <= PROGRESS).all())
    speeds = np.linalg.norm(np.diff(ends, axis=0), axis=1) / tick
    return {
        "outcome": event or ("stalled" if stalled else "off goal"),
        "success": event == "arrived",
        "contact": event == "touched",
        "arrived_s": tick * (len(ends) - 1) if event == "arrived" else None,
        "contacts_moving": int(event == "touched" and speeds[-1] > CRAWL),
    }


def summary(rows: list[Row]) -> Row:
    """Return shares of the cases of a method and setting, and its mean time, s.

    ``at_rest`` are collisions that began while the robot stood.
    """
    hit = [row for row in rows if row["contact"]]
    times = [row["arrived_s"] for row in rows if row["success"]]
    shares = {
        "success": len(times),
        "collision": len(hit),
        "at_rest": sum(not row["contacts_moving"] for row in hit),
        "timeout": len(rows) - len(times) - len(hit),
    }
    found: Row = {k: rows[0][k] for k in ("setting", "method")} | {"n": len(rows)}
    found |= {k: round(count / len(rows), 4) for k, count in shares.items()}
    found["time_s"] = round(float(np.mean(times)), 2) if times else None
    intrusion = [row["intrusion_percent"] for row in rows]
    usual = {"intrusion_percent": round(float(np.mean(intrusion)), 2)}
    return found | (effect(rows) or usual)


def effect(rows: list[Row]) -> Row:
    """Return delay, s, and detour, m, of people per second, with standard errors.

    Ratios of sums over the runs; nothing if these are unknown.
    """
    known = [[row[k] for k in EFFECT] for row in rows if EFFECT[0] in row]
    if not known:
        return {}
    lasted, *costs = np.array(known).T
    found: Row = {}
    for key, cost in zip(("delay_per_s", "detour_mps"), costs, strict=True):
        ratio = cost.sum() / lasted.sum()
        error = np.linalg.norm(cost - ratio * lasted) / lasted.sum()
        numbers = round(float(ratio), 3), round(float(error), 3)
        found |= dict(zip((key, f"{key}_error"), numbers, strict=True))
    return found


def study(options: argparse.Namespace) -> list[Row]:
    """Run all methods in all settings, and return a row a run.

    What is finished is written at once.
    """
    methods = options.methods.split(",")
    names, *variants = zip_longest(*(x.split("@") for x in methods))
    check_methods(x for x in names if x != HOLONOMIC)
    if wrong := {x for some in variants for x in some if x} - VARIANTS:
        raise ConfigError([f"no variant {', '.join(wrong)}"])
    kinds = options.changing, options.reacting
    crowds = [Crowd(options.phase, people, *kinds) for people in options.people]
    for crowd in crowds:  # is there room for so many?
        crowd.meet(options.seed)
    cases = range(options.seed, options.seed + options.count)
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    totals: list[Row] = []
    alone = options.workers == 1
    spawn = get_context("spawn")
    crew = nullcontext() if alone else ProcessPoolExecutor(options.workers, spawn)
    with crew as pool:
        each: Any = map if pool is None else partial(pool.map, chunksize=8)
        for crowd, method in product(crowds, methods):
            found = list(each(partial(run_case, method, crowd), cases))
            rows += found
            totals.append(summary(found))
            ends = Counter(row["outcome"] for row in found)
            print(f"{method}, {crowd.name}: {dict(ends)}", flush=True)
            write_csv(options.out / "runs.csv", rows)
            write_csv(options.out / "summary.csv", totals)
    return rows


def counts(text: str) -> list[int]:
    """Return the numbers of ``5,10``."""
    found = [int(word) for word in text.split(",")]
    if min(found) < 1:
        raise ValueError
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--methods", default=METHODS, metavar="A,B,…")
    add("--seed", type=int, default=0, metavar="S", help="first case")
    add("--out", type=Path, default=Path("out/crowdnav"), metavar="DIR")
    add("--workers", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--phase", choices=FIRST_SEED, default="test")
    parser.add_argument("--count", type=int, metavar="N", help="all if not given")
    kind = parser.add_mutually_exclusive_group().add_argument
    kind("--changing", choices=("circle", "square"), default="", help="goals change")
    kind("--reacting", choices=("orca", "force"), default="", help="see the robot")
    parser.add_argument("--people", type=counts, default=[5], metavar="N,M,…")
    options = parser.parse_args()
    if options.count is None:
        options.count = min(CASES[options.phase], CASES["test"]) - options.seed
    last = options.seed + options.count
    if not 0 <= options.seed < last <= CASES[options.phase]:
        parser.error(f"{options.phase} has the cases 0 to {CASES[options.phase] - 1}")
    try:
        rows = study(options)
    except QPAvoidError as error:
        parser.error(str(error))
    if failed := sum(bool(row["error"]) for row in rows):
        parser.exit(1, f"{failed} of {len(rows)} runs failed\n")


if __name__ == "__main__":
    main()
