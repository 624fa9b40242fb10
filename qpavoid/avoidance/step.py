"""One control step of the filter: prepare, solve, decide; else fall back.

``prepare`` looks round and ahead and writes the QP. ``decide`` solves it exactly, or
takes the answer of a back end, checks it (residual, optimality) and lets it be judged.
An answer that is not good enough is asked for once more within a trust region about a
twist that is: half and a quarter as wide. Where none will do, and where no single twist
does, a plan is driven, or the robot brakes: :mod:`qpavoid.avoidance.ladder`.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import BARRIER, constraint_rows, row_reach
from qpavoid.avoidance.bodies import Scene, bodies_in_reach, look_box
from qpavoid.avoidance.decision import (
    FILTERED,
    INVALID,
    RELAXED,
    STOPPED,
    TRACKING,
)
from qpavoid.avoidance.judge import first_twist
from qpavoid.avoidance.ladder import (
    AGAIN,
    READY,
    ROUNDING,
    WORKSPACE_TOO_SMALL,
    Outcome,
    Prepared,
    fall_back,
    judged,
)
from qpavoid.avoidance.linearisation import Meeting, linearised_rows
from qpavoid.avoidance.lookahead import Query
from qpavoid.avoidance.prediction import hold, roll_out
from qpavoid.avoidance.target import FREE, ROUND, Target, keep_plan, look_ahead
from qpavoid.avoidance.workspace import Workspace, carve, memory_size, seen_then
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.robot import GREATEST, braking_twist, twist_box
from qpavoid.qp.exact import (
    A_OMEGA,
    A_V,
    OWNER,
    B,
    Box,
    Pair,
    certificate,
    relaxation,
    solve_exactly,
)
from qpavoid.qp.solve import TOLERANCE as RESIDUAL

UNCHANGED = 1e-9
"""A twist that differs by less, in m/s and rad/s, counts as the desired one."""


TRUST = (math.inf, 0.5, 0.25)
"""Width of the trust region in every attempt, as a share of the first answer's way."""


@compiled
def clipped(twist: Pair, box: Box) -> Pair:
    """Return the nearest twist of a box."""
    v, omega = twist
    return min(max(v, box[0]), box[1]), min(max(omega, box[2]), box[3])


@compiled
def nothing(code: int) -> Outcome:
    """Return the outcome of a step that could not be taken."""
    return Outcome(code, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1)


@compiled_once
def prepare(
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
) -> Prepared:
    """Look round and ahead, and write the QP; invalid data leave ``state`` as it is."""
    s, last, obstacles = settings[0], (state[0], state[1]), (points, capsules)
    ahead = ahead and s.bound == BARRIER
    most = most_contacts(edges, obstacles)
    fits = memory.shape[0] >= memory_size(most, settings)
    space = carve(memory, most if fits else 0, settings)
    code, clearance, m, hard, count = READY, math.inf, 0, 0, 0
    box, wish = twist_box(robot, last[0], last[1], s.dt), (v, omega)
    wish = clipped(wish, (-GREATEST, GREATEST, -GREATEST, GREATEST))
    if not fits:
        code = WORKSPACE_TOO_SMALL
    else:
        obstacles = seen_then(robot, settings, obstacles, state, space)
        reach = row_reach(robot, settings, obstacles[1], age)
        n, nearest = contact_table(edges, robot[8], obstacles, reach, space.contacts)
        if nearest == -2 or not (math.isfinite(v) and math.isfinite(omega)):
            code = INVALID
        else:
            clearance = space.contacts[nearest, 4] if nearest >= 0 else math.inf
            contacts = space.contacts[:n]
            m, hard = constraint_rows(
                contacts, robot, settings, box, age, ahead, space.rows
            )
    longest = s.dt * (1.0 + s.jitter)
    scene = Scene(edges, robot, settings, space.bodies, last, space.arcs, longest, 0.0)
    if code == READY and s.bound == BARRIER:
        horizon = s.horizon if ahead else 0.0
        count = bodies_in_reach(scene, obstacles, age, horizon, space.bodies)
    scene = Scene(
        edges, robot, settings, space.bodies[:count], last, space.arcs, longest, 0.0
    )
    anchor = braking_twist(robot, last[0], last[1], s.dt)
    target = Target(hold(anchor[0], anchor[1], s.dt), FREE, 0.0, -1)
    rest = (0.0, 0.0)
    if code == READY and ahead:
        many = max(1, round(s.tick / s.dt))
        limits = look_box(robot)
        query = Query(limits, clipped(wish, limits), many)
        target = look_ahead(scene, query, state, space.tables)
        anchor = first_twist(scene, target.plan)
        if target.plan.switch >= 0.5 * s.dt and target.plan.end >= 0.5 * s.dt:
            rest = (target.plan.v - anchor[0], target.plan.omega - anchor[1])
        if target.mode == ROUND:
            m, hard = add_ahead(scene, target, query, anchor, space, m, hard)
    desired = (wish[0] - rest[0], wish[1] - rest[1])
    return Prepared(
        code,
        clearance,
        most,
        count,
        last,
        m,
        hard,
        box,
        wish,
        desired,
        rest,
        anchor,
        target,
        ahead,
    )


@compiled_once
def prepared_scene(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    prepared: Prepared,
    memory: Array,
) -> Scene:
    """Return the scene that a step was prepared for."""
    space = carve(memory, prepared.most, settings)
    bodies = space.bodies[: prepared.bodies]
    longest = settings[0].dt * (1.0 + settings[0].jitter)
    return Scene(
        edges, robot, settings, bodies, prepared.last, space.arcs, longest, 0.0
    )


@compiled_once
def add_ahead(
    scene: Scene,
    target: Target,
    query: Query,
    anchor: Pair,
    space: Workspace,
    m: int,
    hard: int,
) -> tuple[int, int]:
    """Add the rows of the last linearisation, about the target, as hard ones.

    With ``rest`` the target is u + rest, and the row a·(u + rest) ≥ b. No more is asked
    for than the anchor has.
    """
    s = scene.settings[0]
    plan = hold(target.plan.v, target.plan.omega, s.horizon + s.dt)
    rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
    about, rows = (plan.v, plan.omega), space.rows
    met, sides = Meeting(-1, 0.0), space.tables.sides
    count = linearised_rows(scene, rollout, met, sides, about, rows[m:])
    for i in range(m, m + count):
        a_v, a_omega = rows[i, A_V], rows[i, A_OMEGA]
        has = a_v * anchor[0] + a_omega * anchor[1] - ROUNDING
        b = rows[i, B] - a_v * (plan.v - anchor[0]) - a_omega * (plan.omega - anchor[1])
        rows[i, B] = min(b, has)
    return m + count, hard + count


@compiled_once
def trust_box(prepared: Prepared, attempt: int, rejected: Pair) -> Box:
    """Return the limits of an attempt: a box about the anchor, within the limits."""
    if attempt == 0:
        return prepared.box
    (v, omega), box, share = prepared.anchor, prepared.box, TRUST[attempt]
    d_v, d_omega = share * abs(rejected[0] - v), share * abs(rejected[1] - omega)
    return (
        max(box[0], v - d_v),
        min(box[1], v + d_v),
        max(box[2], omega - d_omega),
        min(box[3], omega + d_omega),
    )


@compiled_once
def decide(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    prepared: Prepared,
    memory: Array,
    attempt: int,
    rejected: Pair,
    answer: Pair,
    state: Array,
) -> Outcome:
    """Return the outcome of an attempt, or :data:`AGAIN` with the twist rejected.

    Args:
        edges: Footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.numbers`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        prepared: The QP.
        memory: That it was prepared in.
        attempt: Its number; see :data:`TRUST`.
        rejected: The twist of the first attempt.
        answer: Of a back end; infinite: there is none, the QP is solved here. NaN: it
            has failed.
        state: Brought up to date where the twist is driven.
    """
    scene = prepared_scene(edges, robot, settings, prepared, memory)
    rows = carve(memory, prepared.most, settings).rows[: prepared.m + 4]
    s, hard = settings[0], prepared.hard
    box, weights = trust_box(prepared, attempt, rejected), (s.weight_v, s.weight_omega)
    found, v, omega, slack, first, second = solve_exactly(
        rows, box, prepared.desired, weights, hard, s.slack_tolerance
    )
    if not (math.isinf(answer[0]) or math.isinf(answer[1])):
        v, omega = answer
    relaxed = relaxation(slack, s.slack_tolerance)
    violation, gap = certificate(
        rows, box, prepared.desired, weights, hard, relaxed, v, omega
    )
    residual = max(violation, gap)
    if not (found and residual <= RESIDUAL):
        return fall_back(scene, prepared, prepared.anchor, STOPPED, residual, state)
    if abs(v - prepared.wish[0]) <= UNCHANGED and abs(omega - prepared.wish[1]) <= (
        UNCHANGED
    ):
        v, omega = prepared.wish
    plan = judged(scene, prepared, (v, omega))
    if plan.end == 0.0:
        return Outcome(AGAIN, v, omega, math.inf, 0.0, 0.0, 0.0, -1, -1)
    code = TRACKING if (v, omega) == prepared.wish else FILTERED
    if slack > 0.0:
        code = RELAXED
    keep_plan(state, (v, omega), plan, s.horizon, s.dt)
    m = prepared.m
    first = int(rows[first, OWNER]) if 0 <= first < m else -1
    second = int(rows[second, OWNER]) if 0 <= second < m else -1
    if second < 0:
        second = prepared.target.owner
    if first < 0:
        first, second = second, -1
    return Outcome(
        code, v, omega, prepared.clearance, slack, residual, 0.0, first, second
    )


@compiled_once
def give_up(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    prepared: Prepared,
    memory: Array,
    rejected: Pair,
    state: Array,
) -> Outcome:
    """Do :func:`fall_back` when no attempt passes."""
    scene = prepared_scene(edges, robot, settings, prepared, memory)
    return fall_back(scene, prepared, rejected, AGAIN, 0.0, state)


@compiled
def attempts(prepared: Prepared) -> int:
    """Return how often the QP is solved at most: not where no single twist will do."""
    return len(TRUST) if prepared.target.mode <= ROUND else 0


@compiled_once
def filter_outcome(
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
) -> Outcome:
    """Return the decision of one control step, and bring ``state`` up to date.

    Invalid data leave the state as it is. ``memory`` holds :func:`memory_size` numbers;
    if fewer, the code is :data:`WORKSPACE_TOO_SMALL`.
    """
    prepared = prepare(
        edges,
        robot,
        settings,
        points,
        capsules,
        age,
        ahead,
        v,
        omega,
        state,
        memory,
    )
    if prepared.code != READY:
        return nothing(prepared.code)
    rejected, none = prepared.anchor, (math.inf, math.inf)
    for attempt in range(attempts(prepared)):
        outcome = decide(
            edges, robot, settings, prepared, memory, attempt, rejected, none, state
        )
        if outcome.code != AGAIN:
            return outcome
        if attempt == 0:
            rejected = (outcome.v, outcome.omega)
    return give_up(edges, robot, settings, prepared, memory, rejected, state)


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
) -> tuple[int, float, float, float, float, float, float, int, int]:
    """Do :func:`filter_outcome`, for Python: it takes a plain tuple much sooner."""
    o = filter_outcome(
        edges, robot, settings, points, capsules, age, ahead, v, omega, state, memory
    )
    return (
        o.code,
        o.v,
        o.omega,
        o.clearance,
        o.slack,
        o.residual,
        o.shortfall,
        o.first,
        o.second,
    )
