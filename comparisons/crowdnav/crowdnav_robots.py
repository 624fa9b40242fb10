"""Robots in CrowdNav's cases: any method, or the original's disc with ORCA."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from crowdnav_cases import Crowd, make_scene
from crowdnav_world import GOAL, RADIUS, START, TICK, Orca, People
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
    """Sensor of all discs, with given velocities.

    Attributes:
        velocities: (n, 2) m/s.
    """

    velocities: Array

    def start(self) -> Callable[[float, Obstacles, Pose], Obstacles]:
        """Return what sees."""
        return lambda time, obstacles, pose: Obstacles(
            discs=obstacles.discs, disc_velocities=self.velocities
        ).seen_from(pose)


class Driven:
    """A differential drive under a method of the registry."""

    def __init__(self, method: str, crowd: Crowd) -> None:
        self._shown = Shown(np.zeros((crowd.people, 2)))
        scene = replace(make_scene(), sensor=self._shown)
        self._simulation = Simulation(scene, method)
        self._discs = np.full((crowd.people, 3), RADIUS)
        self._times = scene.dt * np.arange(round(TICK / scene.dt))
        self._noted: list[list[float]] = []

    def drive(self, time: float, people: People) -> Array:
        """Drive for a tick, and return the places (k + 1, 2), m, from step to step."""
        way, self._shown.velocities = [self._simulation.pose[:2]], people.before
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
    """The original's disc, steered by ORCA: of no footprint but the disc."""

    def __init__(self, crowd: Crowd) -> None:
        self._mind, self._place, self._velocity = Orca(crowd.people), START, np.zeros(2)

    def drive(self, time: float, people: People) -> Array:
        """Go on for a tick, and return the places (2, 2), m, at both its ends."""
        begin = self._place
        places = np.vstack([begin, people.places])
        moving = np.vstack([self._velocity, people.before])
        self._velocity = self._mind(places, moving, GOAL)
        self._place = begin + TICK * self._velocity
        return np.array([begin, self._place])

    def row(self) -> Row:
        """Return nothing of a footprint."""
        return dict.fromkeys(FEET)
