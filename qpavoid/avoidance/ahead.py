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

from qpavoid.avoidance.plans import FOREVER, SHARES, best_plan, set_plan
from qpavoid.avoidance.prediction import (
    COS,
    FASTEST,
    OMEGA,
    OWNER,
    SIN,
    Scene,
    V,
    X,
    Y,
    bodies_in_reach,
    drive,
    group_bodies,
    least_room,
)
from qpavoid.avoidance.ways import Way, Wish, most_sides, way_from
from qpavoid.compiled import allocating, compiled, compiled_once
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays
from qpavoid.qp.exact import Pair

CHEAP = 1e-3
"""(m/s)²; below this cost no other way is looked for."""

STARTS = 7
"""The desired twist, straight ahead, straight back, and the four corners of the box."""

PLAN, TARGET = slice(2, 7), 7
MODE, DUE, START, SHARE = 9, 10, 11, 12
STATE_SIZE = 13
"""Memory of a run: twist last driven (2), plan (v, ω, its time, then v, ω), twist aimed
at (2), whether that was an avoidance, steps until the next review, the next start, and
the next share of the plans."""

RETRIES = 2.0

FREE, ROUND, PLANNED = 0.0, 1.0, 2.0
"""Modes: the desired twist, another constant one, a plan."""


@allocating
def fresh_state() -> Array:
    """Return the memory of a robot at rest."""
    state = np.zeros(STATE_SIZE)
    state[4] = FOREVER
    return state


@compiled
def ahead_memory_rows(obstacles: int, settings: npt.NDArray[np.void]) -> int:
    """Return how many rows of memory :func:`aim` needs among so many obstacles.

    Bodies and groups; poses and their slopes; sides, and as many rows of the QP with
    the four limits.
    """
    n = round(settings[0].horizon / settings[0].tick)
    return int(2 * (obstacles + n + 1 + most_sides(n)) + 4)


@compiled
def look_around(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    last: Pair,
    memory: Array,
) -> tuple[Scene, int, Array]:
    """Return the scene, how many ticks to look at, and what is left of the memory."""
    most = obstacles[0].shape[0] + obstacles[1].shape[0]
    n = round(settings[0].horizon / settings[0].tick)
    poses, memory = memory[: n + 1], memory[n + 1 :]
    bodies, groups, memory = memory[:most], memory[most : 2 * most], memory[2 * most :]
    m = bodies_in_reach(robot, settings, obstacles, age, last[0], bodies)
    bodies = bodies[:m]
    count, ticks = group_bodies(settings, bodies, groups)
    poses[0, X] = poses[0, Y] = poses[0, SIN] = 0.0
    poses[0, COS], poses[0, V], poses[0, OMEGA] = 1.0, last[0], last[1]
    return (edges, robot, settings, bodies, groups[:count], poses), ticks, memory


@compiled_once
def aim(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    v: float,
    omega: float,
    state: Array,
    memory: Array,
) -> tuple[float, float, float, int]:
    """Return the twist to aim at, the shortfall in m, and the obstacle that changed it.

    The desired twist where it keeps its distance (obstacle −1); else the nearest
    constant one that does; else the first of the plan with the least shortfall.
    ``memory`` has at least :func:`ahead_memory_rows` rows of nine.
    """
    last, plan = (state[0], state[1]), state[PLAN]
    scene, n, memory = look_around(edges, robot, settings, obstacles, age, last, memory)
    box = (
        max(robot[0], -FASTEST),
        min(robot[1], FASTEST),
        max(robot[2], -FASTEST),
        min(robot[3], FASTEST),
    )
    desired = min(max(v, box[0]), box[1]), min(max(omega, box[2]), box[3])
    drive(scene, 0, n, desired[0], desired[1])
    _, _, body, _ = least_room(scene, 0, n, 0.0, False, 0)
    if body < 0:
        set_plan(plan, desired, FOREVER, desired)
        state[MODE] = FREE
        return v, omega, 0.0, -1
    owner, shortfall = int(scene[3][body, OWNER]), 0.0
    v, omega, cost = cheapest_way(scene, (box, desired, n), state, memory)
    if cost < math.inf:
        state[MODE], state[SHARE] = ROUND, 0.0
        set_plan(plan, (v, omega), FOREVER, (v, omega))
    else:
        room = best_plan(scene, box, plan, int(state[SHARE]))
        state[MODE], state[SHARE] = PLANNED, state[SHARE] % SHARES + 1.0
        v, omega, shortfall = plan[0], plan[1], max(-room, 0.0)
        plan[2] -= settings[0].dt
        if plan[2] <= 0.0:
            set_plan(plan, (plan[3], plan[4]), FOREVER, (plan[3], plan[4]))
    state[TARGET] = v
    state[TARGET + 1] = omega
    return v, omega, shortfall, owner


@compiled_once
def cheapest_way(scene: Scene, wish: Wish, state: Array, memory: Array) -> Way:
    """Return the constant twist that keeps its distance at least cost.

    The way followed so far is followed on from its twist, every step. The other starts
    are looked at, all at once, every ``review`` seconds and where that way has ended;
    where none led to a way in the step before, two a step. Cost as in the QP, less the
    hysteresis for the way so far.
    """
    s = scene[2][0]
    v = omega = 0.0
    least, due = math.inf, float(STARTS)
    if state[MODE] != FREE:
        target = (state[TARGET], state[TARGET + 1])
        v, omega, least = way_from(scene, wish, target, least, memory)
        least *= 1.0 - s.hysteresis
        if least < math.inf:
            state[DUE] -= 1.0
            due = 0.0 if state[DUE] >= 0.0 else float(STARTS)
        elif state[MODE] == PLANNED:
            due = RETRIES
    if least == math.inf or due > 0.0:
        state[DUE] = math.floor(s.review / s.dt)
    if least < CHEAP:
        return v, omega, least
    for _ in range(int(due)):
        start = start_twist(wish, int(state[START]))
        state[START] = (state[START] + 1.0) % STARTS
        u_v, u_omega, cost = way_from(scene, wish, start, least, memory)
        if cost < least:
            v, omega, least = u_v, u_omega, cost
    return v, omega, least


@compiled
def start_twist(wish: Wish, number: int) -> Pair:
    """Return one of the :data:`STARTS`."""
    box, desired, _ = wish
    if number == 0:
        return desired
    omega = (0.0, box[2], box[3])[(number - 1) % 3]
    return (box[1] if number < 4 else box[0]), omega
