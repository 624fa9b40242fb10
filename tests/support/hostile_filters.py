"""Filters of every kind, what they are asked, and what Python answers."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from qpavoid import AvoidanceSettings, InvalidInputError, Repulsion, Robot, SafetyFilter
from qpavoid.avoidance.decision import INVALID
from qpavoid.avoidance.inputs import as_driven
from qpavoid.export.write import Capacity
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import braking_twist
from reliability.calls import CAREFUL, LATE
from shapes import FORKS
from timing.exported import ANSWER, COUNTED, problem_type
from timing.recorded import drive

LIMITED = replace(
    Robot.jackal(),
    limits=replace(
        Robot.jackal().limits,
        acceleration=2.0,
        angular_acceleration=5.0,
        wheel_speed=1.8,
        track=0.4,
    ),
)
PRINTED = AvoidanceSettings(
    bound="repulsion", repulsion=Repulsion(activation="smooth"), braking_room=False
)
FILTERS = {
    "ahead": (Robot.mir100(), AvoidanceSettings(), True, 800),
    "ahead-limited": (LIMITED, CAREFUL, True, 800),
    "ahead-late": (LIMITED, LATE, True, 600),
    "ahead-parts": (replace(LIMITED, footprint=FORKS), CAREFUL, True, 400),
    "late": (LIMITED, LATE, False, 600),
    "present": (Robot.mir100(), AvoidanceSettings(), False, 1500),
    "limited": (LIMITED, CAREFUL, False, 1500),
    "repulsion": (Robot.mir100_rectangle(), PRINTED, False, 1000),
    "unguarded": (
        Robot.mir100(),
        AvoidanceSettings(braking_room=False, reach=2.0),
        False,
        600,
    ),
}
"""Robot, settings, look-ahead, and how many hostile problems."""

LOOPS = 400
"""Steps of closed loops before them."""


@cache
def closed_loops(count):
    """Return what a filter is asked in loops, each with its memory."""
    problems = np.zeros(count, problem_type(CAPACITY))
    moments = drive(SafetyFilter(Robot.mir100(), ahead=False), np.random.default_rng(3))
    for p, moment in zip(problems, moments, strict=False):
        seen = p["obstacles"]
        seen["n_discs"] = len(moment.seen.discs)
        seen["discs"], seen["disc_velocities"] = (
            moment.seen.discs,
            moment.seen.disc_velocities,
        )
        p["v"], p["omega"], p["anew"] = moment.v, moment.omega, moment.step == 0
    return problems


def in_python(robot, settings, ahead, problems, footprints=()):
    """Return what the package answers; where it raises, C brakes.

    Footprints, by the problem before which they are set, replace that of the robot.
    """
    safety = SafetyFilter(robot, settings, ahead=ahead)
    answers = np.zeros(len(problems), ANSWER)
    last, driven = (0.0, 0.0), None
    for i, p in enumerate(problems):
        seen = p["obstacles"]
        n = {k: int(seen[f"n_{k}"]) for k in COUNTED}
        if p["anew"]:
            last = as_driven((p["last_v"], p["last_omega"]), robot.limit_vector)
            driven = None
            safety.reset(*last)
        if i in footprints:
            safety.footprint = footprints[i]
        try:
            if not all(0 <= k <= getattr(CAPACITY, name) for name, k in n.items()):
                raise InvalidInputError("too many")
            decision = safety.filter(
                float(p["v"]),
                float(p["omega"]),
                Obstacles(
                    seen["points"][: n["points"]],
                    seen["discs"][: n["discs"]],
                    seen["disc_velocities"][: n["discs"]],
                    seen["walls"][: n["walls"]],
                    *polygons_of(seen),
                ),
                age=float(seen["age"]),
                driven=driven,
            )
        except InvalidInputError:
            last = driven = braking_twist(robot.limit_vector, *last, settings.dt)
            answers[i] = *driven, INVALID, math.inf, 0.0, 0.0, 0.0, (-1, -1), 0.0
            continue
        last, driven = decision[:2], None
        numbers = decision.clearance, decision.slack, decision.residual
        active = (*decision.active, -1, -1)[:2]
        said = decision.status.number, *numbers, decision.shortfall, active
        answers[i] = *last, *said, 0.0
    return answers


def problems_of(name):
    robot, _, _, count = FILTERS[name]
    known = hostile(np.random.default_rng(len(name)), count, robot)
    return np.concatenate([closed_loops(LOOPS), known])


CAPACITY = Capacity(discs=8, points=5, walls=3, polygons=3, corners=14)
KINDS = 14


def hostile(rng, count, robot):
    """Return problems of every kind that went wrong somewhere, in random order."""
    problems = np.zeros(count, problem_type(CAPACITY))
    corners = robot.footprint.vertices
    for i, p in enumerate(problems):
        seen, size = p["obstacles"], rng.choice([0.7, 1.5, 4.0])
        for name in ("points", "discs", "walls"):
            seen[name] = rng.uniform(-size, size, seen[name].shape)
            seen[f"n_{name}"] = rng.integers(0, getattr(CAPACITY, name) + 1)
        seen["discs"][:, 2] = rng.uniform(0.0, 0.5, CAPACITY.discs)
        moving = rng.random((CAPACITY.discs, 1)) < 0.6
        seen["disc_velocities"] = moving * rng.uniform(-1, 1, (CAPACITY.discs, 2))
        some_polygons(rng, seen, size)
        seen["age"] = rng.choice([0.0, 0.1])
        p["v"], p["omega"], p["last_v"], p["last_omega"] = rng.uniform(-1.5, 1.5, 4)
        p["anew"] = i == 0 or rng.random() < 0.2
        spoil(rng, p, seen, corners, i % KINDS)
    return problems


def some_polygons(rng, seen, size):
    """Put polygons round the robot, moving, turning, and on top of it."""
    count, first = rng.integers(0, CAPACITY.polygons + 1), 0
    seen["n_polygons"] = count
    for i in range(count):
        n = int(rng.integers(3, 5))
        angles = (np.arange(n) + rng.uniform(0, 0.8, n)) * 2 * math.pi / n
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        corners = rng.uniform(-size, size, 2) + rng.uniform(0.05, 1) * circle
        seen["corners"][first : first + n] = corners
        motion = rng.uniform(-1, 1, 3) * rng.choice([0, 1], 3)
        seen["polygons"][i] = n, *motion
        first += n


def polygons_of(seen):
    """Return the polygons of a problem, and their motions."""
    corners, chosen = seen["corners"], seen["polygons"][: seen["n_polygons"]]
    if not ((chosen[:, 0] >= 3) & (chosen[:, 0] <= CAPACITY.corners)).all():
        raise InvalidInputError("no polygons")
    ends = np.cumsum(chosen[:, 0]).astype(int)
    if ends.max(initial=0) > CAPACITY.corners:
        raise InvalidInputError("too many corners")
    return np.split(corners[: ends.max(initial=0)], ends)[:-1], chosen[:, 1:]


def spoil(rng, p, seen, corners, kind):
    """Make one problem degenerate, infeasible or invalid."""
    if kind == 0:  # obstacles at a corner, also at distance 0
        seen["points"][:5] = corners[rng.integers(len(corners))] * rng.choice(
            [1, 1.001]
        )
        seen["n_points"] = 5
    elif kind == 1:  # duplicates
        seen["discs"][1:3], seen["n_discs"] = seen["discs"][0], CAPACITY.discs
    elif kind == 2:  # abeam of the axle: no twist moves away
        half = corners[:, 1].max()
        seen["points"][:2] = (0.0, half + 0.1), (0.0, -half - 0.1)
        seen["n_points"], seen["n_discs"], seen["n_walls"] = 2, 0, 0
    elif kind == 3:  # inside the footprint
        seen["points"][0], seen["n_points"] = rng.uniform(-0.1, 0.1, 2), 1
    elif kind == 4:  # walls of no length, and through the robot
        seen["walls"][0, 2:], seen["n_walls"] = seen["walls"][0, :2], 3
        seen["walls"][1] = -2.0, 0.1, 2.0, 0.1
    elif kind == 5:  # surrounded
        radius = np.hypot(*seen["discs"][:, :2].T)
        seen["discs"][:, :2] *= (1.05 / radius)[:, None]
        seen["n_discs"] = CAPACITY.discs
    elif kind == 6:  # nothing there
        seen["n_points"] = seen["n_discs"] = seen["n_walls"] = seen["n_polygons"] = 0
    elif kind == 7:
        p["v"] = rng.choice([math.nan, math.inf, 1e300])
    elif kind == 8:
        seen["discs"][0, 2], seen["n_discs"] = rng.choice([-1e-9, math.nan, 1e101]), 3
    elif kind == 9:
        name = rng.choice(["points", "discs", "walls", "polygons"])
        seen[f"n_{name}"] = rng.choice([-1, getattr(CAPACITY, name) + 1])
    elif kind == 10:
        seen["age"] = rng.choice([-1e-9, math.nan, math.inf, 1e155, 1e6, 0.5])
    elif kind == 11:  # no polygon: dented, not finite, of two or too many corners
        seen["n_polygons"], seen["polygons"][0, 0] = 1, 4
        seen["corners"][:4] = (2, 0), (3, 0), (2.1, 0.1), (2, 1)
        how = rng.integers(4)
        if how == 1:
            seen["corners"][2] = rng.choice([math.nan, math.inf, 1e200]), 1
        elif how > 1:
            seen["polygons"][0, 0] = rng.choice([2, 99, -1e30, math.nan])
    elif kind == 12:  # a polygon round everything
        seen["n_polygons"], seen["polygons"][0] = 1, (4, 0.1, 0.2, 0.3)
        seen["corners"][:4] = (-3, -3), (3, -3), (3, 2), (-3, 2.5)
