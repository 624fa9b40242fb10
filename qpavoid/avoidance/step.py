"""One control step of the filter: look-ahead, rows, answer, check, braking."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import aim
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
from qpavoid.compiled import allocating, compiled
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays
from qpavoid.model.robot import braking_twist, stopping_time, twist_box
from qpavoid.qp.exact import (
    COLUMNS,
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

Tables: TypeAlias = tuple[Array, Array, Array, Array, Array]
"""Memory of a step: contacts (n, 9), A (n + 4, 2), b and obstacles of the rows (n + 4),
half-planes (n + 8, 5)."""

Answer: TypeAlias = tuple[int, float, float, float, float, float, float, int, int]
"""Code, v, ω, clearance, slack, residual, shortfall, and the two active obstacles."""

NOTHING = (INVALID, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1)
CRAMPED = -2


@compiled
def work_size(contacts: int) -> int:
    """Return how many numbers the tables of so many contacts take."""
    return 9 * contacts + 4 * (contacts + 4) + COLUMNS * (contacts + 8)


@allocating
def tables_in(work: Array, n: int) -> Tables:
    """Return the tables for n contacts as views of one piece of memory."""
    a = 9 * n
    b = a + 2 * (n + 4)
    c = b + n + 4
    d = c + n + 4
    contacts, A = work[:a].reshape(n, 9), work[a:b].reshape(n + 4, 2)
    planes = work[d : d + COLUMNS * (n + 8)].reshape(n + 8, COLUMNS)
    return contacts, A, work[b:c], work[c:d], planes


@compiled
def filter_rows(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    still_only: bool,
    last: Pair,
    tables: Tables,
) -> tuple[int, int, int, int, Box]:
    """Fill the tables for this control step.

    Returns:
        How many contacts there are, which is the nearest (−1: none, −2: invalid
        obstacles), how many rows, how many of them hard, and the twists that can be
        driven next.
    """
    contacts, A, b, owner, _ = tables
    box = twist_box(robot, last[0], last[1], settings[0].dt)
    reach = row_reach(robot, settings, obstacles[2], age)
    n, nearest = contact_table(edges, robot[8], obstacles, reach, contacts)
    m, hard = constraint_rows(
        contacts[:n], robot, settings, box, age, still_only, A, b, owner
    )
    return n, nearest, m, hard, box


@compiled
def fall_back(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    last: Pair,
    v: float,
    omega: float,
    code: int,
) -> tuple[int, float, float]:
    """Return a code and a twist on the way from (v, ω) to braking that may be driven.

    The last rungs of the ladder: half, a quarter, an eighth of the way that the answer
    lies from braking; then braking; where that is standing still, holding.
    """
    known = (edges, robot, settings, obstacles, contacts, age, last)
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


@compiled
def filter_step(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    ahead: bool,
    v: float,
    omega: float,
    state: Array,
    tables: Tables,
) -> Answer:
    """Return the decision of one control step, and bring ``state`` up to date.

    Look-ahead, rows, exact answer, its certificate and the rule of braking, in one
    compiled call. Invalid data leave the state as it is.
    """
    s = settings[0]
    last = (state[0], state[1])
    ahead = ahead and s.bound == BARRIER
    n, nearest, m, hard, box = filter_rows(
        edges, robot, settings, obstacles, age, ahead, last, tables
    )
    if nearest == -2 or not (math.isfinite(v) and math.isfinite(omega)):
        return NOTHING
    contacts, A, b = tables[0][:n], tables[1][:m], tables[2][:m]
    owner, planes = tables[3], tables[4][: m + 4]
    clearance = contacts[nearest, 4] if nearest >= 0 else math.inf
    target, shortfall, third = (v, omega), 0.0, -1
    if ahead:
        aim_v, aim_omega, shortfall, third = aim(
            edges, robot, settings, obstacles, age, v, omega, state
        )
        target = (aim_v, aim_omega)
    weights, soft = (s.weight_v, s.weight_omega), m - hard
    known = (edges, robot, settings, obstacles, contacts, age, last)
    allowed = False
    for _ in range(PASSES):
        found, u_v, u_omega, slack, first, second = solve_exactly(
            A, b, box, target, weights, hard, s.slack_tolerance, planes
        )
        relaxed = relaxation(slack, s.slack_tolerance)
        violation, suboptimality = certificate(
            A, b, box, target, weights, hard, relaxed, planes, u_v, u_omega
        )
        residual = max(violation, suboptimality)
        code = FILTERED if found and residual <= TOLERANCE else STOPPED
        if code == STOPPED or not s.braking_room or s.bound != BARRIER:
            allowed = code != STOPPED
            break
        allowed, lacks = may_drive(*known, u_v, u_omega)
        if allowed:
            break
        for i in range(soft):
            b[i] += lacks / stopping_time(robot, u_v, u_omega, s.dt)
    if not allowed:
        code, u_v, u_omega = fall_back(*known, u_v, u_omega, code)
    elif abs(u_v - v) <= UNCHANGED and abs(u_omega - omega) <= UNCHANGED:
        code, u_v, u_omega = TRACKING, v, omega
    if code in (TRACKING, FILTERED) and (slack > 0.0 or shortfall > 0.0):
        code = RELAXED
    state[0], state[1] = u_v, u_omega
    first = int(owner[first]) if 0 <= first < soft else -1
    second = int(owner[second]) if 0 <= second < soft else third
    if first < 0:
        first, second = second, -1
    return code, u_v, u_omega, clearance, slack, residual, shortfall, first, second


@compiled
def filter_call(
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
    work: Array,
) -> Answer:
    """Do a :func:`filter_step`, its tables in ``work``; ``CRAMPED`` if too small."""
    obstacles = (points, discs, disc_velocities, walls)
    n = most_contacts(edges, obstacles)
    if work_size(n) > work.shape[0]:
        return CRAMPED, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1
    return filter_step(
        edges,
        robot,
        settings,
        obstacles,
        age,
        ahead,
        v,
        omega,
        state,
        tables_in(work, n),
    )
