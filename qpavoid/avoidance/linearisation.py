"""Linearisation of future distances about a twist: rows of the look-ahead QP.

At a time t_k of the rollout of a twist ū the distance to a body is

    d_k(u) ≈ d_k(ū) + ∇d_k·(u − ū),   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

with P_r the footprint point nearest then, and ∂P_r/∂u its derivative by the target
twist.
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
from qpavoid.qp.exact import A_OMEGA, A_V, ROW_OWNER, B
from qpavoid.types import Array, Pair

ROW_ROOM = 2e-3
"""m; added to r_min in the linearised rows, so that the true distance keeps r_min."""

BARELY_TURNED = 1e-3
"""rad; turn of an arc below which its slopes are those of a line, to 1e-6 of them."""

ROW_WITHIN = 0.25
"""m; margin above which a distance gets no row in this iteration."""

STRIDE, OCTANTS = 4, 8
"""Ticks, and directions of the normal, that share one row each."""

DIAGONAL = math.tan(math.pi / 8.0)
"""tan 22.5°: sectors are centred on axes and diagonals, where flat sides lie."""


class Side(NamedTuple):
    """A future contact that gets a row.

    Attributes:
        x: P_r in the robot frame of that time, m.
        y: Of P_r, m.
        n_x: Outward normal of the footprint there, in the same frame.
        n_y: Of the normal.
        room: Margin, m.
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
        frames: (ticks + 1, 4) predicted robot frames: x, y (m), cosine, sine.
    """

    sides: Array
    frames: Array


@entry
@compiled
def most_sides(ticks: int) -> int:
    """Return the greatest number of sides within so many ticks."""
    return (ticks + STRIDE - 1) // STRIDE * OCTANTS


@compiled_once
def sector(n_x: float, n_y: float) -> int:
    """Return the octant of a direction, 0 to 7."""
    if abs(n_y) <= DIAGONAL * abs(n_x):
        return 0 if n_x > 0.0 else 4
    if abs(n_x) < DIAGONAL * abs(n_y):
        return 2 if n_y > 0.0 else 6
    if n_x > 0.0:
        return 1 if n_y > 0.0 else 7
    return 3 if n_y > 0.0 else 5


@compiled
def side_at(sides: Array, row: int) -> Side:
    """Return a row of the table as a record."""
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
    """Store the contact with a body at a time, if it gets a row; return its margin.

    Of a static body the margin that is missing now is added, up to :data:`ROW_ROOM`.

    Args:
        scene: Of the step.
        i: Number of the body.
        body: The body.
        time: s.
        at: Frame of the robot then.
        sides: Updated.
    """
    ends, tick = ends_at(body, time, at), scene.settings[0].tick
    contact = line_contact(scene.edges, body, ends)
    room = contact.distance - body.keep + max(ROW_ROOM - body.now, 0.0)
    if room < ROW_WITHIN:
        # Ticks 1 to STRIDE share slot 0, the next ones slot 1, independent of rounding.
        slot = max(math.ceil(time / tick - SAME_TIME) - 1, 0) // STRIDE
        row = slot * OCTANTS + sector(contact.n_x, contact.n_y)
        side = side_at(sides, row)
        # Of equal margins the first body's: independent of the order of input.
        if room < side.room or (
            room == side.room and comes_first(scene.bodies, i, int(side.body))
        ):
            p_x, p_y, n_x, n_y = contact.x, contact.y, contact.n_x, contact.n_y
            set_side(sides, row, Side(p_x, p_y, n_x, n_y, room, time, i))
    return float(room)


@compiled_once
def frame_then(scene: Scene, rollout: Rollout, k: int, frames: Array) -> Frame:
    """Return the robot's frame at a tick, cached in a table."""
    f, s = frames[k], scene.settings[0]
    # An impossible cosine marks a row that is not filled in for this rollout.
    if f[2] > 1.0:
        arc = arc_at(rollout.arcs, arc_index(rollout.arcs, 0, s.tick * k))
        at = frame_at(arc, s.tick * k, s.dt)
        f[0], f[1], f[2], f[3] = at.x, at.y, at.cos, at.sin
    return Frame(f[0], f[1], f[2], f[3])


@compiled_once
def nearest_sides(scene: Scene, rollout: Rollout, tables: Tables) -> None:
    """Fill in the contacts that get a row of the linearisation.

    Contacts with similar normals at about the same time give similar rows; the one with
    the least margin gets the row of its :data:`STRIDE` and sector. A body is sampled
    again when its margin may have changed by its value. A missed contact costs at most
    an iteration, since the solution is verified in full.
    """
    s, sides = scene.settings[0], tables.sides
    for row in range(sides.shape[0]):
        # Empty: no smaller margin yet.
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
            # At least every other tick: neighbouring rows are nearly equal.
            k += 2 + int(min(abs(room) / pace, last))
        i = next_body(scene, rollout, i + 1, watch)


@compiled_once
def bend_by_turning(v: float, omega: float, time: float) -> Pair:
    """Return ∂(x, y)/∂ω of the position after driving (v, ω) for a time."""
    angle = omega * time
    if abs(angle) < BARELY_TURNED:
        # The closed form is ill-conditioned for small ω: its series instead.
        return -v * omega * time**3 / 3.0, 0.5 * v * time**2
    cos, sin = math.cos(angle), math.sin(angle)
    x = (time * cos - sin / omega) / omega
    y = (time * sin + (cos - 1.0) / omega) / omega
    return v * x, v * y


@compiled_once
def slopes_at(arc: Arc, begin: Slopes, time: float, dt: float) -> Slopes:
    """Return the slopes at a time on an arc from those at its start.

    With p the position on the arc, s_v and s_ω the derivatives of its twist by the
    target: ∂p/∂v = s_v p/v; a turn of the arc's frame rotates p, and ω bends it.
    """
    place, turn = braking_place(time - arc.begin, arc.steps, dt), begin.turn
    one = moved_on(Frame(0.0, 0.0, 1.0, 0.0), 1.0, arc.omega, place)
    b_x, b_y = bend_by_turning(arc.v, arc.omega, place)
    # Bending by ω on this arc, and rotation of its chord with the initial heading.
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
    """Fill in the slopes at the start of every arc."""
    arcs, slopes = rollout.arcs, Slopes(0.0, 0.0, 0.0, 0.0, 0.0)
    set_slopes(arcs, 0, slopes)
    for row in range(1, arcs.shape[0]):
        begin = arc_at(arcs, row).begin
        slopes = slopes_at(arc_at(arcs, row - 1), slopes, begin, dt)
        set_slopes(arcs, row, slopes)


@compiled_once
def linearised_rows(
    scene: Scene, rollout: Rollout, met: Meeting, tables: Tables, rows: Array
) -> int:
    """Fill in the rows margin + ∇d·(u − ū) ≥ :data:`ROW_ROOM`, m; return their number.

    ū is the first target of the rollout. One row per side with a margin below
    :data:`ROW_WITHIN`, including that of the violation ``met``, which may lie between
    two ticks.
    """
    sides, about = tables.sides, rollout.target
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
        rows[count, ROW_OWNER] = body_at(scene, int(side.body)).owner
        count += 1
    return count
