"""Closed loops from which problems are recorded: one robot among moving discs.

Run: python comparisons/timing/solvers.py
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Pose, Twist

DT, STEPS, NUMBER = 0.05, 100, 8
"""s, control step; steps after which a loop ends, if not at a contact; discs."""

ARENA = 4.0
"""m; a disc that is farther away in x or y comes back on the other side."""

BEAMS = 720
"""Of the scan that drives the robot; other scans start from as many."""


class Moment(NamedTuple):
    """Arguments of the filter at one control step."""

    v: float  # desired, m/s
    omega: float  # desired, rad/s
    seen: Obstacles  # discs with their velocities, robot frame
    step: int  # number of the control step in its loop


def random_discs(rng: np.random.Generator) -> Obstacles:
    """Return discs of 0.15 to 0.5 m radius at up to 0.8 m/s round the origin."""
    bearing, course = rng.uniform(0.0, 2 * math.pi, (2, NUMBER))
    distance = rng.uniform(2.0, ARENA, NUMBER)
    speed, radius = rng.uniform(0.0, 0.8, NUMBER), rng.uniform(0.15, 0.5, NUMBER)
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    velocities = np.column_stack([speed * np.cos(course), speed * np.sin(course)])
    return Obstacles(discs=np.column_stack([x, y, radius]), disc_velocities=velocities)


def moved(discs: Obstacles, pose: Pose) -> Obstacles:
    """Return the discs a control step later, within the arena round a pose."""
    places = discs.discs
    places[:, :2] += DT * discs.disc_velocities - pose[:2]
    places[:, :2] = (places[:, :2] + ARENA) % (2 * ARENA) - ARENA + pose[:2]
    return Obstacles(discs=places, disc_velocities=discs.disc_velocities)


def drive(safety: SafetyFilter, rng: np.random.Generator) -> Iterator[Moment]:
    """Drive the filter's robot towards goals among discs, loop after loop, for ever.

    What it drives is the filter's own answer to a scan of the discs. The moments of one
    loop follow each other; a new loop starts after :data:`STEPS` or at a contact.
    """
    while True:
        pose, discs = (0.0, 0.0, 0.0), random_discs(rng)
        goal = rng.uniform(-ARENA, ARENA, 2)
        for step in range(STEPS):
            seen = discs.seen_from(pose)
            v, omega = towards(goal, pose)
            yield Moment(v, omega, seen, step)
            decision = safety.filter(v, omega, scan(seen, BEAMS))
            if decision.clearance < 0.0:
                break
            pose = arc(*pose, decision.v, decision.omega, DT)
            discs = moved(discs, pose)


def towards(goal: Array, pose: Pose) -> Twist:
    """Return a desired twist, m/s and rad/s: turn to the goal, and drive past it."""
    bearing = math.atan2(goal[1] - pose[1], goal[0] - pose[0])
    error = wrap_angle(bearing - pose[2])
    return 0.8 * max(math.cos(error), 0.0), min(max(2.0 * error, -1.2), 1.2)


def scan(seen: Obstacles, beams: int) -> Obstacles:
    """Return the nearest echoes of evenly spaced beams from the robot's origin.

    They are discs of radius 0 in the order of the bearing, with the velocities of
    those seen. A disc that covers the origin gives no echo. With a multiple of 4
    beams, two are exactly abeam of the axle.
    """
    bearing = 2 * math.pi * np.arange(beams) / beams
    beam = np.column_stack([np.cos(bearing), np.sin(bearing)])
    along = beam @ seen.discs[:, :2].T
    tangent = (seen.discs[:, :2] ** 2).sum(axis=1) - seen.discs[:, 2] ** 2
    root = along**2 - tangent
    hit = (root >= 0.0) & (along > 0.0) & (tangent > 0.0)
    ranges = np.where(hit, along - np.sqrt(np.maximum(root, 0.0)), math.inf)
    disc, shortest = ranges.argmin(axis=1), ranges.min(axis=1)
    echo = shortest < math.inf
    points = beam[echo] * shortest[echo, None]
    return Obstacles(
        discs=np.insert(points, 2, 0.0, axis=1),
        disc_velocities=seen.disc_velocities[disc[echo]],
    )
