"""Station keeping: a cart parked at a workbench, and people of nine kinds come by.

Each visit has one person (``people.py``) of 0.5 to 1.5 m/s. Six kinds walk past, at
most 1 m from the station's middle, and react to the robot in HuNavSim's six ways. One
walks straight up to it, stands beside it for 6 s, and turns back. One carries a box,
one pushes a cart; neither takes notice of the robot. All methods see perception's
obstacles of a LiDAR all round at 10 Hz; ``points`` has its points alone.

Run: python comparisons/encounters/station.py [--visits 30]
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "perception"))
from people import ARRIVED, REACTIONS, People
from perception_loops import ROBOT, SETTINGS  # type: ignore[import-not-found]
from perception_scenes import box_walls  # type: ignore[import-not-found]
from qpavoid.avoidance.controllers import StepContext
from qpavoid.guide.guide import Guide
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.lab.sensing.lidar import LidarSettings, scanner
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import integrate, to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist
from qpavoid.tracking.kanayama import Gains, Reference, tracking_error
from qpavoid.tracking.station import StationKeeping, Tracker
from qpavoid.types import Array, Pose, Twist

KINDS = *REACTIONS, "beside", "box", "cart"
METHODS = "ours", "points", "eq5", "eq7", "qp", "nothing"
"""``ours``: guide and perception; ``nothing``: a robot that never moves, as one that
stops for obstacles does while it is parked."""

STATION: Pose = (0.0, 0.0, 0.0)
BENCH = -0.6, -1.35, 0.9, -0.75
"""Corners of the workbench, m."""

REGION = (-2.5, -0.5), (2.5, -0.5), (2.5, 2.5), (-2.5, 2.5)
"""Area that the middle of the robot does not leave, m."""

BODIES = {"box": (0.15, -0.4, 0.55, 0.4), "cart": (0.4, -0.4, 1.6, 0.4)}
"""Loads ahead of the person: two corners, m."""

LIDAR = LidarSettings(range=12.0)
"""360 beams at 10 Hz, σ 1 cm."""

ROOM = box_walls(-8.0, -7.0, 8.0, 7.0)
RADIUS, START, ASIDE, FREE = 0.25, 5.5, 1.0, 0.1
"""Of a person, m; way before and after the nearest place, m; greatest distance of that
from the station, m; least distance of a way from the bench, m."""

STAYS, REACTS, RETURN, LATE = 6.0, 15.0, 10.0, 75.0
"""s beside the robot; of a reaction; after a visit; greatest duration of a scene."""

AWAY = 0.02, math.radians(2.0)
"""m and rad from which on the robot is away from its station."""

OUT = Path(__file__).parents[1] / "results/station.csv"
Row: TypeAlias = dict[str, Any]


class Visitor:
    """A person of a kind who comes by and goes away.

    Attributes:
        people: The person.
        gone: Whether the visit is over.
    """

    def __init__(self, kind: str, seed: int, delay: float = 0.0) -> None:
        random = np.random.default_rng((KINDS.index(kind), seed))
        self._load = BODIES.get(kind)
        half = RADIUS if self._load is None else self._load[3]
        self._stays = STAYS if kind == "beside" else 0.0
        self._speed, gap = random.uniform(0.5, 1.5), -1.0
        while gap < half + (0.5 if self._stays else FREE):
            angle, aside = random.uniform(-math.pi, math.pi), random.uniform(-1, 1)
            way = np.array([math.cos(angle), math.sin(angle)])
            near = ASIDE * aside * np.array([-way[1], way[0]])
            ends = -START, START
            if self._stays:
                ends = -START, -standing_place(way, 0.65 + 0.35 * aside)
                near *= 0.0
            line = near + np.linspace(*ends, 100)[:, None] * way
            gap = float(to_box(line, BENCH).min())
        begin = line[:1] - self._speed * delay * way
        kind = kind if kind in REACTIONS else "impassive"
        more = self._speed, RADIUS, None, kind, box_walls(*BENCH), seed
        self.people = People(begin, line[-1:], *more)
        self.people.robot_radius = ROBOT.footprint.circumradius
        self.people.duration, self._home = REACTS, line[:1]

    @property
    def gone(self) -> bool:
        """Whether the person has arrived, and does not turn back."""
        return self._stays <= 0.0 and self._left < 1.2 * ARRIVED

    @property
    def _left(self) -> float:
        return float(np.linalg.norm(self.people.goals - self.people.places))

    def step(self, pose: Pose, twist: Twist, dt: float) -> None:
        """Go on for dt, s, beside a robot with a pose and a twist."""
        people, (v, _) = self.people, twist
        if self._stays > 0.0:
            people.speeds[:] = min(self._speed, max(0.2, self._left / 0.8))
            self._stays -= dt * (self._left < ARRIVED)
            if self._stays <= 0.0:
                people.goals, people.speeds[:] = self._home, self._speed
        people.step(pose, (v * math.cos(pose[2]), v * math.sin(pose[2])), dt)

    @property
    def outlines(self) -> list[Array]:
        """Polygons of the load, world frame, m."""
        if self._load is None:
            return []
        corners = np.array(box_walls(*self._load))[:, :2]
        return [to_world(corners, (*self.disc[:2], self.people.headings[0]))]

    @property
    def disc(self) -> tuple[float, float, float]:
        """x, y and radius of the person, m."""
        x, y = self.people.places[0].tolist()
        return x, y, RADIUS


def standing_place(way: Array, gap: float) -> float:
    """Return the distance from the station, m, at which somebody is a gap away."""
    (x, y), far = ROBOT.footprint.vertices.max(axis=0), np.linspace(0.0, 3.0, 301)
    gaps = to_box(-far[:, None] * way, (-x, -y, x, y)) - RADIUS
    return float(far[np.argmax(gaps >= gap)])


def to_box(places: Array, box: Sequence[float]) -> Array:
    """Return the distances (n,) of places (n, 2) from a box, m; 0 inside."""
    outside = np.maximum(np.subtract(box[:2], places), places - box[2:])
    return np.asarray(np.hypot(*np.maximum(outside, 0.0).T))


def seen(visitors: Sequence[Visitor], *walls: Sequence[float]) -> Obstacles:
    """Return people, their loads, and walls, world frame."""
    return Obstacles(
        discs=[x.disc for x in visitors],
        walls=np.reshape(walls, (-1, 4)),
        polygons=[y for x in visitors for y in x.outlines],
    )


def clearance(pose: Pose, bodies: Obstacles) -> float:
    """Return the distance of the robot at a pose from bodies in the world frame, m."""
    return clearance_of(ROBOT.footprint, bodies.seen_from(pose).arrays)


def driver(method: str) -> Callable[[Pose, Obstacles, Twist], Twist]:
    """Return the function from pose, obstacles and last twist to the next twist."""
    if method == "nothing":
        return lambda pose, obstacles, last: (0.0, 0.0)
    if method in ("ours", "points"):
        guide = Guide(ROBOT, SETTINGS)
        guide.stay(STATION, region=REGION)
        return lambda pose, obstacles, last: guide.step(pose, obstacles)[:2]
    step = make_controller(method, ROBOT, SETTINGS).start()
    track = Tracker(Gains(), StationKeeping(), ROBOT.limits).start()

    def drive(pose: Pose, obstacles: Obstacles, last: Twist) -> Twist:
        error = tracking_error(pose, STATION)
        context = StepContext(pose, error, (0.0, 0.0), error, last)
        wanted = track(pose, Reference(*STATION, 0.0, 0.0))
        twist = step(*wanted, obstacles, context)[:2]
        return limit_twist(ROBOT.limit_vector, twist, last, SETTINGS.dt)

    return drive


def drive(visitors: Sequence[Visitor], method: str, seed: int) -> Row:
    """Return the figures of a scene."""
    dt, pose, twist, late = SETTINGS.dt, STATION, (0.0, 0.0), RETURN
    lidar = replace(LIDAR, seed=seed, perception=method != "points")
    see, decide = scanner(ROBOT, lidar), driver(method)
    walls = box_walls(*BENCH)
    touched, near, driven, away, bench = "", math.inf, 0.0, 0.0, math.inf
    for k in range(round(LATE / dt)):
        there = seen(visitors, *walls, *ROOM)
        there = there if method == "nothing" else see(k * dt, there, pose)
        twist = decide(pose, there, twist)
        for one in visitors:
            one.step(pose, twist, dt)
        pose = integrate(pose, twist, 0.0, dt)
        gap = clearance(pose, seen(visitors))
        moves = abs(twist[0]) > 0.02 or abs(twist[1]) > 0.05
        touched = touched or (gap < 0.0) * ("robot" if moves else "person")
        near, bench = min(near, gap), min(bench, clearance(pose, seen((), *walls)))
        driven += abs(twist[0]) * dt
        x, y, turned = tracking_error(pose, STATION)
        away += dt * (math.hypot(x, y) > AWAY[0] or abs(turned) > AWAY[1])
        late -= dt * all(x.gone for x in visitors)
        if late < 0.0:
            break
    off = 1000.0 * math.hypot(x, y), math.degrees(abs(turned))
    figures = touched, bench < 0.0, near, driven, away, *off
    return dict(zip(FIGURES, figures, strict=True))


FIGURES = "touched", "bench", "distance_m", "driven_m", "away_s", "off_mm", "off_deg"
"""Of a visit: who moved at the first contact; whether the bench is touched; least
distance, m; way, m; time away from the station, s; final error, mm and degrees."""


def visit(job: tuple[str, str, int]) -> Row:
    """Return the figures of a method, kind and seed."""
    method, kind, seed = job
    return drive([Visitor(kind, seed)], method, seed)


def summary(rows: Sequence[Row], still: Sequence[Row]) -> Row:
    """Return the figures of a method and kind, given those of a robot at rest.

    ``free`` are people who do not touch a robot at rest, ``clear`` those who keep the
    greatest r_min from it; ``off`` are visits after which the robot is not back.
    """
    pairs, least = list(zip(rows, still, strict=True)), SETTINGS.radius.r_min(math.inf)
    free = [a["driven_m"] for a, b in pairs if not b["touched"]]
    clear = [a["driven_m"] for a, b in pairs if b["distance_m"] > least]
    return {
        "visits": len(rows),
        "by_robot": sum(x["touched"] == "robot" for x in rows),
        "by_person": sum(x["touched"] == "person" for x in rows),
        "bench": sum(x["bench"] for x in rows),
        "distance_m": round(float(np.mean([x["distance_m"] for x in rows])), 3),
        "free": len(free),
        "driven_free_m": round(sum(free), 2),
        "clear": len(clear),
        "driven_clear_m": round(sum(clear), 2),
        "driven_m": round(sum(x["driven_m"] for x in rows), 2),
        "away_s": round(sum(x["away_s"] for x in rows), 1),
        "off": sum(x["off_mm"] > 20.0 or x["off_deg"] > 2.0 for x in rows),
        "off_mm": round(max(x["off_mm"] for x in rows), 1),
        "off_deg": round(max(x["off_deg"] for x in rows), 2),
    }


def study(options: argparse.Namespace) -> list[Row]:
    """Return a row per method and kind."""
    rows, visits, methods = [], options.visits, options.methods
    with ProcessPoolExecutor(options.workers) as pool:
        for kind in options.kinds:
            found = {}
            for x in (*methods, "nothing"):
                found[x] = list(pool.map(visit, [(x, kind, k) for k in range(visits)]))
            for method in methods:
                row = summary(found[method], found["nothing"])
                rows.append({"method": method, "kind": kind, **row})
                touched = [k for k, x in enumerate(found[method]) if x["touched"]]
                print(*rows[-1].values(), touched[:9], flush=True)
    return rows


def totals(rows: Sequence[Row], key: str) -> dict[str, Row]:
    """Return the figures of all kinds by method, or of all methods by kind."""
    found: dict[str, Row] = {}
    for name in dict.fromkeys(row[key] for row in rows):
        part = [row for row in rows if row[key] == name]
        sums = {x: sum(float(row[x]) for row in part) for x in list(part[0])[2:]}
        sums["distance_m"] /= len(part)
        most = {x: max(float(row[x]) for row in part) for x in ("off_mm", "off_deg")}
        found[name] = sums | most
    return found


def table(rows: Sequence[Row], key: str) -> list[str]:
    """Return the lines of a table of Markdown, a line per method or kind."""
    lines = []
    for name, x in totals(rows, key).items():
        ways = [x["driven_free_m"] / max(x["free"], 1.0)]
        ways += [x["driven_clear_m"] / max(x["clear"], 1.0), x["away_s"] / x["visits"]]
        cells = [f"{x['by_robot']:.0f} + {x['by_person']:.0f}", f"{x['bench']:.0f}"]
        cells += [f"{x['distance_m']:.2f}", *(f"{way:.2f}" for way in ways)]
        cells += [f"{x['off']:.0f}", f"{x['off_mm']:.0f} mm, {x['off_deg']:.1f}°"]
        lines.append(f"| {name} | {x['visits']:.0f} | {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--visits", type=int, default=30, help="of each kind")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--methods", nargs="*", default=METHODS)
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    found = study(options)
    write_csv(options.out, found)
    print(*table(found, "method"), sep="\n")
