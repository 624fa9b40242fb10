"""People of CrowdNav++ [Liu2023] and GenSafeNav [Yao2025], after their sources.

GitHub repositories Shuijing725/CrowdNav_Prediction_AttnGraph (MIT) and
tasl-lab/GenSafeNav, ``crowd_sim``. Known from there: radii of 0.3 to 0.5 m, greatest
speeds of 0.5 to 1.5 m/s (preferred at most 1 m/s) and ORCA neighbour distances of 5 to
10 m, uniform; ORCA adds 0.16 m to every radius. Starts are on a circle of 6·√2 m with
up to 2 m added to x and to y, goals opposite. Every 5 s each person changes the goal
with probability 0.5. Who arrives is replaced by a new person on the circle. Start and
goal of the robot are 8 m or more apart in a square of ±6 m. People do not see it.

Chosen here: seeds; the crossing ``square``, where a person starts in one half of the
square and has the goal in the other; everybody knows all present radii (there, those of
replaced people remain).

Run: python comparisons/crowdnav/crowdnav.py --changing circle
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from crowdnav_world import RADIUS, SPEED, TICK, WIDER, People, free
from qpavoid.types import Array

ARENA, CIRCLE, NOISE = 6.0, 6.0 * np.sqrt(2.0), 2.0
"""Half of the square, radius of the circle, and what is added to starts, m."""

APART, DISCOMFORT, SPACE = 8.0, 0.25, 0.15
"""Start and goal of the robot; gap to others when somebody begins; ORCA's, m."""

RADII, SPEEDS, REACH = (0.3, 0.5), (0.5, 1.5), (5.0, 10.0)
"""m, m/s, m; ranges of a person's attributes."""

PERIOD, CHANCE, AHEAD = 5.0, 0.5, 5
"""s between changes of goals; their probability; ticks of the personal zone."""

TICKS, SIGHT = 195, 5.0
"""Ticks before 49 s, ``time_limit`` less 1; m between robot and a person it sees."""

FAR = 1e6
"""m; coordinate of people before they begin."""


class ChangingPeople(People):
    """People whose goals change, in a crossing ``circle`` or ``square``."""

    space = WIDER + SPACE

    def __init__(self, seed: int, count: int, crossing: str) -> None:
        self._random, self._crossing = np.random.default_rng(seed), crossing
        self.start = self.goal = np.zeros(2)
        while np.linalg.norm(self.start - self.goal) < APART:
            self.start, self.goal = self._random.uniform(-ARENA, ARENA, (2, 2))
        self._robot, self._tick, self.most = self.start, 0, count * (AHEAD + 1)
        super().__init__(*np.full((2, count, 2), FAR))
        for i in range(count):
            self._begin(i)

    def _begin(self, i: int) -> None:
        """Replace a person by a new one at rest."""
        radius, *more = self._random.uniform(*np.transpose([RADII, SPEEDS, REACH]))
        self.radii[i], self.before[i] = radius, 0.0
        self._minds.change(i, radius, *more)
        if self._crossing == "circle":
            self.places[i] = self._free(i, partial(self._on_circle, 0.0, NOISE))
            self.goals[i] = -self.places[i]
        else:
            side = self._random.choice([-1.0, 1.0])
            self.places[i] = self._free(i, partial(self._in_square, side))
            self.goals[i] = self._free(i, partial(self._in_square, -side))

    def _on_circle(self, low: float, high: float) -> Array:
        """Return a place on the circle with noise between two bounds, m."""
        angle = self._random.uniform(0.0, 2.0 * np.pi)
        noise = self._random.uniform(low, high, 2)
        place: Array = CIRCLE * np.array([np.cos(angle), np.sin(angle)]) + noise
        return place

    def _in_square(self, side: float) -> Array:
        """Return a place in the right (1) or left (−1) half of the square, m."""
        x, y = self._random.uniform((0.0, -ARENA), ARENA)
        return np.array([side * x, y])

    def _free(self, i: int, place: Callable[[], Array]) -> Array:
        """Return the first place clear of positions and goals of all but a person."""
        others = np.arange(len(self.places)) != i
        taken = np.vstack([self.places[others], self.goals[others]])
        radii = np.concatenate([*[self.radii[others]] * 2, [RADIUS] * 2])
        least = self.radii[i] + radii + DISCOMFORT
        return free(place, np.vstack([taken, self._robot, self.goal]), least)

    def judge(self, way: Array) -> str:
        """Return ``touched``, ``arrived`` or nothing at the end of a tick.

        Touched is a disc below 0 m then. Arrived: the robot is within 0.3 m of the
        goal.
        """
        self._robot = end = way[-1]
        gaps = np.linalg.norm(self.at(TICK) - end, axis=1) - self.radii
        if (gaps < RADIUS).any():
            return "touched"
        return "arrived" if np.linalg.norm(end - self.goal) < RADIUS else ""

    def move(self) -> None:
        """Go on to the next tick, change goals, and replace those who arrived."""
        super().move()
        self._tick += 1
        if self._tick % round(PERIOD / TICK) == 0:
            chosen = self._random.random(len(self.goals)) <= CHANCE
            for i in np.flatnonzero(chosen).tolist():
                self.goals[i] = self._free(i, self._new_goal)
        away = np.linalg.norm(self.goals - self.places, axis=1)
        for i in np.flatnonzero(away < self.radii).tolist():
            self._begin(i)

    def _new_goal(self) -> Array:
        """Return a place on the circle with noise of ±0.5 m, or in the square."""
        if self._crossing == "circle":
            return self._on_circle(-0.5 * SPEED, 0.5 * SPEED)
        return self._random.uniform(-ARENA, ARENA, 2)

    def future(self) -> tuple[Array, Array]:
        """Return positions and velocities (5, n, 2), m and m/s, of the next ticks.

        They are those to come if no goal changes.
        """
        states = [(self.places, self.before)]
        for _ in range(AHEAD):
            velocities = self._minds(*states[-1], self.goals)
            states.append((states[-1][0] + TICK * velocities, velocities))
        places, velocities = map(np.array, zip(*states[1:], strict=True))
        return places, velocities
