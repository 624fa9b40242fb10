"""Linearisation: the rows of the distances at times to come, about a twist.

At a time t_k on the way of a twist ū the distance to a body changes with the twist as

    d_k(u) ≈ d_k(ū) + ∇d_k·(u − ū),   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

where P_r is the footprint point nearest then, and ∂P_r/∂u how the pose of that time
depends on the twist that is aimed at.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import (
    arc_at,
    circle_room,
    closing_speed,
    ends_at,
    line_contact,
    passing_speed,
)
from qpavoid.avoidance.bodies import KEEP, KIND, MOVES, NOW, OWNER, Scene
from qpavoid.avoidance.prediction import (
    BEGIN,
    COS,
    DRIVE_OMEGA,
    DRIVE_V,
    SHARE_OMEGA,
    SHARE_V,
    SIN,
    STEPS,
    TURN_BY_OMEGA,
    X_BY_OMEGA,
    X_BY_V,
    Y_BY_OMEGA,
    Y_BY_V,
    Rollout,
    braking_place,
    frame_at,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import Touch
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.qp.exact import A_OMEGA, A_V, B, Pair
from qpavoid.qp.exact import OWNER as OBSTACLE

ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""


NEAR = 0.25
"""m beyond r_min; distances above get no row in this iteration."""


STRIDE, SECTORS = 4, 8
"""So many ticks, and directions of the normal, that may have a row of their own."""


DIAGONAL = math.tan(math.pi / 8.0)
"""Sectors are centred on axes and diagonals: flat sides lie in the middle of one."""


P_X, P_Y, N_X, N_Y, SPARE, TIME, WHOSE = range(7)


SIDE = 7
"""Columns of a side, a contact that gets a row: P_r and normal in the robot frame of
its time, room (m), time (s), obstacle."""


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


@compiled_once
def note_side(
    sides: Array, row: int, touch: Touch, spare: float, time: float, whose: float
) -> None:
    """Keep a contact if it has less room than the one of its place in the table."""
    if spare < sides[row, SPARE]:
        sides[row, P_X], sides[row, P_Y] = touch[0], touch[1]
        sides[row, N_X], sides[row, N_Y] = touch[2], touch[3]
        sides[row, SPARE], sides[row, TIME], sides[row, WHOSE] = spare, time, whose


class Meeting(NamedTuple):
    """What comes too near.

    Attributes:
        body: Its number; −1: nothing does.
        time: When it does first, s.
    """

    body: int
    time: float


@compiled_once
def note_contact(
    scene: Scene, rollout: Rollout, i: int, time: float, sides: Array
) -> float:
    """Keep the contact with body i at a time, if it is to get a row; return its room.

    What stands is granted what there is less than :data:`ROOM` now.
    """
    arcs, tick = rollout.arcs, scene.settings[0].tick
    at = frame_at(arcs, arc_at(arcs, time), time, scene.settings[0].dt)
    ends = ends_at(scene.bodies, i, time, at)
    touch = line_contact(scene.edges, scene.bodies, i, ends)
    spare = touch[4] - scene.bodies[i, KEEP] + max(ROOM - scene.bodies[i, NOW], 0.0)
    if spare < NEAR:
        slot = max(math.ceil(time / tick - 1e-6) - 1, 0) // STRIDE
        place = slot * SECTORS + sector(touch[2], touch[3])
        note_side(sides, place, touch, spare, time, scene.bodies[i, OWNER])
    return float(spare)


@compiled_once
def nearest_sides(scene: Scene, rollout: Rollout, sides: Array) -> None:
    """Fill in the contacts that get a row.

    Contacts with like normals at about the same time ask for about the same, the one
    with the least room for most: it gets the row of its :data:`STRIDE` and sector. A
    body is looked at again when its room may have changed by as much as it is. What
    is left out costs an iteration at worst, since the answer is looked at in full.
    """
    s, bodies, arcs = scene.settings[0], scene.bodies, rollout.arcs
    for row in range(sides.shape[0]):
        sides[row, SPARE] = NEAR
    for i in range(bodies.shape[0]):
        end = s.horizon if bodies[i, KIND] == MOVES else s.horizon_still
        last, k = round(end / s.tick), 1
        pace = s.tick * closing_speed(scene, rollout, i) + 1e-9
        passing = s.tick * passing_speed(scene, rollout, i) + 1e-9
        while k <= last:
            time = s.tick * k
            at = frame_at(arcs, arc_at(arcs, time), time, s.dt)
            spare = circle_room(scene, i, time, at)
            if spare > 2.0 * NEAR:
                k += 2 + int(min((spare - NEAR) / passing, last))
                continue
            spare = note_contact(scene, rollout, i, time, sides)
            k += 2 + int(min(abs(spare) / pace, last))


@compiled_once
def bend_by_turning(v: float, omega: float, time: float) -> Pair:
    """Return ∂(x, y)/∂ω of where (v, ω) leads in a time, in the frame it leaves."""
    angle = omega * time
    if abs(angle) < 1e-3:
        return -v * omega * time**3 / 3.0, 0.5 * v * time**2
    cos, sin = math.cos(angle), math.sin(angle)
    x = (time * cos - sin / omega) / omega
    y = (time * sin + (cos - 1.0) / omega) / omega
    return v * x, v * y


@compiled_once
def slopes_at(
    arcs: Array, row: int, time: float, dt: float
) -> tuple[float, float, float, float, float]:
    """Return ∂(x, y)/∂v, ∂(x, y)/∂ω and ∂γ/∂ω by the target, at a time on an arc.

    With p the way on the arc, s_v and s_ω the derivatives of its twist by the target:
    ∂p/∂v = s_v p/v; what turns the arc's frame turns p, and ω itself bends it.
    """
    place = braking_place(time - arcs[row, BEGIN], arcs[row, STEPS], dt)
    v, omega = arcs[row, DRIVE_V], arcs[row, DRIVE_OMEGA]
    one = moved_on(Frame(0.0, 0.0, 1.0, 0.0), 1.0, omega, place)
    b_x, b_y = bend_by_turning(v, omega, place)
    s_v, s_omega = arcs[row, SHARE_V], arcs[row, SHARE_OMEGA]
    turn, cos, sin = arcs[row, TURN_BY_OMEGA], arcs[row, COS], arcs[row, SIN]
    l_x = s_omega * b_x - turn * v * one.y
    l_y = s_omega * b_y + turn * v * one.x
    return (
        arcs[row, X_BY_V] + s_v * (cos * one.x - sin * one.y),
        arcs[row, Y_BY_V] + s_v * (sin * one.x + cos * one.y),
        arcs[row, X_BY_OMEGA] + cos * l_x - sin * l_y,
        arcs[row, Y_BY_OMEGA] + sin * l_x + cos * l_y,
        turn + s_omega * place,
    )


@compiled_once
def fill_slopes(rollout: Rollout, dt: float) -> None:
    """Fill in the derivatives at the beginning of every arc."""
    arcs = rollout.arcs
    for column in range(X_BY_V, TURN_BY_OMEGA + 1):
        arcs[0, column] = 0.0
    for row in range(1, arcs.shape[0]):
        slopes = slopes_at(arcs, row - 1, arcs[row, BEGIN], dt)
        arcs[row, X_BY_V], arcs[row, Y_BY_V] = slopes[0], slopes[1]
        arcs[row, X_BY_OMEGA], arcs[row, Y_BY_OMEGA] = slopes[2], slopes[3]
        arcs[row, TURN_BY_OMEGA] = slopes[4]


@compiled_once
def linearised_rows(
    scene: Scene,
    rollout: Rollout,
    met: Meeting,
    sides: Array,
    about: Pair,
    rows: Array,
) -> int:
    """Fill in the rows room + ∇d·(u − ū) ≥ :data:`ROOM`, in m; return how many.

    Among the first of the table, one for every side with less room than NEAR; that of
    what is ``met`` among them, whatever lies between two ticks.
    """
    nearest_sides(scene, rollout, sides)
    if met.body >= 0:
        note_contact(scene, rollout, met.body, met.time, sides)
    fill_slopes(rollout, scene.settings[0].dt)
    arcs, dt, count = rollout.arcs, scene.settings[0].dt, 0
    for side in range(sides.shape[0]):
        if sides[side, SPARE] >= NEAR:
            continue
        time = sides[side, TIME]
        row = arc_at(arcs, time)
        at = frame_at(arcs, row, time, dt)
        x_v, y_v, x_omega, y_omega, turn = slopes_at(arcs, row, time, dt)
        n_x, n_y = sides[side, N_X], sides[side, N_Y]
        t_x, t_y = at.cos * n_x - at.sin * n_y, at.sin * n_x + at.cos * n_y
        lever = n_x * sides[side, P_Y] - n_y * sides[side, P_X]
        a_v = -t_x * x_v - t_y * y_v
        a_omega = lever * turn - t_x * x_omega - t_y * y_omega
        rows[count, A_V], rows[count, A_OMEGA] = a_v, a_omega
        rows[count, B] = a_v * about[0] + a_omega * about[1] + ROOM - sides[side, SPARE]
        rows[count, OBSTACLE] = sides[side, WHOSE]
        count += 1
    return count
