"""The parked encounters as scenario files, for studies that take settings by key."""

from functools import lru_cache
from typing import Any, NamedTuple

from encounter_scenes import DT, Encounter, draw_encounters, make_loops
from qpavoid.model.robot import Robot

ROBOT = Robot.mir100()

MOST, FIRST = 1000, 1
"""So many encounters are drawn, and from which seed: those that are reported."""


@lru_cache
def drawn(family: str) -> list[Encounter]:
    """Return the encounters of a family."""
    return draw_encounters(family, MOST, FIRST, ROBOT)


class Parked(NamedTuple):
    """A robot at its station, and discs that are aimed at it.

    Attributes:
        name: Of the family, and what tables call it: ``parked``, one disc; ``several``,
            two to five, in encounters of even number; in others it is on a path.
    """

    name: str = "parked"

    def identity(self, data: str | None) -> str:
        """Return what determines the encounters, but for their numbers and the code."""
        return f"{self!r}, {MOST} of seed {FIRST}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return an encounter as a scenario file.

        Raises:
            ValueError: The robot is on a path, or there is no such family.
        """
        if self.name not in ("parked", "several"):
            raise ValueError(f"{self.name!r} is neither parked nor several")
        encounter = drawn(self.name)[seed or 0]
        if encounter.speed:
            raise ValueError(f"{self.name} {seed}: the robot is on a path")
        (loop,) = make_loops([encounter], ROBOT)
        return {
            "title": "Encounter",
            "duration_s": loop.duration,
            "dt_s": DT,
            "robot": {"preset": "mir100"},
            "reference": {
                "kind": "station",
                "pose": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
            },
            "tracking": {
                "k_x_per_s": 1.0,
                "k_y_rad_per_m2": 4.0,
                "k_gamma_radps": 2.0,
                "station_keeping": True,
            },
            "obstacles": [
                {
                    "kind": "disc",
                    "position_m": [x, y],
                    "radius_m": radius,
                    "velocity_mps": velocity,
                }
                for (x, y, radius), velocity in zip(
                    encounter.discs.tolist(), encounter.velocities.tolist(), strict=True
                )
            ],
            "arrival_m": 0.01,
            "arrival_rad": 0.0175,
        }
