"""Encounters: discs aimed at a robot that is parked or drives straight on.

A disc of radius 0 to 0.4 m at a constant speed of 0.05 to 1.5 m/s is aimed at a random
place of the footprint and first seen 0.8 to 2.5 m away. The robot has no limits of
acceleration. It has 15 s to return once the discs have left.

    qpavoid sweep comparisons/encounters/encounters.toml --out out/encounters
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np

from qpavoid.model.contact import point_contact
from qpavoid.model.robot import Robot
from qpavoid.types import Array

ROBOT = Robot.mir100()
SPEEDS = (0.05, *(k / 10 for k in range(1, 11)), 1.05, *(k / 10 for k in range(11, 16)))
"""Speeds of the discs, m/s."""

DRIVE, RETURN = 6.0, 15.0
"""Duration of the path, s, in whose last second the robot slows down to rest; time for
the return, s."""

STREAMS = {"parked": 0, "several": 3}
"""Second part of the seed of each family."""


class Encounter(NamedTuple):
    """Discs in the frame of the robot at time 0."""

    speed: float  # of the robot along x, m/s; 0: parked
    discs: Array  # (M, 3) x, y, radius, m
    velocities: Array  # (M, 2) m/s


def place_at(bearing: float, clearance: float) -> Array:
    """Return the place (2,), m, at a bearing (rad) and clearance (m) of the robot."""
    ray = np.array([math.cos(bearing), math.sin(bearing)])
    low, high = 0.0, clearance + 2.0 * ROBOT.footprint.circumradius
    for _ in range(40):
        middle = 0.5 * (low + high)
        distance = point_contact(ROBOT.footprint.edges, *(middle * ray)).distance
        low, high = (middle, high) if distance < clearance else (low, middle)
    return low * ray


def place_inside(rng: np.random.Generator) -> Array:
    """Return a random place (2,) of the footprint, m."""
    vertices = ROBOT.footprint.vertices
    while True:
        place: Array = rng.uniform(vertices.min(axis=0), vertices.max(axis=0))
        if point_contact(ROBOT.footprint.edges, *place).distance < 0.0:
            return place


def draw_disc(rng: np.random.Generator, speed: float) -> tuple[Array, Array]:
    """Return a disc (3,) and its velocity (2,), which meets a place of the footprint.

    A robot that cannot be met within its drive is missed by as little as possible.
    """
    pace, radius = rng.choice(SPEEDS), rng.uniform(0.0, 0.4)
    clearance, bearing = rng.uniform(0.8, 2.5), rng.uniform(-math.pi, math.pi)
    place, target = place_at(bearing, clearance + radius), place_inside(rng)
    times = np.linspace(0.0, DRIVE, 601)
    ways = target + np.outer(speed * times, (1.0, 0.0)) - place
    late = np.hypot(*ways.T) - pace * times
    way = ways[np.argmax(late <= 0.0) if (late <= 0.0).any() else np.argmin(late)]
    return np.array([*place, radius]), pace * way / np.hypot(*way)


@lru_cache
def draw_encounters(family: str, count: int) -> list[Encounter]:
    """Return the first encounters of a family.

    ``parked`` has one disc and ``several`` two to five. In every other one of
    ``several`` the robot drives at 0.5 to 1 m/s.
    """
    rng = np.random.default_rng([1, STREAMS[family]])
    encounters = []
    for k in range(count):
        drives = family == "several" and k % 2 == 1
        speed = float(rng.uniform(0.5, 1.0)) if drives else 0.0
        number = int(rng.integers(2, 6)) if family == "several" else 1
        drawn = [draw_disc(rng, speed) for _ in range(number)]
        discs, velocities = (np.array(part) for part in zip(*drawn, strict=True))
        encounters.append(Encounter(speed, discs, velocities))
    return encounters


def time_of_leaving(encounter: Encounter, length: float) -> float:
    """Return when every disc has left the path for good, s.

    Args:
        encounter: Discs on straight lines.
        length: Of the path along x, m.
    """
    path = np.linspace((0.0, 0.0), (length, 0.0), 1 + math.ceil(length / 0.1))
    last = 0.0
    for disc, velocity in zip(encounter.discs, encounter.velocities, strict=True):
        near = ROBOT.footprint.circumradius + 0.35 + disc[2]
        squared, places = velocity @ velocity, disc[:2] - path
        half = places @ velocity
        root = half**2 - squared * ((places**2).sum(axis=1) - near * near)
        if (root > 0.0).any():
            leaves = np.sqrt(root[root > 0.0]) - half[root > 0.0]
            last = max(last, float(leaves.max() / squared))
    return last


@dataclass(frozen=True)
class Encounters:
    """Source of a study: the encounters of a family; the seed is their number."""

    family: Literal["parked", "several"]

    @property
    def name(self) -> str:
        """Name of the family."""
        return self.family

    def identity(self, data: str | None) -> str:
        """Return what determines the encounters, but for their number."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return an encounter as a scenario file."""
        number = seed or 0
        drawn = draw_encounters(self.family, 100 * (1 + number // 100))
        encounter = drawn[number]
        speed, length = encounter.speed, encounter.speed * (DRIVE - 0.5)
        left = time_of_leaving(encounter, length)
        left = max(left, DRIVE) if speed else left
        discs = zip(encounter.discs, encounter.velocities, strict=True)
        return {
            "title": "Encounter",
            "duration_s": left + RETURN,
            "dt_s": 0.05,
            "start": {"x_m": 0.0, "y_m": 0.0},
            "reference": reference(speed, length),
            "tracking": {"station_keeping": True, "k_y_rad_per_m2": 4.0},
            "arrival_m": 0.01,
            "arrival_rad": math.radians(1.0),
            "obstacles": [
                {
                    "kind": "disc",
                    "position_m": disc[:2].tolist(),
                    "radius_m": float(disc[2]),
                    "velocity_mps": velocity.tolist(),
                }
                for disc, velocity in discs
            ],
        }


def reference(speed: float, length: float) -> dict[str, Any]:
    """Return a station, or a straight path whose last second slows down to rest."""
    if speed == 0.0:
        return {"kind": "station", "pose": {"x_m": 0.0, "y_m": 0.0}}
    return {
        "kind": "spline",
        "points_m": [[0.0, 0.0], [length, 0.0]],
        "speed_mps": speed,
        "begin_mps": speed,
        "acceleration_mps2": speed,
    }
