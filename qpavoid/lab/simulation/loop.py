"""One closed loop, compiled: the functions of a single run, step after step.

Capsules keep their velocities and rates of turn from time 0 on. What comes back is
one row of :data:`qpavoid.lab.simulation.outcome.OUTCOME`, not the trajectory.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import wanted_distance
from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.decision import RELAXED
from qpavoid.avoidance.repulsion import repulsion_step
from qpavoid.avoidance.step import filter_outcome
from qpavoid.compiled import compiled, compiled_once
from qpavoid.guide.stage import detour_step
from qpavoid.guide.state import BLOCKED
from qpavoid.lab.simulation.clearance import greatest_pace, room_on_the_way, room_round
from qpavoid.lab.simulation.outcome import (
    ARRIVED,
    BLOCKED_TIME,
    CHANGED,
    CLEARANCE,
    CRAWL,
    DEVIATION,
    ERROR,
    HEADING_ERROR,
    LENGTH,
    MOVING,
    PROGRESS,
    RELAXED_TIME,
    ROOM,
    STILL,
    TIME,
    is_over,
    note_arrival,
)
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Arrays, greatest_speed, in_robot_frame
from qpavoid.model.robot import limit_twist, limits_of
from qpavoid.qp.exact import WIDTH, Pair
from qpavoid.tracking.clock import waiting_reference
from qpavoid.tracking.kanayama import Reference, tracking_error
from qpavoid.tracking.path import Pose
from qpavoid.tracking.station import RESTING, track_step

TRACK_ALONE, EQ5, EQ7, QP, QP_AHEAD = range(5)

X, Y, HEADING, PLACE, MODE, MARK_X, MARK_Y, MARK_TIME, FASTEST, WIDEST, HELD = range(11)
RUN_SIZE = 11
"""Where a run is: pose, place on the plan, mode of the tracker, where and when it last
had come :data:`qpavoid.lab.simulation.outcome.PROGRESS` far; speed and r_min of the
fastest obstacle; and whether the way is blocked."""


@compiled
def contacts_in(edges: Array, obstacles: Arrays, memory: Array) -> tuple[Array]:
    """Return the memory of a step as a table of contacts, in a tuple for numba."""
    most = most_contacts(edges, obstacles)
    return (memory[: most * WIDTH].reshape(most, WIDTH),)


@compiled
def control_step(
    method: int,
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    v: float,
    omega: float,
    state: Array,
    memory: Array,
) -> tuple[int, float, float, float]:
    """Return code, twist and clearance of one step; brings ``state`` up to date."""
    setup = Setup(edges, robot, settings)
    (contacts,) = contacts_in(edges, obstacles, memory)
    if method == EQ5 or method == EQ7:
        law = 5 if method == EQ5 else 7
        code, v, omega, clearance, _ = repulsion_step(
            law, setup, obstacles, 0.0, (v, omega), state, contacts
        )
    elif method == QP or method == QP_AHEAD:
        ahead = method == QP_AHEAD
        outcome = filter_outcome(
            setup, obstacles, 0.0, ahead, (v, omega), state, memory
        )
        code, v, omega = outcome.code, outcome.v, outcome.omega
        clearance = outcome.clearance
    else:
        code = 0
        v, omega = limit_twist(robot, v, omega, state[0], state[1], settings[0].dt)
        state[0], state[1] = v, omega
        _, nearest = contact_table(
            edges, limits_of(robot).circumradius, obstacles, 0.0, contacts
        )
        clearance = contacts[nearest, 4] if nearest >= 0 else math.inf
    return code, v, omega, clearance


@compiled
def begin(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    world: Arrays,
    start: Pose,
    now: Array,
    outcome: Array,
    seen: Arrays,
    memory: Array,
) -> None:
    """Put the robot at its start, and look round."""
    now[X], now[Y], now[HEADING] = start
    now[PLACE], now[MODE], now[MARK_TIME], now[HELD] = 0.0, RESTING, 0.0, 0.0
    now[MARK_X], now[MARK_Y] = now[X], now[Y]
    now[FASTEST] = greatest_speed(world[1])
    now[WIDEST], _ = wanted_distance(settings, now[FASTEST], 0.0)
    motion = (start[0], start[1], start[2], 0.0, 0.0, 0.0, 0.0)
    (contacts,) = contacts_in(edges, seen, memory)
    least, room = room_round(
        edges, robot, settings, motion, world, math.inf, seen, contacts
    )
    for i in range(outcome.shape[0]):
        outcome[i] = 0.0
    outcome[CLEARANCE], outcome[ROOM] = least, room
    outcome[ARRIVED] = outcome[ERROR] = outcome[HEADING_ERROR] = math.inf
    outcome[MOVING] = math.inf


@compiled
def lead(
    robot: Array,
    dt: float,
    law: Array,
    waiting: tuple[float, float, float],
    detour: npt.NDArray[np.void],
    body: Array,
    plan: Array,
    world: Arrays,
    time: float,
    now: Array,
    outcome: Array,
    state: Array,
    stage: Array,
    seen: Arrays,
) -> tuple[float, float]:
    """Look, and return the twist that tracking, and the way round a stall, ask for."""
    x, y, heading = now[X], now[Y], now[HEADING]
    in_robot_frame(x, y, heading, time, world, seen)
    x_r, y_r, heading_r, v_r, omega_r, rate = waiting_reference(
        plan, now[PLACE], x, y, *waiting
    )
    now[PLACE] += rate
    away = math.sqrt((x - x_r) ** 2 + (y - y_r) ** 2)
    outcome[DEVIATION] = max(outcome[DEVIATION], away)
    reference = (x_r, y_r, heading_r, v_r, omega_r)
    v, omega, mode = track_step(law, robot, x, y, heading, reference, int(now[MODE]))
    now[MODE] = mode
    if detour.shape[0] == 0:
        return v, omega
    error = tracking_error(x, y, heading, x_r, y_r, heading_r)
    driven = (state[0], state[1])
    progress, v, omega = detour_step(
        stage, body, detour, *seen, v, omega, *error, v_r, *driven, dt
    )
    now[HELD] = 1.0 if progress == BLOCKED else 0.0
    return v, omega


@compiled
def advance(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    world: Arrays,
    goal: Reference,
    time: float,
    code: int,
    driven: Pair,
    changed: bool,
    distance: float,
    now: Array,
    outcome: Array,
    seen: Arrays,
    memory: Array,
) -> None:
    """Drive a twist for one control step, and note what happens.

    ``distance`` is the clearance at its start, m: where it is too great to matter by
    the end, nobody looks.
    """
    dt, (v, omega) = settings[0].dt, driven
    x, y, heading = now[X], now[Y], now[HEADING]
    if now[HELD] > 0.0 and v == 0.0 and omega == 0.0:
        outcome[BLOCKED_TIME] += dt
    elif code == RELAXED:
        outcome[RELAXED_TIME] += dt
    outcome[CHANGED] += dt if changed else 0.0
    pace = greatest_pace(robot, v, omega, now[FASTEST])
    least, room = outcome[CLEARANCE], outcome[ROOM]
    moves = pace - now[FASTEST] > CRAWL
    nearest = outcome[MOVING] if moves else least
    if distance - pace * dt < max(least, nearest, room + now[WIDEST]):
        motion = (x, y, heading, v, omega, 0.0, time)
        (contacts,) = contacts_in(edges, seen, memory)
        near, outcome[ROOM] = room_on_the_way(
            edges, robot, settings, motion, dt, pace, world, room, seen, contacts
        )
        outcome[CLEARANCE] = min(least, near)
        if moves:
            outcome[MOVING] = min(outcome[MOVING], distance, near)
    x, y, heading = arc(x, y, heading, v, omega, dt)
    now[X], now[Y], now[HEADING] = x, y, heading
    note_arrival(outcome, goal, x, y, heading, time + dt)
    if (x - now[MARK_X]) ** 2 + (y - now[MARK_Y]) ** 2 > PROGRESS * PROGRESS:
        now[MARK_X], now[MARK_Y], now[MARK_TIME] = x, y, time
    outcome[STILL], outcome[TIME] = time - now[MARK_TIME], time
    outcome[LENGTH] += abs(v) * dt


@compiled_once
def close_loop(
    method: int,
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    law: Array,
    waiting: tuple[float, float, float],
    detour: npt.NDArray[np.void],
    body: Array,
    plan: Array,
    world: Arrays,
    start: Pose,
    goal: Reference,
    steps: int,
    quiet: float,
    now: Array,
    outcome: Array,
    state: Array,
    stage: Array,
    seen: Arrays,
    memory: Array,
) -> None:
    """Run one closed loop and fill ``outcome``.

    Args:
        method: One of :data:`METHODS`.
        edges: Footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.numbers`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        law: Of the tracker.
        waiting: free, wide, least_rate of the reference's clock.
        detour: One :data:`qpavoid.guide.settings.RECORD`, or none: no such stage.
        body: The footprint as :func:`qpavoid.guide.room.outline` gives it.
        plan: (n, 5) reference, a row a control step.
        world: Obstacles at time 0, world frame, as all that follows.
        start: Pose at time 0.
        goal: x, y, γ that count as arrival, and the errors allowed, m and rad.
        steps: Greatest number of control steps.
        quiet: s; before, the run is not over even if the robot is at its goal.
        now: (:data:`RUN_SIZE`,) memory of where the run is.
        outcome: (13,) filled, see :data:`qpavoid.lab.simulation.outcome.OUTCOME`.
        state: Of the controller; the twist at time 0 is in it.
        stage: Of the detour.
        seen: Memory for the obstacles in the robot frame.
        memory: As :func:`qpavoid.avoidance.step.filter_outcome` needs it.
    """
    dt, known = settings[0].dt, (edges, robot, settings)
    begin(*known, world, start, now, outcome, seen, memory)
    led = (law, waiting, detour, body, plan, world)
    for step in range(steps):
        time = step * dt
        v_f, omega_f = lead(robot, dt, *led, time, now, outcome, state, stage, seen)
        free = limit_twist(robot, v_f, omega_f, state[0], state[1], dt)
        code, v, omega, distance = control_step(
            method, *known, seen, v_f, omega_f, state, memory
        )
        changed, twist = differs(free, v, omega), (v, omega)
        advance(
            *known,
            world,
            goal,
            time,
            code,
            twist,
            changed,
            distance,
            now,
            outcome,
            seen,
            memory,
        )
        if is_over(time, quiet, outcome):
            break


@compiled
def differs(free: Pair, v: float, omega: float) -> bool:
    """Return whether (v, ω) is not what the robot would drive if it were alone."""
    return abs(v - free[0]) + abs(omega - free[1]) > 1e-6
