"""Robots, things that stand in their way, and a user who holds the stick."""

import math
from typing import NamedTuple

import numpy as np

import qpavoid as qp
from driven import driven_to, least_in_all, lines_of_world

DT, R_MIN = 0.05, 0.17
SETTINGS = qp.AvoidanceSettings(dt=DT)
FORWARD = 0.5, 0.0

ROBOTS = {
    "mir": qp.Robot.mir100(),
    "jackal": qp.Robot.jackal(),
    "long": qp.Robot(
        "long", qp.Footprint.rectangle(1.4, 0.5), qp.Limits.symmetric(1.0, 1.5)
    ),
    "slow to turn": qp.Robot(
        "slow to turn",
        qp.Footprint.pentagon(0.8, 0.5, 0.7),
        qp.Limits(-0.3, 1.2, -1.0, 1.0, 1.5, 2.0, wheel_speed=1.2, track=0.4),
    ),
    "never back": qp.Robot(
        "never back", qp.Footprint.pentagon(0.6, 0.4, 0.8), qp.Limits(0.0, 1, -1, 1)
    ),
}


def round_points(x, y, radius, count=24):
    """Points of a scan all round a post."""
    angle = 2.0 * math.pi * np.arange(count) / count
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


def line_points(x1, y1, x2, y2, spacing=0.05):
    """Points of a scan along a wall."""
    count = round(math.dist((x1, y1), (x2, y2)) / spacing) + 1
    return np.linspace((x1, y1), (x2, y2), count)


def box(x, y, half):
    """The corners of a square."""
    sides = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return [(x + half * a, y + half * b) for a, b in sides]


THINGS = {
    "post": qp.Obstacles(discs=[(2.0, 0.0, 0.15)]),
    "post on the left": qp.Obstacles(discs=[(2.0, 0.05, 0.15)]),
    "post on the right": qp.Obstacles(discs=[(2.0, -0.05, 0.15)]),
    "person": qp.Obstacles(discs=[(2.2, 0.1, 0.3)]),
    "box": qp.Obstacles(polygons=[box(2.2, 0.0, 0.25)]),
    "end of a wall": qp.Obstacles(walls=[(2.0, -1.0, 2.0, 0.0)]),
    "post of points": qp.Obstacles(round_points(2.0, 0.0, 0.15)),
    "wall of points": qp.Obstacles(line_points(2.0, -1.0, 2.0, 0.0)),
}
ENDS = {
    "wall across": qp.Obstacles(walls=[(2.0, -10.0, 2.0, 10.0)]),
    "dead end": qp.Obstacles(
        walls=[(-3, -1.5, 2.5, -1.5), (2.5, -1.5, 2.5, 1.5), (2.5, 1.5, -3, 1.5)]
    ),
    "dead end of points": qp.Obstacles(
        np.vstack(
            [
                line_points(-3.0, -1.5, 2.5, -1.5),
                line_points(2.5, -1.5, 2.5, 1.5),
                line_points(2.5, 1.5, -3.0, 1.5),
            ]
        )
    ),
}


class Drive(NamedTuple):
    """A closed loop: (steps, 5) poses and the twists driven there, and decisions."""

    trace: np.ndarray
    decisions: list

    @property
    def y(self):
        return self.trace[-1, 1]

    @property
    def turns(self):
        """How often the robot turns the other way."""
        omega = self.trace[:, 4]
        side = np.sign(omega[np.abs(omega) > 0.05])
        return np.count_nonzero(np.diff(side))

    def least(self, robot, world):
        lines = lines_of_world(world)
        return least_in_all(robot.footprint.vertices, self.trace, DT, lines)

    def time_past(self, x):
        """When the robot is beyond x m ahead, s; ``inf``: never."""
        past = np.flatnonzero(self.trace[:, 0] > x)
        return DT * past[0] if len(past) else math.inf


def mirrored(world):
    """The same scene, left and right changed over; nothing of it moves."""
    return qp.Obstacles(
        world.points * (1, -1),
        world.discs * (1, -1, 1),
        walls=world.walls * (1, -1, 1, -1),
        polygons=[corners[::-1] * (1, -1) for corners in world.polygons],
    )


def drive(safety, world, seconds, wish=FORWARD, pose=(0.0, 0.0, 0.0)):
    """Hold a wish, or what a function of the time says, for some seconds."""
    trace, decisions = [], []
    for k in range(round(seconds / DT)):
        v, omega = wish(k * DT) if callable(wish) else wish
        decision = safety.filter(v, omega, world.moved(k * DT).seen_from(pose))
        trace.append([*pose, decision.v, decision.omega])
        decisions.append(decision)
        pose = driven_to(pose, decision.v, decision.omega, DT)
    return Drive(np.array(trace), decisions)
