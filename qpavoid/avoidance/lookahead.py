"""Look-ahead: a constant twist, driven on, must keep its distance from what comes.

The row of the present sees only the present distance. It is empty where an obstacle
comes from abeam of the axle, and late where one is fast; and where a wall is known as
points it makes the robot crawl, since every point ahead of a corner asks it to slow
down. Here the twist u = (v, ω) is driven on in thought, bodies keep their velocities,
and at times t_k up to the horizon the distances d_k(u) must stay above r_min:

    d_k(ū) + ∇d_k(ū)·(u − ū) ≥ r_min,   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

linearised about ū and iterated: sequential convexification in two unknowns, a QP each
time, by the same exact solver. Which side to pass on makes the problem one with several
local optima, so that it starts from several ū, keeps the cheapest answer, and changes
over only to one that is cheaper by more than the hysteresis. Of two ways that cost the
same the one to the right is taken.

With acceleration limits u is the twist aimed at, reached from the twist last driven at
full acceleration, and what is driven is the first step of that way.
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
    too_near,
)
from qpavoid.avoidance.prediction import (
    BEGIN,
    COS,
    DRIVE_OMEGA,
    DRIVE_V,
    KEEP,
    KIND,
    MOVES,
    OWNER,
    SHARE_OMEGA,
    SHARE_V,
    SIN,
    STEPS,
    TURN_BY_OMEGA,
    V_X,
    V_Y,
    X_BY_OMEGA,
    X_BY_V,
    Y_BY_OMEGA,
    Y_BY_V,
    Rollout,
    Scene,
    X,
    Y,
    braking_place,
    frame_at,
    hold,
    roll_out,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import Touch, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.qp.exact import A_OMEGA, A_V, B, Box, Pair, solve_exactly
from qpavoid.qp.exact import OWNER as OBSTACLE

ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""

NEAR = 0.25
"""m beyond r_min; distances above get no row in this iteration."""

STRIDE, SECTORS = 4, 8
"""So many ticks, and directions of the normal, that may have a row of their own."""

DIAGONAL = math.tan(math.pi / 8.0)
"""Sectors are centred on the axes and diagonals: flat sides lie in the middle of one."""

ITERATIONS = 8
"""How often a twist is linearised about, or halved, at most."""

HALVINGS = 2
"""How often in a row the way to an answer is halved."""

HOPELESS = 3
"""The same for a start that has not yet kept its distance."""

UNMOVED = 1e-3
"""m/s and rad/s; an answer so near to the twist before would only come again."""

IN_THE_WAY = 10.0
"""A twist that would stand in an obstacle's way at its end is so much more expensive."""

PASSING = 3.0
"""m; an obstacle that has come so far has passed."""

P_X, P_Y, N_X, N_Y, SPARE, TIME, WHOSE = range(7)
SIDE = 7
"""Columns of a side, a contact that gets a row: P_r and normal in the robot frame of
its time, room (m), time (s), obstacle."""


class Query(NamedTuple):
    """What is asked of the look-ahead.

    Attributes:
        box: The twists to choose from.
        desired: Of them, v and ω.
        many: Control steps in which accelerations are counted at once.
    """

    box: Box
    desired: Pair
    many: int


class Candidate(NamedTuple):
    """A constant twist.

    Attributes:
        v: m/s.
        omega: rad/s.
        cost: Of the QP, (m/s)²; ``inf``: there is none.
    """

    v: float
    omega: float
    cost: float


class Tables(NamedTuple):
    """Memory of the look-ahead.

    Attributes:
        sides: (:func:`most_sides`, :data:`SIDE`).
        rows: As many and four, of the QP.
    """

    sides: Array
    rows: Array


@compiled
def most_sides(ticks: int) -> int:
    """Return how many sides there can be within so many ticks."""
    return (ticks + STRIDE - 1) // STRIDE * SECTORS


@compiled
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
def cost_of(scene: Scene, query: Query, v: float, omega: float) -> float:
    """Return the cost of the QP, (m/s)²."""
    s = scene.settings[0]
    d_v, d_omega = v - query.desired[0], omega - query.desired[1]
    return float(s.weight_v * d_v * d_v + s.weight_omega * d_omega * d_omega)


@compiled_once
def first_near(scene: Scene, rollout: Rollout, first: int) -> int:
    """Return a body that a twist driven on comes too near to; −1: none.

    What stands is looked at for ``horizon_still``. The search starts with ``first``.
    """
    s, bodies = scene.settings[0], scene.bodies
    count = bodies.shape[0]
    for j in range(count):
        i = first + j if first + j < count else first + j - count
        end = s.horizon if bodies[i, KIND] == MOVES else s.horizon_still
        near, _ = too_near(scene, rollout, i, (0.0, end), 0.0)
        if near:
            return i
    return -1


# ------------------------------------------------------------------ linearisation
@compiled_once
def note_side(
    sides: Array, row: int, touch: Touch, spare: float, time: float, whose: float
) -> None:
    """Keep a contact if it has less room than the one of its place in the table."""
    if spare < sides[row, SPARE]:
        sides[row, P_X], sides[row, P_Y] = touch[0], touch[1]
        sides[row, N_X], sides[row, N_Y] = touch[2], touch[3]
        sides[row, SPARE], sides[row, TIME], sides[row, WHOSE] = spare, time, whose


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
                k += 1 + int(min((spare - NEAR) / passing, last))
                continue
            ends = ends_at(bodies, i, time, at)
            touch = line_contact(scene.edges, bodies, i, ends)
            spare = touch[4] - bodies[i, KEEP]
            if spare < NEAR:
                place = (k - 1) // STRIDE * SECTORS + sector(touch[2], touch[3])
                note_side(sides, place, touch, spare, time, bodies[i, OWNER])
            k += 1 + int(min(abs(spare) / pace, last))


@compiled
def bend_by_turning(v: float, omega: float, time: float) -> Pair:
    """Return ∂(x, y)/∂ω of where (v, ω) leads in a time, in the frame that it leaves."""
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
    scene: Scene, rollout: Rollout, sides: Array, about: Pair, rows: Array
) -> int:
    """Fill in the rows room + ∇d·(u − ū) ≥ :data:`ROOM`, in m; return how many.

    Among the first of the table, one for every side with less room than NEAR.
    """
    nearest_sides(scene, rollout, sides)
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


# --------------------------------------------------------------------- candidates
@compiled_once
def nearest_ahead(
    scene: Scene, query: Query, start: Pair, limit: float, tables: Tables
) -> Candidate:
    """Return the twist near the start that keeps its distance at the least cost.

    Linearised about the start and on about each answer. From a twist that keeps its
    distance the way to an answer that does not is halved. An answer dearer than
    ``limit`` is not followed.
    """
    s, (u_v, u_omega), where = scene.settings[0], start, 0
    v = omega = 0.0
    least, halved = math.inf, 0
    for iteration in range(ITERATIONS):
        plan = hold(u_v, u_omega, s.horizon + s.dt)
        rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
        body = first_near(scene, rollout, where)
        if body < 0:
            halved, cost = 0, cost_of(scene, query, u_v, u_omega)
            if cost > 0.98 * least:
                break
            v, omega, least = u_v, u_omega, cost
        elif least < math.inf and halved < HALVINGS:
            halved, where = halved + 1, body
            u_v, u_omega = 0.5 * (u_v + v), 0.5 * (u_omega + omega)
            continue
        elif least < math.inf or iteration >= HOPELESS:
            break
        where, old_v, old_omega = max(body, 0), u_v, u_omega
        about = (u_v, u_omega)
        m = linearised_rows(scene, rollout, tables.sides, about, tables.rows)
        found, u_v, u_omega, _, _, _ = solve_exactly(
            tables.rows[: m + 4],
            query.box,
            query.desired,
            (s.weight_v, s.weight_omega),
            0,
            1e-3,
        )
        if not found or abs(u_v - old_v) + abs(u_omega - old_omega) < UNMOVED:
            break
        if body < 0 and cost_of(scene, query, u_v, u_omega) > limit:
            break
    return Candidate(v, omega, least)


@compiled_once
def lets_pass(scene: Scene, rollout: Rollout) -> bool:
    """Return whether a robot that stands at the horizon is out of everybody's way.

    What moves on for :data:`PASSING` sweeps a wall as wide as it wants. A twist that
    does not let an obstacle pass may drive on before it for ever.
    """
    s, bodies, last = scene.settings[0], scene.bodies, rollout.arcs.shape[0] - 1
    at = frame_at(rollout.arcs, last, s.horizon, s.dt)
    for i in range(bodies.shape[0]):
        if bodies[i, KIND] == MOVES:
            speed = math.sqrt(bodies[i, V_X] ** 2 + bodies[i, V_Y] ** 2)
            if speed == 0.0:
                continue
            on = s.horizon + PASSING / speed
            x1, y1 = seen_from(at, bodies, i, s.horizon)
            x2, y2 = seen_from(at, bodies, i, on)
            if wall_contact(scene.edges, x1, y1, x2, y2)[4] < bodies[i, KEEP]:
                return False
    return True


@compiled
def seen_from(at: Frame, bodies: Array, i: int, time: float) -> Pair:
    """Return where the pivot of a body is at a time, as seen from a frame."""
    d_x = bodies[i, X] + time * bodies[i, V_X] - at.x
    d_y = bodies[i, Y] + time * bodies[i, V_Y] - at.y
    return at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x


@compiled_once
def refine_candidate(
    scene: Scene, query: Query, start: Pair, limit: float, tables: Tables
) -> Candidate:
    """Return the twist near the start that keeps its distance and lets others pass.

    That is, on the way from the nearest one back to the start. Where none does, the
    nearest itself at :data:`IN_THE_WAY` times its cost; what costs more than ``limit``
    is not looked at so closely.
    """
    found = nearest_ahead(scene, query, start, limit, tables)
    if found.cost >= limit:
        return found
    s = scene.settings[0]
    for quarter in range(5):
        share = 0.25 * quarter
        v = found.v + share * (start[0] - found.v)
        omega = found.omega + share * (start[1] - found.omega)
        plan = hold(v, omega, s.horizon + s.dt)
        rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
        if not lets_pass(scene, rollout):
            continue
        if quarter == 0:
            return found
        if first_near(scene, rollout, 0) < 0:
            return Candidate(v, omega, cost_of(scene, query, v, omega))
    return Candidate(found.v, found.omega, IN_THE_WAY * found.cost)
