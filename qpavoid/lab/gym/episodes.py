"""Episodes side by side, each in a world of its own, through the compiled loop."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box

from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.scene import Setup
from qpavoid.compiled import compiled, compiled_once
from qpavoid.errors import InvalidInputError
from qpavoid.guide.stage import StageMemory
from qpavoid.lab.sensing.lidar import LidarSettings, cast_rays
from qpavoid.lab.simulation import loop
from qpavoid.lab.simulation.outcome import OUTCOME, Goal
from qpavoid.lab.simulation.scenario import AT_LAST, Scenario
from qpavoid.lab.simulation.sensors import make_sensor
from qpavoid.model.capsules import CAPSULE_WIDTH, greatest_speed, in_robot_frame
from qpavoid.model.contacts import (
    CONTACT_WIDTH,
    contact_table,
    most_contacts,
    nearest_distance,
)
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import GREATEST, limit_twist, limits_of
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.types import Array, Arrays, Pose, Twist

Flags: TypeAlias = npt.NDArray[np.bool_]
Floats: TypeAlias = npt.NDArray[np.float32]

HEAD, VIEW, REACH, POST = 6, 1000.0, 10.0, LidarSettings().point_radius
"""Numbers of an observation before its rays; in m how far away a goal is seen at most,
how long a ray is, and what a point is as thick as for it."""

ARRIVED, TOUCHING = 10.0, -10.0
"""Rewards at the end of an episode, beside one for each metre nearer to the goal."""


class Slots(NamedTuple):
    """n robots, what is round them in the world frame, and memory for one's view of it.

    ``now``, ``noted`` and ``twists`` are as the compiled loop keeps them; ``goals``:
    pose and allowed errors, m and rad; ``told``: clearance and distance from the goal,
    m, and how long obstacles have moved since they were shown, s; ``sizes``: how many
    points and capsules a robot has round it; ``beams``: directions of rays.
    """

    now: Array
    noted: npt.NDArray[np.void]
    twists: Array
    goals: Array
    told: Array
    sizes: npt.NDArray[np.int64]
    points: Array
    capsules: Array
    seen: Arrays
    memory: Array
    beams: Array


@compiled
def at_slot(slots: Slots, i: int) -> tuple[loop.Task, loop.Run]:
    """Return what the compiled loop calls the task and the run of a robot."""
    n, m, now, goal = slots.sizes[i, 0], slots.sizes[i, 1], slots.now[i], slots.goals[i]
    pose = (now[loop.X], now[loop.Y], now[loop.HEADING])
    end = Goal((goal[0], goal[1], goal[2]), goal[3], goal[4])
    world = (slots.points[i, :n], slots.capsules[i, :m])
    # The loop's record wants a stage and a plan, which nobody looks at here: any array
    # of the right shape stands for them. What is seen is scratch, shared by all slots.
    seen, none = (slots.seen[0][:n], slots.seen[1][:m]), slots.goals
    noted, state, memory = slots.noted[i : i + 1], slots.twists[i], slots.memory
    guiding = StageMemory(none, memory)
    run = loop.Run(now, noted, state, state, guiding, none, seen, memory)
    return loop.Task(none, world, pose, end, 0, 0.0), run


@compiled_once
def reset_slot(setup: Setup, slots: Slots, i: int) -> None:
    """Begin a run where the robot is."""
    task, run = at_slot(slots, i)
    loop.reset(setup, task, run)


@compiled_once
def drive_slots(setup: Setup, slots: Slots, twists: Array, moving: Flags) -> None:
    """Drive those that are ``moving`` for a control step, within their limits."""
    dt = setup.settings[0].dt
    for i in range(moving.shape[0]):
        if moving[i]:
            (task, run), told = at_slot(slots, i), slots.told[i]
            asked, last = (twists[i, 0], twists[i, 1]), (run.state[0], run.state[1])
            twist = limit_twist(setup.robot, asked, last, dt)
            # By the very function of the compiled loop: contacts and arrival mean the
            # same.
            driven = loop.Driven(told[2], 0, twist, False, told[0])
            loop.record(setup, task, run, driven)
            run.state[0], run.state[1] = twist
            told[2] += dt


@compiled_once
def observe_slots(setup: Setup, slots: Slots, rows: Array) -> None:
    """Fill what is told, and the rows (n, :data:`HEAD` + m) of all robots."""
    size = limits_of(setup.robot).circumradius
    for i in range(rows.shape[0]):
        (task, run), row, told = at_slot(slots, i), rows[i], slots.told[i]
        in_robot_frame(task.start, told[2], task.world, run.seen)
        contacts = loop.view_of(setup, task, run).contacts
        _, nearest = contact_table(setup.edges, size, run.seen, 0.0, contacts)
        x, y, turn = tracking_error(task.start, task.goal.pose)
        told[0] = nearest_distance(contacts, nearest)
        told[1] = math.sqrt(x * x + y * y)
        row[0], row[1] = min(max(x, -VIEW), VIEW), min(max(y, -VIEW), VIEW)
        row[2], row[3] = math.cos(turn), math.sin(turn)
        row[4], row[5] = run.state[0], run.state[1]
        row[HEAD:] = REACH
        cast_rays(slots.beams, run.seen, POST, row[HEAD:])


def twists_of(actions: Any, shape: tuple[int, ...]) -> Array:
    """Return actions as twists (…, 2), m/s and rad/s, within what the filter counts by.

    Raises:
        InvalidInputError: They are not finite numbers, or of another shape.
    """
    try:
        twists = np.array(actions, dtype=np.float64)
    except (TypeError, ValueError):
        twists = np.empty(0)
    if twists.shape != shape or not np.isfinite(twists).all():
        raise InvalidInputError(f"finite twists {shape} are wanted, not {actions!r}")
    return twists.clip(-GREATEST, GREATEST)


def shielded(
    safety: SafetyFilter, action: Array, seen: Obstacles
) -> tuple[Decision, float]:
    """Return the filter's decision for an action, and its cost (u − a)ᵀ W (u − a).

    In m²/s², of the twist u for the action a: what the filter minimises.
    """
    (v, omega), (w_v, w_omega) = action.tolist(), safety.settings.weights
    decision = safety.filter(v, omega, seen)
    d_v, d_omega = decision.v - v, decision.omega - omega
    return decision, w_v * d_v**2 + w_omega * d_omega**2


class Episodes:
    """n episodes in lockstep, of one kind of robot.

    Args:
        n: How many.
        scene: Any of its kind.
        worlds: There is room for each of these.
        beams: Rays of an observation.
        shield: Whether actions pass the filter.

    Raises:
        InvalidInputError: Less than one episode, or than no rays.
    """

    def __init__(
        self,
        n: int,
        scene: Scenario,
        worlds: Sequence[Obstacles],
        beams: int,
        shield: bool,
    ) -> None:
        if n < 1 or beams < 0:
            raise InvalidInputError("num_envs >= 1 and beams >= 0 are wanted")
        robot, settings, limits = scene.robot, scene.settings, scene.robot.limits
        arrays, edges = [world.arrays for world in worlds], robot.footprint.edges
        points, capsules = (max(map(len, some)) for some in zip(*arrays, strict=True))
        contacts = max(most_contacts(edges, some) for some in arrays)
        angles = 2.0 * math.pi * ((np.arange(beams) + 0.5) / max(beams, 1) - 0.5)
        low = np.clip([limits.v_min, limits.omega_min], -GREATEST, 0.0)
        high = np.clip([limits.v_max, limits.omega_max], 0.0, GREATEST)
        least = np.concatenate([[-VIEW, -VIEW, -1.0, -1.0], low, np.zeros(beams)])
        most = np.concatenate([[VIEW, VIEW, 1.0, 1.0], high, np.full(beams, REACH)])
        self.action_space = Box(*np.array([low, high], dtype=np.float32))
        self.observation_space = Box(*np.array([least, most], dtype=np.float32))
        self._slots = Slots(
            now=np.zeros((n, loop.RUN_SIZE)),
            noted=np.zeros(n, OUTCOME),
            twists=np.zeros((n, 2)),
            goals=np.zeros((n, 5)),
            told=np.zeros((n, 3)),
            sizes=np.zeros((n, 2), np.int64),
            points=np.zeros((n, points, 2)),
            capsules=np.zeros((n, capsules, CAPSULE_WIDTH)),
            seen=(np.zeros((points, 2)), np.zeros((capsules, CAPSULE_WIDTH))),
            memory=np.zeros(contacts * CONTACT_WIDTH),
            beams=np.column_stack([np.cos(angles), np.sin(angles)]),
        )
        self._setup = Setup(edges, robot.limit_vector, settings.record())
        self._filters = [SafetyFilter(robot, settings) for _ in range(n * shield)]
        self._scenes, self._worlds = [scene] * n, [worlds[0]] * n
        self._see = [make_sensor(scene)] * n
        self._away, self._cost, self._steps, self._most = np.zeros((4, n))
        self._ends, self._steady = np.zeros((2, n), np.bool_)

    def begin(self, i: int, scene: Scenario, world: Obstacles) -> None:
        """Let episode i begin among these obstacles, world frame."""
        slots, self._scenes[i], self._steps[i] = self._slots, scene, 0
        self._see[i], self._steady[i] = make_sensor(scene), scene.world.is_steady
        self._ends[i], self._most[i] = scene.ends_at_goal, scene.steps
        slots.goals[i] = *scene.path.sample(AT_LAST)[0, :3], *scene.arrival
        slots.now[i, : loop.HEADING + 1], slots.twists[i] = scene.start, 0.0
        self.show(i, world)
        reset_slot(self._setup, slots, i)
        for safety in self._filters[i : i + 1]:
            safety.reset()

    def show(self, i: int, world: Obstacles) -> None:
        """Let these be where they are now round robot i, world frame."""
        (points, capsules), slots, self._worlds[i] = world.arrays, self._slots, world
        # Time begins anew with what is shown, which moves on from here at its
        # velocities.
        slots.sizes[i], slots.told[i, 2] = (len(points), len(capsules)), 0.0
        slots.points[i, : len(points)] = points
        slots.capsules[i, : len(capsules)] = capsules
        slots.now[i, loop.MAX_V] = greatest_speed(capsules)

    def follow(self) -> None:
        """Bring what does not keep its velocity to where it is by now."""
        # What keeps its velocity is moved on in compiled code, by its time alone.
        for i in np.flatnonzero(~self._steady).tolist():
            scene = self._scenes[i]
            self.show(i, scene.world.at(scene.dt * self._steps[i]))

    def seen(self, i: int) -> Obstacles:
        """Return what the sensors of robot i see, its frame; once a step."""
        now, time = self._worlds[i].moved(self._slots.told[i, 2]), self._steps[i]
        return self._see[i](self._scenes[i].dt * time, now, self.motion(i)[0])

    def drive(self, actions: Any, moving: Flags) -> None:
        """Drive those that are ``moving`` for a control step, within their limits.

        Raises:
            InvalidInputError: The twists (n, 2) are not finite, or of another shape.
        """
        twists = twists_of(actions, self._slots.twists.shape)
        for i in np.flatnonzero(moving[: len(self._filters)]).tolist():
            safety, seen = self._filters[i], self.seen(i)
            decision, self._cost[i] = shielded(safety, twists[i], seen)
            twists[i] = decision[:2]
        self._away = self._slots.told[:, 1].copy()
        drive_slots(self._setup, self._slots, twists, moving)
        self._steps += moving

    def look(self) -> tuple[Floats, Array, dict[str, Any]]:
        """Return what is observed (n, :data:`HEAD` + m) now, rewards, and the rest."""
        rows = np.empty((len(self._steps), HEAD + len(self._slots.beams)))
        observe_slots(self._setup, self._slots, rows)
        touched, told = self._slots.now[:, loop.TOUCHED] > 0.0, self._slots.told
        arrived = self._ends & np.isfinite(self._slots.noted["arrived"]) & ~touched
        rewards = self._away - told[:, 1] + ARRIVED * arrived + TOUCHING * touched
        info = {"clearance": told[:, 0].copy(), "touched": touched, "arrived": arrived}
        cost = {"cost": self._cost.copy()} if self._filters else {}
        late = {"late": self._steps >= self._most}
        return rows.astype(np.float32), rewards, info | late | cost

    def motion(self, i: int) -> tuple[Pose, Twist]:
        """Return pose and twist of robot i, world frame."""
        x, y, heading, *_ = self._slots.now[i].tolist()
        v, omega = self._slots.twists[i].tolist()
        return (x, y, heading), (v, omega)
