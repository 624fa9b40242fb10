"""How near a robot comes to what is round it: at a pose, and on its way."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import wanted_distance
from qpavoid.compiled import compiled
from qpavoid.model.contacts import contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import glide
from qpavoid.model.obstacles import Arrays, in_robot_frame
from qpavoid.model.robot import limits_of

Motion: TypeAlias = tuple[float, float, float, float, float, float, float]
"""Pose x, y, γ (m, rad, world frame), v, ω and speed to the left (m/s, rad/s, m/s; the
last is 0 but for an omnidirectional base), and time (s)."""

FINEST = 0.01
"""m; between two looks so far apart at most 0.1 mm is missed of a clearance of 0.13 m:
half of it is the sagitta's chord, (0.005 m)²/(2 d)."""


@compiled
def greatest_pace(robot: Array, v: float, omega: float, fastest: float) -> float:
    """Return how fast a distance can shrink while (v, ω) is driven, m/s.

    ``fastest`` is the speed of the fastest obstacle point.
    """
    return float(abs(v) + abs(omega) * limits_of(robot).circumradius + fastest)


@compiled
def room_round(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    motion: Motion,
    world: Arrays,
    most: float,
    seen: Arrays,
    contacts: Array,
) -> tuple[float, float]:
    """Return the least distance, and the least distance less r_min(v_o), at a pose, m.

    Obstacles have moved since time 0. The second is exact where it is below ``most``.
    ``seen`` and ``contacts`` are memory for the obstacles in the robot frame.
    """
    x, y, heading, _, _, _, time = motion
    in_robot_frame(x, y, heading, time, world, seen)
    reach = most + settings[0].high
    n, _ = contact_table(edges, limits_of(robot).circumradius, seen, reach, contacts)
    least = room = math.inf
    for k in range(n):
        v_x, v_y = contacts[k, 5], contacts[k, 6]
        r_min, _ = wanted_distance(settings, math.sqrt(v_x * v_x + v_y * v_y), 0.0)
        least = min(least, contacts[k, 4])
        room = min(room, contacts[k, 4] - r_min)
    return least, room


@compiled
def room_on_the_way(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    motion: Motion,
    dt: float,
    pace: float,
    world: Arrays,
    most: float,
    seen: Arrays,
    contacts: Array,
) -> tuple[float, float]:
    """Return what :func:`room_round` does, the least along the arc of a control step.

    Looked at so often that nothing comes nearer by more than :data:`FINEST` in between
    at ``pace`` m/s; the last time at the end of the step.
    """
    x, y, heading, v, omega, lateral, time = motion
    least, looks = math.inf, max(1, math.ceil(pace * dt / FINEST))
    for k in range(1, looks + 1):
        part = dt * k / looks
        p_x, p_y, p_heading = glide(x, y, heading, v, omega, lateral, part)
        there = (p_x, p_y, p_heading, v, omega, lateral, time + part)
        distance, room = room_round(
            edges, robot, settings, there, world, most, seen, contacts
        )
        least, most = min(least, distance), min(most, room)
    return least, most
