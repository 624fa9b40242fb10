"""Several robots in one world as a PettingZoo environment."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pettingzoo import ParallelEnv

from qpavoid.errors import InvalidInputError
from qpavoid.lab.gym.env import only
from qpavoid.lab.gym.episodes import Episodes, spaces
from qpavoid.lab.gym.scenes import Place, chosen, find_scenes
from qpavoid.lab.simulation.fleet import Body, among


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
        self._scenes, self._how = (
            find_scenes(source, seeds, fleet=True),
            (beams, shield),
        )
        robots, *_ = self._scenes.values()
        self.possible_agents = [f"robot_{i}" for i in range(len(robots))]
        self.agents: list[str] = []
        made = [spaces(one, beams) for one in robots]
        self._spaces = dict(zip(self.possible_agents, made, strict=True))
        self._bodies = [Body(one.robot.footprint, i) for i, one in enumerate(robots)]
        self._random = np.random.default_rng()

    def observation_space(self, agent: str) -> Any:
        """Return what an agent observes."""
        return self._spaces[agent][1]

    def action_space(self, agent: str) -> Any:
        """Return the twists of an agent."""
        return self._spaces[agent][0]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; ``options={"scene": 7}`` names its scene."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        drawn = [*self._scenes][self._random.integers(len(self._scenes))]
        scene = (options or {}).get("scene", drawn)
        self._robots, self._time = chosen(self._scenes, scene), 0.0
        self.agents = self.possible_agents[:]
        self._motions = [(one.start, (0.0, 0.0)) for one in self._robots]
        self._all = []
        for one, others in zip(self._robots, self._round(), strict=True):
            self._all.append(Episodes(1, one, [others], *self._how))
            self._all[-1].begin(0, one, others)
        seen = {a: e.observe()[0] for a, e in zip(self.agents, self._all, strict=True)}
        return seen, {agent: {"scene": scene} for agent in seen}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """Drive all for a control step; see :class:`pettingzoo.ParallelEnv`.

        Raises:
            InvalidInputError: An agent has no action, or one that is no finite twist.
        """
        if lacking := sorted({*self.agents} - {*actions}):
            raise InvalidInputError(f"no action for {', '.join(lacking)}")
        each = [*zip(self.possible_agents, self._all, strict=True)]
        live = {agent: one for agent, one in each if agent in self.agents}
        for agent, one in live.items():
            one.drive([actions[agent]], np.ones(1, np.bool_))
        self._time += self._robots[0].dt
        self._motions = [
            (one.motion(0)[0], one.motion(0)[1] if agent in live else (0.0, 0.0))
            for agent, one in each
        ]
        for one, others in zip(self._all, self._round(), strict=True):
            one.show(0, others)
        answers: tuple[dict[str, Any], ...] = {}, {}, {}, {}, {}
        for agent, one in live.items():
            observed, (rewards, told) = one.observe()[0], one.result()
            info = only(told)
            late, over = info.pop("late"), info["touched"] or info["arrived"]
            parts = observed, float(rewards[0]), over, late, info
            for answer, part in zip(answers, parts, strict=True):
                answer[agent] = part
            if over or late:
                self.agents.remove(agent)
        return answers

    def _round(self) -> Any:
        """Yield what is round each of them now."""
        each = zip(self._bodies, self._motions, strict=True)
        bodies = [body.at(*motion) for body, motion in each]
        return among(self._robots[0].world.at(self._time), bodies)
