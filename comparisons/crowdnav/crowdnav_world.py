"""CrowdNav's people and rules [Chen2019], reimplemented after its sources.

GitHub repository vita-epfl/CrowdNav (MIT), ``crowd_sim``: people of radius 0.3 m who
prefer 1 m/s cross a circle of 4 m, each steered by its own ORCA, a decision every
0.25 s. The robot, another disc of 0.3 m, drives from (0, −4) to (0, 4) m. People do not
see it. All arrays are in the world frame.

Run: python comparisons/crowdnav/crowdnav.py
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

NEIGHBOURS, MOST_NEIGHBOURS, HORIZON = 10.0, 10, 5.0
"""ORCA's neighbour distance (m), greatest number of neighbours, time horizon (s)."""

MOST_DRAWS = 10_000
"""Of a place; then there is no room."""

WIDER = 0.01
"""m by which ORCA takes everybody to be wider."""

Draw = Callable[[], float]


def draw_people(seed: int, count: int) -> tuple[Array, Array]:
    """Return starts near the circle and the opposite goals, each (count, 2) m.

    The seed is that of NumPy's legacy generator, which CrowdNav seeds for every case.
    """
    draw = np.random.RandomState(seed).random_sample
    ends = np.array([START, GOAL])
    for _ in range(count):
        start = free(partial(_near_circle, draw), ends, 2 * RADIUS + DISCOMFORT)
        ends = np.vstack([ends, start, -start])
    return ends[2::2], ends[3::2]


def _near_circle(draw: Draw) -> Array:
    angle = draw() * np.pi * 2
    noise = [(draw() - 0.5) * SPEED, (draw() - 0.5) * SPEED]
    return CIRCLE * np.array([np.cos(angle), np.sin(angle)]) + noise


def free(place: Callable[[], Array], taken: Array, least: Array | float) -> Array:
    """Return a place farther than ``least`` from those taken; ConfigError: none."""
    for _ in range(MOST_DRAWS):
        found = place()
        if (np.linalg.norm(found - taken, axis=1) >= least).all():
            return found
    raise ConfigError(["there is no room for so many people"])


class Orca:
    """Policy ``orca`` of CrowdNav for several discs, by the RVO2 library.

    Each disc prefers its distance to the goal per second, at most ``pace``. It knows
    the positions, velocities and radii of the others, not their goals.

    Args:
        radii: (n,) m.
        speeds: (n,) m/s, the greatest ones.
        reach: (n,) m, distance of the farthest neighbour that is considered.
        space: m that is added to every radius.
        most: Greatest number of neighbours that are considered.
        horizon: Time horizon, s.
        pace: Greatest preferred speed, m/s.
        tick: Time between two decisions, s.

    Raises:
        MissingExtraError: pyrvo is not installed.
    """

    def __init__(
        self,
        radii: Array,
        speeds: Array,
        reach: Array,
        space: float,
        most: int,
        horizon: float = HORIZON,
        pace: float = SPEED,
        tick: float = TICK,
    ) -> None:
        nowhere = 0.0, 0.0
        self._sim = library().RVOSimulator(
            tick, NEIGHBOURS, most, horizon, horizon, RADIUS, SPEED
        )
        self._space, self._pace = space, pace
        for radius, speed, far in zip(radii, speeds, reach, strict=True):
            own = far, most, horizon, horizon, radius + space, speed
            self._sim.add_agent(nowhere, *own, nowhere)

    def change(self, i: int, radius: float, speed: float, reach: float) -> None:
        """Replace radius (m), greatest speed (m/s) and reach (m) of a disc."""
        self._sim.set_agent_radius(i, radius + self._space)
        self._sim.set_agent_max_speed(i, speed)
        self._sim.set_agent_neighbor_dist(i, reach)

    def __call__(self, places: Array, velocities: Array, goals: Array) -> Array:
        """Return the velocities (n, 2), m/s, after those of the tick before."""
        away = goals - places
        speeds = np.linalg.norm(away, axis=1) / self._pace
        wanted = away / np.maximum(1.0, speeds)[:, None]
        for i in range(len(places)):
            self._sim.set_agent_position(i, tuple(places[i]))
            self._sim.set_agent_velocity(i, tuple(velocities[i]))
            self._sim.set_agent_pref_velocity(i, tuple(wanted[i]))
        self._sim.do_step()
        found = map(self._sim.get_agent_velocity, range(len(places)))
        return np.array([(x.x, x.y) for x in found])


class People:
    """Everybody but the robot.

    Attributes:
        places: (n, 2) m, at the beginning of the tick.
        goals: (n, 2) m.
        before: (n, 2) m/s, of the tick before; at rest at first.
        velocities: (n, 2) m/s, of this tick.
        radii: (n,) m.
        start: (2,) m, of the robot.
        goal: (2,) m, of the robot.
        space: m that ORCA adds to every radius.
        most: Greatest number of neighbours of ORCA.
        tick: Time between two decisions, s.

    Args:
        starts: (n, 2) m.
        goals: (n, 2) m.
    """

    start, goal, space, most = START, GOAL, WIDER, MOST_NEIGHBOURS
    tick = TICK

    def __init__(self, starts: Array, goals: Array) -> None:
        self.places, self.goals = starts, goals
        self.before = self.velocities = np.zeros_like(starts)
        self.radii = np.full(len(starts), RADIUS)
        alike = np.ones(len(starts))
        reach, more = NEIGHBOURS * alike, (self.space, self.most)
        self._minds = Orca(self.radii, SPEED * alike, reach, *more)

    def decide(self) -> None:
        """Choose all velocities of the tick."""
        self.velocities = self._minds(self.places, self.before, self.goals)

    def at(self, time: float) -> Array:
        """Return the positions (n, 2), m, a time (s) after the tick's beginning."""
        return self.places + time * self.velocities

    def move(self) -> None:
        """Go on to the next tick."""
        self.places, self.before = self.at(self.tick), self.velocities

    def future(self) -> tuple[Array, Array]:
        """Return positions and velocities (k, n, 2), m and m/s, of the next k ticks.

        They are those to come if no goal changes; k is 0 for CrowdNav's people.
        """
        none = np.empty((0, *self.places.shape))
        return none, none

    def effect(self) -> dict[str, float]:
        """Return what the robot cost these people so far; unknown of CrowdNav's."""
        return {}

    def judge(self, way: Array) -> str:
        """Return ``touched``, ``arrived`` or nothing for a tick of the robot.

        People are taken to keep the velocities of the tick *before*: touched is a disc
        below 0 m. Arrived: the robot ends within 0.3 m of the goal.

        Args:
            way: (k + 1, 2) m, of the robot from step to step.
        """
        begin, end = way[0], way[-1]
        offset = self.places - begin
        moved = TICK * self.before - (end - begin)
        if nearest(offset, offset + moved).min() < 2 * RADIUS:
            return "touched"
        return "arrived" if np.linalg.norm(end - self.goal) < RADIUS else ""


def nearest(begin: Array, end: Array) -> Array:
    """Return the distances (…,) of the origin from segments with ends (…, 2)."""
    along = end - begin
    length = (along**2).sum(axis=-1)
    share = -(begin * along).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    places = begin + np.clip(share, 0.0, 1.0)[..., None] * along
    found: Array = np.linalg.norm(places, axis=-1)
    return found
