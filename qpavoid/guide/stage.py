"""Stage between tracking and filter: candidates, and a detour after a stall.

While the robot makes progress, the guide drives the cheapest candidate over the coming
seconds (:mod:`qpavoid.guide.choice`). A robot is stalled if it has a desired twist, is
not at its reference and has not moved by ``progress`` in ``stall_time``. Then a path to
the reference, or to the next free pose ahead of it, is searched among the known
obstacles (:mod:`qpavoid.guide.hybrid_astar`) and followed. It is retained as long as it
is free and the robot makes progress, so that the side does not flip. When the straight
path to the reference is free, tracking resumes. Without a path the robot holds, and
after ``blocked_time`` the stage reports it: a request for a new plan. It resumes when a
path opens. Its desired twist goes through the safety filter. All poses of its state are
in the robot frame, m, m, rad, and move with the robot.
"""

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from qpavoid.avoidance.bodies import (
    BODY,
    BODY_SIZE,
    Scene,
    Setup,
    any_moves,
    bodies_in_reach,
)
from qpavoid.avoidance.plan import ARC
from qpavoid.avoidance.settings import AvoidanceSettings, radius_curve
from qpavoid.avoidance.step import has_valid_sizes
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.guide.choice import (
    KIND,
    NOT_CHOSEN,
    PACE,
    choose,
    driven_candidate,
    ends,
    stand_still,
    track_on,
    twist_of,
)
from qpavoid.guide.hybrid_astar import (
    ACTIONS,
    ARC_LENGTH,
    MOST_ACTIONS,
    TURN,
    Search,
    field_in,
    find_way,
    search_size,
)
from qpavoid.guide.local_grid import (
    AMPLE,
    CELL,
    Field,
    line_room,
    outline,
    pose_room,
    room_field,
)
from qpavoid.guide.rollout import TICK, Course, X, Y, at_pace
from qpavoid.guide.settings import MOST_REACH, GuideSettings, Settings
from qpavoid.model.contacts import most_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import GREATEST, Robot, limits_of
from qpavoid.tracking.kanayama import kanayama, tracking_error
from qpavoid.types import (
    Array,
    Arrays,
    Matrix,
    Points,
    Pose,
    Sizes,
    Twist,
    Vector,
    VectorWritten,
)

CLEAR, SEARCHING, DETOUR, NO_PATH = range(4)
"""Modes: tracking or a candidate, without a path yet, on a path, and without one for
``blocked_time``."""

(
    STAGE_MODE,  # CLEAR, SEARCHING or DETOUR
    STILL,  # s since the robot was last ``progress`` away from the mark
    MARK,  # x, y, turn of the mark in the robot frame, m, m, rad
    LOOKED,  # s since the obstacles were last checked
    LEAD,  # x, y, turn of the pose that the robot follows, m, m, rad
    ACTION,  # action of the path that this pose is in
    ACTION_SHARE,  # of that action done, 0 to 1
    COUNT,  # of actions
    BEGUN,  # s since the last search
    CHOICE_DUE,  # control steps until the candidates are scored again
    CHOSEN,  # the candidate that is driven
    WAY,  # the first action
) = (0, 1, 2, 5, 6, 9, 10, 11, 12, 13, 14, 19)
STATE_SIZE = WAY + MOST_ACTIONS

TURNED = 0.5
"""rad; turn on a detour that counts as progress."""

LEASH, LEASH_TURN = 0.3, 0.5
"""m and rad; lag of the robot behind the followed pose at which that stops."""

DONE = 1.0 - 1e-9
"""Share of an action from which on it is done; tolerates rounding of steps."""

GAINS = 1.5, 6.0, 3.0
"""k_x, k_y, k_γ of Eq. 6 on a detour."""


@compiled
def set_mark(state: Array) -> None:
    """Set the mark to the robot's pose."""
    state[MARK], state[MARK + 1], state[MARK + 2] = 0.0, 0.0, 0.0


@compiled_once
def note_motion(state: Array, progress: float, driven: Twist, dt: float) -> None:
    """Update clocks and poses after a step in which a twist was driven."""
    pose = arc(0.0, 0.0, 0.0, driven[0], driven[1], dt)
    for k in (MARK, LEAD):
        known = (state[k], state[k + 1], state[k + 2])
        state[k], state[k + 1], state[k + 2] = tracking_error(pose, known)
    state[STILL] += dt
    state[LOOKED] += dt
    state[BEGUN] += dt
    far = state[MARK] ** 2 + state[MARK + 1] ** 2 > progress**2
    if far or (state[STAGE_MODE] == DETOUR and abs(state[MARK + 2]) > TURNED):
        state[STILL] = 0.0
        set_mark(state)


@compiled_once
def clear(state: Array) -> None:
    """Resume tracking, with the clock at zero and the mark at the robot's pose."""
    state[STAGE_MODE], state[STILL] = CLEAR, 0.0
    set_mark(state)


@compiled_once
def has_way(state: Array) -> bool:
    """Return whether the remaining actions are valid."""
    place, count = state[ACTION], state[COUNT]
    if not (0.0 <= place and 0.0 <= count <= MOST_ACTIONS):
        return False
    for k in range(int(count)):
        if not 0.0 <= state[WAY + k] < len(ACTIONS):
            return False
    return True


@compiled_once
def is_done(state: Array) -> bool:
    """Return whether the path has been followed to its end."""
    return bool(state[ACTION] >= state[COUNT])


@compiled_once
def way_room(state: Array, field: Field) -> float:
    """Return the least margin on the rest of the path, m."""
    x, y, turn = state[LEAD], state[LEAD + 1], state[LEAD + 2]
    least, share = AMPLE, 1.0 - state[ACTION_SHARE]
    for k in range(int(state[ACTION]), int(state[COUNT])):
        drive, bend = ACTIONS[int(state[WAY + k])]
        x, y, turn = arc(x, y, turn, drive * ARC_LENGTH, bend * TURN, share)
        least = min(least, pose_room(field, x, y, turn))
        share = 1.0
    return least


@compiled_once
def follow(state: Array, speed: float, turn_rate: float, dt: float) -> Twist:
    """Return the twist that follows the path; the followed pose waits for the robot."""
    drive, bend = ACTIONS[int(state[WAY + int(state[ACTION])])]
    time = max(abs(drive) * ARC_LENGTH / speed, abs(bend) * TURN / turn_rate)
    v, omega = drive * ARC_LENGTH / time, bend * TURN / time
    away = math.sqrt(state[LEAD] ** 2 + state[LEAD + 1] ** 2) / LEASH
    away = max(away, abs(state[LEAD + 2]) / LEASH_TURN)
    pace = min(max(2.0 - 2.0 * away, 0.0), 1.0)
    step = min(pace * dt, time * (1.0 - state[ACTION_SHARE]))
    x, y, turn = arc(state[LEAD], state[LEAD + 1], state[LEAD + 2], v, omega, step)
    state[LEAD], state[LEAD + 1], state[LEAD + 2] = x, y, turn
    state[ACTION_SHARE] += step / time
    if state[ACTION_SHARE] >= DONE:
        state[ACTION_SHARE] = 0.0
        state[ACTION] += 1.0
    return kanayama((x, y, turn), (pace * v, pace * omega), GAINS)


WANTS_V, WANTS_OMEGA = 0.02, 0.05
"""m/s and rad/s; a desired twist below both is standing still."""

STRAIGHT_WITHIN = 1.2
"""rad; greatest initial turn of a straight path."""

PER_CONTACT = 2 * BODY_SIZE
"""Numbers of memory per contact: a body, and a group of points."""

PAST_REFERENCE = 0.5
"""m in front of a robot that has passed its reference: target of the detour."""

REFERENCE_RESTS = 1e-3
"""m/s; speed of the reference below which it rests."""


class Tracking(NamedTuple):
    """Input of a step: tracking, and the twist driven.

    Attributes:
        desired: Twist of the tracking law, m/s and rad/s.
        error: Reference in the robot frame, m, m, and its heading minus the robot's,
            rad.
        v_r: Speed of the reference along its path, m/s, that of the path itself where
            the reference waits: 0 at its goal.
        driven: Twist driven since the last call.
        dt: Time since the last call, s.
        ahead: (n, 5) the reference in the robot frame, one row per tick of the guide.
    """

    desired: Twist
    error: Pose
    v_r: float
    driven: Twist
    dt: float
    ahead: Annotated[Matrix, Sizes(0, 5)]


class StageMemory(NamedTuple):
    """Memory of a step.

    Attributes:
        bodies: :data:`PER_CONTACT` numbers per contact.
        search: :func:`qpavoid.guide.hybrid_astar.search_size` numbers.
    """

    bodies: VectorWritten
    search: VectorWritten


class Stage(NamedTuple):
    """Data constant over a run.

    Attributes:
        setup: Of the filter behind it.
        law: Of the tracker.
        settings: From :meth:`GuideSettings.record`; of size 0: no stage.
        body: (n, 2) from :func:`qpavoid.guide.local_grid.outline`.
    """

    setup: Setup
    law: Annotated[Vector, Sizes(9)]
    settings: Settings
    body: Points

    @classmethod
    def of(
        cls,
        robot: Robot,
        guide: GuideSettings,
        avoidance: AvoidanceSettings,
        law: Array,
    ) -> "Stage":
        """Return the data of a robot, its settings and its tracker's law."""
        record, body = guide.record(robot, avoidance.radius), outline(robot.footprint)
        return cls(Setup.of(robot, avoidance), law, record, body)


@compiled_once
def scene_of(stage: Stage, memory: Array, count: int, tracking: Tracking) -> Scene:
    """Return the scene of a step with so many bodies, without memory for arcs."""
    (edges, robot, settings), bodies = stage.setup, memory.view(BODY)
    groups = bodies[bodies.shape[0] // 2 :]
    # fmt: off
    return Scene(edges, robot, settings, bodies[:count], tracking.driven, (0.0, 0.0),
                 memory[:0].view(ARC), groups, tracking.dt, 0.0, math.inf)
    # fmt: on


@compiled_once
def course_of(
    stage: Stage, state: Array, memory: Array, count: int, tracking: Tracking
) -> Course:
    """Return the rollout context of a step, at the pace chosen last."""
    scene, pace = scene_of(stage, memory, count, tracking), state[CHOSEN + PACE]
    return Course(scene, tracking.ahead, stage.law, stage.settings, pace)


@compiled_once
def track_by_candidate(
    stage: Stage, state: Array, memory: Array, obstacles: Arrays, tracking: Tracking
) -> Twist:
    """Return the twist of the cheapest candidate.

    Candidates are scored every :data:`TICK`, and driven in closed loop in between. If
    the robot is blocked and nothing moves, it stands without a new score.

    Args:
        stage: Settings, tracker and filter.
        state: Of the stage.
        memory: Of bodies.
        obstacles: Robot frame.
        tracking: Input of the step.
    """
    s, chosen = stage.settings[0], state[CHOSEN:WAY]
    state[CHOICE_DUE] -= 1.0
    if state[CHOICE_DUE] < 0.5:
        state[CHOICE_DUE] = max(1.0, round(TICK / tracking.dt))
        scene = scene_of(stage, memory, memory.shape[0] // PER_CONTACT, tracking)
        count = bodies_in_reach(scene, obstacles, 0.0, s.horizon)
        scene = scene_of(stage, memory, count, tracking)
        if state[STILL] >= s.blocked_time and not any_moves(scene):
            stand_still(chosen)
        else:
            course = course_of(stage, state, memory, count, tracking)
            choose(course, chosen, state[STILL] > s.stall_time / 2.0)
    course = course_of(stage, state, memory, 0, tracking)
    twist = twist_of(course, driven_candidate(chosen), tracking.desired)
    return at_pace(course, twist)


@entry
@compiled_once
def _is_staged(
    stage: Stage,
    state: Annotated[VectorWritten, Sizes(STATE_SIZE)],
    memory: StageMemory,
    obstacles: Arrays,
    tracking: Tracking,
) -> bool:
    """Return whether all arguments have the required sizes."""
    (edges, robot, settings), s = stage.setup, stage.settings[0]
    leads = tracking.ahead.shape[0] > 0 and tracking.dt > 0.0
    if not (leads and 0.0 <= s.reach <= MOST_REACH):
        return False
    if not (has_valid_sizes(edges, robot, settings) and has_way(state)):
        return False
    fits: bool = memory.search.shape[0] >= search_size(s.reach)
    most = most_contacts(edges, obstacles)
    return fits and memory.bodies.shape[0] >= most * PER_CONTACT


@entry_if(_is_staged)
@compiled_once
def guide_step(
    stage: Stage,
    state: Annotated[VectorWritten, Sizes(STATE_SIZE)],
    memory: StageMemory,
    obstacles: Arrays,
    tracking: Tracking,
) -> tuple[int, float, float]:
    """Return the mode and the desired twist, m/s and rad/s.

    Args:
        stage: Settings, tracker and filter.
        state: (STATE_SIZE,) of :func:`fresh_stage` at the start; updated in place.
        memory: Of sufficient size.
        obstacles: Robot frame.
        tracking: Input of the step.
    """
    settings, bodies, (v, omega) = stage.settings, memory.bodies, tracking.desired
    s, (e_x, e_y, e_gamma) = settings[0], tracking.error
    note_motion(state, s.progress, tracking.driven, tracking.dt)
    near = math.sqrt(e_x * e_x + e_y * e_y) < s.tolerance and abs(e_gamma) < s.tolerance
    wants = abs(v) > WANTS_V or abs(omega) > WANTS_OMEGA
    if near or (state[STAGE_MODE] == CLEAR and not wants):
        clear(state)
    if state[STAGE_MODE] == CLEAR:
        if state[STILL] < s.stall_time:
            v, omega = track_by_candidate(stage, state, bodies, obstacles, tracking)
            return CLEAR, v, omega
        state[CHOICE_DUE], state[CHOSEN + KIND] = 0.0, NOT_CHOSEN
        state[STAGE_MODE], state[LOOKED] = SEARCHING, math.inf
    pause = s.interval if state[STAGE_MODE] == DETOUR else 2.0 * s.interval
    if state[LOOKED] >= pause or (state[STAGE_MODE] == DETOUR and is_done(state)):
        state[LOOKED] = 0.0
        curve = radius_curve(settings)
        field = field_in(memory.search, s.reach, stage.body)
        room_field(s.reach, max(s.inner, 0.0) + AMPLE, curve, obstacles, field.nodes)
        _look(stage, state, field, memory.search, obstacles[1], tracking)
        if state[STAGE_MODE] == CLEAR:
            return CLEAR, v, omega
    if state[STAGE_MODE] == DETOUR:
        twist = follow(state, s.speed, s.turn_rate, tracking.dt)
        v, omega = at_pace(course_of(stage, state, bodies, 0, tracking), twist)
        return DETOUR, v, omega
    v, omega = track_by_candidate(stage, state, bodies, obstacles, tracking)
    return (NO_PATH if state[STILL] >= s.blocked_time else SEARCHING), v, omega


@compiled_once
def _look(
    stage: Stage,
    state: Array,
    field: Field,
    memory: Array,
    walls: Array,
    tracking: Tracking,
) -> None:
    """Check the obstacles: resume tracking, retain the path, or search another one."""
    s, error = stage.settings[0], tracking.error
    moving = abs(tracking.v_r) > REFERENCE_RESTS
    most = math.inf if moving else 0.0
    if moving and ends(tracking.ahead):
        begin, end = tracking.ahead[0], tracking.ahead[-1]
        most = math.sqrt((end[X] - begin[X]) ** 2 + (end[Y] - begin[Y]) ** 2)
    there, x, y = _target(field, s.clearance, error, most)
    straight = there and abs(math.atan2(y, x)) < STRAIGHT_WITHIN
    if straight and line_room(field, x, y, error[2]) >= s.clearance:
        track_on(state[CHOSEN:WAY])
        clear(state)
        return
    if state[STAGE_MODE] == DETOUR:
        if is_done(state):
            clear(state)
            return
        moves_on = min(state[STILL], state[BEGUN]) < s.stall_time
        if moves_on and way_room(state, field) >= 0.0:
            return
    state[STAGE_MODE], state[BEGUN] = SEARCHING, 0.0
    if not there:
        return
    target, reverse = (x, y, error[2]), limits_of(stage.setup.robot).v_min < 0.0
    search = Search(s.inner, reverse, s.clearance, target, not moving, walls)
    count = find_way(field, search, memory, state[WAY:])
    if count > 0:
        state[STAGE_MODE], state[COUNT] = DETOUR, count
        for i in range(LEAD, COUNT):
            state[i] = 0.0


@compiled_once
def _target(
    field: Field, clearance: float, error: Pose, most: float
) -> tuple[bool, float, float]:
    """Return whether there is a free target pose, and its position, robot frame, m.

    The reference itself or, up to ``most`` m, the first free point ahead of it, and
    ahead of the robot, straight along its heading.
    """
    e_x, e_y, e_gamma = error
    cos, sin = math.cos(e_gamma), math.sin(e_gamma)
    passed = -(e_x * cos + e_y * sin)
    start = passed + PAST_REFERENCE if passed > 0.0 else 0.0
    for k in range(math.ceil(2.0 * field.half / CELL)):
        ahead = min(start + k * CELL, most)
        x, y = e_x + ahead * cos, e_y + ahead * sin
        if pose_room(field, x, y, e_gamma) >= clearance:
            return True, x, y
        if ahead == most:
            break
    return False, e_x, e_y


Avoid: TypeAlias = Callable[[Obstacles, Tracking], tuple[int, float, float]]
"""Function from obstacles, robot frame, and tracking to the stage's mode, v, ω."""


def start_stage(stage: Stage, state: Array) -> Avoid:
    """Return the stage of a run in a state, as of :func:`fresh_stage` for a new one."""
    memory = stage_memory(0, stage.settings)

    def avoid(obstacles: Obstacles, tracking: Tracking) -> tuple[int, float, float]:
        nonlocal memory
        most = most_contacts(stage.setup.edges, obstacles.arrays)
        if len(memory.bodies) < most * PER_CONTACT:
            memory = memory._replace(bodies=np.empty(most * PER_CONTACT))
        return guide_step(stage, state, memory, obstacles.arrays, tracking)

    return avoid


def stage_memory(contacts: int, settings: Settings) -> StageMemory:
    """Return memory for so many contacts; none to search without a stage."""
    many = search_size(settings["reach"].item()) if len(settings) else 0
    return StageMemory(np.empty(contacts * PER_CONTACT), np.empty(many))


def fresh_stage() -> Array:
    """Return the state of a new run."""
    state = np.zeros(STATE_SIZE)
    state[CHOSEN + KIND], state[CHOSEN + PACE] = NOT_CHOSEN, GREATEST
    return state
