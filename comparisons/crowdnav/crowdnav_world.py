"""CrowdNav's people and rules [Chen2019], reimplemented after its sources.

GitHub repository vita-epfl/CrowdNav (MIT), ``crowd_sim``: people of radius 0.3 m who
prefer 1 m/s cross a circle of 4 m, each steered by its own ORCA, a decision every
0.25 s. The robot, another disc of 0.3 m, drives from (0, −4) to (0, 4) m. People do not
see it. All arrays are in the world frame.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from qpavoid.errors import ConfigError
from qpavoid.lab.baselines.orca import library
from qpavoid.types import Array

TICK = 0.25
"""Time between two decisions, s."""

TICKS = 96
"""Ticks that count: what has not arrived by 24 s, ``time_limit`` less 1, is late."""

RADIUS, SPEED, DISCOMFORT = 0.3, 1.0, 0.2
"""Radius of everybody, m; preferred speed, m/s; uncomfortable distance, m."""

START, GOAL = np.array([0.0, -4.0]), np.array([0.0, 4.0])
CIRCLE = 4.0
"""Radius of the circle, m."""

FIRST_SEED = {"test": 1000, "val": 0, "train": 2000}
CASES = {"test": 500, "val": 100, "train": 2**32 - 2001}
"""Of a phase: the seed of its case 0, and how many cases it has."""

NEIGHBOURS = 10.0, 10, 5.0, 5.0
"""ORCA's neighbour distance (m), most neighbours, and time horizons (s)."""

MOST_DRAWS = 10_000
"""Of a place; then there is no room."""

WIDER = 0.01
"""m by which ORCA takes everybody to be wider."""

Draw = Callable[[], float]


def draw_people(seed: int, count: int) -> tuple[Array, Array]:
    """Return starts near the circle and the opposite goals, each (count, 2) m.

    Args:
        seed: Of NumPy's legacy generator, which CrowdNav seeds for every case.
        count: Number of people.

    Raises:
        ConfigError: There is no room for so many.
    """
    draw = np.random.RandomState(seed).random_sample
    ends = np.array([START, GOAL])
    for _ in range(count):
        start = _free(partial(_near_circle, draw), ends)
        ends = np.vstack([ends, start, -start])
    return ends[2::2], ends[3::2]


def _near_circle(draw: Draw) -> Array:
    angle = draw() * np.pi * 2
    noise = [(draw() - 0.5) * SPEED, (draw() - 0.5) * SPEED]
    return CIRCLE * np.array([np.cos(angle), np.sin(angle)]) + noise


def _free(place: Callable[[], Array], taken: Array) -> Array:
    """Return the first of the places that is free of those taken."""
    for _ in range(MOST_DRAWS):
        found = place()
        if (np.linalg.norm(found - taken, axis=1) >= 2 * RADIUS + DISCOMFORT).all():
            return found
    raise ConfigError(["there is no room for so many people"])


class Orca:
    """CrowdNav's policy ``orca`` of one disc, by the RVO2 library.

    The disc prefers 1 m/s towards its goal, less within the last metre. It knows the
    places and velocities of the others, not their goals.

    Args:
        others: How many.

    Raises:
        MissingExtraError: pyrvo is not installed.
    """

    def __init__(self, others: int) -> None:
        agent = *NEIGHBOURS, RADIUS, SPEED
        self._sim = library().RVOSimulator(TICK, *agent)
        for _ in range(others + 1):
            wide = *NEIGHBOURS, RADIUS + WIDER, SPEED
            self._sim.add_agent((0.0, 0.0), *wide, (0.0, 0.0))

    def __call__(self, places: Array, velocities: Array, goal: Array) -> Array:
        """Return the velocity (2,), m/s, for the coming tick.

        Args:
            places: (1 + others, 2) m, its own first.
            velocities: The same, m/s, of the tick before.
            goal: (2,) m.
        """
        for i, (place, velocity) in enumerate(zip(places, velocities, strict=True)):
            self._sim.set_agent_position(i, tuple(place))
            self._sim.set_agent_velocity(i, tuple(velocity))
            self._sim.set_agent_pref_velocity(i, (0.0, 0.0))
        away = goal - places[0]
        wanted = away / max(1.0, float(np.linalg.norm(away)))
        self._sim.set_agent_pref_velocity(0, tuple(wanted))
        self._sim.do_step()
        found = self._sim.get_agent_velocity(0)
        return np.array([found.x, found.y])


class People:
    """Everybody but the robot.

    Attributes:
        places: (n, 2) m, at the beginning of the tick.
        before: (n, 2) m/s, of the tick before; at rest at first.
        velocities: (n, 2) m/s, of this tick.

    Args:
        starts: (n, 2) m.
        goals: (n, 2) m.
    """

    def __init__(self, starts: Array, goals: Array) -> None:
        self.places, self.goals = starts, goals
        self.before = self.velocities = np.zeros_like(starts)
        self._minds = [Orca(len(starts) - 1) for _ in starts]

    def decide(self) -> None:
        """Choose all velocities of the tick."""
        chosen = []
        for i, mind in enumerate(self._minds):
            order = [i, *(j for j in range(len(self.places)) if j != i)]
            chosen.append(mind(self.places[order], self.before[order], self.goals[i]))
        self.velocities = np.array(chosen)

    def at(self, time: float) -> Array:
        """Return where they are (n, 2), m, so many s after the tick's beginning."""
        return self.places + time * self.velocities

    def move(self) -> None:
        """Go on to the next tick."""
        self.places, self.before = self.at(TICK), self.velocities


def judge_tick(people: People, begin: Array, end: Array) -> str:
    """Return ``touched``, ``arrived`` or nothing for a tick from ``begin`` to ``end``.

    By this rule people keep the velocities of the tick *before*: touched is a disc
    below 0 m. Arrived: the robot ends within 0.3 m of the goal.
    """
    offset = people.places - begin
    moved = TICK * people.before - (end - begin)
    if nearest(offset, offset + moved).min() < 2 * RADIUS:
        return "touched"
    return "arrived" if np.linalg.norm(end - GOAL) < RADIUS else ""


def nearest(begin: Array, end: Array) -> Array:
    """Return the distances (…,) of the origin from segments with ends (…, 2)."""
    along = end - begin
    length = (along**2).sum(axis=-1)
    share = -(begin * along).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    places = begin + np.clip(share, 0.0, 1.0)[..., None] * along
    found: Array = np.linalg.norm(places, axis=-1)
    return found
