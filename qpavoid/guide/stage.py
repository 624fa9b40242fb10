"""The stage between tracking and filter: the coming seconds, and a way round a stall.

As long as the robot gets on, the guide drives the candidate that comes nearest to the
reference over the coming seconds (:mod:`qpavoid.guide.choice`). A robot that
wants to move, is not at its reference and has not come ``progress`` far in
``stall_time`` is stalled. Then a way to the reference, or to the next free place ahead
of it, is searched among the obstacles at hand (:mod:`qpavoid.guide.way`) and
followed. It is kept as long as it is free and the robot gets on, so that the side does
not flip; a robot that is wedged in backs out first. When the straight way to the
reference is free, tracking takes over again. Without a way the robot holds, and after
``blocked_time`` the stage says ``blocked``: the call for a replanner. It resumes when a
way opens. What it desires goes through the safety filter like anything else.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from qpavoid.avoidance.bodies import bodies_in_reach
from qpavoid.avoidance.body_table import BODY, any_moves
from qpavoid.avoidance.scene import Scene, Setup
from qpavoid.avoidance.settings import AvoidanceSettings, radius_curve
from qpavoid.avoidance.workspace import is_counted
from qpavoid.compiled import compiled_once, entry, entry_if
from qpavoid.guide.choice import (
    FASTEST,
    KIND,
    NOT_CHOSEN,
    PACE,
    choose,
    driven_candidate,
    stand_still,
    track_on,
    twist_of,
)
from qpavoid.guide.geodesic import CELL
from qpavoid.guide.rollout import TICK, Course, at_pace
from qpavoid.guide.room import AMPLE, Field, line_room, outline, pose_room, room_field
from qpavoid.guide.settings import MOST_REACH, GuideSettings, Settings
from qpavoid.guide.state import (
    BACK_TIME,
    BACKED,
    BACKING,
    BACKS,
    BEGUN,
    BLOCKED,
    CHOSEN,
    CLEAR,
    COUNT,
    DETOUR,
    DUE,
    FAILED,
    LEAD,
    LOOKED,
    MODE,
    PROGRESS,
    SEARCHING,
    STATE_SIZE,
    STILL,
    WAY,
    Progress,
    back_out,
    clear,
    follow,
    has_way,
    is_done,
    note_motion,
    way_room,
)
from qpavoid.guide.way import Search, field_in, find_way, search_size
from qpavoid.model.contacts import most_contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import (
    Array,
    Arrays,
    Matrix,
    MatrixWritten,
    Points,
    Pose,
    Sizes,
    Twist,
    Vector,
    VectorWritten,
)

WANTS_V, WANTS_OMEGA = 0.02, 0.05
"""m/s and rad/s; a desired twist below both wants to stand still."""

STRAIGHT_WITHIN = 1.2
"""rad; a straight way that begins with a greater turn is none."""

LOSS, DEMAND = 0.02, 0.02
"""m of room that leaving a tight place may cost; by which each failure raises what a
way must keep."""

AHEAD = 0.5
"""m in front of a robot that has passed its reference, where it goes instead."""


REFERENCE_RESTS = 1e-3
"""m/s; a reference that is slower stands."""


class Tracking(NamedTuple):
    """Input of a step: what tracking asks for, and what has been driven.

    Attributes:
        desired: Twist of the tracking law, m/s and rad/s.
        error: Reference in the robot frame, m, m, and its heading less the robot's,
            rad.
        v_r: Speed of the reference along its path, m/s, that of the path itself where
            the reference waits: 0 says that it has come to its goal.
        driven: Twist driven since the last call.
        dt: Time since the last call, s.
        ahead: (n, 5) the reference in the robot frame, a row a tick of the guide.
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
        bodies: A row a contact.
        search: As many numbers as :func:`qpavoid.guide.way.search_size` says.
    """

    bodies: Annotated[MatrixWritten, Sizes(0, BODY)]
    search: VectorWritten


class Stage(NamedTuple):
    """What stays the same from step to step.

    Attributes:
        setup: Of the filter behind it.
        law: Of the tracker.
        settings: From :meth:`GuideSettings.record`; of size 0: there is no stage.
        body: (n, 2) from :func:`qpavoid.guide.room.outline`.
    """

    setup: Setup
    law: Annotated[Vector, Sizes(9)]
    settings: Settings
    body: Points


@compiled_once
def scene_of(stage: Stage, bodies: Array, tracking: Tracking) -> Scene:
    """Return the scene of a step among some bodies, without memory for rollouts."""
    (edges, robot, settings), none = stage.setup, bodies[:0]
    # fmt: off
    return Scene(edges, robot, settings, bodies, tracking.driven, (0.0, 0.0), none,
                 none, tracking.dt, 0.0, math.inf)
    # fmt: on


@compiled_once
def course_of(stage: Stage, state: Array, bodies: Array, tracking: Tracking) -> Course:
    """Return what the rollouts of a step share, at the pace chosen last."""
    pace = state[CHOSEN + PACE] if state[CHOSEN + PACE] > 0.0 else FASTEST
    scene = scene_of(stage, bodies, tracking)
    return Course(scene, tracking.ahead, stage.law, stage.settings, pace)


@compiled_once
def track_by_candidate(
    stage: Stage, state: Array, bodies: Array, obstacles: Arrays, tracking: Tracking
) -> Twist:
    """Return the twist of the candidate that comes nearest to the reference.

    They are looked at every :data:`TICK`, and driven in closed loop in between. Where
    the robot is blocked and nothing moves, it stands: what is weighed stays the same.

    Args:
        stage: Settings, tracker and filter.
        state: Of the stage.
        bodies: VectorWritten, a row a contact.
        obstacles: Robot frame.
        tracking: What it does.
    """
    s, chosen = stage.settings[0], state[CHOSEN:WAY]
    state[DUE] -= 1.0
    if state[DUE] < 0.5:
        state[DUE] = max(1.0, round(TICK / tracking.dt))
        scene = scene_of(stage, bodies, tracking)
        count = bodies_in_reach(scene, obstacles, 0.0, s.horizon)
        scene = scene_of(stage, bodies[:count], tracking)
        if state[STILL] >= s.blocked_time and not any_moves(scene):
            stand_still(chosen)
        else:
            course = course_of(stage, state, bodies[:count], tracking)
            choose(course, chosen, state[STILL] > s.stall_time / 2.0)
    course = course_of(stage, state, bodies[:0], tracking)
    return twist_of(course, driven_candidate(chosen), tracking.desired)


@entry
@compiled_once
def _is_staged(
    stage: Stage,
    state: Annotated[VectorWritten, Sizes(STATE_SIZE)],
    memory: StageMemory,
    obstacles: Arrays,
    tracking: Tracking,
) -> bool:
    """Return whether all that is read is there, and memory for all that is written."""
    (edges, robot, settings), s = stage.setup, stage.settings[0]
    leads = tracking.ahead.shape[0] > 0 and tracking.dt > 0.0
    if not (leads and 0.0 <= s.reach <= MOST_REACH):
        return False
    if not (is_counted(edges, robot, settings) and has_way(state)):
        return False
    fits: bool = memory.search.shape[0] >= search_size(s.reach)
    return fits and memory.bodies.shape[0] >= most_contacts(edges, obstacles)


@entry_if(_is_staged)
@compiled_once
def guide_step(
    stage: Stage,
    state: Annotated[VectorWritten, Sizes(STATE_SIZE)],
    memory: StageMemory,
    obstacles: Arrays,
    tracking: Tracking,
) -> tuple[int, float, float]:
    """Return a number of :data:`PROGRESS` and the twist to desire, m/s and rad/s.

    Args:
        stage: Settings, tracker and filter.
        state: (STATE_SIZE,) zeros at the start of a run; brought up to date in place.
        memory: Big enough.
        obstacles: Robot frame.
        tracking: What it does.
    """
    settings, bodies, (v, omega) = stage.settings, memory.bodies, tracking.desired
    s, (e_x, e_y, e_gamma) = settings[0], tracking.error
    note_motion(state, s.progress, tracking.driven, tracking.dt)
    near = math.sqrt(e_x * e_x + e_y * e_y) < s.tolerance and abs(e_gamma) < s.tolerance
    wants = abs(v) > WANTS_V or abs(omega) > WANTS_OMEGA
    if near or (state[MODE] == CLEAR and not wants):
        clear(state)
    if state[MODE] == CLEAR:
        if state[STILL] < s.stall_time:
            v, omega = track_by_candidate(stage, state, bodies, obstacles, tracking)
            return CLEAR, v, omega
        state[FAILED] = state[BACKS] = state[DUE] = 0.0
        state[CHOSEN + KIND] = NOT_CHOSEN
        state[MODE], state[LOOKED] = SEARCHING, math.inf
    if state[MODE] == BACKING:
        state[BACKED] += tracking.dt
        if state[BACKED] < BACK_TIME:
            return BACKING, -s.back_speed, 0.0
        state[MODE], state[LOOKED] = SEARCHING, math.inf
    pause = s.interval if state[MODE] == DETOUR else 2.0 * s.interval
    if state[LOOKED] >= pause or (state[MODE] == DETOUR and is_done(state)):
        state[LOOKED] = 0.0
        curve = radius_curve(settings)
        field = field_in(memory.search, s.reach, stage.body)
        room_field(s.reach, s.inner + AMPLE, curve, obstacles, field.nodes)
        _look(state, field, settings, memory.search, obstacles, tracking)
        if state[MODE] == CLEAR:
            return CLEAR, v, omega
    if state[MODE] == DETOUR:
        twist = follow(state, s.speed, s.turn_rate, tracking.dt)
        v, omega = at_pace(course_of(stage, state, bodies[:0], tracking), twist)
        return DETOUR, v, omega
    v, omega = track_by_candidate(stage, state, bodies, obstacles, tracking)
    return (BLOCKED if state[STILL] >= s.blocked_time else SEARCHING), v, omega


@compiled_once
def _look(
    state: Array,
    field: Field,
    settings: Settings,
    memory: Array,
    obstacles: Arrays,
    tracking: Tracking,
) -> None:
    """Look at the obstacles: go back to tracking, keep the way, or find another."""
    s, error = settings[0], tracking.error
    moving = abs(tracking.v_r) > REFERENCE_RESTS
    there, x, y = _target(field, s.clearance, error, moving)
    straight = there and abs(math.atan2(y, x)) < STRAIGHT_WITHIN
    if straight and line_room(field, x, y, error[2]) >= s.clearance:
        track_on(state[CHOSEN:WAY])
        clear(state)
        return
    if _goes_on(state, field, settings):
        return
    state[MODE] = SEARCHING
    if not there:
        return
    more = DEMAND * state[FAILED]
    clearance, reverse = s.clearance + more, s.back_speed > 0.0
    target = (x, y, error[2])
    loss, walls = LOSS - more, obstacles[1]
    search = Search(s.inner, reverse, clearance, loss, target, not moving, walls)
    count = find_way(field, search, memory, state[WAY:])
    if count > 0:
        state[MODE], state[COUNT] = DETOUR, count
        for i in range(LEAD, COUNT):
            state[i] = 0.0
        return
    wedged = pose_room(field, 0.0, 0.0, 0.0) < s.clearance
    if count == 0 and wedged and back_out(state, s.back_speed):
        return
    if state[STILL] < s.blocked_time:
        state[FAILED] = 0.0


@compiled_once
def _goes_on(state: Array, field: Field, settings: Settings) -> bool:
    """Return whether nothing need be searched: the way is free, done, or backed out."""
    s = settings[0]
    if state[MODE] != DETOUR:
        state[BEGUN] = 0.0
        return False
    if is_done(state):
        clear(state)
        return True
    if min(state[STILL], state[BEGUN]) < s.stall_time:
        return way_room(state, field) >= 0.0
    state[FAILED] += 1.0
    state[BEGUN] = 0.0
    return back_out(state, s.back_speed)


@compiled_once
def _target(
    field: Field, clearance: float, error: Pose, moving: bool
) -> tuple[bool, float, float]:
    """Return whether there is a free place to go to, and it, robot frame, m.

    It is the reference itself or, if that moves, the first free place ahead of it, and
    ahead of the robot, straight on along its heading.
    """
    e_x, e_y, e_gamma = error
    cos, sin = math.cos(e_gamma), math.sin(e_gamma)
    passed = -(e_x * cos + e_y * sin)
    start = passed + AHEAD if moving and passed > 0.0 else 0.0
    steps = math.ceil(2.0 * field.half / CELL) if moving else 1
    for k in range(steps):
        x, y = e_x + (start + k * CELL) * cos, e_y + (start + k * CELL) * sin
        if pose_room(field, x, y, e_gamma) >= clearance:
            return True, x, y
    return False, e_x, e_y


Avoid: TypeAlias = Callable[[Obstacles, Tracking], tuple[Progress, float, float]]
"""From obstacles, robot frame, and what tracking does to what the stage does, v, ω."""


@dataclass(frozen=True)
class GuideStage:
    """The stage with its settings; it holds no state of any run.

    Attributes:
        robot: Footprint and limits.
        settings: When it acts, how, and what it weighs.
        avoidance: Settings of the filter behind it.
        law: Of the tracker.
    """

    robot: Robot
    settings: GuideSettings = field(default_factory=GuideSettings)
    avoidance: AvoidanceSettings = field(default_factory=AvoidanceSettings)
    law: Array = field(default_factory=lambda: np.zeros(9))

    @property
    def stage(self) -> Stage:
        """What the compiled functions take."""
        edges = self.robot.footprint.edges
        return Stage(
            Setup(edges, self.robot.limit_vector, self.avoidance.record()),
            self.law,
            self.settings.record(self.robot, self.avoidance.radius),
            outline(self.robot.footprint),
        )

    def start(self, state: Array | None = None) -> Avoid:
        """Return the stage of a new run, or of one that goes on in a state."""
        stage, state = self.stage, fresh_stage() if state is None else state
        memory = stage_memory(0, stage.settings)

        def avoid(
            obstacles: Obstacles, tracking: Tracking
        ) -> tuple[Progress, float, float]:
            nonlocal memory
            most = most_contacts(stage.setup.edges, obstacles.arrays)
            if len(memory.bodies) < most:
                memory = memory._replace(bodies=np.empty((most, BODY)))
            code, v, omega = guide_step(
                stage, state, memory, obstacles.arrays, tracking
            )
            return PROGRESS[code], v, omega

        return avoid


def stage_memory(contacts: int, settings: Settings) -> StageMemory:
    """Return memory for so many contacts; none to search where there is no stage."""
    many = search_size(settings["reach"].item()) if len(settings) else 0
    return StageMemory(np.empty((contacts, BODY)), np.empty(many))


def fresh_stage() -> Array:
    """Return the state of a new run."""
    state = np.zeros(STATE_SIZE)
    state[CHOSEN + KIND] = NOT_CHOSEN
    return state
