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

from qpavoid.avoidance.prediction import FASTEST, bodies_in_reach, drive, least_room
from qpavoid.avoidance.ways import FOREVER, best_plan, nearest_ahead, out_of_the_way
from qpavoid.compiled import allocating
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays

CHEAP = 1e-3
"""(m/s)²; below this cost no other way is looked for."""

PLAN = slice(2, 7)
TARGET = slice(7, 9)
ACTIVE, WAIT = 9, 10
STATE_SIZE = 11
"""Memory of a run: twist last driven (2), plan (v, ω, its time, then v, ω), twist aimed
at (2), whether that was an avoidance, and steps until the next review."""


@allocating
def fresh_state() -> Array:
    """Return the memory of a robot at rest."""
    state = np.zeros(STATE_SIZE)
    state[4] = FOREVER
    return state


@allocating
def aim(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    v: float,
    omega: float,
    state: Array,
) -> tuple[float, float, float, int]:
    """Return the twist to aim at, the shortfall in m, and the obstacle that changed it.

    The desired twist where it keeps its distance (obstacle −1); else the nearest
    constant one that does; else the first of the plan with the least shortfall.
    """
    s = settings[0]
    last, plan = state[:2].copy(), state[PLAN]
    bodies, owner = bodies_in_reach(robot, settings, obstacles, age, last)
    lower = np.array([max(robot[0], -FASTEST), max(robot[2], -FASTEST)])
    upper = np.array([min(robot[1], FASTEST), min(robot[3], FASTEST)])
    desired = np.minimum(np.maximum(np.array([v, omega]), lower), upper)
    poses = np.empty((round(s.horizon / s.tick) + 1, 5))
    holds = np.array([desired[0], desired[1], FOREVER, 0.0, 0.0])
    drive(robot, s.tick, last, holds, poses)
    room, body = least_room(edges, robot, s.tick, bodies, poses, False, 0.0, -FOREVER)
    if body < 0:
        plan[:] = holds
        state[ACTIVE] = state[WAIT] = 0.0
        return v, omega, 0.0, -1
    v, omega, cost = cheapest_way(
        edges, robot, settings, lower, upper, desired, bodies, state, poses
    )
    shortfall = 0.0
    if cost < math.inf:
        plan[0], plan[1], plan[2] = v, omega, FOREVER
    else:
        best, room = best_plan(
            edges, robot, s.tick, lower, upper, last, bodies, plan, poses
        )
        plan[:] = best
        v, omega, shortfall = plan[0], plan[1], max(-room, 0.0)
        plan[2] -= s.dt
        if plan[2] <= 0.0:
            plan[0], plan[1], plan[2] = plan[3], plan[4], FOREVER
    state[TARGET] = v, omega
    state[ACTIVE] = 1.0
    return v, omega, shortfall, owner[body]


@allocating
def cheapest_way(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    lower: Array,
    upper: Array,
    desired: Array,
    bodies: Array,
    state: Array,
    poses: Array,
) -> tuple[float, float, float]:
    """Return the constant twist that keeps its distance at least cost, and the cost.

    The way chosen last is followed on from its twist; the others, from the desired
    twist, straight ahead, straight back and the four corners of the box, are looked at
    when it has ended, and every ``review`` seconds. The cost is that of the QP, ``inf``
    where no way is found.
    """
    s = settings[0]
    last, start = state[:2].copy(), np.empty(2)
    v = omega = 0.0
    least = math.inf
    for way in range(8):
        if way == 0:
            if state[ACTIVE] == 0.0:
                continue
            start[:] = state[TARGET]
        elif way == 1:
            if least < CHEAP or (least < math.inf and state[WAIT] >= 1.0):
                state[WAIT] -= 1.0
                return v, omega, least
            state[WAIT] = math.floor(s.review / s.dt)
            start[:] = desired
        else:
            start[0] = upper[0] if way < 5 else lower[0]
            start[1] = (0.0, lower[1], upper[1])[(way - 2) % 3]
        u_v, u_omega, cost = nearest_ahead(
            edges,
            robot,
            settings,
            lower,
            upper,
            last,
            desired,
            start,
            bodies,
            poses,
        )
        if way == 0:
            cost *= 1.0 - s.hysteresis
        if cost < least:
            u_v, u_omega, cost = out_of_the_way(
                edges,
                robot,
                settings,
                last,
                desired,
                start,
                bodies,
                poses,
                u_v,
                u_omega,
                cost,
            )
        if cost < least:
            v, omega, least = u_v, u_omega, cost
    return v, omega, least
