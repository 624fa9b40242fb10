"""CrowdNav's test cases [Chen2019]: across a circle of people steered by ORCA.

Case i of a phase has the people of the original's case i (``crowdnav_world.py``), and
success, collision and timeout are its own, looked at every 0.25 s: within 0.3 m of the
goal by 24 s, and never a disc of 0.3 m within 0.6 m of another, if people went on at
the velocities that they had. The row ``orca-holonomic`` is the original's: a disc that
moves any way it likes, steered by ORCA with its parameters.

All others drive a differential drive: |v| ≤ 1 m/s, |ω| ≤ π rad/s (the original's
unicycle turns by at most π/4 in 0.25 s), no limits of acceleration, as there. It starts
with heading π/2, as there, which is towards the goal. Its footprint fits into the disc:
a regular dodecagon, or a rectangle of 0.5 by 0.33 m (``--robot cart``). Control steps
are of 0.05 s. Where a tick of 0.25 s begins it sees the velocities that people had, and
what they have from the next step on; with ``--set dt_s=0.25`` just what a policy there
sees.

Metrics: touched disc, touched footprint: share of runs in which either was, by people
as they really moved; least: distance of the discs, m; discomfort: share of the ticks
nearer than 0.2 m.

    python comparisons/crowdnav.py --people 5,10 --out out/crowdnav
    python comparisons/crowdnav.py --phase val --set robot.v_min_mps=0
"""

import argparse
import json
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np

from crowdnav_world import (
    CASES,
    FIRST_SEED,
    GOAL,
    RADIUS,
    SPEED,
    START,
    TICK,
    TICKS,
    Orca,
    People,
    Tick,
    draw_people,
    judge_tick,
    true_gap,
)
from qpavoid.errors import ConfigError
from qpavoid.lab.simulation.config import changed
from qpavoid.lab.simulation.log import COLUMNS
from qpavoid.lab.simulation.methods import check_methods
from qpavoid.lab.simulation.outcome import CRAWL, PROGRESS, STALLED, mean_jerk
from qpavoid.lab.simulation.scenario import Scenario, make_scenario
from qpavoid.lab.simulation.simulation import Simulation
from qpavoid.lab.study.statistics import wilson
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Pose
from studies import Row, main_of, make_parser, table_row

HOLONOMIC = "orca-holonomic"
METHODS = f"{HOLONOMIC},alone,eq5,eq7,qp,qp-ahead,qp-ahead+guide,orca,c3bf,mppi"

ANGLES = 2.0 * np.pi * np.arange(12) / 12
ROBOTS = {
    "round": RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]),
    "cart": np.array([(-0.25, -0.165), (0.25, -0.165), (0.25, 0.165), (-0.25, 0.165)]),
}
"""Footprints, (k, 2) m, that fit into the disc."""

NOTED = [COLUMNS.index(f"{key}_m") for key in ("clearance", "least_clearance", "room")]
NOTED += [COLUMNS.index(key) for key in ("v_mps", "solve_time_s")]
FEET = ("start_clearance_m", "min_clearance_m", "min_room_m", "jerk_mps3", "solve_us")
"""Columns of a step, and those of a row that are made of them."""


class Crowd(NamedTuple):
    """What all cases of a setting have in common.

    Attributes:
        phase: ``test``, ``val`` or ``train``.
        people: How many.
        seeing: Whether they see the robot.
        rule: ``circle`` or ``square``.
        robot: One of :data:`ROBOTS`.
        changes: Settings of the scenario by dotted key, as JSON.
    """

    phase: str = "test"
    people: int = 5
    seeing: bool = False
    rule: str = "circle"
    robot: str = "round"
    changes: str = "{}"

    @property
    def name(self) -> str:
        """What tables call it."""
        words = [f"{self.people} people"]
        words += [f"in a {self.rule}"] * (self.rule != "circle")
        words += ["who see it"] * self.seeing
        words += [f"of a {self.robot}"] * (self.robot != "round")
        words += [f"{key}={value}" for key, value in json.loads(self.changes).items()]
        return " ".join(words)

    def meet(self, case: int) -> People:
        """Return the people of a case."""
        seed = FIRST_SEED[self.phase] + case
        return People(*draw_people(seed, self.people, self.rule), self.seeing)

    def identity(self, data: str | None) -> str:
        """Return what determines the cases, but for their numbers and the code."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return a case as a scenario file, for studies and tuning.

        People who do not see the robot go the same way whatever it does. Contacts are
        those of its footprint, as people really move.

        Raises:
            ConfigError: They see it.
        """
        if self.seeing:
            raise ConfigError(["people who see the robot are not known in advance"])
        people, still, places = self.meet(seed or 0), np.zeros(2), []
        for _ in range(TICKS):
            places.append(people.places)
            people.decide(still, still)
            people.move()
        ways = np.array([*places, people.places])
        document = make_document(self.robot, self.changes) | {
            "duration_s": TICK * TICKS,
            "ends_at_goal": True,
            "settled_s": 0.0,
            "arrival_m": RADIUS,
            "arrival_rad": 3.2,
        }
        obstacles = [
            {
                "kind": "waypoints",
                "times_s": [TICK * k for k in range(TICKS + 1)],
                "positions_m": ways[:, i].tolist(),
                "radius_m": RADIUS,
            }
            for i in range(self.people)
        ]
        return document | {"obstacles": obstacles}


def make_document(robot: str, changes: str) -> dict[str, Any]:
    """Return robot, reference and settings as a scenario file; the people are not in.

    Args:
        robot: One of :data:`ROBOTS`.
        changes: By dotted key, as JSON.
    """
    document: dict[str, Any] = {
        "title": "CrowdNav",
        "duration_s": TICK * (TICKS + 1),
        "dt_s": 0.05,
        "start": {"x_m": START[0], "y_m": START[1], "heading_rad": math.pi / 2},
        "robot": {
            "footprint_m": ROBOTS[robot].tolist(),
            "v_min_mps": -SPEED,
            "v_max_mps": SPEED,
            "omega_min_radps": -math.pi,
            "omega_max_radps": math.pi,
        },
        "reference": {
            "kind": "spline",
            "points_m": [START.tolist(), GOAL.tolist()],
            "speed_mps": SPEED,
        },
        "tracking": {"waiting": True, "station_keeping": True, "k_y_rad_per_m2": 4.0},
        "filter": {"passive": True},
        "radius": {"r_min_slow_m": 0.05, "r_min_fast_m": 0.1},
    }
    return changed(document, json.loads(changes))


@lru_cache
def make_scene(robot: str, changes: str) -> Scenario:
    """Return robot, reference and settings; the people come with the simulation.

    Raises:
        ConfigError: A change is wrong, or the control step does not divide a tick.
    """
    document = make_document(robot, changes)
    scene = make_scenario(document, "crowdnav", Path("crowdnav"))
    steps = TICK / scene.dt
    if not math.isclose(steps, max(1, round(steps))):
        raise ConfigError([f"dt_s: {scene.dt:g} s are no part of a tick of {TICK} s"])
    return scene


@dataclass
class Shown:
    """A sensor: the discs where they are, at the velocities that it is told.

    Attributes:
        velocities: (n, 2) m/s.
    """

    velocities: Array

    def start(self) -> Callable[[float, Obstacles, Pose], Obstacles]:
        """Return what sees."""
        return lambda time, obstacles, pose: Obstacles(
            discs=obstacles.discs, disc_velocities=self.velocities
        ).seen_from(pose)


class Driven:
    """A differential drive under a method of the registry."""

    def __init__(self, method: str, crowd: Crowd) -> None:
        self._shown = Shown(np.zeros((crowd.people, 2)))
        scene = make_scene(crowd.robot, crowd.changes)
        scene = replace(scene, sensor=self._shown)
        self._simulation = Simulation(scene, method)
        self._discs = np.full((crowd.people, 3), RADIUS)
        self._dt = scene.dt
        self._times = scene.dt * np.arange(round(TICK / scene.dt))
        self._noted: list[list[float]] = []

    def drive(self, time: float, people: People) -> Array:
        """Drive for a tick, and return the places (k + 1, 2), m, from step to step."""
        way, self._shown.velocities = [self._simulation.pose[:2]], people.before
        for later in self._times:
            self._discs[:, :2] = people.at(later)
            there = Obstacles(discs=self._discs, disc_velocities=people.velocities)
            row = self._simulation.step(time + later, there).row
            self._noted.append([row[k] for k in NOTED])
            self._shown.velocities = people.velocities
            way.append(self._simulation.pose[:2])
        return np.array(way)

    def row(self) -> Row:
        """Return what is said of its footprint and its steps so far."""
        start, least, room, v, times = np.array(self._noted).T
        jerk, solve = mean_jerk(v, self._dt), 1e6 * np.median(times)
        numbers = start[0], least.min(), room.min(), jerk, solve
        return dict(zip(FEET, map(float, numbers), strict=True))


class Holonomic:
    """The original's disc, steered by ORCA: of no footprint but the disc."""

    def __init__(self, crowd: Crowd) -> None:
        self._mind, self._place, self._velocity = Orca(crowd.people), START, np.zeros(2)

    def drive(self, time: float, people: People) -> Array:
        """Go on for a tick, and return the places (2, 2), m, at both its ends."""
        begin = self._place
        places = np.vstack([begin, people.places])
        moving = np.vstack([self._velocity, people.before])
        self._velocity = self._mind(places, moving, GOAL)
        self._place = begin + TICK * self._velocity
        return np.array([begin, self._place])

    def row(self) -> Row:
        """Return nothing of a footprint."""
        return dict.fromkeys(FEET)


def episode(method: str, crowd: Crowd, case: int) -> Row:
    """Return the row of a case."""
    people = crowd.meet(case)
    robot = Holonomic(crowd) if method == HOLONOMIC else Driven(method, crowd)
    ends, ticks, gaps = [START, START], [], []
    for k in range(TICKS):
        people.decide(ends[-1], (ends[-1] - ends[-2]) / TICK)
        way = robot.drive(k * TICK, people)
        ticks.append(judge_tick(people, way[0], way[-1]))
        gaps.append(true_gap(people, way))
        ends.append(way[-1])
        people.move()
        if ticks[-1].event in ("touched", "arrived"):
            break
    row = {"method": method, "setting": crowd.name, "scenario": crowd.name}
    row |= {"seed": case, **judged(ticks, np.array(ends[1:]))}
    feet = robot.row()
    least = feet["min_clearance_m"]
    return row | {
        **feet,
        "metric_touched_disc": float(min(gaps) < 0.0),
        "metric_touched_footprint": None if least is None else float(least < 0.0),
        "metric_least": min(gaps),
        "metric_discomfort": fmean(tick.event == "near" for tick in ticks),
        "error": "",
    }


def judged(ticks: Sequence[Tick], ends: Array) -> Row:
    """Return what became of an episode, by the original's rule.

    Args:
        ticks: What it says of each.
        ends: (n + 1, 2) m, the robot's places from the beginning on.
    """
    event = ticks[-1].event
    late = ends[-1 - round(STALLED / TICK) :]
    stalled = bool((np.linalg.norm(late - ends[-1], axis=1) <= PROGRESS).all())
    over = event if event in ("touched", "arrived") else ""
    speeds = np.linalg.norm(np.diff(ends, axis=0), axis=1) / TICK
    return {
        "outcome": over or ("stalled" if stalled else "off goal"),
        "success": over == "arrived",
        "contact": over == "touched",
        "arrived_s": TICK * len(ticks) if over == "arrived" else None,
        "contacts_moving": int(over == "touched" and speeds[-1] > CRAWL),
    }


def summary(rows: Sequence[Row]) -> Row:
    """Return the line of a method: the table's, and Wilson's intervals."""
    line = table_row(rows[0]["method"], rows[0]["setting"], rows)
    for name, key in (("success", "success"), ("collision", "contact")):
        bounds = wilson(sum(row[key] for row in rows), len(rows))
        names = (name, f"{name}_low", f"{name}_high")
        line |= dict(zip(names, (round(x, 4) for x in bounds), strict=True))
    return line


def study(options: argparse.Namespace) -> None:
    """Run all methods in all settings; what is finished is written at once."""
    methods = options.methods.split(",")
    check_methods(name for name in methods if name != HOLONOMIC)
    changes = json.dumps(dict(options.set))
    make_scene(options.robot, changes)
    more = options.seeing, options.rule, options.robot, changes
    cases = range(options.seed, options.seed + options.count)
    options.out.mkdir(parents=True, exist_ok=True)
    rows, table = [], []
    alone = options.workers == 1
    spawn = get_context("spawn")
    crew = nullcontext() if alone else ProcessPoolExecutor(options.workers, spawn)
    with crew as pool:
        each: Any = map if pool is None else partial(pool.map, chunksize=8)
        for people in options.people:
            crowd = Crowd(options.phase, people, *more)
            for method in methods:
                found = list(each(partial(episode, method, crowd), cases))
                rows += found
                table.append(summary(found))
                line = {k: v for k, v in table[-1].items() if v != ""}
                print(" ".join(f"{k}={v}" for k, v in line.items()), flush=True)
                write_csv(options.out / "runs.csv", rows)
                write_csv(options.out / "table.csv", table)


def counts(text: str) -> list[int]:
    """Return the numbers of ``5,10``."""
    found = [int(word) for word in text.split(",")]
    if min(found) < 1:
        raise ValueError
    return found


def setting(text: str) -> tuple[str, Any]:
    """Return key and value of ``KEY=VALUE``, the value as JSON."""
    key, _, value = text.partition("=")
    return key, json.loads(value)


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/crowdnav")
    parser.add_argument("--phase", choices=FIRST_SEED, default="test")
    parser.add_argument("--count", type=int, metavar="N", help="all if not given")
    parser.add_argument("--people", type=counts, default=[5], metavar="N,M,…")
    parser.add_argument("--seeing", action="store_true", help="people see the robot")
    parser.add_argument("--rule", choices=("circle", "square"), default="circle")
    parser.add_argument("--robot", choices=ROBOTS, default="round")
    add = parser.add_argument
    add("--set", type=setting, action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    if options.count is None:
        options.count = min(CASES[options.phase], CASES["test"]) - options.seed
    last = options.seed + options.count
    if not 0 <= options.seed < last <= CASES[options.phase]:
        parser.error(f"{options.phase} has the cases 0 to {CASES[options.phase] - 1}")
    options.workers = options.workers or os.cpu_count() or 1
    main_of(lambda: study(options), parser)


if __name__ == "__main__":
    main()
