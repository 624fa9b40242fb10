"""One control step of the filter: look-ahead, rows, answer, check, braking."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import ahead_memory_rows, aim
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
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays
from qpavoid.model.robot import braking_twist, stopping_time, twist_box
from qpavoid.qp.exact import (
    OWNER,
    B,
    Box,
    Pair,
    certificate,
    relaxation,
    solve_exactly,
)
from qpavoid.qp.solve import TOLERANCE

UNCHANGED = 1e-9
"""A twist that differs by less, in m/s and rad/s, counts as the desired one."""

PASSES = 3
"""How often rows are tightened, and then the twist halved, before the robot brakes."""

Answer: TypeAlias = tuple[int, float, float, float, float, float, float, int, int]
"""Code, v, ω, clearance, slack, residual, shortfall, and the two active obstacles."""

NOTHING = (INVALID, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1)
CRAMPED = -2
"""Code that says that the memory is too small; see :func:`memory_rows`."""


@compiled
def memory_rows(contacts: int, settings: npt.NDArray[np.void]) -> int:
    """Return how many rows of memory a step among so many contacts needs.

    The contacts, then as many rows of the QP, four of the wheels, and four limits; then
    what the look-ahead needs.
    """
    return 2 * contacts + 8 + ahead_memory_rows(contacts, settings)


@compiled
def filter_rows(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    still_only: bool,
    last: Pair,
    contacts: Array,
    rows: Array,
) -> tuple[int, int, int, int, Box]:
    """Fill contacts and rows of this control step.

    Returns:
        How many contacts there are, which is the nearest (−1: none, −2: invalid
        obstacles), how many rows, how many of them hard, and the twists that can be
        driven next.
    """
    box = twist_box(robot, last[0], last[1], settings[0].dt)
    reach = row_reach(robot, settings, obstacles[1], age)
    n, nearest = contact_table(edges, robot[8], obstacles, reach, contacts)
    m, hard = constraint_rows(contacts[:n], robot, settings, box, age, still_only, rows)
    return n, nearest, m, hard, box


@compiled_once
def fall_back(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    yields: bool,
    last: Pair,
    v: float,
    omega: float,
    code: int,
) -> tuple[int, float, float]:
    """Return a code and a twist on the way from (v, ω) to braking that may be driven.

    The last rungs of the ladder: half, a quarter, an eighth of the way that the answer
    lies from braking; then braking; where that is standing still, holding.
    """
    known = (edges, robot, settings, obstacles, contacts, age, yields, last)
    b_v, b_omega = braking_twist(robot, last[0], last[1], settings[0].dt)
    share = 1.0 if code != STOPPED else 0.0
    for _ in range(PASSES if code != STOPPED else 0):
        share *= 0.5
        u_v, u_omega = b_v + share * (v - b_v), b_omega + share * (omega - b_omega)
        allowed, _ = may_drive(*known, u_v, u_omega)
        if allowed:
            return code, u_v, u_omega
    if code != STOPPED:
        code = HOLDING if b_v == 0.0 and b_omega == 0.0 else BRAKING
    return code, b_v, b_omega


@compiled_once
def filter_step(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    points: Array,
    capsules: Array,
    age: float,
    ahead: bool,
    v: float,
    omega: float,
    state: Array,
    memory: Array,
) -> Answer:
    """Return the decision of one control step, and bring ``state`` up to date.

    Look-ahead, rows, exact answer, its certificate and the rule of braking, in one
    compiled call. Invalid data leave the state as it is. ``memory`` has
    :func:`memory_rows` rows of nine; if fewer, the code is ``CRAMPED``.
    """
    s, last = settings[0], (state[0], state[1])
    obstacles = (points, capsules)
    ahead = ahead and s.bound == BARRIER
    most = most_contacts(edges, obstacles)
    if memory.shape[0] < memory_rows(most, settings):
        return CRAMPED, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1
    rest = memory[2 * most + 8 :]
    contacts, rows = memory[:most], memory[most : 2 * most + 8]
    n, nearest, m, hard, box = filter_rows(
        edges, robot, settings, obstacles, age, ahead, last, contacts, rows
    )
    if nearest == -2 or not (math.isfinite(v) and math.isfinite(omega)):
        return NOTHING
    contacts, rows = contacts[:n], rows[: m + 4]
    clearance = contacts[nearest, 4] if nearest >= 0 else math.inf
    target, shortfall, third = (v, omega), 0.0, -1
    if ahead:
        aim_v, aim_omega, shortfall, third = aim(
            edges, robot, settings, obstacles, age, v, omega, state, rest
        )
        target = (aim_v, aim_omega)
    problem = (box, target, (s.weight_v, s.weight_omega), hard)
    yields = s.passive != 0 and (shortfall > s.low or clearance < 0.0)
    known = (edges, robot, settings, obstacles, contacts, age, yields, last)
    allowed = False
    for _ in range(PASSES):
        found, u_v, u_omega, slack, first, second = solve_exactly(
            rows, *problem, s.slack_tolerance
        )
        relaxed = relaxation(slack, s.slack_tolerance)
        residual = max(*certificate(rows, *problem, relaxed, u_v, u_omega))
        code = FILTERED if found and residual <= TOLERANCE else STOPPED
        if code == STOPPED or not s.braking_room or s.bound != BARRIER:
            allowed = code != STOPPED
            break
        allowed, lacks = may_drive(*known, u_v, u_omega)
        if allowed:
            break
        for i in range(m - hard):
            rows[i, B] += lacks / stopping_time(robot, u_v, u_omega, s.dt)
    if not allowed:
        code, u_v, u_omega = fall_back(*known, u_v, u_omega, code)
    elif abs(u_v - v) <= UNCHANGED and abs(u_omega - omega) <= UNCHANGED:
        code, u_v, u_omega = TRACKING, v, omega
    if code in (TRACKING, FILTERED) and (slack > 0.0 or shortfall > 0.0):
        code = RELAXED
    state[0], state[1] = u_v, u_omega
    first = int(rows[first, OWNER]) if 0 <= first < m - hard else -1
    second = int(rows[second, OWNER]) if 0 <= second < m - hard else third
    if first < 0:
        first, second = second, -1
    return code, u_v, u_omega, clearance, slack, residual, shortfall, first, second
