"""One robot among obstacles as a Gymnasium environment; many of them; the shield."""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.lab.gym.episodes import Episodes, Floats, shielded, twists_of
from qpavoid.lab.gym.scenes import Place, find_scenes
from qpavoid.model.obstacles import Obstacles


class ScenarioVectorEnv(VectorEnv):  # type: ignore[misc]
    """Many of :class:`ScenarioEnv` in one compiled loop.

    One that has ended begins anew in the next step (``AutoresetMode.NEXT_STEP``).

    Args:
        source: :data:`~qpavoid.lab.gym.scenes.Place` of the scenes.
        num_envs: How many environments.
        seeds: Of the scenes to draw from, or as ``find_scenes`` says.
        beams: Rays of an observation, all round.
        shield: Whether actions pass the filter; ``info`` has the ``cost`` of that.

    Raises:
        QPAvoidError: As :func:`~qpavoid.lab.gym.scenes.find_scenes` does.
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

    ``info`` has ``cost`` (:func:`~qpavoid.lab.gym.episodes.shielded`) and ``status``.

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
