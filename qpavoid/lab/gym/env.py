"""One robot among obstacles as a Gymnasium environment; many of them; the shield."""

import math
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

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
from qpavoid.lab.simulation.simulation import make_sensor
from qpavoid.lab.study.sweep.job import find_scene
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.worlds.scenes import ScenarioFile
from qpavoid.lab.worlds.source import Source
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
    """Write the observations, and the rows (n, :data:`HEAD` + m) of all robots."""
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


Place: TypeAlias = str | os.PathLike[str] | Source
"""A scenario's file or shipped name, as ``"demo/strangers"``; or a generator of
:mod:`qpavoid.lab.worlds`, as ``Forest(2)``. Published data: ``QPAVOID_DATA``."""


class Scenes(dict[int | None, Scenario]):
    """Scenes by their seeds; another seed is an InvalidInputError."""

    def __missing__(self, seed: int | None) -> Scenario:
        raise InvalidInputError(f"scene {seed!r} is none of the seeds")


def find_scenes(source: Place, seeds: Sequence[int] | None) -> Scenes:
    """Return the scenes of these seeds; else the first 100, or all there is by a file.

    Raises:
        QPAvoidError: No such scenario, or something in it is wrong.
        InvalidInputError: No seeds, no such scene, several robots, other robots in
            other scenes, a plant or a localisation.
    """
    if isinstance(source, str | os.PathLike):
        source = scenario_file(os.fspath(source))
    fixed = isinstance(source, ScenarioFile) and not source.is_drawn
    scenes = Scenes()
    for seed in seeds if seeds is not None else [None] if fixed else range(100):
        try:
            scene = find_scene(source, seed, "{}", None)
        except IndexError:
            raise InvalidInputError(
                f"{source.name}: there is no scene {seed}"
            ) from None
        scenes[seed] = scene
        if scene.robots:
            raise InvalidInputError(f"{source.name} has several robots")
        if scene.plant or scene.localisation:
            raise InvalidInputError(f"{source.name}: no [plant] or [localisation] here")
    if len({*map(_kind, scenes.values())}) != 1:
        what = "robots or settings differ from scene to scene" if scenes else "no seeds"
        raise InvalidInputError(f"{source.name}: {what}")
    return scenes


def _kind(one: Scenario) -> bytes:
    arrays = one.robot.footprint.edges, one.robot.limit_vector, one.settings.record()
    return b"".join(array.tobytes() for array in arrays)


class ScenarioVectorEnv(VectorEnv):  # type: ignore[misc]
    """Many of :class:`ScenarioEnv` in one compiled loop.

    One that has ended begins anew in the next step (``AutoresetMode.NEXT_STEP``).

    Args:
        source: :data:`~qpavoid.lab.gym.env.Place` of the scenes.
        num_envs: How many environments.
        seeds: Of the scenes to draw from, or as ``find_scenes`` says.
        beams: Rays of an observation, all round.
        shield: Whether actions pass the filter; ``info`` has the ``cost`` of that.

    Raises:
        QPAvoidError: As :func:`~qpavoid.lab.gym.env.find_scenes` does.
        InvalidInputError: No environment, or less than no beams.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        source: Place,
        num_envs: int = 1,
        seeds: Sequence[int] | None = None,
        beams: int = 36,
        shield: bool = False,
    ) -> None:
        self._scenes = find_scenes(source, seeds)
        self.scene, *_ = made = [*self._scenes.values()]
        worlds = [scene.world.at(0.0) for scene in made]
        self.episodes = each = Episodes(num_envs, self.scene, worlds, beams, shield)
        self.single_action_space = each.action_space
        self.single_observation_space = each.observation_space
        self.action_space = batch_space(each.action_space, num_envs)
        self.observation_space = batch_space(each.observation_space, num_envs)
        self.num_envs, self._over = num_envs, np.zeros(num_envs, np.bool_)
        self._seeds, self._begun = np.array([*self._scenes][:1] * num_envs), False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin all; ``options={"scene": 7}`` names their scene."""
        super().reset(seed=seed)
        for i in range(self.num_envs):
            self._begin(i, options or {})
        self._over[:], self._begun = False, True
        return self.episodes.look()[0], {"scene": self._seeds.copy()}

    def step(self, actions: Any) -> tuple[Any, ...]:
        """Drive for a control step; see :class:`gymnasium.vector.VectorEnv`.

        Raises:
            InvalidInputError: The actions are not finite, or of another shape.
            ResetNeeded: It has not been reset.
        """
        self.want_reset()
        for i in np.flatnonzero(self._over).tolist():
            self._begin(i, {})
        moving = ~self._over
        self.episodes.drive(actions, moving)
        self.episodes.follow()
        observed, rewards, told = self.episodes.look()
        late, over = told.pop("late"), told["touched"] | told["arrived"]
        self._over, told["scene"] = over | late, self._seeds.copy()
        return observed, rewards * moving, over, late, told

    def want_reset(self) -> None:
        """Refuse what has not been reset."""
        if not self._begun:
            raise ResetNeeded("call reset first")

    def _begin(self, i: int, options: dict[str, Any]) -> None:
        seed = [*self._scenes][self.np_random.integers(len(self._scenes))]
        self._seeds[i] = seed = options.get("scene", seed)
        scene = self._scenes[seed]
        self.episodes.begin(i, scene, scene.world.at(0.0))


class ScenarioEnv(gymnasium.Env):  # type: ignore[misc]
    """A robot of a scenario, driven by a twist in each control step (``dt_s``).

    An action is v (m/s) and ω (rad/s), cut to the robot's limits. Observed are the goal
    in the robot's frame (x, y in m, cosine and sine of the turn to it), the twist
    driven last, and the lengths of exact rays from the middle of the axle, m. A reward
    is the metres that the goal came nearer, and ±10 where it is reached or an obstacle
    touched, which ends an episode; ``duration_s`` truncates it. Without
    ``ends_at_goal`` it goes on there. ``info`` has ``scene`` (its seed), ``clearance``
    (m), ``touched``, ``arrived``.

    Args:
        source: As :class:`ScenarioVectorEnv` takes it.
        seeds: The same.
        beams: The same.

    Raises:
        QPAvoidError: As :class:`ScenarioVectorEnv` does.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self, source: Place, seeds: Sequence[int] | None = None, beams: int = 36
    ) -> None:
        self._one = ScenarioVectorEnv(source, 1, seeds, beams)
        self.robot, self.settings = self._one.scene.robot, self._one.scene.settings
        self.action_space = self._one.single_action_space
        self.observation_space = self._one.single_observation_space

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles of the scenario's sensors, robot frame; read once per step."""
        self._one.want_reset()
        return self._one.episodes.seen(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; ``options={"scene": 7}`` names its scene."""
        super().reset(seed=seed)
        (observed,), told = self._one.reset(seed=seed, options=options)
        return observed, only(told)

    def step(self, action: Any) -> tuple[Any, ...]:
        """Drive for a control step; see :class:`gymnasium.Env`.

        Raises:
            InvalidInputError: The action is not finite, or of another shape.
            ResetNeeded: It has not been reset.
        """
        (observed,), rewards, over, late, told = self._one.step([action])
        return observed, float(rewards[0]), bool(over[0]), bool(late[0]), only(told)


def only(told: dict[str, Any]) -> dict[str, Any]:
    """Return what ``info`` has of one of one robot."""
    return {key: each.tolist()[0] for key, each in told.items()}


class ShieldedEnv(gymnasium.Wrapper):  # type: ignore[misc]
    """An environment of twists whose actions pass the filter.

    ``info`` has ``cost`` (:func:`~qpavoid.lab.gym.env.shielded`) and ``status``.

    Args:
        env: A :class:`ScenarioEnv`, wrapped or not; or any other, with what follows.
        obstacles: What the robot sees now, robot frame; called once a step.
        safety: The filter; that of the scenario's robot and settings.
    """

    def __init__(
        self,
        env: Any,
        obstacles: Callable[[], Obstacles] | None = None,
        safety: SafetyFilter | None = None,
    ) -> None:
        super().__init__(env)
        bare = env.unwrapped
        self._see = obstacles or (lambda: bare.obstacles)
        self._safety = safety or SafetyFilter(bare.robot, bare.settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset environment and filter; see :class:`gymnasium.Env`."""
        self._safety.reset()
        return super().reset(seed=seed, options=options)  # type: ignore[no-any-return]

    def step(self, action: Any) -> tuple[Any, ...]:
        """Drive what the filter answers; see :class:`gymnasium.Env`.

        Raises:
            InvalidInputError: The action is not finite, or of another shape.
            ResetNeeded: The environment has not been reset.
        """
        decision, cost = shielded(self._safety, twists_of(action, (2,)), self._see())
        *rest, told = self.env.step(np.array(decision[:2]))
        return *rest, {**told, "cost": cost, "status": str(decision.status)}
