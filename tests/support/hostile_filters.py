"""Filters of every kind, what they are asked, and what Python answers."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from export_problems import CAPACITY, hostile, polygons_of
from qpavoid import (
    AvoidanceSettings,
    InvalidInputError,
    Repulsion,
    Robot,
    SafetyFilter,
)
from qpavoid.avoidance.decision import INVALID
from qpavoid.avoidance.inputs import as_driven
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


def in_python(robot, settings, ahead, problems):
    """Return what the package answers; where it raises, C brakes."""
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
