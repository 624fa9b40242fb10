"""Ways round: constant twists that keep their distance, by linearised rows."""

import math
from typing import TypeAlias

from qpavoid.avoidance.prediction import (
    COS,
    FIRST,
    OMEGA,
    SIN,
    SPEED,
    SPREAD,
    TICKS,
    V_X,
    V_Y,
    WANTED,
    Scene,
    V,
    X,
    Y,
    body_contact,
    drive,
    least_room,
    nearest_body,
    seen_from,
)
from qpavoid.avoidance.rows import STILL
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.qp.exact import A_OMEGA, A_V, B, Box, Pair, solve_exactly

ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""

NEAR = 0.25
"""m beyond r_min; distances above get no row in this iteration."""

STRIDE, SECTORS = 4, 8
"""So many ticks, and directions of the normal, that may have a row of their own."""

ITERATIONS = 8
"""How often a way is linearised, or halved, at most."""

HALVINGS = 2
"""How often in a row the way to an answer is halved."""

HOPELESS = 3
"""The same for a way that has not yet kept its distance."""

UNMOVED = 1e-3
"""m/s and rad/s; an answer so near to the twist before would only come again."""

IN_THE_WAY = 10.0
"""A way that would stand in an obstacle's way at its end is so much more expensive."""

PASSING = 3.0
"""m; an obstacle that has come so far has passed."""

Wish: TypeAlias = tuple[Box, Pair, int]
"""The twists to choose from, the one desired, and how many ticks are looked at."""

Way: TypeAlias = tuple[float, float, float]
"""v, ω, and its cost in (m/s)²; ``inf``: none."""

TICK = 5
"""Column of a side, after P_r, normal and room."""


@compiled
def most_sides(n: int) -> int:
    """Return how many sides there can be within n ticks."""
    return (n + STRIDE - 1) // STRIDE * SECTORS


@compiled
def sector(n_x: float, n_y: float) -> int:
    """Return in which eighth of the plane a direction points, 0 to 7."""
    number = int(n_x > 0.0) + 2 * int(n_y > 0.0)
    return number + 4 * int(abs(n_x) > abs(n_y))


@compiled_once
def nearest_sides(scene: Scene, n: int, sides: Array) -> None:
    """Fill in P_r, normal, room and tick of the contacts that get a row.

    Contacts with like normals at about the same time ask for about the same, the one
    with the least room for most: it gets the row of its :data:`STRIDE` and sector. A
    group is looked at again when its room may have changed by as much as it is. What
    is left out costs an iteration at worst, since the answer is looked at in full.
    """
    edges, robot, settings, bodies, groups, poses = scene
    tick = settings[0].tick
    for row in range(most_sides(n)):
        sides[row, 4] = NEAR
    moving = tick * max(abs(poses[0, V]), abs(poses[n, V])) + 1e-9
    turning = tick * robot[8] * max(abs(poses[0, OMEGA]), abs(poses[n, OMEGA]))
    for g in range(groups.shape[0]):
        last, k = min(n, int(groups[g, TICKS])), 1
        while k <= last:
            pace, time = moving + tick * groups[g, SPEED], tick * k
            x, y = (
                groups[g, X] + groups[g, V_X] * time,
                groups[g, Y] + groups[g, V_Y] * time,
            )
            d_x, d_y = x - poses[k, X], y - poses[k, Y]
            room = math.sqrt(d_x * d_x + d_y * d_y) - robot[8] - groups[g, SPREAD]
            if room < NEAR:
                touch = point_contact(edges, *seen_from(poses, k, x, y))
                room = touch[4] - groups[g, SPREAD]
                pace += turning
                row = (k - 1) // STRIDE * SECTORS + sector(touch[2], touch[3])
                if room < sides[row, 4]:
                    if groups[g, SPREAD] != bodies[int(groups[g, FIRST]), WANTED]:
                        room, i = nearest_body(scene, g, k)
                        touch = body_contact(scene, i, k)
                        row = (k - 1) // STRIDE * SECTORS + sector(touch[2], touch[3])
                    if room < sides[row, 4]:
                        sides[row, 0], sides[row, 1] = touch[0], touch[1]
                        sides[row, 2], sides[row, 3] = touch[2], touch[3]
                        sides[row, 4], sides[row, TICK] = room, k
            k += 1 + int(min(abs(room) / pace, n))


@compiled_once
def pose_slopes(scene: Scene, n: int, v: float, omega: float, slopes: Array) -> None:
    """Fill in ∂(x, y)/∂v, ∂(x, y)/∂ω and ∂γ/∂ω of the poses on the way to (v, ω).

    A twist follows its target once it is reached: ∂γ/∂ω is the time since, and
    ∂p/∂ω = ∫ (∂γ/∂ω) ẑ × dp. Every tick by the mean of its ends, to second order.
    """
    _, robot, settings, _, _, poses = scene
    tick = settings[0].tick
    v_x = v_y = omega_x = omega_y = turn = 0.0
    for k in range(n):
        time = tick * max(1.0 - abs(v - poses[k, V]) / (robot[4] * tick), 0.0)
        v_x += 0.5 * time * (poses[k, COS] + poses[k + 1, COS])
        v_y += 0.5 * time * (poses[k, SIN] + poses[k + 1, SIN])
        time = tick * max(1.0 - abs(omega - poses[k, OMEGA]) / (robot[5] * tick), 0.0)
        omega_x -= (turn + 0.5 * time) * (poses[k + 1, Y] - poses[k, Y])
        omega_y += (turn + 0.5 * time) * (poses[k + 1, X] - poses[k, X])
        turn += time
        slopes[k + 1, 0], slopes[k + 1, 1] = v_x, v_y
        slopes[k + 1, 2], slopes[k + 1, 3], slopes[k + 1, 4] = omega_x, omega_y, turn


@compiled_once
def ahead_rows(
    poses: Array, slopes: Array, sides: Array, v: float, omega: float, rows: Array
) -> int:
    """Fill in the rows room + ∇d·(u − (v, ω)) ≥ :data:`ROOM`, in m; return how many."""
    count = 0
    for side in range(sides.shape[0]):
        if sides[side, 4] >= NEAR:
            continue
        k = int(sides[side, TICK])
        n_x, n_y = sides[side, 2], sides[side, 3]
        turned_x = poses[k, COS] * n_x - poses[k, SIN] * n_y
        turned_y = poses[k, SIN] * n_x + poses[k, COS] * n_y
        lever = n_x * sides[side, 1] - n_y * sides[side, 0]
        a_v = -turned_x * slopes[k, 0] - turned_y * slopes[k, 1]
        a_omega = lever * slopes[k, 4]
        a_omega -= turned_x * slopes[k, 2] + turned_y * slopes[k, 3]
        rows[count, A_V], rows[count, A_OMEGA] = a_v, a_omega
        rows[count, B] = a_v * v + a_omega * omega + ROOM - sides[side, 4]
        count += 1
    return count


@compiled
def cost_of(scene: Scene, wish: Wish, v: float, omega: float) -> float:
    """Return the cost of the QP, (m/s)²."""
    s = scene[2][0]
    d_v, d_omega = v - wish[1][0], omega - wish[1][1]
    return float(s.weight_v * d_v * d_v + s.weight_omega * d_omega * d_omega)


@compiled_once
def nearest_ahead(
    scene: Scene, wish: Wish, start: Pair, limit: float, memory: Array
) -> Way:
    """Return the twist near the start that keeps its distance at the least cost.

    Linearised about the start and on about each answer. From a twist that keeps its
    distance the way to an answer that does not is halved. An answer dearer than
    ``limit`` is not followed.
    """
    s, poses, (box, desired, n) = scene[2][0], scene[5], wish
    slopes, sides = memory[: n + 1], memory[n + 1 : n + 1 + most_sides(n)]
    rows = memory[n + 1 + most_sides(n) :]
    (u_v, u_omega), where = start, 0
    v = omega = 0.0
    least, halved = math.inf, 0
    for iteration in range(ITERATIONS):
        drive(scene, 0, n, u_v, u_omega)
        _, where, body, _ = least_room(scene, 0, n, 0.0, True, where)
        if body < 0:
            halved = 0
            cost = cost_of(scene, wish, u_v, u_omega)
            if cost > 0.98 * least:
                break
            v, omega, least = u_v, u_omega, cost
        elif least < math.inf and halved < HALVINGS:
            halved += 1
            u_v, u_omega = 0.5 * (u_v + v), 0.5 * (u_omega + omega)
            continue
        elif least < math.inf or iteration >= HOPELESS:
            break
        pose_slopes(scene, n, u_v, u_omega, slopes)
        nearest_sides(scene, n, sides)
        m = ahead_rows(poses, slopes, sides, u_v, u_omega, rows)
        old_v, old_omega = u_v, u_omega
        found, u_v, u_omega, _, _, _ = solve_exactly(
            rows[: m + 4], box, desired, (s.weight_v, s.weight_omega), 0, 1e-3
        )
        if not found or abs(u_v - old_v) + abs(u_omega - old_omega) < UNMOVED:
            break
        if body < 0 and cost_of(scene, wish, u_v, u_omega) > limit:
            break
    return v, omega, least


@compiled_once
def lets_pass(scene: Scene, n: int) -> bool:
    """Return whether a robot that stands at the last pose is out of everybody's way.

    What moves on for :data:`PASSING` sweeps a wall as wide as it wants. A way that does
    not let an obstacle pass may drive on before it for ever.
    """
    edges, _, settings, bodies, groups, poses = scene
    time = settings[0].tick * n
    for g in range(groups.shape[0]):
        if groups[g, SPEED] > STILL:
            x, y = (
                groups[g, X] + groups[g, V_X] * time,
                groups[g, Y] + groups[g, V_Y] * time,
            )
            on = PASSING / groups[g, SPEED]
            x1, y1 = seen_from(poses, n, x, y)
            x, y = x + on * groups[g, V_X], y + on * groups[g, V_Y]
            x2, y2 = seen_from(poses, n, x, y)
            wanted = bodies[int(groups[g, FIRST]), WANTED]
            if wall_contact(edges, x1, y1, x2, y2)[4] < wanted:
                return False
    return True


@compiled_once
def way_from(scene: Scene, wish: Wish, start: Pair, limit: float, memory: Array) -> Way:
    """Return the twist near the start that keeps its distance and lets others pass.

    That is, on the way from the nearest one back to the start. Where none does, the
    nearest itself at :data:`IN_THE_WAY` times its cost; what costs more than ``limit``
    is not looked at so closely.
    """
    n = wish[2]
    v, omega, cost = nearest_ahead(scene, wish, start, limit, memory)
    if cost >= limit:
        return v, omega, cost
    for quarter in range(5):
        share = 0.25 * quarter
        u_v, u_omega = v + share * (start[0] - v), omega + share * (start[1] - omega)
        drive(scene, 0, n, u_v, u_omega)
        if not lets_pass(scene, n):
            continue
        if quarter == 0:
            return v, omega, cost
        _, _, body, _ = least_room(scene, 0, n, 0.0, True, 0)
        if body < 0:
            return u_v, u_omega, cost_of(scene, wish, u_v, u_omega)
    return v, omega, IN_THE_WAY * cost
