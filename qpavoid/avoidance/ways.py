"""Ways round: the nearest constant twist that keeps its distance, by linearised rows."""

import math
from typing import TypeAlias

import numpy as np

from qpavoid.avoidance.prediction import (
    PASSING,
    Scene,
    body_contact,
    drive,
    least_room,
    nearest_body,
)
from qpavoid.avoidance.rows import STILL
from qpavoid.compiled import compiled
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.qp.exact import solve_exactly

ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""

NEAR = 0.25
"""m beyond r_min; distances above get no row in this iteration."""

STRIDE, SECTORS = 4, 8
"""Every so many ticks get a row for each of so many directions, for what is nearest."""

ITERATIONS = 8
"""How often a way is linearised, or halved, at most."""

HALVINGS = 2
"""How often in a row the way to an answer is halved."""

HOPELESS = 3
"""The same for a way that has not yet kept its distance."""

UNMOVED = 1e-3
"""An answer so near to the twist before, in m/s and rad/s, would only come again."""

IN_THE_WAY = 10.0
"""A way that would stand in an obstacle's way at its end is so much more expensive."""

Wish: TypeAlias = tuple[float, float, float, float, float, float]
"""v_min, v_max, ω_min, ω_max, and the desired v, ω within."""


@compiled
def cost_of(scene: Scene, wish: Wish, v: float, omega: float) -> float:
    """Return the cost of the QP, (m/s)²: how far a twist is from the desired one."""
    s = scene[2][0]
    d_v, d_omega = v - wish[4], omega - wish[5]
    return float(s.weight_v * d_v * d_v + s.weight_omega * d_omega * d_omega)


@compiled
def pose_slopes(scene: Scene, n: int, v: float, omega: float, slopes: Array) -> None:
    """Fill ``slopes`` (n + 1, 5): ∂(x, y)/∂v, ∂(x, y)/∂ω, ∂γ/∂ω along a way.

    The heading follows the target once it is reached: ∂γ/∂ω is the time since, and
    ∂p/∂ω = ∫ (∂γ/∂ω) ẑ × dp. Each tick by the mean of its ends, to second order.
    """
    _, robot, settings, _, _, poses = scene
    tick = settings[0].tick
    v_x = v_y = w_x = w_y = turn = 0.0
    for j in range(5):
        slopes[0, j] = 0.0
    for k in range(n):
        share = max(1.0 - abs(v - poses[k, 4]) / (robot[4] * tick), 0.0)
        v_x += 0.5 * share * tick * (poses[k, 2] + poses[k + 1, 2])
        v_y += 0.5 * share * tick * (poses[k, 3] + poses[k + 1, 3])
        share = max(1.0 - abs(omega - poses[k, 5]) / (robot[5] * tick), 0.0)
        middle = turn + 0.5 * share * tick
        w_x -= middle * (poses[k + 1, 1] - poses[k, 1])
        w_y += middle * (poses[k + 1, 0] - poses[k, 0])
        turn += share * tick
        slopes[k + 1, 0], slopes[k + 1, 1] = v_x, v_y
        slopes[k + 1, 2], slopes[k + 1, 3], slopes[k + 1, 4] = w_x, w_y, turn


@compiled
def nearest_sides(
    edges: Array,
    robot: Array,
    tick: float,
    bodies: Array,
    groups: Array,
    poses: Array,
    n: int,
    sides: Array,
) -> None:
    """Fill ``sides`` (ticks, SECTORS, 5) with what is nearest in every direction.

    P_r, normal and room of the contact with the least room below :data:`NEAR`, at every
    ``STRIDE``-th tick for every eighth of the directions of the normal. Contacts with
    like normals ask for the same, the nearest for most.
    """
    for row in range(sides.shape[0]):
        sides[row, 4] = NEAR
    moving = tick * max(abs(poses[0, 4]), abs(poses[n, 4])) + 1e-9
    turning = tick * robot[8] * max(abs(poses[0, 5]), abs(poses[n, 5]))
    for g in range(groups.shape[0]):
        last, k = min(n, int(groups[g, 6])), 1
        begin, end = int(groups[g, 7]), int(groups[g, 8])
        while k <= last:
            time, pace = tick * k, moving + tick * groups[g, 5]
            x = groups[g, 0] + groups[g, 3] * time - poses[k, 0]
            y = groups[g, 1] + groups[g, 4] * time - poses[k, 1]
            room = math.sqrt(x * x + y * y) - robot[8] - groups[g, 2]
            if room < NEAR:
                cos, sin = poses[k, 2], poses[k, 3]
                p_x, p_y, n_x, n_y, distance, _ = point_contact(
                    edges, cos * x + sin * y, cos * y - sin * x
                )
                room = distance - groups[g, 2]
                pace += turning
                row = (k - 1) // STRIDE * SECTORS + sector(n_x, n_y)
                if room < sides[row, 4]:
                    if groups[g, 2] != bodies[begin, 4]:
                        i = begin
                        if end > begin + 1:
                            _, i = nearest_body(edges, bodies, begin, end, poses, k)
                        p_x, p_y, n_x, n_y, distance, _ = body_contact(
                            edges, bodies, i, time, poses, k
                        )
                        room = distance - bodies[i, 4]
                        row = (k - 1) // STRIDE * SECTORS + sector(n_x, n_y)
                    if room < sides[row, 4]:
                        sides[row, 0], sides[row, 1] = p_x, p_y
                        sides[row, 2], sides[row, 3] = n_x, n_y
                        sides[row, 4], sides[row, 5] = room, k
            k += 1 + int(min(abs(room) / pace, n))


@compiled
def sector(n_x: float, n_y: float) -> int:
    """Return in which eighth of the plane a direction points, 0 to 7."""
    number = int(n_x > 0.0) + 2 * int(n_y > 0.0)
    return number + 4 * int(abs(n_x) > abs(n_y))


@compiled
def ahead_rows(
    scene: Scene, n: int, slopes: Array, sides: Array, A: Array, b: Array
) -> int:
    """Fill A, b (in m) with room + ∇d_k·(u − ū) ≥ 0; return how many.

    b still lacks A ū.
    """
    poses = scene[5]
    count = 0
    for row in range(sides.shape[0]):
        if sides[row, 4] >= NEAR:
            continue
        k = int(sides[row, 5])
        p_x, p_y, n_x, n_y = sides[row, 0], sides[row, 1], sides[row, 2], sides[row, 3]
        m_x = poses[k, 2] * n_x - poses[k, 3] * n_y
        m_y = poses[k, 3] * n_x + poses[k, 2] * n_y
        lever = n_x * p_y - n_y * p_x
        A[count, 0] = -m_x * slopes[k, 0] - m_y * slopes[k, 1]
        A[count, 1] = -m_x * slopes[k, 2] - m_y * slopes[k, 3] + lever * slopes[k, 4]
        b[count] = -sides[row, 4]
        count += 1
    return count


@compiled
def nearest_ahead(
    scene: Scene, wish: Wish, n: int, v: float, omega: float, limit: float, work: Array
) -> tuple[float, float, float]:
    """Return (v, ω) that keeps its distance at the least cost, and the cost; or inf.

    Linearised about the start (v, ω) and on about each answer. From a twist that keeps
    its distance the way to an answer that does not is halved.
    """
    edges, robot, settings, bodies, groups, poses = scene
    s = settings[0]
    tick = s.tick
    rows = (n + STRIDE - 1) // STRIDE * SECTORS
    slopes = work[: 5 * n + 5].reshape(n + 1, 5)
    sides = work[5 * n + 5 : 5 * n + 5 + 6 * rows].reshape(rows, 6)
    rest = work[5 * n + 5 + 6 * rows :]
    A, b = rest[: 2 * rows].reshape(rows, 2), rest[2 * rows : 3 * rows]
    lower, upper = np.array([wish[0], wish[2]]), np.array([wish[1], wish[3]])
    weights, desired = np.array([s.weight_v, s.weight_omega]), np.array(wish[4:])
    u_v, u_omega, where = v, omega, 0
    v = omega = 0.0
    least, halved = math.inf, 0
    for iteration in range(ITERATIONS):
        drive(robot, tick, 0, n, u_v, u_omega, poses)
        room, where, _, _ = least_room(
            edges, robot, tick, bodies, groups, poses, 0, n, 0.0, True, where
        )
        if room >= 0.0:
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
        nearest_sides(edges, robot, tick, bodies, groups, poses, n, sides)
        m = ahead_rows(scene, n, slopes, sides, A, b)
        for i in range(m):
            b[i] += A[i, 0] * u_v + A[i, 1] * u_omega + ROOM
        old_v, old_omega = u_v, u_omega
        found, u_v, u_omega, _, _, _ = solve_exactly(
            A[:m], b[:m], lower, upper, desired, weights, 0, 1e-3
        )
        if abs(u_v - old_v) + abs(u_omega - old_omega) < UNMOVED:
            break
        if not found or (room >= 0.0 and cost_of(scene, wish, u_v, u_omega) > limit):
            break
    return v, omega, least


@compiled
def lets_pass(scene: Scene, n: int) -> bool:
    """Return whether a robot that stands at the last pose is out of everybody's way.

    What moves on for :data:`PASSING` sweeps a wall as wide as itself. A way that does
    not let an obstacle pass may drive on before it for ever.
    """
    edges, robot, settings, bodies, groups, poses = scene
    time, cos, sin = n * settings[0].tick, poses[n, 2], poses[n, 3]
    for g in range(groups.shape[0]):
        if groups[g, 5] <= STILL:
            continue
        on = PASSING / groups[g, 5]
        for i in range(int(groups[g, 7]), int(groups[g, 8])):
            x = bodies[i, 0] + bodies[i, 5] * time - poses[n, 0]
            y = bodies[i, 1] + bodies[i, 6] * time - poses[n, 1]
            x1, y1 = cos * x + sin * y, cos * y - sin * x
            x, y = x + on * bodies[i, 5], y + on * bodies[i, 6]
            x2, y2 = cos * x + sin * y, cos * y - sin * x
            if wall_contact(edges, x1, y1, x2, y2)[4] < bodies[i, 4]:
                return False
    return True


@compiled
def out_of_the_way(
    scene: Scene,
    wish: Wish,
    n: int,
    start_v: float,
    start_omega: float,
    v: float,
    omega: float,
    cost: float,
) -> tuple[float, float, float]:
    """Return a twist that lets the obstacles pass, on the way from (v, ω) to its start.

    Where there is none, (v, ω) itself at :data:`IN_THE_WAY` times its cost.
    """
    edges, robot, settings, bodies, groups, poses = scene
    tick = settings[0].tick
    for quarter in range(5):
        share = 0.25 * quarter
        u_v, u_omega = v + share * (start_v - v), omega + share * (start_omega - omega)
        drive(robot, tick, 0, n, u_v, u_omega, poses)
        if not lets_pass(scene, n):
            continue
        if quarter == 0:
            return v, omega, cost
        room, _, _, _ = least_room(
            edges, robot, tick, bodies, groups, poses, 0, n, 0.0, True, 0
        )
        if room >= 0.0:
            return u_v, u_omega, cost_of(scene, wish, u_v, u_omega)
    return v, omega, IN_THE_WAY * cost


@compiled
def way_from(
    scene: Scene, wish: Wish, n: int, v: float, omega: float, limit: float, work: Array
) -> tuple[float, float, float]:
    """Return the constant twist near (v, ω) that keeps its distance, and its cost."""
    u_v, u_omega, cost = nearest_ahead(scene, wish, n, v, omega, limit, work)
    if cost < limit:
        return out_of_the_way(scene, wish, n, v, omega, u_v, u_omega, cost)
    return u_v, u_omega, cost
