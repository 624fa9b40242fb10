"""Several robots in one world as a PettingZoo environment."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pettingzoo import ParallelEnv

from qpavoid.errors import InvalidInputError
from qpavoid.lab.gym.env import only
from qpavoid.lab.gym.episodes import Episodes
from qpavoid.lab.gym.scenes import Place, find_scenes
from qpavoid.lab.simulation.fleet import RobotObstacle, among
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.model.obstacles import Obstacles


class FleetEnv(ParallelEnv):  # type: ignore[misc]
    """The robots of a scenario with ``[[robots]]``, each an agent, in lockstep.

    ``robot_0``, ``robot_1``, … act, observe and are rewarded as in
    :class:`~qpavoid.lab.gym.env.ScenarioEnv`. To each other they are polygons under
    way, which within a step drive on as in the one before. One that has arrived or
    touched anything leaves, and stands where it is.

    Args:
        source: As :class:`~qpavoid.lab.gym.env.ScenarioVectorEnv` takes it.
        seeds: The same.
        beams: The same.
        shield: The same; a filter for each.

    Raises:
        QPAvoidError: As :class:`~qpavoid.lab.gym.env.ScenarioVectorEnv` does.
    """

    metadata = {"name": "qpavoid_fleet", "render_modes": []}  # noqa: RUF012
    render_mode = None

    def __init__(
        self,
        source: Place,
        seeds: Sequence[int] | None = None,
        beams: int = 36,
        shield: bool = False,
    ) -> None:
        self._scenes = find_scenes(source, seeds, fleet=True)
        self._robots, *_ = self._scenes.values()
        self._bodies = [
            RobotObstacle(e.robot.footprint, i) for i, e in enumerate(self._robots)
        ]
        rounds = zip(*map(self._begin, self._scenes.values()), strict=True)
        self._all = {
            f"robot_{i}": Episodes(1, one, worlds, beams, shield)
            for i, (one, worlds) in enumerate(zip(self._robots, rounds, strict=True))
        }
        self.possible_agents, self.agents = [*self._all], list[str]()
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> Any:
        """Return what an agent observes."""
        return self._all[agent].observation_space

    def action_space(self, agent: str) -> Any:
        """Return the twists of an agent."""
        return self._all[agent].action_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; ``options={"scene": 7}`` names its scene."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        drawn = [*self._scenes][self._random.integers(len(self._scenes))]
        scene, self.agents = (options or {}).get("scene", drawn), [*self._all]
        worlds = self._begin(self._scenes[scene])
        for one, robot, world in zip(
            self._all.values(), self._robots, worlds, strict=True
        ):
            one.begin(0, robot, world)
        seen = {agent: one.look()[0][0] for agent, one in self._all.items()}
        return seen, {agent: {"scene": scene} for agent in seen}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """Drive all for a control step; see :class:`pettingzoo.ParallelEnv`.

        Raises:
            InvalidInputError: An agent has no action, or one that is no finite twist.
        """
        if lacking := sorted({*self.agents} - {*actions}):
            raise InvalidInputError(f"no action for {', '.join(lacking)}")
        for i, (agent, one) in enumerate(self._all.items()):
            self._motions[i] = self._motions[i][0], (0.0, 0.0)
            if agent in self.agents:
                one.drive([actions[agent]], np.ones(1, np.bool_))
                self._motions[i] = one.motion(0)
        self._time += self._robots[0].dt
        for one, world in zip(self._all.values(), self._round(), strict=True):
            one.show(0, world)
        answers: tuple[dict[str, Any], ...] = {}, {}, {}, {}, {}
        for agent in self.agents:
            (observed,), (reward,), told = self._all[agent].look()
            told = only(told)
            late, over = told.pop("late"), told["touched"] or told["arrived"]
            parts = observed, float(reward), over, late, told
            for answer, part in zip(answers, parts, strict=True):
                answer[agent] = part
        self.agents = [a for a in self.agents if not (answers[2][a] or answers[3][a])]
        return answers

    def _begin(self, robots: tuple[Scenario, ...]) -> list[Obstacles]:
        """Place these, and return what is round each of them."""
        self._robots, self._time = robots, 0.0
        self._motions = [(one.start, (0.0, 0.0)) for one in robots]
        return self._round()

    def _round(self) -> list[Obstacles]:
        each = zip(self._bodies, self._motions, strict=True)
        bodies = [body.at(*motion) for body, motion in each]
        return [*among(self._robots[0].world.at(self._time), bodies)]
