"""CrowdNav's cases as scenarios: robot, reference and walking people."""

import math
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crowdnav_world import (
    FIRST_SEED,
    GOAL,
    RADIUS,
    SPEED,
    START,
    TICK,
    TICKS,
    People,
    draw_people,
)
from qpavoid.lab.simulation.scenario import Scenario, make_scenario

ANGLES = 2.0 * np.pi * np.arange(12) / 12
FOOTPRINT = RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
"""(12, 2) regular dodecagon in the disc, m."""


class Crowd(NamedTuple):
    """Cases with a number of people.

    Attributes:
        phase: ``test``, ``val`` or ``train``.
        people: Number of people.
    """

    phase: str = "test"
    people: int = 5

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.people} people"

    def meet(self, case: int) -> People:
        """Return the people of a case."""
        return People(*draw_people(FIRST_SEED[self.phase] + case, self.people))

    def identity(self, data: str | None) -> str:
        """Return what determines the cases, but for their numbers and the code."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return a case as a scenario file, for studies and tuning.

        People walk the same way whatever the robot does. Contacts are those of its
        footprint.
        """
        people, places = self.meet(seed or 0), []
        for _ in range(TICKS):
            places.append(people.places)
            people.decide()
            people.move()
        ways = np.array([*places, people.places])
        document = make_document() | {
            "duration_s": TICK * TICKS,
            "ends_at_goal": True,
            "settled_s": 0.0,
            "arrival_m": RADIUS,
            "arrival_rad": 3.2,
        }
        obstacles = [
            {
                "kind": "waypoints",
                "times_s": [TICK * k for k in range(TICKS + 1)],
                "positions_m": ways[:, i].tolist(),
                "radius_m": RADIUS,
            }
            for i in range(self.people)
        ]
        return document | {"obstacles": obstacles}


def make_document() -> dict[str, Any]:
    """Return robot, reference and settings as a scenario file, without people."""
    return {
        "title": "CrowdNav",
        "duration_s": TICK * (TICKS + 1),
        "dt_s": 0.05,
        "start": {"x_m": START[0], "y_m": START[1], "heading_rad": math.pi / 2},
        "robot": {
            "footprint_m": FOOTPRINT.tolist(),
            "v_min_mps": -SPEED,
            "v_max_mps": SPEED,
            "omega_min_radps": -math.pi,
            "omega_max_radps": math.pi,
        },
        "reference": {
            "kind": "spline",
            "points_m": [START.tolist(), GOAL.tolist()],
            "speed_mps": SPEED,
        },
        "tracking": {"waiting": True, "station_keeping": True, "k_y_rad_per_m2": 4.0},
        "filter": {"passive": True},
        "radius": {"r_min_slow_m": 0.05, "r_min_fast_m": 0.1},
    }


@lru_cache
def make_scene() -> Scenario:
    """Return robot, reference and settings; the simulation adds the people."""
    return make_scenario(make_document(), "crowdnav", Path("crowdnav"))
