"""Table of bodies: one moving segment per row, with its required distance."""

from typing import NamedTuple

from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import Contact, point_contact, wall_contact
from qpavoid.types import Array


class Body(NamedTuple):
    """A moving segment with its required distance: r_min and the inflation.

    Attributes:
        x: Of the pivot, m.
        y: Of the pivot, m.
        x1: Of one end from the pivot, m.
        y1: Of one end from the pivot, m.
        x2: Of the other end.
        y2: Of the other end.
        v_x: Of the pivot, m/s.
        v_y: Of the pivot, m/s.
        turn: rad/s.
        keep: Required distance: radius, inflation, r_min; m.
        inflation: Required distance minus r_min, m.
        spread: Radius about the pivot of segment and required distance, m.
        speed: Greatest of its points, m/s.
        growth: Rate of growth of the required distance, m/s.
        kind: :data:`STANDS`, :data:`MOVES` or :data:`CREEPS`.
        owner: Number of the obstacle.
        now: Present margin of a static body inside r_min, m, else ``inf``.
        group: Number of the group that begins with it, or −1.
        sigma: σ of the velocity of a moving body, m/s.
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
    sigma: float


BODY = len(Body._fields)

KIND, OWNER, GROUP = map(Body._fields.index, ("kind", "owner", "group"))

STANDS, MOVES, CREEPS = 0.0, 1.0, 2.0
"""Kinds: static, moving, and, without look-ahead, a slow obstacle modelled as static
and growing at its speed."""


@compiled
def body_at(scene: Scene, i: int) -> Body:
    """Return row i of the table."""
    b = scene.bodies[i]
    # fmt: off
    return Body(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10],
                b[11], b[12], b[13], b[14], b[15], b[16], b[17], b[18])
    # fmt: on


@compiled
def set_body(bodies: Array, i: int, body: Body) -> None:
    """Write row i of the table."""
    b = bodies[i]
    b[0], b[1], b[2], b[3] = body.x, body.y, body.x1, body.y1
    b[4], b[5], b[6], b[7] = body.x2, body.y2, body.v_x, body.v_y
    b[8], b[9], b[10], b[11] = body.turn, body.keep, body.inflation, body.spread
    b[12], b[13], b[14], b[15] = body.speed, body.growth, body.kind, body.owner
    b[16], b[17], b[18] = body.now, body.group, body.sigma


@compiled_once
def comes_first(bodies: Array, i: int, j: int) -> bool:
    """Return whether row i is before row j in lexicographic order."""
    for column in range(OWNER):
        if bodies[i, column] != bodies[j, column]:
            return bool(bodies[i, column] < bodies[j, column])
    return False


@compiled_once
def sort_bodies(bodies: Array) -> None:
    """Sort the rows by Shell's method, independent of the order of input."""
    # Not numpy's sort, which allocates and is not in the C export.
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
    """Return the present contact of the footprint with the segment of a body."""
    x, y = body.x, body.y
    if is_point(body):
        return point_contact(edges, x, y)
    wall = Segment(x + body.x1, y + body.y1, x + body.x2, y + body.y2)
    return wall_contact(edges, wall)
