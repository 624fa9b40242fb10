"""One control step of the filter: the plan is selected, its first twist driven.

The obstacles are those at the time when the twist takes effect. Every QP is stated for
a target twist; with limited accelerations the first step towards it is driven. All
memory of a step is one array, see :class:`Workspace`.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import (
    BODY,
    BODY_SIZE,
    FEW,
    Request,
    Scene,
    Setup,
    bodies_in_reach,
    look_box,
    threshold,
    with_bodies,
)
from qpavoid.avoidance.cbf_rows import (
    BARRIER,
    constraint_rows,
    is_too_old,
    required_distance,
    row_reach,
    turn_to_walls,
)
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
from qpavoid.avoidance.plan import (
    ARC,
    ARC_SIZE,
    BRAKED,
    KEPT,
    PENDING,
    FilterStateWritten,
    frame_of_effect,
    hold,
    keep_plan,
    most_arcs,
    pending_sums,
)
from qpavoid.avoidance.proposals import (
    FRAME,
    FRAME_SIZE,
    PREDICTED,
    PREDICTED_SIZE,
    SEPARATION,
    Problem,
    Query,
    most_predicted,
    qp_of,
    row_violation,
    snapped,
    solution,
)
from qpavoid.avoidance.selection import Choice, fallback, select, select_now
from qpavoid.avoidance.settings import MOST_PENDING, FilterSettings
from qpavoid.avoidance.verdict import first_twist, verdict
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.capsules import CAPSULE_WIDTH, in_robot_frame, join_walls
from qpavoid.model.contacts import (
    CONTACT,
    CONTACT_SIZE,
    contact_table,
    most_contacts,
)
from qpavoid.model.robot import (
    GREATEST,
    RELATIVE_ROUNDING,
    clipped,
    limits_of,
    twist_box,
)
from qpavoid.qp.exact import (
    A_V,
    ROW_OWNER,
    ROW_WIDTH,
    B,
    Optimum,
    Terms,
    certificate,
    relaxation,
)
from qpavoid.qp.solve import RESIDUAL_TOLERANCE
from qpavoid.types import (
    Array,
    Arrays,
    Box,
    Capsules,
    Edges,
    LimitVector,
    Pair,
    Points,
    Table,
    VectorWritten,
)


class Workspace(NamedTuple):
    """Memory of a control step, as views of one array.

    Attributes:
        contacts: Memory of the contacts of all obstacles.
        rows: Of the QP.
        bodies: In reach.
        groups: Of bodies.
        arcs: Of a rollout.
        predicted: Predicted contacts.
        points: In the robot frame when the twist takes effect.
        capsules: In that frame, with joined walls.
        closer: Bodies of :func:`qpavoid.avoidance.selection.at_min_clearance`.
        frames: Robot frames at the ticks.
        problem: See :func:`qpavoid.avoidance.step.set_problem`.
    """

    contacts: Array
    rows: Array
    bodies: Table
    groups: Table
    arcs: Table
    predicted: Table
    points: Array
    capsules: Array
    closer: Table
    frames: Table
    problem: Array


PROBLEM_SIZE = 8
"""Numbers of a QP besides its rows."""

MOST_TICKS = 1e6
"""Greatest number of control steps or ticks of a horizon."""


@entry
@compiled_once
def has_valid_sizes(edges: Edges, robot: LimitVector, settings: FilterSettings) -> bool:
    """Return whether the settings give a valid layout of the memory."""
    s = settings[0]
    ticks = 0.0 < s.tick and s.horizon <= MOST_TICKS * s.tick
    steps = 0.0 < s.dt and 0.0 <= s.horizon <= MOST_TICKS * s.dt
    pending = 0.0 <= s.delay <= MOST_PENDING * s.dt * (1.0 + RELATIVE_ROUNDING)
    counted: bool = ticks and steps and pending and 0.0 <= s.jitter < math.inf
    return counted


@entry
@compiled
def look_ticks(settings: FilterSettings) -> int:
    """Return the number of ticks of the horizon."""
    ticks: int = round(settings[0].horizon / settings[0].tick)
    return ticks


@entry
@compiled_once
def memory_size(contacts: int, settings: FilterSettings) -> int:
    """Return the numbers of memory that a step with so many contacts needs."""
    # The sizes of `workspace_in`: 8 rows more for the four of the wheels and the four
    # limits of the solver. A float: an int of C could overflow.
    predicted, many = most_predicted(look_ticks(settings)), float(contacts)
    rows = many + predicted + 8
    tables = (2.0 * many + contacts // FEW) * BODY_SIZE
    tables += most_arcs(settings) * ARC_SIZE + predicted * PREDICTED_SIZE
    tables += (look_ticks(settings) + 1) * FRAME_SIZE
    each = CONTACT_SIZE + 2 + CAPSULE_WIDTH
    return int(many * each + rows * ROW_WIDTH + tables + PROBLEM_SIZE)


@compiled_once
def workspace_in(
    memory: Array, contacts: int, settings: npt.NDArray[np.void]
) -> Workspace:
    """Return the memory as the tables of a step."""
    predicted, arcs = most_predicted(look_ticks(settings)), most_arcs(settings)
    a = contacts * CONTACT_SIZE
    b = a + (contacts + predicted + 8) * ROW_WIDTH
    d = b + contacts * BODY_SIZE
    e = d + contacts // FEW * BODY_SIZE
    f = e + arcs * ARC_SIZE
    g = f + predicted * PREDICTED_SIZE
    h = g + 2 * contacts
    i = h + CAPSULE_WIDTH * contacts
    j = i + contacts * BODY_SIZE
    end = j + (look_ticks(settings) + 1) * FRAME_SIZE
    return Workspace(
        memory[:a],
        memory[a:b].reshape(contacts + predicted + 8, ROW_WIDTH),
        memory[b:d].view(BODY),
        memory[d:e].view(BODY),
        memory[e:f].view(ARC),
        memory[f:g].view(PREDICTED),
        memory[g:h].reshape(contacts, 2),
        memory[h:i].reshape(contacts, CAPSULE_WIDTH),
        memory[i:j].view(BODY),
        memory[j:end].view(FRAME),
        memory[end : end + PROBLEM_SIZE],
    )


@compiled
def new_scene(setup: Setup, state: Array, space: Workspace, clearance: float) -> Scene:
    """Return the scene of a control step, with memory for the bodies."""
    (edges, robot, settings), s = setup, setup.settings[0]
    last, pending = (state[0], state[1]), pending_sums(settings, state)
    longest = s.dt * (1.0 + s.jitter)
    # fmt: off
    return Scene(edges, robot, settings, space.bodies, last, pending,
                 space.arcs, space.groups, longest, 0.0, clearance)
    # fmt: on


@compiled_once
def obstacles_at_effect(
    setup: Setup, obstacles: Arrays, state: Array, space: Workspace
) -> Arrays:
    """Return the obstacles in the robot frame when the next twist takes effect."""
    (_, robot, settings), (points, capsules) = setup, obstacles
    count = join_walls(capsules, space.capsules)
    capsules = space.capsules[:count]
    if settings[0].delay == 0.0:
        return points, capsules
    at = frame_of_effect(robot, settings, state)
    pose, seen = (at.x, at.y, math.atan2(at.sin, at.cos)), space.points
    now, then = (points, capsules), (seen[: points.shape[0]], capsules)
    in_robot_frame(pose, settings[0].delay, now, then)
    return then


WORKSPACE_TOO_SMALL = -2
"""Code other than a status: see :func:`qpavoid.avoidance.step.memory_size`."""

NO_ANSWER = (math.inf, math.inf)
"""Absent answer of a back end."""


class Outcome(NamedTuple):
    """Result of a control step.

    Attributes:
        code: Number of the status.
        v: m/s.
        omega: rad/s.
        clearance: Of the nearest obstacle, m.
        slack: Relaxation of the rows, m/s.
        residual: Of the certificate.
        shortfall: Predicted violation of the required distance, m.
        first: Obstacle of an active constraint, or −1.
        second: Another one, or −1.
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


@compiled
def no_outcome(code: int) -> Outcome:
    """Return the outcome of a step that could not be computed."""
    return Outcome(code, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, -1, -1)


@entry_if(has_valid_sizes)
@compiled_once
def filter_outcome(
    setup: Setup,
    request: Request,
    answer: Pair,
    state: FilterStateWritten,
    memory: VectorWritten,
) -> Outcome:
    """Return the outcome of one control step, and update ``state``.

    Invalid data leave the state unchanged. ``memory`` holds :func:`memory_size`
    numbers; if fewer, the code is :data:`WORKSPACE_TOO_SMALL`.

    Args:
        setup: Footprint, limits and settings.
        request: Obstacles and command.
        answer: Twist of a back end: the solution of the QP that a call with
            :data:`NO_ANSWER`, on a copy of the state, left in memory; NaN: it failed.
        state: Updated.
        memory: Overwritten.
    """
    (edges, robot, settings), s = setup, setup.settings[0]
    most = most_contacts(edges, request.obstacles)
    if memory.shape[0] < memory_size(most, settings):
        return no_outcome(WORKSPACE_TOO_SMALL)
    space, (v, omega) = workspace_in(memory, most, settings), request.desired
    obstacles = obstacles_at_effect(setup, request.obstacles, state, space)
    reach = row_reach(robot, settings, obstacles[1], request.age)
    radius = limits_of(robot).circumradius
    n, nearest = contact_table(edges, radius, obstacles, reach, space.contacts)
    if nearest == -2 or not (math.isfinite(v) and math.isfinite(omega)):
        return no_outcome(INVALID)
    contacts = space.contacts.view(CONTACT)[:n]
    clearance = contacts[nearest].distance if nearest >= 0 else math.inf
    barrier, age, count = s.bound == BARRIER, request.age, 0
    ahead = request.ahead and barrier
    old = barrier and is_too_old(contacts, settings, age)
    scene = new_scene(setup, state, space, clearance)
    if barrier and not old:
        count = bodies_in_reach(scene, obstacles, age, s.horizon if ahead else 0.0)
    scene = with_bodies(scene, space.bodies[:count], 0.0)
    query = query_of(scene, request, space, contacts, ahead)
    kept = state[:PENDING].view(KEPT)[0]
    if old:
        # No plan is searched, none retained.
        kept.end = 0.0
        choice = fallback(scene, query, kept, -1)
    elif ahead:
        choice = select(scene, query, kept)
    else:
        choice = select_now(scene, query, kept)
    qp = certified(scene, query, choice, answer, space)
    if not qp.holds:
        choice = fallback(scene, query, kept, -1)
        qp = Certified(False, qp.twist, 0.0, qp.residual, -1, -1)
    elif is_answered(answer) and choice.proposal.cost < math.inf:
        choice = answered_by(scene, query, choice, qp.twist)
    return finished(scene, query, choice, qp, state)


@compiled_once
def query_of(
    scene: Scene, request: Request, space: Workspace, contacts: Table, ahead: bool
) -> Query:
    """Write the rows of the present; return the problem of a step."""
    s, robot, last, age = scene.settings[0], scene.robot, scene.last, request.age
    command = clipped(request.desired, Box(-GREATEST, GREATEST, -GREATEST, GREATEST))
    box, rows = twist_box(robot, last[0], last[1], s.dt), space.rows
    if ahead:
        box = look_box(robot)
        _, near = required_distance(scene.settings, 0.0, age)
        if scene.clearance < near:
            turn_to_walls(scene.edges, contacts, near)
    m = constraint_rows(contacts, robot, scene.settings, box, age, ahead, rows)
    for i in range(m if ahead else 0):
        for column in range(A_V, B + 1):
            rows[i, column] *= SEPARATION
    desired = clipped(command, box) if ahead else command
    tables, slack = (space.predicted, space.frames, space.closer), s.slack_tolerance
    return Query(box, command, desired, *tables, rows, m, slack, ahead)


class Certified(NamedTuple):
    """Solution of the QP of a choice, and its certificate.

    Attributes:
        holds: Whether the certificate holds.
        twist: The solution, or the answer of a back end.
        slack: Least relaxation of the rows, m/s.
        residual: Of the certificate.
        first: Obstacle of an active row, or −1.
        second: Another one, or −1.
    """

    holds: bool
    twist: Pair
    slack: float
    residual: float
    first: int
    second: int


@compiled_once
def certified(
    scene: Scene, query: Query, choice: Choice, answer: Pair, space: Workspace
) -> Certified:
    """Solve the QP of a choice, which is left in memory, and certify the solution.

    Without a proposal the QP is the projection of the driven twist onto the limits.
    ``answer``: see :func:`filter_outcome`.
    """
    s, goal = scene.settings[0], first_twist(scene, choice.plan)
    qp = Problem(0, Terms(query.box, goal, (s.weight_v, s.weight_omega), 0))
    if choice.proposal.cost < math.inf:
        qp = qp_of(scene, query, choice.proposal)
    set_problem(space.problem, qp)
    found, rows = solution(query, qp), query.rows[: qp.m + 4]
    twist = answer if is_answered(answer) else (found.v, found.omega)
    relaxed = relaxation(found.slack, query.slack_tolerance)
    residual = max(*certificate(rows, qp.terms, relaxed, twist))
    first, second = active_obstacles(rows[: qp.m], found, choice.owner)
    holds = found.found and residual <= RESIDUAL_TOLERANCE
    return Certified(holds, twist, found.slack, residual, first, second)


@compiled
def is_answered(answer: Pair) -> bool:
    """Return whether a back end has answered."""
    return not (math.isinf(answer[0]) or math.isinf(answer[1]))


@compiled_once
def finished(
    scene: Scene, query: Query, choice: Choice, qp: Certified, state: Array
) -> Outcome:
    """Retain the plan of a certified choice; return the outcome."""
    proposed, twist = choice.proposal.cost < math.inf, first_twist(scene, choice.plan)
    slack, level, (static, moving) = 0.0, threshold(scene), choice.margins
    if proposed and qp.holds:
        slack = row_violation(query, twist) if query.ahead else qp.slack
    code = code_of(scene, query, choice, twist, slack) if qp.holds else STOPPED
    margin = min(static, moving) if static < level else moving
    keep_plan(
        state, twist, choice.plan, choice.mode, choice.until, scene.settings[0].dt
    )
    shortfall = -margin if margin < level else 0.0
    # fmt: off
    return Outcome(code, twist[0], twist[1], scene.clearance, slack, qp.residual,
                   shortfall, qp.first, qp.second)
    # fmt: on


@compiled_once
def answered_by(scene: Scene, query: Query, choice: Choice, twist: Pair) -> Choice:
    """Return the choice with the twist of a back end, if that is clear, too.

    Without look-ahead and ``braking_room`` no plan is checked.
    """
    twist, unchecked = snapped(query, twist), scene.settings[0].braking_room == 0
    plan = hold(twist[0], twist[1], choice.plan.end)
    if (query.ahead or not unchecked) and not verdict(scene, plan, choice.until):
        return choice
    _, mode, until, least, proposal, owner = choice
    return Choice(plan, mode, until, least, proposal, owner)


@compiled_once
def code_of(
    scene: Scene, query: Query, choice: Choice, twist: Pair, slack: float
) -> int:
    """Return the status of a choice."""
    level, least = threshold(scene), choice.margins
    if choice.proposal.cost < math.inf:
        if slack > 0.0:
            return RELAXED
        return TRACKING if twist == query.command else FILTERED
    rests = twist == (0.0, 0.0)
    if choice.mode == BRAKED:
        return HOLDING if rests else BRAKING
    if least.moving < level or least.static < level:
        return RELAXED
    p = choice.plan
    stays = (p.v, p.omega) == (0.0, 0.0) and (p.v_then, p.omega_then) == (0.0, 0.0)
    return HOLDING if rests and stays else PLANNED


@compiled_once
def active_obstacles(rows: Array, found: Optimum, owner: int) -> tuple[int, int]:
    """Return the obstacles of the active rows, else of the command; −1: none."""
    m, one, other = rows.shape[0], found.first, found.second
    first = int(rows[one, ROW_OWNER]) if 0 <= one < m else -1
    second = int(rows[other, ROW_OWNER]) if 0 <= other < m else -1
    if second < 0:
        second = owner
    return (first, second) if first >= 0 else (second, -1)


@compiled
def set_problem(memory: Array, qp: Problem) -> None:
    """Write a QP's number of rows, of hard ones, limits, and desired twist."""
    box, terms = qp.terms.box, qp.terms
    memory[0], memory[1] = qp.m, terms.n_hard
    memory[2], memory[3] = box.v_min, box.v_max
    memory[4], memory[5] = box.omega_min, box.omega_max
    memory[6], memory[7] = terms.desired


@entry_if(has_valid_sizes)
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
    o = filter_outcome(setup, request, NO_ANSWER, state, memory)
    # fmt: off
    return (o.code, o.v, o.omega, o.clearance, o.slack, o.residual, o.shortfall,
            o.first, o.second)
    # fmt: on
