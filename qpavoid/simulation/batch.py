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
from qpavoid.avoidance.rows import wanted_distance
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import compiled
from qpavoid.detour.room import outline
from qpavoid.detour.settings import RECORD as DETOUR_RECORD
from qpavoid.detour.settings import DetourSettings
from qpavoid.detour.stage import detour_step
from qpavoid.detour.state import BLOCKED, CLEAR
from qpavoid.detour.state import STATE_SIZE as STAGE_SIZE
from qpavoid.model.contact import contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Arrays, Obstacles, in_robot_frame
from qpavoid.model.robot import Robot, limit_twist
from qpavoid.motion.station import RESTING, track_step
from qpavoid.motion.tracking import Tracker, tracking_error
from qpavoid.motion.waiting import NEVER, Waiting, waiting_reference

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
    points: Array,
    discs: Array,
    disc_velocities: Array,
    walls: Array,
    v: float,
    omega: float,
    state: Array,
) -> tuple[int, float, float]:
    """Return code and twist of one step of a method, and bring ``state`` up to date."""
    if method == EQ5 or method == EQ7:
        law = 5 if method == EQ5 else 7
        code, v, omega, _, _ = repulsion_step(
            law,
            edges,
            robot,
            settings,
            points,
            discs,
            disc_velocities,
            walls,
            0.0,
            v,
            omega,
            state,
        )
    elif method == QP or method == QP_AHEAD:
        code, v, omega, _, _, _, _, _, _ = filter_step(
            edges,
            robot,
            settings,
            points,
            discs,
            disc_velocities,
            walls,
            0.0,
            method == QP_AHEAD,
            v,
            omega,
            state,
        )
    else:
        code = 0
        v, omega = limit_twist(robot, v, omega, state[0], state[1], settings[0].dt)
        state[0], state[1] = v, omega
    return code, v, omega


@compiled
def room_round(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    x: float,
    y: float,
    heading: float,
    time: float,
    obstacles: Arrays,
    least: float,
) -> tuple[float, float]:
    """Return the least distance, and the least distance less r_min(v_o), at a pose, m.

    Discs have moved for ``time`` seconds. The second is exact where it is below
    ``least``.
    """
    points, discs, disc_velocities, walls = obstacles
    moved = discs.copy()
    moved[:, :2] += time * disc_velocities
    seen = in_robot_frame(x, y, heading, points, moved, disc_velocities, walls)
    numbers, _, _ = contact_table(
        edges, robot[8], seen[0], seen[1], seen[2], seen[3], least + settings[0].high
    )
    least = room = math.inf
    for k in range(numbers.shape[0]):
        v_x, v_y = numbers[k, 5], numbers[k, 6]
        r_min, _ = wanted_distance(settings, math.sqrt(v_x * v_x + v_y * v_y), 0.0)
        least = min(least, numbers[k, 4])
        room = min(room, numbers[k, 4] - r_min)
    return least, room


@compiled
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
    dt = settings[0].dt
    x, y, heading = start[0], start[1], start[2]
    state, mode, place = fresh_state(), RESTING, 0.0
    mark_x, mark_y, mark_time = x, y, 0.0
    stage, progress = np.zeros(STAGE_SIZE), CLEAR
    state[:2] = start[3:]
    pace = max(-robot[0], robot[1]) + max(-robot[2], robot[3]) * robot[8]
    for i in range(discs.shape[0]):
        v_x, v_y = disc_velocities[i]
        pace = max(pace, pace + math.sqrt(v_x * v_x + v_y * v_y))
    world = (points, discs, disc_velocities, walls)
    least, room = room_round(
        edges, robot, settings, x, y, heading, 0.0, world, math.inf
    )
    distance = least
    deviation = changed = relaxed = blocked = 0.0
    arrived, error, heading_error, time = math.inf, math.inf, math.inf, 0.0
    for step in range(steps):
        time = step * dt
        moved = discs.copy()
        moved[:, :2] += time * disc_velocities
        seen = in_robot_frame(x, y, heading, points, moved, disc_velocities, walls)
        x_r, y_r, heading_r, v_r, omega_r, rate = waiting_reference(
            plan, place, x, y, waiting[0], waiting[1], waiting[2]
        )
        place += rate
        deviation = max(deviation, math.sqrt((x - x_r) ** 2 + (y - y_r) ** 2))
        reference = (x_r, y_r, heading_r, v_r, omega_r)
        v_f, omega_f, mode = track_step(law, robot, x, y, heading, reference, mode)
        if detour.shape[0] == 1:
            e_x, e_y, e_gamma = tracking_error(x, y, heading, x_r, y_r, heading_r)
            progress, v_f, omega_f = detour_step(
                stage,
                body,
                detour,
                seen[0],
                seen[1],
                seen[2],
                seen[3],
                v_f,
                omega_f,
                e_x,
                e_y,
                e_gamma,
                v_r,
                state[0],
                state[1],
                dt,
            )
            blocked += dt if progress == BLOCKED else 0.0
        free_v, free_omega = limit_twist(robot, v_f, omega_f, state[0], state[1], dt)
        code, v, omega = control_step(
            method,
            edges,
            robot,
            settings,
            seen[0],
            seen[1],
            seen[2],
            seen[3],
            v_f,
            omega_f,
            state,
        )
        if abs(v - free_v) + abs(omega - free_omega) > 1e-6:
            changed += dt
        if code == RELAXED:
            relaxed += dt
        distance -= pace * dt
        looks = substeps if distance < max(least, room + settings[0].high) else 0
        for k in range(1, looks + 1):
            part = dt * k / substeps
            p_x, p_y, p_heading = arc(x, y, heading, v, omega, part)
            distance, spare = room_round(
                edges, robot, settings, p_x, p_y, p_heading, time + part, world, room
            )
            least, room = min(least, distance), min(room, spare)
        x, y, heading = arc(x, y, heading, v, omega, dt)
        error = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
        heading_error = abs(wrap_angle(heading - goal[2]))
        if error > goal[3] or heading_error > goal[4]:
            arrived = math.inf
        elif arrived == math.inf:
            arrived = time + dt
        if (x - mark_x) ** 2 + (y - mark_y) ** 2 > PROGRESS * PROGRESS:
            mark_x, mark_y, mark_time = x, y, time
        if time > max(quiet, arrived + SETTLED):
            break
    outcome[:] = (
        least,
        room,
        deviation,
        changed,
        relaxed,
        blocked,
        arrived,
        error,
        heading_error,
        time - mark_time,
        time,
    )


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
