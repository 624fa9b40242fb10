"""How long a twist can be driven on among obstacles that stay where they are now."""

import math

from qpavoid.avoidance.decision import Status
from qpavoid.compiled import compiled_once
from qpavoid.lab.baselines.drive import Answer, Twist
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import RADIUS, Arrays, capsule_at, has_length
from qpavoid.model.robot import Robot, braking_twist, limits_of

ROUNDING = 1e-9
"""m; less is no difference."""

FINEST = 2e-3
"""m; the greatest way of a footprint point between two looks at an obstacle."""


@compiled_once
def time_to_meet(
    edges: Array,
    x1: float,
    y1: float,
    x2: float,
    y2: float,
    wanted: float,
    v: float,
    omega: float,
    speed: float,
    end: float,
) -> float:
    """Return how long (v, ω) keeps ``wanted`` (m) to one obstacle, at most ``end`` s.

    Where it is nearer already: how long it comes no nearer. No footprint point is
    faster than ``speed`` (m/s), so that the next look waits until it could be too near.
    """
    time, before = 0.0, 0.0
    while True:
        x, y, heading = arc(0.0, 0.0, 0.0, v, omega, time)
        cos, sin = math.cos(heading), math.sin(heading)
        q_x, q_y = cos * (x1 - x) + sin * (y1 - y), cos * (y1 - y) - sin * (x1 - x)
        if x1 == x2 and y1 == y2:
            distance = point_contact(edges, q_x, q_y).distance
        else:
            e_x, e_y = cos * (x2 - x) + sin * (y2 - y), cos * (y2 - y) - sin * (x2 - x)
            distance = wall_contact(edges, q_x, q_y, e_x, e_y).distance
        if time == 0.0:
            wanted = min(wanted, distance - ROUNDING)
        room = distance - wanted
        if room < 0.0:
            return before
        if time >= end or room >= speed * (end - time):
            return end
        before = time
        time = min(end, time + max(room, FINEST) / speed)


@compiled_once
def free_time(
    edges: Array,
    robot: Array,
    obstacles: Arrays,
    margin: float,
    v: float,
    omega: float,
    horizon: float,
) -> float:
    """Return how long (v, ω) keeps ``margin`` (m) to everything, at most the horizon.

    All are taken to stand where they are, whatever their velocities; s.
    """
    limits = limits_of(robot)
    points, capsules = obstacles
    speed, end = abs(v) + abs(omega) * limits.circumradius, horizon
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        if x * x + y * y < (limits.circumradius + margin + speed * end) ** 2:
            end = time_to_meet(edges, x, y, x, y, margin, v, omega, speed, end)
    for i in range(capsules.shape[0]):
        x, y, x2, y2 = capsule_at(capsules, i, 0.0)
        wanted = margin + capsules[i, RADIUS]
        near = x * x + y * y < (limits.circumradius + wanted + speed * end) ** 2
        if near or has_length(capsules, i):
            end = time_to_meet(edges, x, y, x2, y2, wanted, v, omega, speed, end)
    return end


def brake(robot: Robot, driven: Twist, dt: float) -> Answer:
    """Return full braking along the arc of the twist driven last, or holding still."""
    if not any(driven):
        return Answer((0.0, 0.0), Status.HOLDING)
    return Answer(braking_twist(robot.numbers, *driven, dt), Status.BRAKING)
