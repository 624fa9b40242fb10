"""Look-ahead: a constant twist, driven on, must keep its distance from what moves.

The row of the present sees only the present distance. It is empty where an obstacle
comes from abeam of the axle, and late where one is fast. Here the twist u = (v, ω) is
driven on in thought, obstacles keep their velocities, and at times t_k = k·tick up to
the horizon the distances d_k(u) must stay above r_min:

    d_k(ū) + ∇d_k(ū)·(u − ū) ≥ r_min,   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

linearised about ū and iterated: still a QP in two unknowns, by the same exact solver.
Which side to pass on makes the problem one with several local optima, so that it starts
from several ū, keeps the cheapest answer, and changes over only to one that is cheaper
by more than the hysteresis.

With acceleration limits u is the twist aimed at, reached from the twist last driven at
full acceleration, and what is driven is the first step of that way.

Where no constant twist keeps r_min, a plan of two twists, one after the other, is
searched: the one whose least distance is greatest, *least violation first*.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.plans import FOREVER, best_plan
from qpavoid.avoidance.prediction import (
    BODY,
    FASTEST,
    GROUP,
    POSE,
    Scene,
    bodies_in_reach,
    drive,
    group_bodies,
    least_room,
)
from qpavoid.avoidance.ways import (
    SECTORS,
    STRIDE,
    Wish,
    way_from,
)
from qpavoid.compiled import compiled
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays

STARTS = 7
"""Desired twist, straight ahead, straight back, and the corners of the box."""

ENOUGH = 3

CHEAP = 1e-3
"""(m/s)²; below this cost no other way is looked for."""

PLAN = slice(2, 7)
TARGET = slice(7, 9)
ACTIVE, DUE, START, TURN = 9, 10, 11, 12
STATE_SIZE = 13
"""Memory of a run: twist last driven (2), plan (v, ω, its time, then v, ω), twist aimed
at (2), whether that was an avoidance, and steps until the next review."""


@compiled
def fresh_state() -> Array:
    """Return the memory of a robot at rest."""
    state = np.zeros(STATE_SIZE)
    state[4] = FOREVER
    return state


@compiled
def ahead_work(obstacles: int, settings: npt.NDArray[np.void]) -> int:
    """Return how many numbers :func:`aim` wants to work with."""
    n = round(settings[0].horizon / settings[0].tick)
    return obstacles * (BODY + GROUP) + (n + 1) * (POSE + 5) + 9 * (n // STRIDE + 1) * SECTORS


@compiled
def aim(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    v: float,
    omega: float,
    state: Array,
    work: Array,
) -> tuple[float, float, float, int]:
    """Return the twist to aim at, the shortfall in m, and the obstacle that changed it.

    The desired twist where it keeps its distance (obstacle −1); else the nearest
    constant one that does; else the first of the plan with the least shortfall.
    """
    s = settings[0]
    count = obstacles[0].shape[0] + obstacles[1].shape[0] + obstacles[3].shape[0]
    bodies = work[: BODY * count].reshape(count, BODY)
    groups = work[BODY * count : (BODY + GROUP) * count].reshape(count, GROUP)
    work = work[(BODY + GROUP) * count :]
    n = round(s.horizon / s.tick)
    poses, work = work[: POSE * n + POSE].reshape(n + 1, POSE), work[POSE * n + POSE :]
    bodies = bodies[
        : bodies_in_reach(robot, settings, obstacles, age, state[0], bodies)
    ]
    groups = groups[: group_bodies(bodies, groups)]
    scene = (edges, robot, settings, bodies, groups, poses)
    poses[0, 0] = poses[0, 1] = poses[0, 3] = 0.0
    poses[0, 2], poses[0, 4], poses[0, 5] = 1.0, state[0], state[1]
    n = 0
    for g in range(groups.shape[0]):
        n = max(n, int(groups[g, 6]))
    low_v, high_v = max(robot[0], -FASTEST), min(robot[1], FASTEST)
    low_omega, high_omega = max(robot[2], -FASTEST), min(robot[3], FASTEST)
    wish_v = min(max(v, low_v), high_v)
    wish_omega = min(max(omega, low_omega), high_omega)
    wish = (low_v, high_v, low_omega, high_omega, wish_v, wish_omega)
    drive(robot, s.tick, 0, n, wish_v, wish_omega, poses)
    room, _, body, _ = least_room(edges, robot, s.tick, bodies, groups, poses, 0, n, 0.0, False, 0)
    plan = state[PLAN]
    if body < 0:
        plan[0], plan[1], plan[2], plan[3], plan[4] = (
            wish_v,
            wish_omega,
            FOREVER,
            0.0,
            0.0,
        )
        state[ACTIVE] = state[DUE] = state[START] = 0.0
        return v, omega, 0.0, -1
    v, omega, cost = cheapest_way(scene, wish, n, state, work)
    shortfall = 0.0
    state[ACTIVE] = 1.0 if cost < math.inf else 2.0
    if cost < math.inf:
        state[TURN] = 0.0
        plan[0], plan[1], plan[2] = v, omega, FOREVER
    else:
        room = best_plan(scene, wish, plan, int(state[TURN]))
        state[TURN] = state[TURN] % 3.0 + 1.0
        v, omega, shortfall = plan[0], plan[1], max(-room, 0.0)
        plan[2] -= s.dt
        if plan[2] <= 0.0:
            plan[0], plan[1], plan[2] = plan[3], plan[4], FOREVER
    state[7], state[8] = v, omega
    return v, omega, shortfall, int(bodies[body, 9])


@compiled
def cheapest_way(
    scene: Scene, wish: Wish, n: int, state: Array, work: Array
) -> tuple[float, float, float]:
    """Return the constant twist that keeps its distance at least cost, and the cost.

    The way chosen last is followed on from its twist; the others, from the desired
    twist, straight ahead, straight back and the four corners of the box, are looked at
    when it has ended, and every ``review`` seconds. The cost is that of the QP, ``inf``
    where no way is found.
    """
    s = scene[2][0]
    v = omega = 0.0
    least, due = math.inf, STARTS
    if state[ACTIVE] > 0.0:
        v, omega, least = way_from(scene, wish, n, state[7], state[8], least, work)
        least *= 1.0 - s.hysteresis
    if least < CHEAP:
        return v, omega, least
    if least < math.inf:
        state[DUE] += STARTS * s.dt / max(s.review, s.dt)
        due = int(state[DUE])
        state[DUE] -= due
    elif state[ACTIVE] == 2.0:
        due = 2
    for tried in range(due):
        if tried >= ENOUGH and least < math.inf:
            break
        start = int(state[START])
        state[START] = (start + 1) % STARTS
        if start == 0:
            start_v, start_omega = wish[4], wish[5]
        else:
            start_v = wish[1] if start < 4 else wish[0]
            start_omega = (0.0, wish[2], wish[3])[(start - 1) % 3]
        u_v, u_omega, cost = way_from(
            scene, wish, n, start_v, start_omega, least, work
        )
        if cost < least:
            v, omega, least = u_v, u_omega, cost
    return v, omega, least
