"""One control step of the filter: prepare, solve, decide; else fall back.

``prepare`` looks round and ahead and writes the QP. ``decide`` solves it exactly, or
takes the answer of a back end, checks it (residual, optimality) and lets it be judged.
An answer that is not good enough is asked for once more within a trust region about a
twist that is: half and a quarter as wide, and at last that twist itself. So the QP that
is solved last is always the one whose solution is driven.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.barrier_rows import BARRIER, constraint_rows, row_reach
from qpavoid.avoidance.decision import (
    BRAKING,
    FILTERED,
    HOLDING,
    INVALID,
    PLANNED,
    RELAXED,
    STOPPED,
    TRACKING,
)
from qpavoid.avoidance.judge import (
    clear_end,
    first_twist,
    follow,
    is_inexact,
    keeps_from_standing,
    lowest,
    may_brake,
    moving_room,
    rests_in_time,
    room_to_brake,
)
from qpavoid.avoidance.lookahead import (
    SIDE,
    Query,
    Tables,
    linearised_rows,
    most_sides,
)
from qpavoid.avoidance.plans import ALIKE
from qpavoid.avoidance.prediction import (
    ARC,
    BODY,
    KEEP,
    KIND,
    MOVES,
    TOLERANCE,
    TOUCH,
    Plan,
    Scene,
    bodies_in_reach,
    hold,
    look_box,
    most_arcs,
    roll_out,
)
from qpavoid.avoidance.target import (
    CARRIED,
    END,
    FREE,
    ROUND,
    STUCK,
    UNTIL,
    Target,
    frame_of_effect,
    keep_plan,
    kept_plan,
    look_ahead,
)
from qpavoid.avoidance.target import PLANNED as BY_PLAN
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import CAPSULE_WIDTH, Arrays, in_robot_frame, join_walls
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.robot import GREATEST, braking_twist, twist_box
from qpavoid.qp.exact import (
    A_OMEGA,
    A_V,
    OWNER,
    WIDTH,
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

TRUST = (math.inf, 0.5, 0.25, 0.0)
"""Width of the trust region in every attempt, as a share of the first answer's way."""

ROUNDING = 1e-9
"""m/s; what the rows of the look-ahead leave to a twist that just keeps them."""

READY, AGAIN, WORKSPACE_TOO_SMALL = 100, -3, -2
"""Codes beside those of the statuses: the QP is written; a smaller trust region is
wanted; the memory is too small, see :func:`memory_size`."""


class Prepared(NamedTuple):
    """What is known before the QP is solved.

    Attributes:
        code: :data:`READY`, or why not.
        clearance: Of the nearest obstacle, m.
        most: Contacts for which the memory is carved.
        bodies: How many of them are in reach.
        last: Twist driven last.
        m: How many rows the QP has.
        hard: How many of them, the last, are never relaxed.
        box: Twists that can be driven next.
        wish: The twist that is desired.
        desired: The same, for the QP: less by ``rest``.
        rest: Of the way to the twist aimed at, what is left after this step.
        anchor: A twist that is good enough, the middle of the trust regions.
        target: What is aimed at.
        ahead: Whether it was looked ahead.
    """

    code: int
    clearance: float
    most: int
    bodies: int
    last: Pair
    m: int
    hard: int
    box: Box
    wish: Pair
    desired: Pair
    rest: Pair
    anchor: Pair
    target: Target
    ahead: bool


class Outcome(NamedTuple):
    """What a control step gives.

    Attributes:
        code: Number of the status.
        v: m/s.
        omega: rad/s.
        clearance: Of the nearest obstacle, m.
        slack: By which rows were relaxed, m/s.
        residual: Of the check of the answer.
        shortfall: By how much r_min will be undercut by what moves, m.
        first: Obstacle that holds the twist; −1: none.
        second: Another one.
    """

    code: int
    v: float
    omega: float
    clearance: float
    slack: float
    residual: float
    shortfall: float
    first: int
    second: int


class Workspace(NamedTuple):
    """Memory of a control step, carved out of one array.

    Attributes:
        contacts: (n, 9) of all obstacles.
        rows: Of the QP.
        bodies: In reach.
        arcs: Of a rollout.
        tables: Of the look-ahead.
        points: As seen when the twist takes effect.
        capsules: The same, walls in one piece.
    """

    contacts: Array
    rows: Array
    bodies: Array
    arcs: Array
    tables: Tables
    points: Array
    capsules: Array


@compiled
def look_ticks(settings: npt.NDArray[np.void]) -> int:
    """Return how many ticks the horizon has."""
    return round(settings[0].horizon / settings[0].tick)


@compiled
def memory_size(contacts: int, settings: npt.NDArray[np.void]) -> int:
    """Return how many numbers of memory a step among so many contacts needs."""
    sides = most_sides(look_ticks(settings))
    rows = contacts + sides + 8 + sides + 4
    tables = contacts * BODY + most_arcs(settings) * ARC + sides * SIDE
    seen = contacts * (2 + CAPSULE_WIDTH)
    return int((contacts + rows) * WIDTH + tables + seen)


@compiled
def carve(memory: Array, contacts: int, settings: npt.NDArray[np.void]) -> Workspace:
    """Return the memory as the tables of a step."""
    sides, arcs = most_sides(look_ticks(settings)), most_arcs(settings)
    a = contacts * WIDTH
    b = a + (contacts + sides + 8) * WIDTH
    c = b + (sides + 4) * WIDTH
    d = c + contacts * BODY
    e = d + arcs * ARC
    f = e + sides * SIDE
    g = f + 2 * contacts
    h = g + CAPSULE_WIDTH * contacts
    inner = memory[b:c].reshape(sides + 4, WIDTH)
    return Workspace(
        memory[:a].reshape(contacts, WIDTH),
        memory[a:b].reshape(contacts + sides + 8, WIDTH),
        memory[c:d].reshape(contacts, BODY),
        memory[d:e].reshape(arcs, ARC),
        Tables(memory[e:f].reshape(sides, SIDE), inner),
        memory[f:g].reshape(contacts, 2),
        memory[g:h].reshape(contacts, CAPSULE_WIDTH),
    )


@compiled_once
def seen_then(
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    state: Array,
    space: Workspace,
) -> Arrays:
    """Return the obstacles as they are seen when the next twist takes effect."""
    points, capsules = obstacles
    count = join_walls(capsules, space.capsules)
    capsules = space.capsules[:count]
    if settings[0].delay == 0.0:
        return points, capsules
    at = frame_of_effect(robot, settings, state)
    heading, seen = math.atan2(at.sin, at.cos), space.points[: points.shape[0]]
    now, then = (points, capsules), (seen, capsules)
    in_robot_frame(at.x, at.y, heading, settings[0].delay, now, then)
    return then


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
        if target.mode != FREE and target.mode != STUCK:
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


@compiled
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
    plan, s = target.plan, scene.settings[0]
    if target.mode == ROUND:
        plan = hold(plan.v, plan.omega, s.horizon + s.dt)
    rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
    about, rows = (plan.v, plan.omega), space.rows
    count = linearised_rows(scene, rollout, space.tables.sides, about, rows[m:])
    for i in range(m, m + count):
        a_v, a_omega = rows[i, A_V], rows[i, A_OMEGA]
        has = a_v * anchor[0] + a_omega * anchor[1] - ROUNDING
        b = rows[i, B] - a_v * (plan.v - anchor[0]) - a_omega * (plan.omega - anchor[1])
        rows[i, B] = min(b, has)
    return m + count, hard + count


@compiled
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
        return fall_back(scene, prepared, prepared.anchor, STOPPED, state)
    if abs(v - prepared.wish[0]) <= UNCHANGED and abs(omega - prepared.wish[1]) <= (
        UNCHANGED
    ):
        v, omega = prepared.wish
    verdict = judged(scene, prepared, (v, omega))
    if not verdict.passes:
        return Outcome(AGAIN, v, omega, math.inf, 0.0, 0.0, 0.0, -1, -1)
    code, shortfall = FILTERED, 0.0
    if verdict.room < lowest(scene):
        shortfall = -verdict.room
    if (v, omega) == prepared.wish:
        code = TRACKING
    if prepared.target.mode >= BY_PLAN:
        code = PLANNED
    if slack > 0.0 or shortfall > 0.0:
        code = RELAXED
    until = s.horizon if prepared.target.mode != CARRIED else state[UNTIL]
    keep_plan(state, (v, omega), verdict.plan, until, s.dt)
    m = prepared.m
    first = int(rows[first, OWNER]) if 0 <= first < m else -1
    second = int(rows[second, OWNER]) if 0 <= second < m else -1
    if second < 0:
        second = prepared.target.owner
    if first < 0:
        first, second = second, -1
    return Outcome(
        code, v, omega, prepared.clearance, slack, residual, shortfall, first, second
    )


class Verdict(NamedTuple):
    """What the judge says of a twist.

    Attributes:
        passes: Whether it may be driven.
        plan: That it begins.
        room: Least room of what moves, m; 0 for a plan that keeps clear.
    """

    passes: bool
    plan: Plan
    room: float


@compiled_once
def judged(scene: Scene, prepared: Prepared, twist: Pair) -> Verdict:
    """Judge a twist with the rest of what it is the beginning of."""
    s, target, (v, omega) = scene.settings[0], prepared.target, twist
    plan, room = hold(v, omega, s.dt), 0.0
    if s.bound != BARRIER or not s.braking_room:
        return Verdict(True, plan, room)
    aimed = (v + prepared.rest[0], omega + prepared.rest[1])
    if not prepared.ahead:
        passes = may_brake(scene, twist)
    elif target.mode < BY_PLAN:
        end = clear_end(scene, aimed, twist)
        plan, passes = hold(aimed[0], aimed[1], max(end, s.dt)), end > 0.0
    else:
        plan = target.plan
        rollout, level = follow(scene, plan, twist), lowest(scene)
        passes = keeps_from_standing(scene, rollout, 0.0, level)
        passes = passes and (not is_inexact(scene) or may_brake(scene, twist))
        if target.room < level:
            room = moving_room(scene, rollout, 1.0)
            passes = passes and room >= target.room - ALIKE
    if passes and prepared.clearance <= 0.0:
        passes = leaves_contact(scene, twist)
    if passes and s.passive and (room < -s.low or prepared.clearance <= 0.0):
        passes = rests_in_time(scene, twist) or not rests_in_time(
            scene, braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
        )
    return Verdict(passes, plan, room)


@compiled_once
def leaves_contact(scene: Scene, twist: Pair) -> bool:
    """Return whether a twist leads out of what stands and is touched, or stays."""
    if twist == (0.0, 0.0):
        return True
    s = scene.settings[0]
    rollout = follow(scene, hold(twist[0], twist[1], s.dt), twist)
    for i in range(scene.bodies.shape[0]):
        touched = scene.bodies[i, KEEP] - TOLERANCE < scene.bodies[i, TOUCH]
        if scene.bodies[i, KIND] != MOVES and touched:
            span = (s.dt, max(rollout.rest, s.dt))
            near, _ = too_near(scene, rollout, i, span, ROUNDING - TOLERANCE)
            if near:
                return False
    return True


@compiled_once
def fall_back(
    scene: Scene, prepared: Prepared, rejected: Pair, code: int, state: Array
) -> Outcome:
    """Return the last rungs of the ladder.

    The rest of the last plan where that keeps clear of what stands, and braking either
    does not or meets sooner what moves; braking where that keeps clear. Else, where
    what stands has come nearer than it was, ``rejected`` if it leaves no less room than
    braking, and braking.
    """
    s, level, kept = scene.settings[0], lowest(scene), kept_plan(state)
    brake = braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
    stop = hold(brake[0], brake[1], s.dt)
    braked = room_to_brake(scene, brake)
    room, until = moving_room(scene, follow(scene, stop, brake), 0.0), 0.0
    twist, plan = brake, stop
    if state[END] > 0.5 * s.dt and not is_inexact(scene):
        u = first_twist(scene, kept)
        rollout = follow(scene, kept, u)
        if keeps_from_standing(scene, rollout, 0.0, level):
            other = moving_room(scene, rollout, 0.0)
            if braked < level or other > room + ALIKE:
                twist, plan, room, until = u, kept, other, state[UNTIL]
                code = PLANNED if code != STOPPED else code
                braked = level
    if braked < level and code != STOPPED and not is_inexact(scene):
        if room_to_brake(scene, rejected) >= braked - ROUNDING:
            twist, plan, code = rejected, hold(rejected[0], rejected[1], s.dt), FILTERED
    if code == AGAIN:
        code = HOLDING if twist == (0.0, 0.0) else BRAKING
    shortfall = -room if room < level else 0.0
    keep_plan(state, twist, plan, until, s.dt)
    return Outcome(
        code,
        twist[0],
        twist[1],
        prepared.clearance,
        0.0,
        0.0,
        shortfall,
        prepared.target.owner,
        -1,
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
    return fall_back(scene, prepared, rejected, AGAIN, state)


@compiled
def first_attempt(prepared: Prepared) -> int:
    """Return the number of the first attempt: a plan is driven as it was found."""
    if prepared.target.mode == STUCK:
        return len(TRUST)
    return 0 if prepared.target.mode < BY_PLAN else len(TRUST) - 1


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
    for attempt in range(first_attempt(prepared), len(TRUST)):
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
    """Return what :func:`filter_outcome` does, as a plain tuple: Python takes it sooner."""
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
