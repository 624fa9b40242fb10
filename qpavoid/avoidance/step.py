"""One control step of the filter: prepare, solve, verify; else fall back.

``prepare`` predicts and writes the QP. ``decide`` solves it exactly, or takes the
solution of a back end, certifies it and lets the judge verify its plan. A rejected
solution is solved again within a trust region about a feasible twist: a half and a
quarter as wide. If all are rejected, or no single twist is feasible, the fallback
policy decides: :mod:`qpavoid.avoidance.ladder`.
"""

import math

from qpavoid.avoidance.barrier_rows import (
    BARRIER,
    constraint_rows,
    may_be_here,
    row_reach,
    wanted_distance,
    wheel_rows,
)
from qpavoid.avoidance.bodies import bodies_in_reach
from qpavoid.avoidance.broad_phase import Meeting
from qpavoid.avoidance.decision import FILTERED, INVALID, RELAXED, STOPPED, TRACKING
from qpavoid.avoidance.judge import first_twist
from qpavoid.avoidance.ladder import (
    AGAIN,
    READY,
    ROW_ROUNDING,
    WORKSPACE_TOO_SMALL,
    Outcome,
    Prepared,
    fall_back,
    judged,
    unsolved,
)
from qpavoid.avoidance.linearisation import Tables, linearised_rows, most_sides
from qpavoid.avoidance.lookahead import Query, driven_on
from qpavoid.avoidance.prediction import Plan, hold
from qpavoid.avoidance.scene import Request, Scene, Setup, look_box
from qpavoid.avoidance.settings import FilterSettings
from qpavoid.avoidance.state import (
    END,
    FREE,
    ROUND,
    STUCK,
    FilterStateWritten,
    keep_plan,
)
from qpavoid.avoidance.tangent import turn_to_walls
from qpavoid.avoidance.target import Target, choose_target
from qpavoid.avoidance.workspace import (
    carve,
    is_counted,
    look_ticks,
    memory_size,
    new_scene,
    seen_then,
)
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.contacts import (
    CONTACT_WIDTH,
    contact_table,
    most_contacts,
    nearest_distance,
)
from qpavoid.model.robot import (
    GREATEST,
    braking_twist,
    clipped,
    limits_of,
    twist_box,
)
from qpavoid.qp.exact import (
    A_OMEGA,
    A_V,
    ROW_OWNER,
    B,
    Terms,
    certificate,
    relaxation,
    solve_exactly,
)
from qpavoid.qp.solve import RESIDUAL_TOLERANCE
from qpavoid.types import (
    Array,
    Box,
    Capsules,
    Edges,
    LimitVector,
    Pair,
    Points,
    VectorWritten,
)

SAME_TWIST = 1e-9
"""m/s and rad/s; tolerance of equal twists."""

TRUST = (math.inf, 0.5, 0.25)
"""Size of the trust region per attempt, relative to the first step from the anchor."""


@compiled
def is_near(one: Pair, other: Pair) -> bool:
    """Return whether two twists are equal, to :data:`SAME_TWIST`."""
    d_v, d_omega = abs(one[0] - other[0]), abs(one[1] - other[1])
    return d_v <= SAME_TWIST and d_omega <= SAME_TWIST


@entry_if(is_counted)
@compiled_once
def prepare(
    setup: Setup, request: Request, state: FilterStateWritten, memory: VectorWritten
) -> Prepared:
    """Predict and write the QP; invalid data leave ``state`` unchanged."""
    (edges, robot, settings), last = setup, (state[0], state[1])
    obstacles, age, ahead, desired = request
    s, most = settings[0], most_contacts(edges, obstacles)
    code, clearance, m, n_hard, old = WORKSPACE_TOO_SMALL, math.inf, 0, 0, False
    ahead = ahead and s.bound == BARRIER
    box = twist_box(robot, last[0], last[1], s.dt)
    wish = clipped(desired, Box(-GREATEST, GREATEST, -GREATEST, GREATEST))
    fits = memory.shape[0] >= memory_size(most, settings)
    # Too small: laid out for 0 contacts; the caller enlarges the memory and retries.
    space = carve(memory, most if fits else 0, settings)
    if fits:
        # From here on in the robot frame at the time when this twist takes effect.
        obstacles = seen_then(setup, obstacles, state, space)
        reach = row_reach(robot, settings, obstacles[1], age)
        radius, code = limits_of(robot).circumradius, READY
        n, nearest = contact_table(edges, radius, obstacles, reach, space.contacts)
        if nearest == -2 or not (
            math.isfinite(desired[0]) and math.isfinite(desired[1])
        ):
            code = INVALID
        else:
            clearance = nearest_distance(space.contacts, nearest)
            _, near = wanted_distance(settings, 0.0, age)
            if ahead and clearance < near:
                turn_to_walls(edges, space.contacts[:n], near)
            m = constraint_rows(
                space.contacts[:n], robot, settings, box, age, ahead, space.rows
            )
            old = s.bound == BARRIER and may_be_here(space.contacts[:n], settings, age)
            n_hard = wheel_rows(robot, space.rows[m:])
            m += n_hard
    count = 0
    if code == READY and s.bound == BARRIER and not old:
        scene = new_scene(setup, state, space, most)
        count = bodies_in_reach(scene, obstacles, age, s.horizon if ahead else 0.0)
    scene = new_scene(setup, state, space, count)
    anchor, rest = braking_twist(robot, last[0], last[1], s.dt), (0.0, 0.0)
    target = Target(hold(anchor[0], anchor[1], s.dt), FREE, 0.0, -1)
    if old:
        # The data are too old: no plan is searched, none retained.
        target, state[END] = Target(target.plan, STUCK, 0.0, -1), 0.0
    elif code == READY and ahead:
        limits, many = look_box(robot), max(1, round(s.tick / s.dt))
        query = Query(limits, clipped(wish, limits), many, space.tables)
        target = choose_target(scene, query, state)
        anchor = first_twist(scene, target.plan)
        rest = left_after(scene, target.plan, anchor)
        if target.mode == ROUND:
            more = add_ahead(scene, target, query, space.rows[m:])
            m, n_hard = m + more, n_hard + more
    # fmt: off
    return Prepared(code, clearance, most, count, m, n_hard, last, box, wish,
                    (wish[0] - rest[0], wish[1] - rest[1]), rest, anchor, target, ahead)
    # fmt: on


@compiled_once
def left_after(scene: Scene, plan: Plan, twist: Pair) -> Pair:
    """Return the difference from a twist to the first target of a plan."""
    half = 0.5 * scene.settings[0].dt
    if plan.switch < half or plan.end < half:
        return 0.0, 0.0
    return plan.v - twist[0], plan.omega - twist[1]


@compiled_once
def add_ahead(scene: Scene, target: Target, query: Query, rows: Array) -> int:
    """Add the rows of the last linearisation, about the target; return their number.

    Hard rows. With ``rest`` the target is u + rest, and the row a·(u + rest) ≥ b. They
    are relaxed to what the first twist satisfies.
    """
    anchor = first_twist(scene, target.plan)
    plan = target.plan
    rollout = driven_on(scene, query, (plan.v, plan.omega))
    tables = Tables(query.tables.sides, rows, query.tables.frames)
    count = linearised_rows(scene, rollout, Meeting(-1, 0.0), tables)
    for i in range(count):
        a_v, a_omega = rows[i, A_V], rows[i, A_OMEGA]
        has = a_v * anchor[0] + a_omega * anchor[1] - ROW_ROUNDING
        # The rows constrain the plan's target; the QP's twist is the first step to it.
        b = rows[i, B] - a_v * (plan.v - anchor[0]) - a_omega * (plan.omega - anchor[1])
        rows[i, B] = min(b, has)
    return count


@entry
@compiled_once
def is_attempt(prepared: Prepared, attempt: int) -> bool:
    """Return whether ``attempt`` is the number of an attempt."""
    return 0 <= attempt < len(TRUST)


@entry_if(is_attempt)
@compiled_once
def trust_box(prepared: Prepared, attempt: int, rejected: Pair) -> Box:
    """Return the limits of an attempt: the trust region within the box."""
    if attempt == 0:
        return prepared.box
    box, share = prepared.box, TRUST[attempt]
    v, omega = clipped(prepared.anchor, box)
    d_v, d_omega = share * abs(rejected[0] - v), share * abs(rejected[1] - omega)
    return Box(
        max(box.v_min, v - d_v),
        min(box.v_max, v + d_v),
        max(box.omega_min, omega - d_omega),
        min(box.omega_max, omega + d_omega),
    )


@entry
@compiled
def attempts(prepared: Prepared) -> int:
    """Return the number of attempts; 0 if no single twist is feasible."""
    return len(TRUST) if prepared.target.mode <= ROUND else 0


@entry
@compiled_once
def is_prepared(
    setup: Setup, prepared: Prepared, memory: VectorWritten, attempt: int
) -> bool:
    """Return whether the memory fits what was prepared in it."""
    if not is_counted(setup.edges, setup.robot, setup.settings):
        return False
    most, m, given = prepared.most, prepared.m, memory.shape[0]
    if not (prepared.code == READY and 0 <= most <= given // CONTACT_WIDTH):
        return False
    counts = 0 <= prepared.n_hard <= m and 0 <= prepared.bodies <= most
    rows = most + most_sides(look_ticks(setup.settings)) + 4
    fits: bool = given >= memory_size(most, setup.settings) and m <= rows
    return counts and fits and attempt >= 0


@entry_if(is_prepared)
@compiled_once
def decide(
    setup: Setup,
    prepared: Prepared,
    memory: VectorWritten,
    attempt: int,
    rejected: Pair,
    answer: Pair,
    state: FilterStateWritten,
) -> Outcome:
    """Return the outcome of an attempt, or :data:`AGAIN` with the rejected twist.

    Args:
        setup: Footprint, limits and settings.
        prepared: The QP.
        memory: In which it was prepared.
        attempt: Its number, see :data:`TRUST`; after the last one the fallbacks follow.
        rejected: Twist of the first attempt.
        answer: Of a back end; infinite: none, the QP is solved here; NaN: it failed.
        state: Updated if the twist is driven.
    """
    s, space = setup.settings[0], carve(memory, prepared.most, setup.settings)
    scene = new_scene(setup, state, space, prepared.bodies)
    if attempt >= attempts(prepared):
        return fall_back(scene, prepared, unsolved(AGAIN, rejected, 0.0), state)
    rows, n_hard, desired = (
        space.rows[: prepared.m + 4],
        prepared.n_hard,
        prepared.desired,
    )
    box, weights = trust_box(prepared, attempt, rejected), (s.weight_v, s.weight_omega)
    terms = Terms(box, desired, weights, n_hard)
    solved = solve_exactly(rows, terms, s.slack_tolerance)
    twist, slack = (solved.v, solved.omega), solved.slack
    if not (math.isinf(answer[0]) or math.isinf(answer[1])):
        twist = answer
    relaxed = relaxation(slack, s.slack_tolerance)
    violation, gap = certificate(rows, terms, relaxed, twist)
    residual = max(violation, gap)
    if not (solved.found and residual <= RESIDUAL_TOLERANCE):
        failed = unsolved(STOPPED, prepared.anchor, residual)
        return fall_back(scene, prepared, failed, state)
    # A solver's rounding: the anchor is verified, and the desired twist is `tracking`.
    if is_near(twist, prepared.anchor):
        twist = prepared.anchor
    if is_near(twist, prepared.wish):
        twist = prepared.wish
    plan = judged(scene, prepared, twist)
    if plan.end == 0.0:
        return unsolved(AGAIN, twist if attempt == 0 else rejected, 0.0)
    code = TRACKING if twist == prepared.wish else FILTERED
    if slack > 0.0:
        code = RELAXED
    keep_plan(state, twist, plan, s.horizon, s.dt)
    first, second = holders(rows, prepared, solved.first, solved.second)
    (v, omega), clearance = twist, prepared.clearance
    return Outcome(code, v, omega, clearance, slack, residual, 0.0, first, second)


@compiled_once
def holders(rows: Array, prepared: Prepared, one: int, other: int) -> tuple[int, int]:
    """Return the obstacles of the active rows, and of the target; −1: none."""
    m = prepared.m
    first = int(rows[one, ROW_OWNER]) if 0 <= one < m else -1
    second = int(rows[other, ROW_OWNER]) if 0 <= other < m else -1
    if second < 0:
        second = prepared.target.owner
    return (first, second) if first >= 0 else (second, -1)


@compiled_once
def filter_outcome(
    setup: Setup, request: Request, state: Array, memory: Array
) -> Outcome:
    """Return the outcome of one control step, and update ``state``.

    Invalid data leave the state unchanged. ``memory`` holds :func:`memory_size`
    numbers; if fewer, the code is :data:`WORKSPACE_TOO_SMALL`.
    """
    prepared = prepare(setup, request, state, memory)
    outcome = unsolved(prepared.code, (0.0, 0.0), 0.0)
    rejected, none = prepared.anchor, (math.inf, math.inf)
    for attempt in range(attempts(prepared) + 1 if prepared.code == READY else 0):
        outcome = decide(setup, prepared, memory, attempt, rejected, none, state)
        if outcome.code != AGAIN:
            break
        rejected = (outcome.v, outcome.omega)
    return outcome


@entry_if(is_counted)
@compiled_once
def filter_step(
    edges: Edges,
    robot: LimitVector,
    settings: FilterSettings,
    points: Points,
    capsules: Capsules,
    age: float,
    ahead: bool,
    v: float,
    omega: float,
    state: FilterStateWritten,
    memory: VectorWritten,
) -> tuple[int, float, float, float, float, float, float, int, int]:
    """Return the fields of :func:`filter_outcome`, for Python.

    Plain arguments and a plain tuple: records would take twice as long.
    """
    setup = Setup(edges, robot, settings)
    request = Request((points, capsules), age, ahead, (v, omega))
    o = filter_outcome(setup, request, state, memory)
    # fmt: off
    return (o.code, o.v, o.omega, o.clearance, o.slack, o.residual, o.shortfall,
            o.first, o.second)
    # fmt: on
