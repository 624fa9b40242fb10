"""One closed loop, compiled: the functions of a single run, step after step.

Discs keep their velocities from time 0 on; points and walls stand. What comes back is
one row of :data:`OUTCOME`, not the trajectory.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import RELAXED
from qpavoid.avoidance.repulsion import repulsion_step
from qpavoid.avoidance.rows import wanted_distance
from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import compiled, compiled_once
from qpavoid.detour.stage import detour_step
from qpavoid.detour.state import BLOCKED
from qpavoid.model.contacts import contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Arrays, in_robot_frame
from qpavoid.model.robot import limit_twist
from qpavoid.motion.path import Pose
from qpavoid.motion.station import RESTING, track_step
from qpavoid.motion.tracking import Reference, tracking_error
from qpavoid.motion.waiting import waiting_reference
from qpavoid.simulation.clearance import greatest_pace, room_on_the_way, room_round

TRACK_ALONE, EQ5, EQ7, QP, QP_AHEAD = range(5)
METHODS = {"eq5": EQ5, "eq7": EQ7, "qp": QP, "qp-ahead": QP_AHEAD, "none": TRACK_ALONE}

OUTCOME = np.dtype(
    [
        ("clearance", np.float64),
        ("room", np.float64),
        ("deviation", np.float64),
        ("changed", np.float64),
        ("relaxed", np.float64),
        ("blocked", np.float64),
        ("arrived", np.float64),
        ("error", np.float64),
        ("heading_error", np.float64),
        ("still", np.float64),
        ("time", np.float64),
    ]
)
"""Least clearance (m), least clearance less r_min(v_o) (m), greatest distance from the
reference (m), seconds with a twist other than the desired one, relaxed, and blocked,
when it had arrived for good (s; inf: never), last errors (m, rad), for how long it had
not come :data:`PROGRESS` far at the end, and how long it ran (s)."""

(
    CLEARANCE,
    ROOM,
    DEVIATION,
    CHANGED,
    RELAXED_TIME,
    BLOCKED_TIME,
    ARRIVED,
    ERROR,
    HEADING_ERROR,
    STILL,
    TIME,
) = range(11)

PROGRESS = 0.1
"""m"""

SETTLED = 1.0
"""s at the goal after which nothing more is expected to happen."""


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
    known = (edges, robot, settings)
    if method == EQ5 or method == EQ7:
        law = 5 if method == EQ5 else 7
        code, v, omega, clearance, _ = repulsion_step(
            law, *known, obstacles, 0.0, v, omega, state, memory
        )
    elif method == QP or method == QP_AHEAD:
        code, v, omega, clearance, _, _, _, _, _ = filter_step(
            *known, *obstacles, 0.0, method == QP_AHEAD, v, omega, state, memory
        )
    else:
        code = 0
        v, omega = limit_twist(robot, v, omega, state[0], state[1], settings[0].dt)
        state[0], state[1] = v, omega
        _, nearest = contact_table(edges, robot[8], obstacles, 0.0, memory)
        clearance = memory[nearest, 4] if nearest >= 0 else math.inf
    return code, v, omega, clearance


@compiled
def desired_twist(
    robot: Array,
    dt: float,
    law: Array,
    detour: npt.NDArray[np.void],
    body: Array,
    pose: Pose,
    reference: Reference,
    obstacles: Arrays,
    state: Array,
    stage: Array,
    mode: int,
) -> tuple[float, float, int, bool]:
    """Return what tracking, and the way round a stall, ask for; mode, and blocked."""
    x, y, heading = pose
    v, omega, mode = track_step(law, robot, x, y, heading, reference, mode)
    if detour.shape[0] == 0:
        return v, omega, mode, False
    x_r, y_r, heading_r, v_r, _ = reference
    error = tracking_error(x, y, heading, x_r, y_r, heading_r)
    progress, v, omega = detour_step(
        stage,
        body,
        detour,
        *obstacles,
        v,
        omega,
        *error,
        v_r,
        state[0],
        state[1],
        dt,
    )
    return v, omega, mode, progress == BLOCKED


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
    outcome: Array,
    state: Array,
    stage: Array,
    seen: Arrays,
    memory: Array,
) -> None:
    """Run one closed loop and fill ``outcome`` in the order of :data:`OUTCOME`.

    Args:
        method: One of :data:`METHODS`.
        edges: Footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.numbers`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        law: Of the tracker.
        waiting: free, wide, least_rate of the reference's clock.
        detour: One :data:`qpavoid.detour.settings.RECORD`, or none: no such stage.
        body: The footprint as :func:`qpavoid.detour.room.outline` gives it.
        plan: (n, 5) reference, a row a control step.
        world: Obstacles at time 0, world frame, as all that follows.
        start: Pose at time 0.
        goal: x, y, γ that count as arrival, and the errors allowed, m and rad.
        steps: Greatest number of control steps.
        quiet: s; before, the run is not over even if the robot is at its goal.
        outcome: (11,) filled.
        state: Of the controller; the twist at time 0 is in it.
        stage: Of the detour.
        seen: Memory for the obstacles in the robot frame.
        memory: As :func:`qpavoid.avoidance.step.filter_step` needs it.
    """
    dt, known = settings[0].dt, (edges, robot, settings)
    _, fastest = greatest_pace(robot, 0.0, 0.0, world[2])
    widest, _ = wanted_distance(settings, fastest, 0.0)
    (x, y, heading), mode, place = start, RESTING, 0.0
    mark_x, mark_y, mark_time, time = x, y, 0.0, 0.0
    motion = (x, y, heading, 0.0, 0.0, 0.0)
    least, room = room_round(*known, motion, world, math.inf, seen, memory)
    outcome[:] = 0.0
    outcome[ARRIVED] = outcome[ERROR] = outcome[HEADING_ERROR] = math.inf
    for step in range(steps):
        time = step * dt
        in_robot_frame(x, y, heading, time, world, seen)
        x_r, y_r, heading_r, v_r, omega_r, rate = waiting_reference(
            plan, place, x, y, *waiting
        )
        place += rate
        away = math.sqrt((x - x_r) ** 2 + (y - y_r) ** 2)
        outcome[DEVIATION] = max(outcome[DEVIATION], away)
        reference, pose = (x_r, y_r, heading_r, v_r, omega_r), (x, y, heading)
        v_f, omega_f, mode, blocked = desired_twist(
            robot, dt, law, detour, body, pose, reference, seen, state, stage, mode
        )
        free_v, free_omega = limit_twist(robot, v_f, omega_f, state[0], state[1], dt)
        code, v, omega, distance = control_step(
            method, *known, seen, v_f, omega_f, state, memory
        )
        outcome[BLOCKED_TIME] += dt if blocked else 0.0
        outcome[RELAXED_TIME] += dt if code == RELAXED else 0.0
        if abs(v - free_v) + abs(omega - free_omega) > 1e-6:
            outcome[CHANGED] += dt
        pace = abs(v) + abs(omega) * robot[8] + fastest
        if distance - pace * dt < max(least, room + widest):
            motion = (x, y, heading, v, omega, time)
            distance, room = room_on_the_way(
                *known, motion, dt, pace, world, room, seen, memory
            )
            least = min(least, distance)
        x, y, heading = arc(x, y, heading, v, omega, dt)
        note_arrival(outcome, goal, x, y, heading, time + dt)
        if (x - mark_x) ** 2 + (y - mark_y) ** 2 > PROGRESS * PROGRESS:
            mark_x, mark_y, mark_time = x, y, time
        if time > max(quiet, outcome[ARRIVED] + SETTLED):
            break
    outcome[CLEARANCE], outcome[ROOM] = least, room
    outcome[STILL], outcome[TIME] = time - mark_time, time


@compiled
def note_arrival(
    outcome: Array, goal: Reference, x: float, y: float, heading: float, time: float
) -> None:
    """Write the errors at the goal, and since when they have been small enough."""
    error = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
    heading_error = abs(wrap_angle(heading - goal[2]))
    if error > goal[3] or heading_error > goal[4]:
        outcome[ARRIVED] = math.inf
    elif outcome[ARRIVED] == math.inf:
        outcome[ARRIVED] = time
    outcome[ERROR], outcome[HEADING_ERROR] = error, heading_error
