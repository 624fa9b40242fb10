"""Ways round: constant twists by linearised rows, plans of two twists by search."""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.prediction import body_contact, drive, least_room, lets_pass
from qpavoid.compiled import allocating
from qpavoid.model.footprint import Array
from qpavoid.qp.exact import solve_exactly

ROOM = 2e-3
"""m beyond r_min that the linearised rows ask for: the true distance then keeps it."""

NEAR = 0.5
"""m beyond r_min; distances above get no row in this iteration."""

ITERATIONS = 8
"""How often a way is linearised, or halved, at most."""

HALVINGS = 2
"""How often in a row the way to an answer is halved."""

HOPELESS = 3
"""The same for a way that has not yet kept its distance."""

IN_THE_WAY = 10.0
"""A way that would stand in an obstacle's way at its end is so much more expensive."""

SWITCHES = (0.1, 0.2, 0.4, 0.7, 1.1, 1.6)
"""s; when a plan of two twists may go over to its second."""

BETTER = 3e-3
"""m by which another plan must be better to be taken up."""

FOREVER = 1e9


@allocating
def ahead_rows(
    edges: Array,
    robot: Array,
    tick: float,
    bodies: Array,
    poses: Array,
    gradients: Array,
    A: Array,
    b: Array,
) -> int:
    """Fill A, b (in m) with d_k(ū) − wanted + ∇d_k·(u − ū) ≥ 0; return how many.

    ``gradients`` (2, n + 1, 5) are the derivatives of ``poses`` by v and ω; b still
    lacks A ū.
    """
    count = 0
    for i in range(bodies.shape[0]):
        body = bodies[i]
        half = 0.5 * math.sqrt((body[2] - body[0]) ** 2 + (body[3] - body[1]) ** 2)
        beyond = NEAR + body[4] + half + robot[8]
        m_x, m_y = 0.5 * (body[0] + body[2]), 0.5 * (body[1] + body[3])
        for k in range(1, int(body[7]) + 1):
            x = m_x + body[5] * tick * k - poses[k, 0]
            y = m_y + body[6] * tick * k - poses[k, 1]
            if x * x + y * y > beyond * beyond:
                continue
            touch = body_contact(edges, body, tick * k, poses[k])
            p_x, p_y, n_x, n_y, distance, _ = touch
            if distance - body[4] > NEAR:
                continue
            cos, sin = poses[k, 2], poses[k, 3]
            for j in range(2):
                g_x, g_y, turn = (
                    gradients[j, k, 0],
                    gradients[j, k, 1],
                    gradients[j, k, 4],
                )
                r_x, r_y = cos * g_x + sin * g_y, cos * g_y - sin * g_x
                A[count, j] = -n_x * (r_x - turn * p_y) - n_y * (r_y + turn * p_x)
            b[count] = body[4] - distance
            count += 1
    return count


@allocating
def nearest_ahead(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    lower: Array,
    upper: Array,
    last: Array,
    desired: Array,
    start: Array,
    bodies: Array,
    poses: Array,
) -> tuple[float, float, float]:
    """Return (v, ω) that keeps its distance at the least cost, and the cost; or inf.

    Linearised about the start and on about each answer. From a twist that keeps its
    distance the way to an answer that does not is halved.
    """
    s = settings[0]
    n, step = poses.shape[0], 1e-5
    gradients = np.empty((2, n, 5))
    A, b = np.empty((bodies.shape[0] * n, 2)), np.empty(bodies.shape[0] * n)
    rows = np.empty((bodies.shape[0] * n + 4, 9))
    box = (lower[0], upper[0], lower[1], upper[1])
    weights = (s.weight_v, s.weight_omega)
    plan = np.array([start[0], start[1], FOREVER, 0.0, 0.0])
    v = omega = 0.0
    least, halved = math.inf, 0
    for iteration in range(ITERATIONS):
        drive(robot, s.tick, last, plan, poses)
        room, _ = least_room(edges, robot, s.tick, bodies, poses, False, NEAR, -FOREVER)
        if room >= 0.0:
            halved = 0
            cost = s.weight_v * (plan[0] - desired[0]) ** 2
            cost += s.weight_omega * (plan[1] - desired[1]) ** 2
            if cost > 0.98 * least:
                break
            v, omega, least = plan[0], plan[1], cost
        elif least < math.inf and halved < HALVINGS:
            halved += 1
            plan[0], plan[1] = 0.5 * (plan[0] + v), 0.5 * (plan[1] + omega)
            continue
        elif least < math.inf or iteration >= HOPELESS:
            break
        for j in range(2):
            plan[j] += step
            drive(robot, s.tick, last, plan, gradients[j])
            plan[j] -= step
            gradients[j] -= poses
            gradients[j] /= step
        m = ahead_rows(edges, robot, s.tick, bodies, poses, gradients, A, b)
        for i in range(m):
            rows[i, 0], rows[i, 1] = A[i, 0], A[i, 1]
            rows[i, 2] = b[i] + A[i, 0] * plan[0] + A[i, 1] * plan[1] + ROOM
        found, plan[0], plan[1], _, _, _ = solve_exactly(
            rows[: m + 4], box, (desired[0], desired[1]), weights, 0, 1e-3
        )
        if not found:
            break
    return v, omega, least


@allocating
def out_of_the_way(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    last: Array,
    desired: Array,
    start: Array,
    bodies: Array,
    poses: Array,
    v: float,
    omega: float,
    cost: float,
) -> tuple[float, float, float]:
    """Return a twist that lets the obstacles pass, on the way from (v, ω) to its start.

    Where there is none, (v, ω) itself at :data:`IN_THE_WAY` times its cost.
    """
    s = settings[0]
    for quarter in range(5):
        share = 0.25 * quarter
        u_v, u_omega = v + share * (start[0] - v), omega + share * (start[1] - omega)
        holds = np.array([u_v, u_omega, FOREVER, 0.0, 0.0])
        drive(robot, s.tick, last, holds, poses)
        if not lets_pass(edges, robot, s.tick, bodies, poses):
            continue
        if quarter == 0:
            return v, omega, cost
        room, _ = least_room(edges, robot, s.tick, bodies, poses, False, 0.0, -1e-9)
        if room >= 0.0:
            moved = s.weight_v * (u_v - desired[0]) ** 2
            return u_v, u_omega, moved + s.weight_omega * (u_omega - desired[1]) ** 2
    return v, omega, IN_THE_WAY * cost


@allocating
def best_plan(
    edges: Array,
    robot: Array,
    tick: float,
    lower: Array,
    upper: Array,
    last: Array,
    bodies: Array,
    memory: Array,
    poses: Array,
) -> tuple[Array, float]:
    """Return the plan of two extreme twists with the most room, and that room in m.

    The plan last followed is kept unless another is better by :data:`BETTER`.
    """
    twists = np.empty((9, 2))
    for i in range(9):
        twists[i, 0] = (lower[0], 0.0, upper[0])[i // 3]
        twists[i, 1] = (lower[1], 0.0, upper[1])[i % 3]
    best = memory.copy()
    drive(robot, tick, last, best, poses)
    most, _ = least_room(edges, robot, tick, bodies, poses, True, FOREVER, -FOREVER)
    wanted = most + BETTER
    plan = np.empty(5)
    for i in range(9):
        for j in range(9):
            for k in range(len(SWITCHES) if i != j else 1):
                plan[:2], plan[2], plan[3:] = twists[i], SWITCHES[k], twists[j]
                drive(robot, tick, last, plan, poses)
                room, _ = least_room(
                    edges,
                    robot,
                    tick,
                    bodies,
                    poses,
                    True,
                    FOREVER,
                    wanted,
                )
                if room > wanted:
                    best[:] = plan
                    most = wanted = room
    return best, most
