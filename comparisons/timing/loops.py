"""Closed loops from which problems are recorded: one robot among moving discs."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array

DT = 0.05
"""s, control step."""

STEPS = 100
"""Control steps after which a loop ends, if it does not end at a contact."""

ARENA = 4.0
"""m; a disc that is farther away in x or y comes back on the other side."""

BEAMS = 720
"""Of the scan that drives the robot; other scans start from as many."""


@dataclass(frozen=True, eq=False)
class Moment:
    """Arguments of the filter at one control step.

    Attributes:
        v: Desired forward speed, m/s.
        omega: Desired yaw rate, rad/s.
        seen: The discs with their velocities, robot frame.
        step: Number of the control step in its loop.
    """

    v: float
    omega: float
    seen: Obstacles
    step: int


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs that move straight on, and stay near the robot; world frame.

    Attributes:
        discs: (M, 3) x, y, radius, m.
        velocities: (M, 2) m/s.
    """

    discs: Array
    velocities: Array

    @classmethod
    def random(cls, rng: np.random.Generator, number: int = 8) -> "Discs":
        """Return discs of 0.15 to 0.5 m radius at up to 0.8 m/s round the origin."""
        bearing, course = rng.uniform(0.0, 2 * math.pi, (2, number))
        distance = rng.uniform(2.0, ARENA, number)
        speed = rng.uniform(0.0, 0.8, number)
        radius = rng.uniform(0.15, 0.5, number)
        x, y = distance * np.cos(bearing), distance * np.sin(bearing)
        velocities = np.column_stack([speed * np.cos(course), speed * np.sin(course)])
        return cls(np.column_stack([x, y, radius]), velocities)

    def after(self, dt: float, pose: tuple[float, float, float]) -> "Discs":
        """Return the discs ``dt`` s later, within the arena round a robot's pose."""
        moved = self.discs.copy()
        moved[:, :2] += self.velocities * dt - pose[:2]
        moved[:, :2] = (moved[:, :2] + ARENA) % (2 * ARENA) - ARENA + pose[:2]
        return Discs(moved, self.velocities)

    def seen_from(self, pose: tuple[float, float, float]) -> Obstacles:
        """Return the discs in the frame of a robot at the pose."""
        here = Obstacles(discs=self.discs, disc_velocities=self.velocities)
        return here.seen_from(pose)


def drive(safety: SafetyFilter, rng: np.random.Generator) -> Iterator[Moment]:
    """Drive the filter's robot towards goals among discs, loop after loop, for ever.

    What it drives is the filter's own answer to a scan of the discs. The moments of one
    loop follow each other; a new loop starts after :data:`STEPS` or at a contact.
    """
    while True:
        pose, discs = (0.0, 0.0, 0.0), Discs.random(rng)
        goal = rng.uniform(-ARENA, ARENA, 2)
        for step in range(STEPS):
            seen = discs.seen_from(pose)
            v, omega = _towards(goal, pose)
            yield Moment(v, omega, seen, step)
            echoes, velocities = scan(seen, BEAMS)
            decision = safety.filter(
                v, omega, Obstacles(discs=echoes, disc_velocities=velocities)
            )
            if decision.clearance < 0.0:
                break
            pose = arc(*pose, decision.v, decision.omega, DT)
            discs = discs.after(DT, pose)


def _towards(goal: Array, pose: tuple[float, float, float]) -> tuple[float, float]:
    """Return a desired twist, m/s and rad/s: turn to the goal, and drive past it."""
    bearing = math.atan2(goal[1] - pose[1], goal[0] - pose[0])
    error = wrap_angle(bearing - pose[2])
    return 0.8 * max(math.cos(error), 0.0), min(max(2.0 * error, -1.2), 1.2)


def scan(seen: Obstacles, beams: int) -> tuple[Array, Array]:
    """Return the echoes of evenly spaced beams from the robot's origin.

    Args:
        seen: Discs, robot frame; one that covers the origin gives no echo.
        beams: Their number; with a multiple of 4, two are exactly abeam of the axle.

    Returns:
        (n, 3) the nearest echo of each beam that has one, as a disc of radius 0, m, in
        the order of the bearing; (n, 2) the velocity of its disc, m/s.
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
    echoes = np.column_stack([points, np.zeros(len(points))])
    return echoes, seen.disc_velocities[disc[echo]]
