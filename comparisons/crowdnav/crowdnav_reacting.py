"""Crowds of constant density that see the robot.

A square of 8 m repeats in both directions: whoever leaves it on one side enters on the
other. It is centred on the robot. Of the people 70 % walk to and fro along one axis,
the others along the other one; the robot crosses 6 m along the first axis in even
cases, along the second in odd ones. Each person keeps a direction and a preferred
speed. The robot is a neighbour like any other.

For 10 s before a case begins people walk round a robot that stands at its start. From
then on the same people are also computed without the robot, for its effect on those who
are near it.
"""

import sys
from copy import deepcopy
from functools import lru_cache
from pathlib import Path

import numpy as np

from crowdnav_world import RADIUS, Orca, People, nearest
from qpavoid.types import Array

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from people import NOWHERE
from people import People as Walkers

SIDE, WAY = 8.0, 6.0
"""m; side of the square, and distance of the robot's goal."""

BODY, SPEEDS, FASTER = 0.2, (1.0, 1.6), 1.3
"""m, radius of a person; m/s, preferred speeds; greatest speed over preferred."""

CELLS, JITTER = 15, 0.05
"""Cells along a side in which a person may begin; m from the middle of a cell."""

ALONG = 0.7
"""Share of people along the first axis."""

TICK, TICKS, BEFORE = 0.1, 300, 100
"""s between two decisions; ticks of a case, and before it."""

FAR = 1e3
"""m to the goals of the social force model."""

EFFECT = "lasted_s", "people_delay_s", "people_detour_m"
"""Columns of a run."""

NEAR = 2.0
"""m from the robot's centre within which its effect on people is summed."""

SIGHT = SIDE / 2 - BODY
"""m between robot and person that it sees."""

REACH, WIDER, HORIZON = 2.5, 0.05, 2.0
"""ORCA's neighbour distance, m, what it adds to a radius, m, and time horizon, s."""


class ReactingPeople(People):
    """People who give way to each other and to the robot.

    Args:
        seed: Of everything random.
        count: Number of people in the square.
        kind: ``orca`` or ``force``.
    """

    tick = TICK

    def __init__(self, seed: int, count: int, kind: str) -> None:
        draw, self._case = np.random.default_rng(seed), (seed, count, kind)
        x, y = (0.5 * WAY, 0.0) if seed % 2 == 0 else (0.0, 0.5 * WAY)
        self.start, self.goal = np.array([-x, -y]), np.array([x, y])
        self._robot, self._moved = self.start, np.zeros(2)
        self.places, self.radii = self._begin(draw, count), np.full(count, BODY)
        pairs = np.where(np.arange(count) < count // 2, np.arange(count) // 2, -1)
        lead = np.where(pairs < 0, np.arange(count), 2 * pairs)
        across = (draw.random(count) >= ALONG)[lead]
        signs = draw.choice([-1.0, 1.0], count)[lead]
        self._pace = draw.uniform(*SPEEDS, count)[lead]
        self._ahead = signs[:, None] * np.column_stack([~across, across])
        self._walkers = None if kind == "orca" else self._by_force(pairs)
        self.before = self.velocities = np.zeros((count, 2))
        self._present = True
        self.walked: list[Array] = []
        for _ in range(BEFORE):
            self.decide()
            self.move()
        self.walked.clear()

    def _begin(self, draw: np.random.Generator, count: int) -> Array:
        """Return starts (count, 2), m, in cells that do not touch the robot."""
        middles = SIDE / CELLS * (np.arange(CELLS) + 0.5)
        places = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
        places = self._near(places)
        away = np.linalg.norm(places - self._robot, axis=1)
        free = places[away > RADIUS + BODY + 2.0 * JITTER]
        chosen = np.sort(draw.choice(len(free), count, replace=False))
        found: Array = free[chosen] + draw.uniform(-JITTER, JITTER, (count, 2))
        return found

    def _near(self, places: Array) -> Array:
        """Return the images of places (n, 2), m, that are nearest to the robot."""
        found: Array = places - SIDE * np.round((places - self._robot) / SIDE)
        return found

    def _by_force(self, pairs: Array) -> Walkers:
        """Return the same people for the social force model."""
        alike = self._pace, self.radii, pairs
        walkers = Walkers(self.places, self.places + FAR * self._ahead, *alike)
        walkers.robot_radius, walkers.period = RADIUS, SIDE
        return walkers

    def decide(self) -> None:
        """Choose all velocities of the tick."""
        if self._walkers is None:
            self.velocities = self._by_orca()
            return
        self._walkers.places = self.places
        self._walkers.goals = self.places + FAR * self._ahead
        robot = (*self._robot, 0.0) if self._present else NOWHERE
        self._walkers.step(robot, self._moved, TICK)
        self.velocities = (self._walkers.places - self.places) / TICK

    def _by_orca(self) -> Array:
        """Return the velocities (n, 2), m/s, of ORCA."""
        sides = SIDE * np.array([0.0, -1.0, 1.0])
        shifts = np.stack(np.meshgrid(sides, sides), axis=-1).reshape(-1, 1, 2)
        images = self.places + shifts  # the first are the people themselves
        inside = abs(images - self._robot).max(axis=-1) < SIDE / 2 + REACH
        who = np.nonzero(inside)[1]
        wanted = (self._pace[:, None] * self._ahead)[who]
        places, moving = images[inside], self.before[who]
        radii, speeds = self.radii[who], FASTER * self._pace[who]
        if self._present:
            places = np.vstack([places, self._robot])
            moving, wanted = (np.vstack([x, self._moved]) for x in (moving, wanted))
            radii, speeds = np.append(radii, RADIUS), np.append(speeds, SPEEDS[1])
        more = np.full(len(radii), REACH), WIDER, self.most
        minds = Orca(radii, speeds, *more, HORIZON, FASTER * SPEEDS[1], TICK)
        return minds(places, moving, places + wanted)[: len(self.places)]

    def move(self) -> None:
        """Go on to the next tick."""
        away = np.linalg.norm(self.places - self._robot, axis=1)
        self.walked.append(self._paces(away < (NEAR if self._present else FAR)))
        super().move()
        self.places = self._near(self.places)

    def _paces(self, some: Array) -> Array:
        """Return the number of some people, and sums of their paces in this tick.

        Of the way in a person's direction, over the preferred speed, and of the path
        beyond that way, m/s.
        """
        along = (self.velocities * self._ahead).sum(axis=1)
        off = np.linalg.norm(self.velocities, axis=1) - along
        each = np.column_stack([np.ones(len(along)), along / self._pace, off])
        total: Array = each[some].sum(axis=0)
        return total

    def judge(self, way: Array) -> str:
        """Return ``touched``, ``arrived`` or nothing for a tick of the robot.

        Touched is a disc below 0 m at any time of the tick.
        """
        times = np.linspace(0.0, TICK, len(way))
        offsets = np.array([self.at(x) for x in times]) - way[:, None]
        self._robot, self._moved = way[-1], (way[-1] - way[0]) / TICK
        if (nearest(offsets[:-1], offsets[1:]) < RADIUS + self.radii).any():
            return "touched"
        return "arrived" if np.linalg.norm(way[-1] - self.goal) < RADIUS else ""

    def effect(self) -> dict[str, float]:
        """Return the time so far, and people's delay and detour by the robot, s and m.

        Of people within 2 m of the robot, by the mean paces of the same crowd without
        it.
        """
        count, way, off = TICK * np.sum(self.walked, axis=0)
        usual_way, usual_off = usual_paces(*self._case)
        costs = usual_way * count - way, off - usual_off * count
        numbers = map(float, (TICK * len(self.walked), *costs))
        return dict(zip(EFFECT, numbers, strict=True))


def begin(seed: int, count: int, kind: str) -> ReactingPeople:
    """Return the people of a case when it begins."""
    return deepcopy(_begun(seed, count, kind))


_begun = lru_cache(ReactingPeople)


@lru_cache
def usual_paces(seed: int, count: int, kind: str) -> Array:
    """Return the mean paces of the people of a case without the robot."""
    people = begin(seed, count, kind)
    people._present = False
    for _ in range(TICKS // 2):
        people.decide()
        people.move()
    number, *paces = np.sum(people.walked, axis=0)
    return np.asarray(np.array(paces) / number)
