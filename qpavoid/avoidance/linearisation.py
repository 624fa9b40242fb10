"""Linearisation: the rows of the distances at times to come, about a twist.

At a time t_k on the way of a twist ū the distance to a body changes with the twist as

    d_k(u) ≈ d_k(ū) + ∇d_k·(u − ū),   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

where P_r is the footprint point nearest then, and ∂P_r/∂u how the pose of that time
depends on the twist that is aimed at.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.body_table import Body, body_at, comes_first, moves
from qpavoid.avoidance.broad_phase import Meeting, Watch, next_body
from qpavoid.avoidance.motion import (
    circle_room,
    closing_speed,
    ends_at,
    line_contact,
    passing_speed,
)
from qpavoid.avoidance.prediction import (
    SAME_TIME,
    Arc,
    Rollout,
    Slopes,
    arc_at,
    arc_index,
    braking_place,
    frame_at,
    set_slopes,
    slopes_of,
)
from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.kinematics import TINY, Frame, moved_on
from qpavoid.qp.exact import A_OMEGA, A_V, OWNER, B
from qpavoid.types import Array, Pair

ROW_ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""

BARELY_TURNED = 1e-3
"""rad; below it the slopes of an arc are those of a straight line, to 1e-6 of them."""

ROW_WITHIN = 0.25
"""m beyond r_min; distances above get no row in this iteration."""

STRIDE, SECTORS = 4, 8
"""So many ticks, and directions of the normal, that may have a row of their own."""

DIAGONAL = math.tan(math.pi / 8.0)
"""Sectors are centred on axes and diagonals: flat sides lie in the middle of one."""


class Side(NamedTuple):
    """A contact at a time to come that gets a row.

    Attributes:
        x: P_r in the robot frame of that time, m.
        y: m.
        n_x: Outward normal of the footprint there, in the same frame.
        n_y: The same.
        room: m.
        time: s.
        body: Its number.
    """

    x: float
    y: float
    n_x: float
    n_y: float
    room: float
    time: float
    body: float


SIDE, ROOM_OF = len(Side._fields), Side._fields.index("room")


class Tables(NamedTuple):
    """Memory of the look-ahead.

    Attributes:
        sides: (:func:`most_sides`, :data:`SIDE`).
        rows: As many and four, of the QP.
        frames: (ticks + 1, 4) where the robot is then: x, y (m), cosine, sine.
    """

    sides: Array
    rows: Array
    frames: Array


@entry
@compiled
def most_sides(ticks: int) -> int:
    """Return how many sides there can be within so many ticks."""
    return (ticks + STRIDE - 1) // STRIDE * SECTORS


@compiled_once
def sector(n_x: float, n_y: float) -> int:
    """Return in which eighth of the plane a direction points, 0 to 7."""
    if abs(n_y) <= DIAGONAL * abs(n_x):
        return 0 if n_x > 0.0 else 4
    if abs(n_x) < DIAGONAL * abs(n_y):
        return 2 if n_y > 0.0 else 6
    if n_x > 0.0:
        return 1 if n_y > 0.0 else 7
    return 3 if n_y > 0.0 else 5


@compiled
def side_at(sides: Array, row: int) -> Side:
    """Return a row of the table."""
    s = sides[row]
    return Side(s[0], s[1], s[2], s[3], s[4], s[5], s[6])


@compiled
def set_side(sides: Array, row: int, side: Side) -> None:
    """Write a row of the table."""
    s = sides[row]
    s[0], s[1], s[2], s[3] = side.x, side.y, side.n_x, side.n_y
    s[4], s[5], s[6] = side.room, side.time, side.body


@compiled_once
def note_contact(
    scene: Scene, i: int, body: Body, time: float, at: Frame, sides: Array
) -> float:
    """Keep the contact with a body at a time, if it is to get a row; return its room.

    What stands is granted what there is less than :data:`ROW_ROOM` now.

    Args:
        scene: Of the step.
        i: Number of the body that is met.
        body: The same.
        time: When, s.
        at: Where the robot is then.
        sides: Brought up to date.
    """
    ends, tick = ends_at(body, time, at), scene.settings[0].tick
    contact = line_contact(scene.edges, body, ends)
    room = contact.distance - body.keep + max(ROW_ROOM - body.now, 0.0)
    if room < ROW_WITHIN:
        # Ticks 1 to STRIDE share slot 0, the next as many slot 1, whatever k·tick/tick
        # rounds to.
        slot = max(math.ceil(time / tick - SAME_TIME) - 1, 0) // STRIDE
        row = slot * SECTORS + sector(contact.n_x, contact.n_y)
        side = side_at(sides, row)
        # Of equal rooms that of the body which comes first: the order in which
        # obstacles are given decides nothing.
        if room < side.room or (
            room == side.room and comes_first(scene.bodies, i, int(side.body))
        ):
            p_x, p_y, n_x, n_y = contact.x, contact.y, contact.n_x, contact.n_y
            set_side(sides, row, Side(p_x, p_y, n_x, n_y, room, time, i))
    return float(room)


@compiled_once
def frame_then(scene: Scene, rollout: Rollout, k: int, frames: Array) -> Frame:
    """Return where the robot is at a tick, from the table once it is known."""
    f, s = frames[k], scene.settings[0]
    # No cosine is: the row has not been filled in for this rollout.
    if f[2] > 1.0:
        arc = arc_at(rollout.arcs, arc_index(rollout.arcs, 0, s.tick * k))
        at = frame_at(arc, s.tick * k, s.dt)
        f[0], f[1], f[2], f[3] = at.x, at.y, at.cos, at.sin
    return Frame(f[0], f[1], f[2], f[3])


@compiled_once
def nearest_sides(scene: Scene, rollout: Rollout, tables: Tables) -> None:
    """Fill in the contacts that get a row of the linearisation.

    Contacts with like normals at about the same time ask for about the same, the one
    with the least room for most: it gets the row of its :data:`STRIDE` and sector. A
    body is looked at again when its room may have changed by as much as it is. What
    is left out costs an iteration at worst, since the answer is looked at in full.
    """
    s, sides = scene.settings[0], tables.sides
    for row in range(sides.shape[0]):
        # Empty, until something has less room than that.
        sides[row, ROOM_OF] = ROW_WITHIN
    for k in range(tables.frames.shape[0]):
        tables.frames[k, 2] = math.inf
    watch = Watch((s.horizon, ROW_WITHIN), (s.horizon_still, ROW_WITHIN))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        body, end = body_at(scene, i), s.horizon if moves(scene, i) else s.horizon_still
        last, k = round(end / s.tick), 1
        pace = s.tick * closing_speed(scene, rollout, body) + TINY
        passing = s.tick * passing_speed(scene, rollout, body) + TINY
        while k <= last:
            time, at = s.tick * k, frame_then(scene, rollout, k, tables.frames)
            room = circle_room(scene, body, time, at)
            if room > 2.0 * ROW_WITHIN:
                k += 2 + int(min((room - ROW_WITHIN) / passing, last))
                continue
            room = note_contact(scene, i, body, time, at, sides)
            # Every other tick at least: the row of a neighbour says nearly the same.
            k += 2 + int(min(abs(room) / pace, last))
        i = next_body(scene, rollout, i + 1, watch)


@compiled_once
def bend_by_turning(v: float, omega: float, time: float) -> Pair:
    """Return ∂(x, y)/∂ω of where (v, ω) leads in a time, in the frame it leaves."""
    angle = omega * time
    if abs(angle) < BARELY_TURNED:
        # The closed form divides differences that vanish by ω²: its series instead.
        return -v * omega * time**3 / 3.0, 0.5 * v * time**2
    cos, sin = math.cos(angle), math.sin(angle)
    x = (time * cos - sin / omega) / omega
    y = (time * sin + (cos - 1.0) / omega) / omega
    return v * x, v * y


@compiled_once
def slopes_at(arc: Arc, begin: Slopes, time: float, dt: float) -> Slopes:
    """Return the slopes at a time on an arc from those where it begins.

    With p the way on the arc, s_v and s_ω the derivatives of its twist by the target:
    ∂p/∂v = s_v p/v; what turns the arc's frame turns p, and ω itself bends it.
    """
    place, turn = braking_place(time - arc.begin, arc.steps, dt), begin.turn
    one = moved_on(Frame(0.0, 0.0, 1.0, 0.0), 1.0, arc.omega, place)
    b_x, b_y = bend_by_turning(arc.v, arc.omega, place)
    # What ω bends on this arc, and the way on it turned with the heading at its
    # beginning.
    l_x = arc.share_omega * b_x - turn * arc.v * one.y
    l_y = arc.share_omega * b_y + turn * arc.v * one.x
    return Slopes(
        begin.x_v + arc.share_v * (arc.cos * one.x - arc.sin * one.y),
        begin.y_v + arc.share_v * (arc.sin * one.x + arc.cos * one.y),
        begin.x_omega + arc.cos * l_x - arc.sin * l_y,
        begin.y_omega + arc.sin * l_x + arc.cos * l_y,
        turn + arc.share_omega * place,
    )


@compiled_once
def fill_slopes(rollout: Rollout, dt: float) -> None:
    """Fill in the slopes at the beginning of every arc."""
    arcs, slopes = rollout.arcs, Slopes(0.0, 0.0, 0.0, 0.0, 0.0)
    set_slopes(arcs, 0, slopes)
    for row in range(1, arcs.shape[0]):
        begin = arc_at(arcs, row).begin
        slopes = slopes_at(arc_at(arcs, row - 1), slopes, begin, dt)
        set_slopes(arcs, row, slopes)


@compiled_once
def linearised_rows(
    scene: Scene, rollout: Rollout, met: Meeting, tables: Tables
) -> int:
    """Fill in the rows room + ∇d·(u − ū) ≥ :data:`ROW_ROOM`, in m; return how many.

    About the first target of the rollout. Among the first of the table, one for every
    side with less room than :data:`ROW_WITHIN`; that of what is ``met`` among them,
    whatever lies between two ticks.
    """
    sides, rows, about = tables.sides, tables.rows, rollout.target
    nearest_sides(scene, rollout, tables)
    if met.body >= 0:
        arc = arc_at(rollout.arcs, arc_index(rollout.arcs, 0, met.time))
        at = frame_at(arc, met.time, scene.settings[0].dt)
        body = body_at(scene, met.body)
        note_contact(scene, met.body, body, met.time, at, sides)
    fill_slopes(rollout, scene.settings[0].dt)
    arcs, dt, count = rollout.arcs, scene.settings[0].dt, 0
    for i in range(sides.shape[0]):
        side = side_at(sides, i)
        if side.room >= ROW_WITHIN:
            continue
        k = arc_index(arcs, 0, side.time)
        arc, n_x, n_y = arc_at(arcs, k), side.n_x, side.n_y
        at = frame_at(arc, side.time, dt)
        slopes = slopes_at(arc, slopes_of(arcs, k), side.time, dt)
        # d shrinks as P_r moves along t, the outward normal: ∇d = −tᵀ ∂P_r/∂u.
        t_x, t_y = at.cos * n_x - at.sin * n_y, at.sin * n_x + at.cos * n_y
        a_v = -t_x * slopes.x_v - t_y * slopes.y_v
        # P_r turns with the robot, as in J_0 of Eq. 4.
        a_omega = (n_x * side.y - n_y * side.x) * slopes.turn
        a_omega = a_omega - t_x * slopes.x_omega - t_y * slopes.y_omega
        rows[count, A_V], rows[count, A_OMEGA] = a_v, a_omega
        rows[count, B] = a_v * about[0] + a_omega * about[1] + ROW_ROOM - side.room
        rows[count, OWNER] = body_at(scene, int(side.body)).owner
        count += 1
    return count
