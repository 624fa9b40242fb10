"""How near a robot comes to what is round it: at a pose, and on its way."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.rows import wanted_distance
from qpavoid.compiled import allocating, compiled
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Arrays, in_robot_frame

Memory: TypeAlias = tuple[Array, Array, Array, Array, Array]
"""Room for the obstacles in the robot frame, and for their contacts."""

Motion: TypeAlias = tuple[float, float, float, float, float, float]
"""Pose x, y, γ (m, rad, world frame), twist v, ω (m/s, rad/s), and time (s)."""


@allocating
def memory_for(edges: Array, world: Arrays) -> Memory:
    """Return the memory that looks at these obstacles need."""
    points, discs, disc_velocities, walls = world
    return (
        np.empty_like(points),
        np.empty_like(discs),
        np.empty_like(disc_velocities),
        np.empty_like(walls),
        np.empty((most_contacts(edges, world), 9)),
    )


@compiled
def room_round(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    motion: Motion,
    world: Arrays,
    most: float,
    memory: Memory,
) -> tuple[float, float]:
    """Return the least distance, and the least distance less r_min(v_o), at a pose, m.

    Discs have moved since time 0. The second is exact where it is below ``most``.
    """
    x, y, heading, _, _, time = motion
    seen, contacts = memory[:4], memory[4]
    in_robot_frame(x, y, heading, time, world, seen)
    reach = most + settings[0].high
    n, _ = contact_table(edges, robot[8], seen, reach, contacts)
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
    substeps: int,
    world: Arrays,
    most: float,
    memory: Memory,
) -> tuple[float, float]:
    """Return what :func:`room_round` does, the least along the arc of a control step.

    Looked at ``substeps`` evenly spaced times after the start, the last at its end.
    """
    x, y, heading, v, omega, time = motion
    least = math.inf
    for k in range(1, substeps + 1):
        part = dt * k / substeps
        p_x, p_y, p_heading = arc(x, y, heading, v, omega, part)
        there = (p_x, p_y, p_heading, v, omega, time + part)
        distance, room = room_round(edges, robot, settings, there, world, most, memory)
        least, most = min(least, distance), min(most, room)
    return least, most
