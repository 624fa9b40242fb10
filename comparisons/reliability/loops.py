"""Closed loops with a fault, and their contacts.

``SafetyFilter.step`` drives a robot among static posts; the desired arcs ignore them.
One fault begins at a random time and lasts a random while. Within the premises a fault
shows in the stamps, or the robot brakes by itself; outside them the robot gets wrong
data. Old scans are brought to the robot's present pose by its odometry. The clearance
of the true pose is checked after every step and half step. Every other loop has a robot
that brakes slowly, does not know its driven twist, and keeps 5 cm.

    python comparisons/reliability/loops.py --count 10000
"""

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import shapely

import qpavoid as qp
from qpavoid.model.kinematics import integrate, to_world
from qpavoid.types import Array, Pose

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.page import add_row

DT, STEPS, RANGE = 0.02, 300, 6.0
QUICK, LAZY = (-0.5, 1.0, -1.5, 1.5, 2.0, 4.0), (0.0, 1.5, -1.5, 1.5, 0.8, 2.0)
"""Limits of the robots of even and odd loops."""

R_MIN = 0.17, 0.05
FRESH = qp.Freshness(points=0.1, odometry=0.1, good=0.1)
WITHIN = (
    "none",
    "scans drop",
    "scans freeze, stamps too",
    "scans come late, stamped",
    "scans double",
    "scans out of order",
    "blind, said",
    "no data",
    "NaN in a scan",
    "the loop raises",
    "the solver fails",
    "localisation jumps 0.5 m",
)
OUTSIDE = (
    "scans freeze, newly stamped",
    "scans come late, newly stamped",
    "blind, not said",
    "odometry drifts 20 %",
    "a wheel slips 30 %",
    "a step is missed",
)
FAULTS = (*WITHIN, *OUTSIDE)
"""Faults within the premises, and outside them."""

Scan: TypeAlias = tuple[float, Array]
"""Time of measurement, s, and points in the present robot frame."""


def failing(problem: Any) -> Array:
    """Raise, as a back end that fails."""
    raise RuntimeError("no licence")


class World:
    """Static posts and the true pose of the robot."""

    def __init__(self, rng: np.random.Generator, corners: Array) -> None:
        self.footprint = shapely.Polygon(corners)
        self.pose: Pose = 0.0, 0.0, 0.0
        places = rng.uniform(-5.0, 5.0, (40, 2))
        self.posts = qp.Obstacles(places[np.hypot(*places.T) > 1.2])

    def scan(self) -> Array:
        """Return the posts in range, robot frame."""
        return self.posts.seen_from(self.pose).within(RANGE).points

    def drive(self, v: float, omega: float) -> float:
        """Drive for a step; return the least clearance at its half and its end, m."""
        least = math.inf
        for _ in range(2):
            self.pose = integrate(self.pose, (v, omega), 0.0, 0.5 * DT)
            posts = shapely.points(self.scan())
            apart = shapely.distance(posts, self.footprint.exterior)
            apart = np.where(shapely.contains(self.footprint, posts), -apart, apart)
            least = min(least, float(apart.min(initial=math.inf)))
        return least


def brought(points: Array, before: Pose, now: Pose) -> Array:
    """Return points of one robot pose in the frame of another."""
    return qp.Obstacles(to_world(points, before)).seen_from(now).points


def given(
    fault: str, now: float, scans: list[Scan], rng: np.random.Generator
) -> tuple[Any, qp.Stamps]:
    """Return points and stamps of a step; ``scans``: all so far, with their times."""
    (stamp, points), late = scans[-1], scans[max(0, len(scans) - 1 - int(0.5 / DT))]
    valid = 1.0
    if fault == "scans drop":
        return late[1], qp.Stamps(now, odometry=now, steady=now)
    if fault == "scans freeze, stamps too":
        stamp, points = scans[0]
    elif fault == "scans freeze, newly stamped":
        points = scans[0][1]
    elif fault == "scans come late, stamped":
        stamp, points = late
    elif fault == "scans come late, newly stamped":
        points = late[1]
    elif fault == "scans double" and len(scans) > 1:
        stamp, points = scans[-1 - len(scans) % 2]
    elif fault == "scans out of order" and rng.random() < 0.5:
        stamp, points = scans[-min(3, len(scans))]
    elif fault == "blind, said":
        points, valid = np.empty((0, 2)), 0.1
    elif fault == "blind, not said":
        points = np.empty((0, 2))
    elif fault == "no data":
        return None, qp.Stamps(now, points=stamp, odometry=now, steady=now)
    elif fault == "NaN in a scan" and len(points):
        points = points.copy()
        points[rng.integers(len(points)), 0] = math.nan
    return points, qp.Stamps(now, points=stamp, odometry=now, valid=valid, steady=now)


def run(fault: str, seed: int) -> tuple[float, bool]:
    """Return the least clearance of a loop, m, and whether the robot moved then."""
    rng, lazy = np.random.default_rng(seed), seed % 2
    robot = replace(qp.Robot.mir100(), limits=qp.Limits(*(LAZY if lazy else QUICK)))
    radius = qp.SafetyRadius(R_MIN[lazy], R_MIN[lazy])
    safety = qp.SafetyFilter(robot, qp.AvoidanceSettings(radius), freshness=FRESH)
    world = World(rng, robot.footprint.vertices)
    began, lasts = int(rng.integers(50, 200)), int(rng.integers(5, 100))
    desired, scans, pose = (0.0, 0.0), list[tuple[float, Array, Pose]](), world.pose
    twist, least, touched = (0.0, 0.0), math.inf, False
    for step in range(STEPS):
        now = 100.0 + DT * step
        fails = fault if began <= step < began + lasts else "none"
        if step % 50 == 0:
            desired = (float(rng.uniform(0.2, 1.6)), float(rng.normal(0.0, 0.6)))
        if fails == "none":
            scans.clear()
        scans.append((now, world.scan(), pose))
        as_new = fails.endswith("newly stamped")
        seen = [(t, x if as_new else brought(x, old, pose)) for t, x, old in scans]
        points, stamps = given(fails, now, seen, rng)
        odometry = (0.8, 1.2) if fails == "odometry drifts 20 %" else (1.0, 1.0)
        driven = None if lazy else (odometry[0] * twist[0], odometry[1] * twist[1])
        wish = desired
        if fails == "localisation jumps 0.5 m":  # the wish jumps, what is seen does not
            wish = -desired[0], 3.0 * desired[1] + 1.0
        safety._engine.use(failing if fails == "the solver fails" else None)
        if fails == "the loop raises":
            decision = safety.brake("the planner is gone", driven=driven)
        elif not (fails == "a step is missed" and rng.random() < 0.3):
            decision = safety.step(*wish, points, stamps=stamps, driven=driven)
        twist = decision.v, decision.omega
        slips = fails == "a wheel slips 30 %"
        true = (0.85 * twist[0], twist[1] + 0.5 * twist[0]) if slips else twist
        clearance = world.drive(*true)
        measured = odometry[0] * twist[0], odometry[1] * twist[1]
        pose = integrate(pose, measured, 0.0, DT)
        moves = max(abs(true[0]), abs(true[1])) > 1e-3
        least, touched = min(least, clearance), touched or (clearance <= 0.0 and moves)
        if decision.status is qp.Status.INVALID and fails == "none" and step < began:
            raise RuntimeError(f"{fault}, {seed}: {decision.problem}")
    return least, touched


def study(fault: str, count: int, first: int = 0) -> dict[str, Any]:
    """Return the row of a fault; the scenes are the same for all faults."""
    found = [run(fault, first + k) for k in range(count)]
    least = np.array([room for room, _ in found])
    keeps = np.array([R_MIN[(first + k) % 2] for k in range(count)])
    return {
        "fault": fault,
        "within the premises": "yes" if fault in WITHIN else "no",
        "loops": count,
        "contacts": sum(touched for _, touched in found),
        "below r_min": int((least < keeps - 1e-3).sum()),
        "least clearance m": round(float(least.min()), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="loops in all")
    parser.add_argument("--only", choices=FAULTS, help="one fault")
    options = parser.parse_args()
    each = math.ceil(options.count / len(FAULTS))
    for fault in [options.only] if options.only else FAULTS:
        row = study(fault, each)
        add_row("loops", row)
        print(row, flush=True)


if __name__ == "__main__":
    main()
