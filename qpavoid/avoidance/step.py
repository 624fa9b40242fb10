"""One control step of the filter: look-ahead, rows, answer, check, braking."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import ahead_work, aim
from qpavoid.avoidance.braking import may_drive
from qpavoid.avoidance.decision import (
    BRAKING,
    FILTERED,
    HOLDING,
    INVALID,
    RELAXED,
    STOPPED,
    TRACKING,
)
from qpavoid.avoidance.rows import BARRIER, constraint_rows, row_reach
from qpavoid.compiled import compiled
from qpavoid.model.contact import Names, contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays
from qpavoid.model.robot import braking_twist, stopping_time, twist_box
from qpavoid.qp.exact import certificate, relaxation, solve_exactly
from qpavoid.qp.solve import TOLERANCE

UNCHANGED = 1e-9
"""A twist that differs by less, in m/s and rad/s, counts as the desired one."""

PASSES = 3
"""How often rows are tightened, and then the twist halved, before the robot brakes."""

Rows: TypeAlias = tuple[
    bool, Array, Array, Names, int, Array, Array, float, Names, Array
]
"""Valid, A, b, obstacle of each row, how many are hard, lower, upper, clearance, and
the obstacles and segments within reach, and their distances."""

Answer: TypeAlias = tuple[int, float, float, float, float, float, float, int, int]
"""Code, v, ω, clearance, slack, residual, shortfall, and the two active obstacles."""

NOTHING = (INVALID, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1)


@compiled
def filter_rows(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    still_only: bool,
    last: Array,
) -> Rows:
    """Return the rows and limits of this control step; see :data:`Rows`."""
    points, discs, disc_velocities, walls = obstacles
    box = twist_box(robot, last[0], last[1], settings[0].dt)
    lower, upper = np.array([box[0], box[2]]), np.array([box[1], box[3]])
    reach = row_reach(robot, settings, disc_velocities, age)
    numbers, names, nearest = contact_table(
        edges, robot[8], points, discs, disc_velocities, walls, reach
    )
    valid = nearest != -2
    if not valid:
        numbers, names = numbers[:0], names[:0]
    clearance = numbers[nearest, 4] if valid and nearest >= 0 else math.inf
    A, b, owner, hard = constraint_rows(
        numbers, names, robot, settings, lower, upper, age, still_only
    )
    far = numbers[:, 4].copy()
    return valid, A, b, owner, hard, lower, upper, clearance, names, far


@compiled
def fall_back(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    names: Names,
    distances: Array,
    age: float,
    last: Array,
    v: float,
    omega: float,
    code: int,
) -> tuple[int, float, float]:
    """Return a code and a twist on the way from (v, ω) to braking that may be driven.

    The last rungs of the ladder: half, a quarter, an eighth of the way that the answer
    lies from braking; then braking; where that is standing still, holding.
    """
    b_v, b_omega = braking_twist(robot, last[0], last[1], settings[0].dt)
    share = 1.0 if code != STOPPED else 0.0
    for _ in range(PASSES if code != STOPPED else 0):
        share *= 0.5
        u_v, u_omega = b_v + share * (v - b_v), b_omega + share * (omega - b_omega)
        allowed, _ = may_drive(
            edges, robot, settings, obstacles, names, distances, age, last, u_v, u_omega
        )
        if allowed:
            return code, u_v, u_omega
    if code != STOPPED:
        code = HOLDING if b_v == 0.0 and b_omega == 0.0 else BRAKING
    return code, b_v, b_omega


@compiled
def filter_step(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    points: Array,
    discs: Array,
    disc_velocities: Array,
    walls: Array,
    age: float,
    ahead: bool,
    v: float,
    omega: float,
    state: Array,
) -> Answer:
    """Return the decision of one control step, and bring ``state`` up to date.

    Look-ahead, rows, exact answer, its certificate and the rule of braking, in one
    compiled call. Invalid data leave the state as it is.
    """
    s = settings[0]
    obstacles = (points, discs, disc_velocities, walls)
    ahead = ahead and s.bound == BARRIER
    valid, A, b, owner, hard, lower, upper, clearance, names, far = filter_rows(
        edges, robot, settings, obstacles, age, ahead, state
    )
    if not (valid and math.isfinite(v) and math.isfinite(omega)):
        return NOTHING
    aim_v, aim_omega, shortfall, third = v, omega, 0.0, -1
    if ahead:
        count = points.shape[0] + discs.shape[0] + walls.shape[0]
        work = np.empty(ahead_work(count, settings))
        aim_v, aim_omega, shortfall, third = aim(
            edges, robot, settings, obstacles, age, v, omega, state, work
        )
    target = np.array([aim_v, aim_omega])
    weights = np.array([s.weight_v, s.weight_omega])
    last, soft = state[:2].copy(), b.shape[0] - hard
    allowed = False
    for _ in range(PASSES):
        found, u_v, u_omega, slack, first, second = solve_exactly(
            A, b, lower, upper, target, weights, hard, s.slack_tolerance
        )
        eased = b.copy()
        eased[:soft] -= relaxation(slack, s.slack_tolerance)
        residual = max(
            certificate(A, eased, lower, upper, target, weights, hard, u_v, u_omega)
        )
        code = FILTERED if found and residual <= TOLERANCE else STOPPED
        if code == STOPPED or not s.braking_room or s.bound != BARRIER:
            allowed = code != STOPPED
            break
        allowed, lacks = may_drive(
            edges, robot, settings, obstacles, names, far, age, last, u_v, u_omega
        )
        if allowed:
            break
        b[:soft] += lacks / stopping_time(robot, u_v, u_omega, s.dt)
    if not allowed:
        code, u_v, u_omega = fall_back(
            edges, robot, settings, obstacles, names, far, age, last, u_v, u_omega, code
        )
    elif abs(u_v - v) <= UNCHANGED and abs(u_omega - omega) <= UNCHANGED:
        code, u_v, u_omega = TRACKING, v, omega
    if code in (TRACKING, FILTERED) and (slack > 0.0 or shortfall > 0.0):
        code = RELAXED
    state[0], state[1] = u_v, u_omega
    first = owner[first] if 0 <= first < soft else -1
    second = owner[second] if 0 <= second < soft else third
    if first < 0:
        first, second = second, -1
    return code, u_v, u_omega, clearance, slack, residual, shortfall, first, second
