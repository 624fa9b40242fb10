"""One robot among obstacles as a Gymnasium environment, and the filter as a shield."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.scenario import Scenario
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings, Sensor
from qpavoid.lab.simulation.loop import Simulation, make_sensor
from qpavoid.lab.simulation.outcome import Goal
from qpavoid.lab.study.sweep.job import find_scene
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.worlds.scenes import ScenarioFile
from qpavoid.lab.worlds.source import Source
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import GREATEST
from qpavoid.settings import want
from qpavoid.types import Array

VIEW, RAY = 1000.0, 10.0
"""m; greatest coordinate of the goal, and length of a ray, in an observation."""

ARRIVED, TOUCHING = 10.0, -10.0
"""Rewards at the end of an episode, beside one for each metre nearer to the goal."""

Place: TypeAlias = str | os.PathLike[str] | Source
"""A scenario's file or shipped name, as ``"demo/strangers"``; or a generator of
:mod:`qpavoid.lab.worlds`, as ``Forest(2)``. Published data: ``QPAVOID_DATA``."""


def twist_of(action: Any) -> Array:
    """Return an action as a twist (2,), m/s and rad/s, at most what the filter takes.

    Raises:
        InvalidInputError: It is not finite, or of another shape.
    """
    try:
        twist = np.array(action, dtype=np.float64)
    except (TypeError, ValueError):
        twist = np.empty(0)
    if twist.shape != (2,) or not np.isfinite(twist).all():
        raise InvalidInputError(f"a finite twist (v, omega) is wanted, not {action!r}")
    return twist.clip(-GREATEST, GREATEST)


def find_scenes(
    source: Place, seeds: Sequence[int] | None
) -> dict[int | None, Scenario]:
    """Return the scenes of these seeds; else the first 100, or all there is by a file.

    Raises:
        QPAvoidError: No such scenario, or something in it is wrong.
        InvalidInputError: No seeds, no such scene, several robots, other robots in
            other scenes, or a localisation.
    """
    if isinstance(source, str | os.PathLike):
        source = scenario_file(os.fspath(source))
    fixed = isinstance(source, ScenarioFile) and not source.is_drawn
    scenes: dict[int | None, Scenario] = {}
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
        if scene.localisation:
            raise InvalidInputError(f"{source.name}: no [localisation] here")
    if len({*map(_kind, scenes.values())}) != 1:
        what = "robots or settings differ from scene to scene" if scenes else "no seeds"
        raise InvalidInputError(f"{source.name}: {what}")
    return scenes


def _kind(one: Scenario) -> bytes:
    arrays = one.robot.footprint.edges, one.robot.limit_vector, one.settings.record()
    return b"".join(array.tobytes() for array in arrays)


class Blind:
    """Sensor without a range: a simulation computes nothing that is not asked for."""

    def start(self) -> Sensor:
        """Return the function of a run."""
        return lambda time, obstacles, pose: Obstacles()


class ScenarioEnv(gymnasium.Env):  # type: ignore[misc]
    """A robot of a scenario, driven by a twist in each control step (``dt_s``).

    An action is v (m/s) and ω (rad/s), cut to the robot's limits. Observed are the goal
    in the robot's frame (x, y in m, cosine and sine of the turn to it), the twist
    driven last, and the lengths of exact rays from the middle of the axle, m. A reward
    is the metres that the goal came nearer, and ±10 where it is reached or an obstacle
    touched, which ends an episode; ``duration_s`` truncates it. Without
    ``ends_at_goal`` it goes on there. ``info`` has ``scene`` (its seed), and after a
    step ``clearance`` (the least within it, m), ``touched``, ``arrived``.

    Args:
        source: :data:`~qpavoid.lab.gym.env.Place` of the scenes.
        seeds: Of the scenes to draw from, or as ``find_scenes`` says.
        beams: Rays of an observation, all round.

    Raises:
        QPAvoidError: As :func:`~qpavoid.lab.gym.env.find_scenes` does.
        InvalidInputError: Less than one beam.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self, source: Place, seeds: Sequence[int] | None = None, beams: int = 36
    ) -> None:
        self._scenes = find_scenes(source, seeds)
        scene = next(iter(self._scenes.values()))
        self._rays = Lidar(LidarSettings(beams=beams, range=RAY, noise=0.0))
        self.robot, self.settings = scene.robot, scene.settings
        limits = scene.robot.limits
        low = np.clip([limits.v_min, limits.omega_min], -GREATEST, 0.0)
        high = np.clip([limits.v_max, limits.omega_max], 0.0, GREATEST)
        least = np.concatenate([[-VIEW, -VIEW, -1.0, -1.0], low, np.zeros(beams)])
        most = np.concatenate([[VIEW, VIEW, 1.0, 1.0], high, np.full(beams, RAY)])
        self.action_space = Box(*np.array([low, high], dtype=np.float32))
        self.observation_space = Box(*np.array([least, most], dtype=np.float32))
        self._action, self._steps = (0.0, 0.0), -1
        self._seen: Obstacles | None = None

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles of the scenario's sensors, robot frame; read once per step."""
        self._want_reset()
        if self._seen is None:
            self._seen = self._see(self._time, self._world(), self._simulation.pose)
        return self._seen

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; ``options={"scene": 7}`` names its scene."""
        super().reset(seed=seed)
        drawn = [*self._scenes][self.np_random.integers(len(self._scenes))]
        self._seed = (options or {}).get("scene", drawn)
        known = self._seed in self._scenes
        want(known, f"scene {self._seed!r} is none of the seeds")
        self._scene, self._steps = self._scenes[self._seed], 0
        alone = replace(self._scene, guide=None, sensor=Blind())
        self._simulation = Simulation(alone, lambda v, omega, seen, more: self._action)
        self._goal = Goal(self._simulation.goal, *self._scene.arrival)
        self._see, self._seen = make_sensor(self._scene), None
        return self._observe(), {"scene": self._seed}

    def step(self, action: Any) -> tuple[Any, ...]:
        """Drive for a control step; see :class:`gymnasium.Env`.

        Raises:
            InvalidInputError: The action is not finite, or of another shape.
            ResetNeeded: It has not been reset.
        """
        self._want_reset()
        v, omega = twist_of(action).tolist()
        self._action, before = (v, omega), self._away
        row = self._simulation.step(self._time, self._world())
        self._steps, self._seen = self._steps + 1, None
        observed = self._observe()
        touched = row.least_clearance_m < 0.0
        arrived = self._scene.ends_at_goal and not touched
        arrived = arrived and self._goal.holds(self._simulation.pose)
        reward = before - self._away + ARRIVED * arrived + TOUCHING * touched
        info = {"scene": self._seed, "clearance": row.least_clearance_m}
        info |= {"touched": touched, "arrived": arrived}
        late = self._steps >= self._scene.steps
        return observed, reward, touched or arrived, late, info

    @property
    def _time(self) -> float:
        return self._scene.dt * self._steps

    def _world(self) -> Obstacles:
        return self._scene.world.at(self._time)

    def _want_reset(self) -> None:
        """Refuse a step before the first reset."""
        if self._steps < 0:
            raise ResetNeeded("call reset first")

    def _observe(self) -> npt.NDArray[np.float32]:
        """Return the observation; note the distance from the goal."""
        pose = self._simulation.pose
        x, y, turn = self._simulation.error(pose)
        place, self._away = np.clip([x, y], -VIEW, VIEW), math.hypot(x, y)
        head = *place, math.cos(turn), math.sin(turn), *self._simulation.driven
        row = np.concatenate([head, self._rays.ranges(pose, self._world())])
        return row.astype(np.float32)


class ShieldedEnv(gymnasium.Wrapper):  # type: ignore[misc]
    """An environment of twists whose actions pass the filter.

    ``info`` has ``status`` and ``cost``: (u − a)ᵀ W (u − a), m²/s², of the twist u for
    the action a, which the filter minimises.

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
        v, omega = twist_of(action).tolist()
        decision = self._safety.filter(v, omega, self._see())
        w_v, w_omega = self._safety.settings.weights
        cost = w_v * (decision.v - v) ** 2 + w_omega * (decision.omega - omega) ** 2
        *rest, told = self.env.step(np.array(decision[:2]))
        return *rest, {**told, "cost": cost, "status": str(decision.status)}
