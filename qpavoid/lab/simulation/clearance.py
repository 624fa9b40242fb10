"""Clearance of a robot: at a pose, and the least along a control step."""

import math
from typing import NamedTuple

from qpavoid.avoidance.barrier_rows import wanted_distance
from qpavoid.avoidance.scene import Setup
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.capsules import are_as_many, in_robot_frame
from qpavoid.model.contacts import contact_at, contact_table, most_contacts
from qpavoid.model.kinematics import integrate
from qpavoid.model.robot import limits_of
from qpavoid.types import (
    Arrays,
    ArraysWritten,
    ContactRowsWritten,
    LimitVector,
    Pose,
    Twist,
)


class Motion(NamedTuple):
    """A robot under way, world frame.

    Attributes:
        pose: m, m, rad.
        twist: v (m/s), ω (rad/s).
        lateral: Speed to the left, m/s; 0 but for an omnidirectional base.
        time: s.
        pace: m/s; no distance shrinks faster.
    """

    pose: Pose
    twist: Twist
    lateral: float
    time: float
    pace: float


class View(NamedTuple):
    """Obstacles, and memory for them in the robot frame.

    Attributes:
        world: Obstacles at time 0, world frame.
        seen: Of their size.
        contacts: With room for all contacts.
    """

    world: Arrays
    seen: ArraysWritten
    contacts: ContactRowsWritten


FINEST = 0.01
"""m; between two looks so far apart at most 0.1 mm is missed of a clearance of 0.13 m:
half of it is the sagitta's chord, (0.005 m)²/(2 d)."""


@entry
@compiled
def greatest_pace(robot: LimitVector, v: float, omega: float, fastest: float) -> float:
    """Return how fast a distance can shrink while (v, ω) is driven, m/s.

    ``fastest`` is the speed of the fastest obstacle point.
    """
    return float(abs(v) + abs(omega) * limits_of(robot).circumradius + fastest)


@compiled_once
def has_room(setup: Setup, view: View) -> bool:
    """Return whether all that is seen, and each contact with it, has a row."""
    most = most_contacts(setup.edges, view.world)
    return are_as_many(view.world, view.seen) and view.contacts.shape[0] >= most


@entry
@compiled_once
def _has_room_then(setup: Setup, motion: Motion, view: View) -> bool:
    """Return whether it :func:`has_room`."""
    return has_room(setup, view)


@entry_if(_has_room_then)
@compiled
def room_round(
    setup: Setup, motion: Motion, view: View, most: float
) -> tuple[float, float]:
    """Return the least distance, and the least distance less r_min(v_o), at a pose, m.

    Obstacles have moved since time 0. The second is exact where it is below ``most``.
    """
    (edges, robot, settings), seen, contacts = setup, view.seen, view.contacts
    in_robot_frame(motion.pose, motion.time, view.world, seen)
    reach = most + settings[0].r_min_fast
    n, _ = contact_table(edges, limits_of(robot).circumradius, seen, reach, contacts)
    least = room = math.inf
    for k in range(n):
        c = contact_at(contacts, k)
        speed = math.sqrt(c.v_x * c.v_x + c.v_y * c.v_y)
        r_min, _ = wanted_distance(settings, speed, 0.0)
        least, room = min(least, c.distance), min(room, c.distance - r_min)
    return least, room


@entry_if(_has_room_then)
@compiled
def room_on_the_way(
    setup: Setup, motion: Motion, view: View, most: float
) -> tuple[float, float]:
    """Return what :func:`room_round` does, the least along the arc of a control step.

    Looked at so often that nothing comes nearer by more than :data:`FINEST` in between;
    the last time at the end of the step.
    """
    dt, (start, twist, lateral, time, pace) = setup.settings[0].dt, motion
    least, looks = math.inf, max(1, math.ceil(pace * dt / FINEST))
    for k in range(1, looks + 1):
        part = dt * k / looks
        pose = integrate(start, twist, lateral, part)
        there = Motion(pose, twist, lateral, time + part, pace)
        # The least so far bounds what the next look has to tell apart.
        distance, room = room_round(setup, there, view, most)
        least, most = min(least, distance), min(most, room)
    return least, most
