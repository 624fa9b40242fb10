"""The table of bodies: a moving segment a row, and the distance to keep from it."""

from typing import NamedTuple

from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import Contact, point_contact, wall_contact
from qpavoid.types import Array


class Body(NamedTuple):
    """A moving segment, and the distance to keep from it: r_min and the inflation.

    Attributes:
        x: Of the pivot, m.
        y: The same.
        x1: Of one end from the pivot, m.
        y1: The same.
        x2: Of the other end.
        y2: The same.
        v_x: Of the pivot, m/s.
        v_y: The same.
        turn: rad/s.
        keep: Distance to keep: radius, margins, r_min; m.
        inflation: What of it is not r_min, m.
        spread: Radius round the pivot that holds the line and what is kept, m.
        speed: Greatest of a point of it, m/s.
        growth: How fast the distance to keep grows, m/s.
        kind: :data:`STANDS`, :data:`MOVES` or :data:`CREEPS`.
        owner: Number of the obstacle.
        now: Room that there is now of what stands near, m, else ``inf``.
        group: Number of the group that begins with it; −1: none.
    """

    x: float
    y: float
    x1: float
    y1: float
    x2: float
    y2: float
    v_x: float
    v_y: float
    turn: float
    keep: float
    inflation: float
    spread: float
    speed: float
    growth: float
    kind: float
    owner: float
    now: float
    group: float


BODY = len(Body._fields)

KIND, OWNER, GROUP = map(Body._fields.index, ("kind", "owner", "group"))

STANDS, MOVES, CREEPS = 0.0, 1.0, 2.0
"""Kinds. What is slow creeps for a filter that does not look ahead: it stands, and
grows as fast as it moves, whatever its direction."""


@compiled
def body_at(scene: Scene, i: int) -> Body:
    """Return row i of the table, with what is wanted in this scene."""
    b = scene.bodies[i]
    keep, inflation, spread, kind, now = b[9], b[10], b[11], b[14], b[16]
    # Only r_min is waived, never the inflation: what may be wrong about an obstacle is
    # as wrong where it is tight.
    if kind != MOVES:
        waived = max(keep - inflation - scene.closest, 0.0)
        keep, spread, now = keep - waived, spread - waived, now + waived
    # fmt: off
    return Body(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], keep, inflation,
                spread, b[12], b[13], kind, b[15], now, b[17])


@compiled
def set_body(bodies: Array, i: int, body: Body) -> None:
    """Write row i of the table."""
    b = bodies[i]
    b[0], b[1], b[2], b[3] = body.x, body.y, body.x1, body.y1
    b[4], b[5], b[6], b[7] = body.x2, body.y2, body.v_x, body.v_y
    b[8], b[9], b[10], b[11] = body.turn, body.keep, body.inflation, body.spread
    b[12], b[13], b[14], b[15] = body.speed, body.growth, body.kind, body.owner
    b[16], b[17] = body.now, body.group


@compiled_once
def comes_first(bodies: Array, i: int, j: int) -> bool:
    """Return whether row i comes before row j by the first number that differs."""
    for column in range(OWNER):
        if bodies[i, column] != bodies[j, column]:
            return bool(bodies[i, column] < bodies[j, column])
    return False


@compiled_once
def sort_bodies(bodies: Array) -> None:
    """Sort the rows, so that the order in which obstacles are given decides nothing.

    Shell's method, in place.
    """
    # Not numpy's sort: it would allocate, and the C export has none.
    gap = count = bodies.shape[0]
    while gap > 1:
        gap = max(gap * 5 // 11, 1)
        for i in range(gap, count):
            j = i - gap
            while j >= 0 and comes_first(bodies, j + gap, j):
                for column in range(bodies.shape[1]):
                    kept = bodies[j, column]
                    bodies[j, column] = bodies[j + gap, column]
                    bodies[j + gap, column] = kept
                j -= gap


@compiled
def moves(scene: Scene, i: int) -> bool:
    """Return whether body i moves."""
    return bool(scene.bodies[i, KIND] == MOVES)


@compiled_once
def any_moves(scene: Scene) -> bool:
    """Return whether any body in reach moves."""
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i):
            return True
    return False


@compiled
def is_point(body: Body) -> bool:
    """Return whether a body has no length."""
    return body.spread == body.keep


@compiled_once
def line_contact_now(edges: Array, body: Body) -> Contact:
    """Return the contact of the footprint with the line of a body at present."""
    x, y = body.x, body.y
    if is_point(body):
        return point_contact(edges, x, y)
    wall = Segment(x + body.x1, y + body.y1, x + body.x2, y + body.y2)
    return wall_contact(edges, wall)
