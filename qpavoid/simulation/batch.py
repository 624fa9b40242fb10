"""Thousands of closed loops: the functions of a single run, in one compiled loop.

Discs keep their velocities from time 0 on; points and walls stand. What comes back is
one row of :data:`OUTCOME` a run, not its trajectory.
"""

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, field

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import fresh_state
from qpavoid.avoidance.controllers import check_controllers
from qpavoid.avoidance.decision import RELAXED
from qpavoid.avoidance.repulsion import repulsion_step
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import Tables, filter_step, tables_in, work_size
from qpavoid.compiled import allocating, compiled
from qpavoid.detour.room import outline
from qpavoid.detour.settings import RECORD as DETOUR_RECORD
from qpavoid.detour.settings import DetourSettings
from qpavoid.detour.stage import detour_step
from qpavoid.detour.state import BLOCKED
from qpavoid.detour.state import STATE_SIZE as STAGE_SIZE
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Arrays, Obstacles, in_robot_frame
from qpavoid.model.robot import Robot, limit_twist
from qpavoid.motion.path import Pose
from qpavoid.motion.station import RESTING, track_step
from qpavoid.motion.tracking import Reference, Tracker, tracking_error
from qpavoid.motion.waiting import NEVER, Waiting, waiting_reference
from qpavoid.simulation.clearance import memory_for, room_on_the_way, room_round

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
    tables: Tables,
) -> tuple[int, float, float, float]:
    """Return code, twist and clearance of one step; brings ``state`` up to date."""
    known = (edges, robot, settings, obstacles, 0.0)
    if method == EQ5 or method == EQ7:
        law = 5 if method == EQ5 else 7
        code, v, omega, clearance, _ = repulsion_step(
            law, *known, v, omega, state, tables[0]
        )
    elif method == QP or method == QP_AHEAD:
        code, v, omega, clearance, _, _, _, _, _ = filter_step(
            *known, method == QP_AHEAD, v, omega, state, tables
        )
    else:
        code = 0
        v, omega = limit_twist(robot, v, omega, state[0], state[1], settings[0].dt)
        state[0], state[1] = v, omega
        _, nearest = contact_table(edges, robot[8], obstacles, 0.0, tables[0])
        clearance = tables[0][nearest, 4] if nearest >= 0 else math.inf
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


@allocating
def roll_out(
    method: int,
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    law: Array,
    waiting: tuple[float, float, float],
    detour: npt.NDArray[np.void],
    body: Array,
    plan: Array,
    points: Array,
    discs: Array,
    disc_velocities: Array,
    walls: Array,
    start: Array,
    goal: Array,
    steps: int,
    quiet: float,
    substeps: int,
    outcome: Array,
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
        points: World frame, as all that follows.
        discs: (M, 3) at time 0.
        disc_velocities: (M, 2).
        walls: (K, 4).
        start: (5,) pose and twist at time 0.
        goal: (5,) pose that counts as arrival, and the errors allowed, m and rad.
        steps: Greatest number of control steps.
        quiet: s; before, the run is not over even if the robot is at its goal.
        substeps: Looks at the clearance within a control step.
        outcome: (11,) filled.
    """
    dt, world = settings[0].dt, (points, discs, disc_velocities, walls)
    known = (edges, robot, settings)
    n = most_contacts(edges, world)
    memory, tables = memory_for(edges, world), tables_in(np.empty(work_size(n)), n)
    seen, pace = memory[:4], greatest_pace(robot, disc_velocities)
    x, y, heading = start[0], start[1], start[2]
    state, stage, mode, place = fresh_state(), np.zeros(STAGE_SIZE), RESTING, 0.0
    state[0], state[1] = start[3], start[4]
    mark_x, mark_y, mark_time, time = x, y, 0.0, 0.0
    motion = (x, y, heading, 0.0, 0.0, 0.0)
    least, room = room_round(*known, motion, world, math.inf, memory)
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
            method, *known, seen, v_f, omega_f, state, tables
        )
        outcome[BLOCKED_TIME] += dt if blocked else 0.0
        outcome[RELAXED_TIME] += dt if code == RELAXED else 0.0
        if abs(v - free_v) + abs(omega - free_omega) > 1e-6:
            outcome[CHANGED] += dt
        if distance - pace * dt < max(least, room + settings[0].high):
            motion = (x, y, heading, v, omega, time)
            distance, room = room_on_the_way(
                *known, motion, dt, substeps, world, room, memory
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
def greatest_pace(robot: Array, disc_velocities: Array) -> float:
    """Return how fast, m/s, the distance to an obstacle can shrink at most."""
    fastest = 0.0
    for i in range(disc_velocities.shape[0]):
        v_x, v_y = disc_velocities[i, 0], disc_velocities[i, 1]
        fastest = max(fastest, math.sqrt(v_x * v_x + v_y * v_y))
    turning = max(-robot[2], robot[3]) * robot[8]
    return float(max(-robot[0], robot[1]) + turning + fastest)


@compiled
def note_arrival(
    outcome: Array, goal: Array, x: float, y: float, heading: float, time: float
) -> None:
    """Write the errors at the goal, and since when they have been small enough."""
    error = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
    heading_error = abs(wrap_angle(heading - goal[2]))
    if error > goal[3] or heading_error > goal[4]:
        outcome[ARRIVED] = math.inf
    elif outcome[ARRIVED] == math.inf:
        outcome[ARRIVED] = time
    outcome[ERROR], outcome[HEADING_ERROR] = error, heading_error


@dataclass(frozen=True, eq=False)
class Loop:
    """One closed loop of a batch; world frame.

    Attributes:
        plan: (n, 5) reference, a row a control step: x, y, γ, v, ω; n ≥ 2.
        obstacles: At time 0; discs keep their velocities.
        start: Pose and twist at time 0.
        duration: s, at most.
        quiet: s; until then the run goes on even if the robot stands at its goal.
    """

    plan: Array
    obstacles: Obstacles
    start: tuple[float, float, float, float, float]
    duration: float
    quiet: float = 0.0


@dataclass(frozen=True)
class Batch:
    """What all loops of a batch have in common.

    Attributes:
        robot: Footprint and limits.
        settings: Of the controllers; its dt is the control step.
        tracker: The tracking law.
        waiting: The reference's clock.
        detour: The stage against stalls; None: there is none.
        arrival: Errors that count as arrived, m and rad.
        substeps: Looks at the clearance within a control step.
    """

    robot: Robot
    tracker: Tracker
    settings: AvoidanceSettings = field(default_factory=AvoidanceSettings)
    waiting: Waiting = NEVER
    detour: DetourSettings | None = None
    arrival: tuple[float, float] = (0.01, math.radians(1.0))
    substeps: int = 5

    def run(
        self, controller: str, loops: Sequence[Loop], threads: int | None = None
    ) -> npt.NDArray[np.void]:
        """Return the outcome of every loop, on all cores; see :data:`OUTCOME`.

        Raises:
            UnknownNameError: No controller of that name (``none``: tracking alone).
        """
        if controller != "none":
            check_controllers([controller])
        outcomes = np.zeros((len(loops), len(OUTCOME.names or ())))
        known = (
            METHODS[controller],
            self.robot.footprint.edges,
            self.robot.numbers,
            self.settings.record(),
            self.tracker.array,
            astuple(self.waiting),
            self._detour(),
            outline(self.robot.footprint),
        )

        def run_some(numbers: Iterable[int]) -> None:
            for i in numbers:
                loop = loops[i]
                roll_out(
                    *known,
                    loop.plan,
                    *loop.obstacles.arrays,
                    np.array(loop.start),
                    np.array([*loop.plan[-1, :3], *self.arrival]),
                    round(loop.duration / self.settings.dt),
                    loop.quiet,
                    self.substeps,
                    outcomes[i],
                )

        threads = threads or os.cpu_count() or 1
        with ThreadPoolExecutor(threads) as pool:
            list(
                pool.map(
                    run_some, (range(k, len(loops), threads) for k in range(threads))
                )
            )
        return outcomes.view(OUTCOME)[:, 0]

    def _detour(self) -> npt.NDArray[np.void]:
        """Return the record of the stage, or none."""
        if self.detour is None:
            return np.zeros(0, dtype=DETOUR_RECORD)
        return self.detour.record(self.robot, self.settings.radius)
