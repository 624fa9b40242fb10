"""One closed loop, compiled: the functions of a single run, step after step.

Capsules keep their velocities and rates of turn from time 0 on. What comes back is
one row of :data:`qpavoid.lab.simulation.outcome.OUTCOME`, not the trajectory.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.barrier_rows import wanted_distance
from qpavoid.avoidance.decision import RELAXED
from qpavoid.avoidance.ladder import Outcome
from qpavoid.avoidance.repulsion import repulsion_step
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.step import filter_outcome
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.guide.rollout import TICK, fill_ahead
from qpavoid.guide.stage import Stage, StageMemory, Tracking, guide_step
from qpavoid.guide.state import NO_PATH
from qpavoid.lab.simulation import outcome as noted
from qpavoid.lab.simulation.clearance import (
    Motion,
    View,
    greatest_pace,
    room_on_the_way,
    room_round,
)
from qpavoid.lab.simulation.outcome import CRAWL, PROGRESS, Goal, is_over, note_arrival
from qpavoid.model.capsules import greatest_speed, in_robot_frame
from qpavoid.model.contacts import (
    CONTACT_WIDTH,
    contact_table,
    most_contacts,
    nearest_distance,
)
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import limit_twist, limits_of
from qpavoid.tracking.clock import waiting_reference
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.tracking.station import RESTING, track_step
from qpavoid.types import Array, Arrays, Pose, Twist

TRACK_ALONE, EQ5, EQ7, QP, QP_AHEAD = range(5)

X, Y, HEADING, PLACE, MODE, MARK_X, MARK_Y, MARK_TIME, MAX_V, WIDEST, HELD = range(11)
TOUCHED, LAST_V, BEFORE_V = range(11, 14)
RUN_SIZE = 14
"""Where a run is: pose, place on the plan, mode of the tracker, where and when it last
had come :data:`qpavoid.lab.simulation.outcome.PROGRESS` far; speed and r_min of the
fastest obstacle; whether the way is blocked; whether it touched something in the last
step; and the speeds of the last step and of the one before."""


UNCHANGED = 1e-6
"""m/s and rad/s; what differs by less has not been changed by the method."""


class Shared(NamedTuple):
    """Common data of all loops of a batch.

    Attributes:
        setup: Footprint, limits and settings.
        law: Of the tracker.
        lags: Of the reference's clock.
        stage: Between tracking and controller.
    """

    setup: Setup
    law: Array
    lags: tuple[float, float, float]
    stage: Stage


class Task(NamedTuple):
    """Task of one loop; world frame.

    Attributes:
        plan: (n, 5) reference, a row a control step.
        world: Obstacles at time 0.
        start: Pose at time 0.
        goal: What counts as arrival.
        steps: Greatest number of control steps.
        quiet: s; before, the run is not over even if the robot is at its goal.
    """

    plan: Array
    world: Arrays
    start: Pose
    goal: Goal
    steps: int
    quiet: float


class Run(NamedTuple):
    """Memory of one loop.

    Attributes:
        now: (:data:`RUN_SIZE`,) where it is.
        outcome: One :data:`qpavoid.lab.simulation.outcome.OUTCOME`, filled.
        state: Of the controller; the twist at time 0 is in it.
        stage: Of the stage between tracking and controller.
        guiding: Its memory.
        ahead: The same, a row a tick.
        seen: For the obstacles in the robot frame.
        memory: As :func:`qpavoid.avoidance.step.filter_outcome` needs it.
    """

    now: Array
    outcome: noted.Outcome
    state: Array
    stage: Array
    guiding: StageMemory
    ahead: Array
    seen: Arrays
    memory: Array


@compiled
def view_of(setup: Setup, task: Task, run: Run) -> View:
    """Return the world, with the memory of a step as a table of contacts."""
    most = most_contacts(setup.edges, run.seen)
    contacts = run.memory[: most * CONTACT_WIDTH].reshape(most, CONTACT_WIDTH)
    return View(task.world, run.seen, contacts)


@compiled
def control_step(
    method: int, shared: Shared, task: Task, run: Run, desired: Twist
) -> Outcome:
    """Return the outcome of one step; brings the state up to date.

    Args:
        method: One of :data:`TRACK_ALONE` and those after it.
        shared: Footprint, limits and settings.
        task: The world.
        run: What is seen of it, and the state.
        desired: Of the tracking law.
    """
    setup, state = shared.setup, run.state
    if method == QP or method == QP_AHEAD:
        request = Request(run.seen, 0.0, method == QP_AHEAD, desired)
        return filter_outcome(setup, request, state, run.memory)
    contacts = view_of(setup, task, run).contacts
    if method == EQ5 or method == EQ7:
        law, request = 5 if method == EQ5 else 7, Request(run.seen, 0.0, False, desired)
        return repulsion_step(law, setup, request, state, contacts)
    robot = setup.robot
    twist = limit_twist(robot, desired, (state[0], state[1]), setup.settings[0].dt)
    state[0], state[1] = twist
    radius = limits_of(robot).circumradius
    _, nearest = contact_table(setup.edges, radius, run.seen, 0.0, contacts)
    clearance = nearest_distance(contacts, nearest)
    return Outcome(0, twist[0], twist[1], clearance, 0.0, 0.0, 0.0, -1, -1)


@compiled
def reset(setup: Setup, task: Task, run: Run) -> None:
    """Put the robot at its start, and record its clearance there."""
    now, outcome = run.now, run.outcome[0]
    now[X], now[Y], now[HEADING] = task.start
    now[PLACE], now[MODE], now[MARK_TIME], now[HELD] = 0.0, RESTING, 0.0, 0.0
    now[MARK_X], now[MARK_Y], now[TOUCHED] = now[X], now[Y], 0.0
    now[MAX_V] = greatest_speed(task.world[1])
    now[WIDEST], _ = wanted_distance(setup.settings, now[MAX_V], 0.0)
    motion = Motion(task.start, (0.0, 0.0), 0.0, 0.0, 0.0)
    view = view_of(setup, task, run)
    least, room = room_round(setup, motion, view, math.inf)
    outcome.clearance, outcome.room, outcome.start = least, room, least
    outcome.arrived = outcome.error = outcome.heading_error = math.inf


@compiled
def track(shared: Shared, task: Task, run: Run, time: float) -> Twist:
    """Observe, and return the desired twist of tracking and the stage after it."""
    now, outcome, state = run.now, run.outcome[0], run.state
    pose = (now[X], now[Y], now[HEADING])
    in_robot_frame(pose, time, task.world, run.seen)
    # The clock of the reference stands on the plan's rows, not on the time: where the
    # robot is held up it slows down, so the place has a fraction.
    reference, rate = waiting_reference(task.plan, now[PLACE], pose, shared.lags)
    place, now[PLACE] = now[PLACE], now[PLACE] + rate
    away = math.sqrt((pose[0] - reference.x) ** 2 + (pose[1] - reference.y) ** 2)
    outcome.deviation = max(outcome.deviation, away)
    robot, mode = shared.setup.robot, int(now[MODE])
    v, omega, mode = track_step(shared.law, robot, pose, reference, mode)
    now[MODE] = mode
    # An empty row of settings is how a batch without a guide says so: None would be
    # another type to numba, and all of this compiled twice.
    if shared.stage.settings.shape[0] == 0:
        return v, omega
    target = (reference.x, reference.y, reference.heading)
    error, driven = tracking_error(pose, target), (state[0], state[1])
    dt = shared.setup.settings[0].dt
    fill_ahead(task.plan, place, pose, TICK / dt, run.ahead)
    asked = Tracking((v, omega), error, reference.v, driven, dt, run.ahead)
    progress, v, omega = guide_step(
        shared.stage, run.stage, run.guiding, run.seen, asked
    )
    now[HELD] = 1.0 if progress == NO_PATH else 0.0
    return v, omega


class Driven(NamedTuple):
    """Motion of one control step.

    Attributes:
        time: At its start, s.
        code: Of the status.
        twist: v (m/s), ω (rad/s).
        changed: Whether the robot would drive something else if it were alone.
        distance: Clearance at its start, m.
    """

    time: float
    code: int
    twist: Twist
    changed: bool
    distance: float


@compiled
def record(setup: Setup, task: Task, run: Run, driven: Driven) -> None:
    """Integrate a twist over one control step, and record what happens.

    Where its clearance is too great to matter by the end, nobody looks.
    """
    now, outcome = run.now, run.outcome[0]
    dt, (v, omega), time = setup.settings[0].dt, driven.twist, driven.time
    pose, distance = (now[X], now[Y], now[HEADING]), driven.distance
    # Blocked and relaxed exclude each other, as the statuses of a log do.
    if now[HELD] > 0.0 and v == 0.0 and omega == 0.0:
        outcome.blocked += dt
    elif driven.code == RELAXED:
        outcome.relaxed += dt
    outcome.changed += dt if driven.changed else 0.0
    pace = greatest_pace(setup.robot, v, omega, now[MAX_V])
    room, touched, now[TOUCHED] = outcome.room, now[TOUCHED], 0.0
    # Nothing can come nearer than distance − pace · dt. If that changes neither the
    # least clearance, nor whether it touches, nor the least room, the arc is not
    # sampled.
    if distance - pace * dt < max(outcome.clearance, 0.0, room + now[WIDEST]):
        motion = Motion(pose, (v, omega), 0.0, time, pace)
        view = view_of(setup, task, run)
        near, outcome.room = room_on_the_way(setup, motion, view, room)
        outcome.clearance = min(outcome.clearance, near)
        now[TOUCHED] = 1.0 if min(distance, near) < 0.0 else 0.0
        # Struck: contact begins while the robot's own part of the pace is more than a
        # crawl. Who is run into while standing has not struck anybody.
        if now[TOUCHED] > touched and pace - now[MAX_V] > CRAWL:
            outcome.struck += 1.0
    x, y, heading = arc(pose[0], pose[1], pose[2], v, omega, dt)
    now[X], now[Y], now[HEADING] = x, y, heading
    note_arrival(run.outcome, task.goal, (x, y, heading), time + dt)
    if (x - now[MARK_X]) ** 2 + (y - now[MARK_Y]) ** 2 > PROGRESS * PROGRESS:
        now[MARK_X], now[MARK_Y], now[MARK_TIME] = x, y, time
    outcome.still, outcome.time = time - now[MARK_TIME], time
    outcome.length += abs(v) * dt
    # The mean is kept as it goes, for a compiled loop stores no trajectory; v of two
    # steps ago is known from the third step on.
    steps = round(time / dt)
    if steps > 1:
        jerk = abs(v - 2.0 * now[LAST_V] + now[BEFORE_V]) / (dt * dt)
        outcome.jerk += (jerk - outcome.jerk) / (steps - 1)
    now[BEFORE_V], now[LAST_V] = now[LAST_V], v


@compiled_once
def close_loop(method: int, shared: Shared, task: Task, run: Run) -> None:
    """Run one closed loop and fill the outcome; ``method`` as for control_step."""
    setup = shared.setup
    reset(setup, task, run)
    robot, dt, state = setup.robot, setup.settings[0].dt, run.state
    for step in range(task.steps):
        time = step * dt
        wanted = track(shared, task, run, time)
        # What an empty world would have made of it, taken before the step, which brings
        # the state (the twist driven last) up to date.
        free = limit_twist(robot, wanted, (state[0], state[1]), dt)
        o = control_step(method, shared, task, run, wanted)
        twist = (o.v, o.omega)
        changed = differs(free, twist)
        record(setup, task, run, Driven(time, o.code, twist, changed, o.clearance))
        if is_over(time, task.quiet, run.outcome):
            break


@entry
@compiled
def differs(free: Twist, twist: Twist) -> bool:
    """Return whether a twist is not what the robot would drive if it were alone."""
    return abs(twist[0] - free[0]) + abs(twist[1] - free[1]) > UNCHANGED
