"""Lanes: ways beside a robot that stands, and how to get into the nearest of them.

A *lane* is a way beside the robot along a heading: for :data:`ON` circumradii of the
footprint it keeps :data:`SPARE` more than r_min from everything at hand. To get there
the robot backs up as little as it must, turns on the spot, drives straight on and turns
back. All of this is looked at before by conservative advancement [Mirtich1996] along
its arcs; what moves counts as where it is. Of all lanes the nearest is taken, of two as
near that on the right.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled_once, entry, entry_if
from qpavoid.model.capsules import are_as_many, in_robot_frame
from qpavoid.model.contacts import contact_at, contact_table, most_contacts
from qpavoid.model.kinematics import TINY, arc
from qpavoid.types import Arrays, ArraysWritten, ContactRowsWritten, Edges, Pair, Pose

SPARE, FINE, NEARER = 0.02, 0.02, 1e-4
"""m beyond r_min; between two looks along a way, at least; that a way may come nearer
than it begins."""

ON, BARRED_WITHIN, FARTHEST, APART = 2.0, 0.1, 2.0, 0.1
"""Circumradii that a lane leads on; m that bar the straight way; how far aside the
farthest lane is, and the next one."""

LANE_PITCH, EQUAL = 1e-3, 1e-6
"""m to which the nearest lane is known; that make no difference between two."""

ANGLES = tuple(math.radians(a) for a in (-30, 30, -50, 50, -70, 70, -90, 90))
"""Ways into a lane; of two as near the first one, on the right."""

HERE = (0.0, 0.0, 0.0)
"""Where the robot is."""


class LaneSearch(NamedTuple):
    """What is driven, among what.

    Attributes:
        edges: Of the footprint.
        obstacles: Robot frame.
        seen: The same from a pose: memory.
        contacts: Memory.
        radius: Circumradius, m.
        keep: Distance to keep, m.
        v: m/s.
        turn: rad/s.
        reverse: m/s of backing up.
        ahead: How far lanes lead at least, from the robot along their heading, m.
    """

    edges: Edges
    obstacles: Arrays
    seen: ArraysWritten
    contacts: ContactRowsWritten
    radius: float
    keep: float
    v: float
    turn: float
    reverse: float
    ahead: float


class Lane(NamedTuple):
    """A way into a lane.

    Attributes:
        aside: How far the lane is from the robot, m; ``inf``: there is none.
        angle: Of the way there from the lane, rad.
        far: How long that is, m.
        back: How far to back up before, m.
    """

    aside: float
    angle: float
    far: float
    back: float


NO_LANE = Lane(math.inf, 0.0, 0.0, 0.0)


@entry
@compiled_once
def has_lane_room(search: LaneSearch) -> bool:
    """Return whether all that is seen, and each contact with it, has a row."""
    most = most_contacts(search.edges, search.obstacles)
    same = are_as_many(search.obstacles, search.seen)
    return same and search.contacts.shape[0] >= most


@entry_if(has_lane_room)
@compiled_once
def nearest(search: LaneSearch, pose: Pose) -> Pair:
    """Return the room of a pose, m, and the speed of what is nearest, m/s."""
    in_robot_frame(pose, 0.0, search.obstacles, search.seen)
    contacts = search.contacts
    edges, radius = search.edges, search.radius
    _, row = contact_table(edges, radius, search.seen, 0.0, contacts)
    if row < 0:
        return math.inf, 0.0
    c = contact_at(contacts, row)
    return c.distance - search.keep, math.sqrt(c.v_x * c.v_x + c.v_y * c.v_y)


@entry_if(has_lane_room)
@compiled_once
def free_share(search: LaneSearch, pose: Pose, twist: Pair, time: float) -> float:
    """Return the share of a time for which a twist may be held from a pose.

    It may come as near as :data:`SPARE`, or as it is at first.
    """
    (x, y, heading), (v, omega) = pose, twist
    room, _ = nearest(search, pose)
    level, now = min(SPARE, room - NEARER), 0.0
    # No room shrinks faster [Mirtich1996]; FINE, or looks at the level itself would
    # stand still.
    fastest = abs(v) + abs(omega) * search.radius
    while now < time:
        before = now
        now = min(now + max(room - level, FINE) / fastest, time)
        room, _ = nearest(search, arc(x, y, heading, v, omega, now))
        if room < level:
            return before / time
    return 1.0


@compiled_once
def can_turn(search: LaneSearch, pose: Pose, heading: float) -> bool:
    """Return whether the robot can turn to a heading at a pose."""
    angle = heading - pose[2]
    if search.turn == 0.0:
        return angle == 0.0
    time, omega = abs(angle) / search.turn, math.copysign(search.turn, angle)
    return free_share(search, pose, (0.0, omega), time) == 1.0


@entry_if(has_lane_room)
@compiled_once
def leads_on(search: LaneSearch, pose: Pose, heading: float) -> bool:
    """Return whether the robot can turn to a heading at a pose, and drive on."""
    (x, y, _), v = pose, search.v
    there = (x, y, heading)
    if nearest(search, there)[0] < SPARE or not can_turn(search, pose, heading):
        return False
    come = math.copysign(1.0, v) * (x * math.cos(heading) + y * math.sin(heading))
    time = max(search.ahead - come, search.radius) / abs(v)
    return free_share(search, there, (v, 0.0), time) == 1.0


@compiled_once
def nearest_lane(search: LaneSearch, pose: Pose, heading: float, angle: float) -> float:
    """Return how far aside the nearest lane along a heading is, m; ``inf``: none.

    That is how far the robot drives at an angle to it until it :func:`leads_on`.
    """
    (x, y, _), v, toward = pose, search.v, heading + angle
    if not can_turn(search, pose, toward):
        return math.inf
    time = 1.0 / (abs(v) * math.sin(abs(angle)))
    far = FARTHEST * free_share(search, (x, y, toward), (v, 0.0), FARTHEST * time)
    aside, step, found = 0.0, APART, math.inf
    # In steps of APART to the first lane, then halved back to where it begins.
    while step > LANE_PITCH and aside + step <= far:
        at = arc(x, y, toward, v, 0.0, (aside + step) * time)
        if leads_on(search, at, heading):
            found, step = aside + step, 0.5 * step
        else:
            aside += step
    return found


@entry_if(has_lane_room)
@compiled_once
def best_lane(search: LaneSearch, heading: float, back: float) -> Lane:
    """Return the nearest lane after backing up so far, m; the right of two as near."""
    best, v, time = NO_LANE, search.reverse, 0.0
    if back > 0.0:
        time = back / max(abs(v), TINY)
        if v == 0.0 or free_share(search, HERE, (v, 0.0), time) < 1.0:
            return NO_LANE
    pose = arc(0.0, 0.0, 0.0, v, 0.0, time)
    for angle in ANGLES:
        aside = nearest_lane(search, pose, heading, angle)
        if aside < best.aside - EQUAL:
            best = Lane(aside, angle, aside / math.sin(abs(angle)), back)
    return best
