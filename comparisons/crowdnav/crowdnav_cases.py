"""CrowdNav's cases as scenarios: robot, reference and walking people.

Run: python comparisons/crowdnav/crowdnav.py
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from crowdnav_changing import SIGHT, ChangingPeople
from crowdnav_changing import TICKS as CHANGING_TICKS
from crowdnav_reacting import SIGHT as REACTING_SIGHT
from crowdnav_reacting import TICKS as REACTING_TICKS
from crowdnav_reacting import begin
from crowdnav_world import (
    FIRST_SEED,
    RADIUS,
    SPEED,
    TICKS,
    People,
    draw_people,
)
from qpavoid.lab.scenario.scenario import Scenario, make_scenario
from qpavoid.perception.settings import PerceptionSettings

ANGLES = 2.0 * np.pi * np.arange(12) / 12
FOOTPRINT = RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
"""(12, 2) regular dodecagon in the disc, m."""

BODIES = PerceptionSettings(radius=0.4)
"""Of perception: the mean radius of people whose goals change."""


class Crowd(NamedTuple):
    """Cases with a number of people.

    Attributes:
        phase: ``test``, ``val`` or ``train``.
        people: Number of people.
        changing: Crossing of people whose goals change, ``circle`` or ``square``;
            empty: CrowdNav's people.
        reacting: What steers people who see the robot, ``orca`` or ``force``.
    """

    phase: str = "test"
    people: int = 5
    changing: str = ""
    reacting: str = ""

    @property
    def name(self) -> str:
        """Name in tables."""
        kind = self.changing or self.reacting
        return f"{self.people} people" + (kind and f", {kind}")

    @property
    def sight(self) -> float:
        """Distance from the robot's centre to the farthest disc that it sees, m."""
        if self.reacting:
            return REACTING_SIGHT
        return SIGHT + RADIUS if self.changing else math.inf

    @property
    def ticks(self) -> int:
        """Ticks until a robot that has not arrived is late."""
        if self.reacting:
            return REACTING_TICKS
        return CHANGING_TICKS if self.changing else TICKS

    def meet(self, case: int) -> People:
        """Return the people of a case."""
        seed = FIRST_SEED[self.phase] + case
        if self.reacting:
            return begin(seed, self.people, self.reacting)
        if self.changing:
            return ChangingPeople(seed, self.people, self.changing)
        return People(*draw_people(seed, self.people))


def make_document(people: People, ticks: int, wide: bool) -> dict[str, Any]:
    """Return robot, reference and settings as a scenario file, without people."""
    start, goal, far = people.start, people.goal, 0.25 if wide else 0.1
    (x, y), heading = start.tolist(), math.atan2(*(goal - start)[::-1].tolist())
    return {
        "title": "CrowdNav",
        "duration_s": people.tick * (ticks + 1),
        "dt_s": 0.05,
        "start": {"x_m": x, "y_m": y, "heading_rad": heading},
        "robot": {
            "footprint_m": FOOTPRINT.tolist(),
            "v_min_mps": -SPEED,
            "v_max_mps": SPEED,
            "omega_min_radps": -math.pi,
            "omega_max_radps": math.pi,
        },
        "reference": {
            "kind": "spline",
            "points_m": [start.tolist(), goal.tolist()],
            "speed_mps": SPEED,
        },
        "tracking": {"waiting": True, "station_keeping": True, "k_y_rad_per_m2": 4.0},
        "filter": {"passive": True},
        "radius": {"r_min_slow_m": 0.1 if wide else 0.05, "r_min_fast_m": far},
    }


def make_scene(people: People, ticks: int, wide: bool = False) -> Scenario:
    """Return robot, reference and settings; the simulation adds the people.

    ``wide``: r_min is 0.10 to 0.25 m, not 0.05 to 0.10 m.
    """
    document = make_document(people, ticks, wide)
    scene = make_scenario(document, "crowdnav", Path("crowdnav"))
    return replace(scene, perception=BODIES)
