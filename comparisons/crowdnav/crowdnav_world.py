"""CrowdNav's people and rules [Chen2019], written anew from what its sources do.

GitHub repository vita-epfl/CrowdNav (MIT), ``crowd_sim``: people of radius 0.3 m who
want 1 m/s cross a circle of 4 m, or a square, each steered by its own ORCA, a decision
every 0.25 s. The robot, another disc of 0.3 m, goes from (0, −4) to (0, 4) m. Unseen,
it is known to nobody, and all evasion is its own. All arrays are of the world frame.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from qpavoid.errors import ConfigError
from qpavoid.lab.baselines.orca import library
from qpavoid.types import Array

TICK = 0.25
"""s; everybody keeps a velocity for so long."""

TICKS = 96
"""Ticks that count: what has not arrived by 24 s, ``time_limit`` less 1, is late."""

RADIUS, SPEED, DISCOMFORT = 0.3, 1.0, 0.2
"""m of everybody; m/s that everybody wants; m between discs that is too near."""

START, GOAL = np.array([0.0, -4.0]), np.array([0.0, 4.0])
CIRCLE, SQUARE = 4.0, 10.0
"""m; radius of the circle, side of the square."""

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


def draw_people(seed: int, count: int, rule: str = "circle") -> tuple[Array, Array]:
    """Return where people start and want to go, each (count, 2) m.

    Args:
        seed: Of NumPy's legacy generator, which CrowdNav seeds for every case.
        count: How many.
        rule: ``circle``: from a place near the circle to the opposite one; ``square``:
            from one half of the square to the other.

    Raises:
        ConfigError: There is no room for so many.
    """
    draw = np.random.RandomState(seed).random_sample
    person = {"circle": _across_circle, "square": _across_square}[rule]
    starts, goals = START[None], GOAL[None]
    for _ in range(count):
        start, goal = person(draw, starts, goals)
        starts, goals = np.vstack([starts, start]), np.vstack([goals, goal])
    return starts[1:], goals[1:]


def _across_circle(draw: Draw, starts: Array, goals: Array) -> tuple[Array, Array]:
    def place() -> Array:
        angle = draw() * np.pi * 2
        noise = [(draw() - 0.5) * SPEED, (draw() - 0.5) * SPEED]
        return CIRCLE * np.array([np.cos(angle), np.sin(angle)]) + noise

    start = _free(place, np.vstack([starts, goals]))
    return start, -start


def _across_square(draw: Draw, starts: Array, goals: Array) -> tuple[Array, Array]:
    side = -1.0 if draw() > 0.5 else 1.0

    def place() -> Array:
        return SQUARE * np.array([draw() * 0.5 * side, draw() - 0.5])

    start, side = _free(place, starts), -side
    return start, _free(place, goals)


def _free(place: Callable[[], Array], taken: Array) -> Array:
    """Return the first of the places that is free of those taken."""
    for _ in range(MOST_DRAWS):
        found = place()
        if (np.linalg.norm(found - taken, axis=1) >= 2 * RADIUS + DISCOMFORT).all():
            return found
    raise ConfigError(["there is no room for so many people"])


class Orca:
    """CrowdNav's policy ``orca`` of one disc, by the RVO2 library.

    The disc wants 1 m/s towards its goal, less within the last metre, and never ceases
    to want it. Of the others it knows places and velocities, not where they want to go.

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
        seeing: Whether they see the robot.
    """

    def __init__(self, starts: Array, goals: Array, seeing: bool = False) -> None:
        self.places, self.goals, self.seeing = starts, goals, seeing
        self.before = self.velocities = np.zeros_like(starts)
        others = len(starts) - 1 + seeing
        self._minds = [Orca(others) for _ in starts]

    def decide(self, place: Array, velocity: Array) -> None:
        """Choose all velocities of the tick, from what is at its beginning.

        Args:
            place: (2,) m, of the robot.
            velocity: (2,) m/s, its own of the tick before.
        """
        everybody, moving = self.places, self.before
        if self.seeing:
            everybody, moving = (
                np.vstack([everybody, place]),
                np.vstack([moving, velocity]),
            )
        chosen = []
        for i, mind in enumerate(self._minds):
            order = [i, *(j for j in range(len(everybody)) if j != i)]
            chosen.append(mind(everybody[order], moving[order], self.goals[i]))
        self.velocities = np.array(chosen)

    def at(self, time: float) -> Array:
        """Return where they are (n, 2), m, so many s after the tick's beginning."""
        return self.places + time * self.velocities

    def move(self) -> None:
        """Go on to the next tick."""
        self.places, self.before = self.at(TICK), self.velocities


class Tick(NamedTuple):
    """What CrowdNav says of a tick.

    Attributes:
        event: ``touched``, ``arrived``, ``near``, or nothing.
        gap: m between robot and nearest disc, as it reckons it.
    """

    event: str
    gap: float


def judge_tick(people: People, begin: Array, end: Array) -> Tick:
    """Return what CrowdNav says of a tick, whose robot went from ``begin`` to ``end``.

    Its rule lets people go on at their velocities of the tick *before*: touched is a
    disc below 0 m, near below 0.2 m. Arrived is who ends within 0.3 m of the goal.
    """
    offset = people.places - begin
    moved = TICK * people.before - (end - begin)
    gap = float(nearest(offset, offset + moved).min()) - 2 * RADIUS
    if gap < 0.0:
        return Tick("touched", gap)
    if np.linalg.norm(end - GOAL) < RADIUS:
        return Tick("arrived", gap)
    return Tick("near" if gap < DISCOMFORT else "", gap)


def true_gap(people: People, way: Array) -> float:
    """Return the least distance, m, between the discs as they really move in a tick.

    Args:
        people: With the velocities of the tick.
        way: (k + 1, 2) m, where the robot is at k + 1 times from its beginning to its
            end; straight in between.
    """
    times = np.linspace(0.0, TICK, len(way))
    offsets = np.array([people.at(time) for time in times]) - way[:, None]
    return float(nearest(offsets[:-1], offsets[1:]).min()) - 2 * RADIUS


def nearest(begin: Array, end: Array) -> Array:
    """Return the distances (…,) of the origin from segments with ends (…, 2)."""
    along = end - begin
    length = (along**2).sum(axis=-1)
    share = -(begin * along).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
    places = begin + np.clip(share, 0.0, 1.0)[..., None] * along
    found: Array = np.linalg.norm(places, axis=-1)
    return found
