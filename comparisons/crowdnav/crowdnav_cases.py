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
from qpavoid.lab.scenario.scenario import Scenario, make_scenario

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
