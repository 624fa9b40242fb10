"""Robots in CrowdNav's cases: any method, or the original's disc with ORCA.

Run: python comparisons/crowdnav/crowdnav.py
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from crowdnav_cases import Crowd
from crowdnav_world import NEIGHBOURS, RADIUS, SPEED, TICK, Orca, People
from qpavoid.lab.scenario.scenario import Scenario
from qpavoid.lab.simulation.log import COLUMNS
from qpavoid.lab.simulation.loop import Simulation
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Pose

Row: TypeAlias = dict[str, Any]

NOTED = [COLUMNS.index(x) for x in ("clearance_m", "room_m", "solve_time_s")]
FEET = "start_clearance_m", "min_room_m", "solve_us", "solve_p99_us"
"""Columns of a step, and those of a row that are made of them."""


@dataclass
class Shown:
    """Sensor of the discs within a distance, with given velocities."""

    velocities: Array  # (n, 2) m/s
    sight: float  # m from the robot's centre to a disc

    def start(self) -> Callable[[float, Obstacles, Pose], Obstacles]:
        """Return what sees."""

        def see(time: float, obstacles: Obstacles, pose: Pose) -> Obstacles:
            discs = obstacles.discs
            seen = Obstacles(discs=discs, disc_velocities=self.velocities)
            return seen.seen_from(pose).within(self.sight)

        return see


class Driven:
    """A differential drive under a method of the registry.

    Args:
        method: Its name.
        crowd: The cases.
        people: Of the case.
        scene: Of the case; without a LiDAR the robot sees true discs.
    """

    def __init__(
        self, method: str, crowd: Crowd, people: People, scene: Scenario
    ) -> None:
        self._shown = Shown(people.before, crowd.sight)
        if scene.lidar is None:
            scene = replace(scene, sensor=self._shown)
        self._simulation = Simulation(scene, method)
        self._discs = np.empty((crowd.people, 3))
        self._times = scene.dt * np.arange(round(people.tick / scene.dt))
        self._noted: list[list[float]] = []

    def drive(self, time: float, people: People) -> Array:
        """Drive for a tick, and return the places (k + 1, 2), m, from step to step."""
        way, self._shown.velocities = [self._simulation.pose[:2]], people.before
        self._discs[:, 2] = people.radii
        for later in self._times:
            self._discs[:, :2] = people.at(later)
            there = Obstacles(discs=self._discs, disc_velocities=people.velocities)
            row = self._simulation.step(time + later, there)
            self._noted.append([row[k] for k in NOTED])
            self._shown.velocities = people.velocities
            way.append(self._simulation.pose[:2])
        return np.array(way)

    def row(self) -> Row:
        """Return what is said of its footprint and its steps so far."""
        start, room, times = np.array(self._noted).T
        solve = 1e6 * np.percentile(times, (50.0, 99.0))
        numbers = start[0], room.min(), *solve
        return dict(zip(FEET, map(float, numbers), strict=True))


class Holonomic:
    """The original's disc, steered by ORCA: of no footprint but the disc.

    As there, it takes all radii for 0.3 m, and future positions for further people.
    """

    def __init__(self, crowd: Crowd, people: People) -> None:
        self._sight, self._place = crowd.sight, people.start
        self._velocity = np.zeros(2)

    def drive(self, time: float, people: People) -> Array:
        """Go on for a tick, and return the places (2, 2), m, at both its ends."""
        begin, (places, moving) = self._place, people.future()
        gaps = np.linalg.norm(people.places - begin, axis=1) - people.radii
        seen = gaps <= self._sight
        places = np.vstack([people.places, *places])[np.tile(seen, len(places) + 1)]
        moving = np.vstack([people.before, *moving])[np.tile(seen, len(moving) + 1)]
        alike = np.ones(len(places) + 1)
        sizes = RADIUS * alike, SPEED * alike, NEIGHBOURS * alike
        mind = Orca(*sizes, people.space, people.most)
        goals, places = np.vstack([people.goal, places]), np.vstack([begin, places])
        self._velocity = mind(places, np.vstack([self._velocity, moving]), goals)[0]
        self._place = begin + TICK * self._velocity
        return np.array([begin, self._place])

    def row(self) -> Row:
        """Return nothing of a footprint."""
        return dict.fromkeys(FEET)
