"""Least clearance of a robot along the arc of a control step."""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.cbf_rows import required_distance
from qpavoid.avoidance.settings import radius_curve, safety_radius
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.capsules import are_as_many, in_robot_frame
from qpavoid.model.contacts import CONTACT, CONTACT_SIZE, contact_table, most_contacts
from qpavoid.model.kinematics import integrate
from qpavoid.model.robot import limits_of
from qpavoid.types import Arrays, ArraysWritten, LimitVector, Pose, Twist, VectorWritten


class Motion(NamedTuple):
    """Motion of a robot from the origin.

    Attributes:
        twist: v (m/s), ω (rad/s).
        lateral: Speed to the left, m/s; 0 but for an omnidirectional base.
        pace: Upper bound of the rate of any distance, m/s.
    """

    twist: Twist
    lateral: float
    pace: float


class View(NamedTuple):
    """Obstacles, and memory for them in the robot frame.

    Attributes:
        world: Obstacles at the beginning, in the frame in which the robot begins.
        seen: Of their size.
        contacts: With room for all contacts.
    """

    world: Arrays
    seen: ArraysWritten
    contacts: VectorWritten


FINEST = 0.01
"""m; greatest motion between two samples. A clearance of 0.13 m is missed by at most
0.1 mm: half of it is the sagitta's chord, (0.005 m)²/(2 d)."""


@entry
@compiled
def greatest_pace(robot: LimitVector, v: float, omega: float, fastest: float) -> float:
    """Return the greatest rate at which a distance shrinks while (v, ω) is driven, m/s.

    ``fastest`` is the speed of the fastest obstacle point.
    """
    return float(abs(v) + abs(omega) * limits_of(robot).circumradius + fastest)


@entry
@compiled_once
def _has_room(setup: Setup, motion: Motion, view: View) -> bool:
    """Return whether all that is seen, and each contact with it, has a row."""
    most = most_contacts(setup.edges, view.world)
    fits = view.contacts.shape[0] >= most * CONTACT_SIZE
    return are_as_many(view.world, view.seen) and fits


@compiled
def room_round(
    setup: Setup, pose: Pose, time: float, view: View, most: float
) -> tuple[float, float]:
    """Return the least distance, and the least distance less r_min(v_o), at a pose, m.

    Obstacles have moved since time 0. The second is exact where it is below ``most``.
    """
    (edges, robot, settings), seen = setup, view.seen
    in_robot_frame(pose, time, view.world, seen)
    reach = most + safety_radius(math.inf, radius_curve(settings))
    radius, contacts = limits_of(robot).circumradius, view.contacts.view(CONTACT)
    n, _ = contact_table(edges, radius, seen, reach, view.contacts)
    least = room = math.inf
    for k in range(n):
        c = contacts[k]
        speed = math.sqrt(c.v_x * c.v_x + c.v_y * c.v_y)
        r_min, _ = required_distance(settings, speed, 0.0)
        least, room = min(least, c.distance), min(room, c.distance - r_min)
    return least, room


@entry_if(_has_room)
@compiled
def room_on_the_way(setup: Setup, motion: Motion, view: View) -> tuple[float, float]:
    """Return least distance and least distance less r_min along a control step, m.

    Sampled so often that nothing comes nearer by more than :data:`FINEST` in between;
    the last time at the end of the step.
    """
    dt, (twist, lateral, pace) = setup.settings[0].dt, motion
    least, most, looks = math.inf, math.inf, max(1, math.ceil(pace * dt / FINEST))
    for k in range(1, looks + 1):
        part = dt * k / looks
        pose = integrate((0.0, 0.0, 0.0), twist, lateral, part)
        # The least so far bounds what the next sample has to tell apart.
        distance, room = room_round(setup, pose, part, view, most)
        least, most = min(least, distance), min(most, room)
    return least, most
