"""CrowdNav's cases as scenes: robot and reference, and people who walk on their own."""

import json
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
from qpavoid.errors import ConfigError
from qpavoid.lab.simulation.config import changed
from qpavoid.lab.simulation.scenario import Scenario, make_scenario

ANGLES = 2.0 * np.pi * np.arange(12) / 12
ROBOTS = {
    "round": RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]),
    "cart": np.array([(-0.25, -0.165), (0.25, -0.165), (0.25, 0.165), (-0.25, 0.165)]),
}
"""Footprints, (k, 2) m, that fit into the disc."""


class Crowd(NamedTuple):
    """What all cases of a setting have in common.

    Attributes:
        phase: ``test``, ``val`` or ``train``.
        people: How many.
        seeing: Whether they see the robot.
        rule: ``circle`` or ``square``.
        robot: One of :data:`ROBOTS`.
        changes: Settings of the scenario by dotted key, as JSON.
    """

    phase: str = "test"
    people: int = 5
    seeing: bool = False
    rule: str = "circle"
    robot: str = "round"
    changes: str = "{}"

    @property
    def name(self) -> str:
        """What tables call it."""
        words = [f"{self.people} people"]
        words += [f"in a {self.rule}"] * (self.rule != "circle")
        words += ["who see it"] * self.seeing
        words += [f"of a {self.robot}"] * (self.robot != "round")
        words += [f"{key}={value}" for key, value in json.loads(self.changes).items()]
        return " ".join(words)

    def meet(self, case: int) -> People:
        """Return the people of a case."""
        seed = FIRST_SEED[self.phase] + case
        return People(*draw_people(seed, self.people, self.rule), self.seeing)

    def identity(self, data: str | None) -> str:
        """Return what determines the cases, but for their numbers and the code."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return a case as a scenario file, for studies and tuning.

        People who do not see the robot go the same way whatever it does. Contacts are
        those of its footprint, as people really move.

        Raises:
            ConfigError: They see it.
        """
        if self.seeing:
            raise ConfigError(["people who see the robot are not known in advance"])
        people, still, places = self.meet(seed or 0), np.zeros(2), []
        for _ in range(TICKS):
            places.append(people.places)
            people.decide(still, still)
            people.move()
        ways = np.array([*places, people.places])
        document = make_document(self.robot, self.changes) | {
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


def make_document(robot: str, changes: str) -> dict[str, Any]:
    """Return robot, reference and settings as a scenario file; the people are not in.

    Args:
        robot: One of :data:`ROBOTS`.
        changes: By dotted key, as JSON.
    """
    document: dict[str, Any] = {
        "title": "CrowdNav",
        "duration_s": TICK * (TICKS + 1),
        "dt_s": 0.05,
        "start": {"x_m": START[0], "y_m": START[1], "heading_rad": math.pi / 2},
        "robot": {
            "footprint_m": ROBOTS[robot].tolist(),
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
    return changed(document, json.loads(changes))


@lru_cache
def make_scene(robot: str, changes: str) -> Scenario:
    """Return robot, reference and settings; the people come with the simulation.

    Raises:
        ConfigError: A change is wrong, or the control step does not divide a tick.
    """
    document = make_document(robot, changes)
    scene = make_scenario(document, "crowdnav", Path("crowdnav"))
    steps = TICK / scene.dt
    if not math.isclose(steps, max(1, round(steps))):
        raise ConfigError([f"dt_s: {scene.dt:g} s are no part of a tick of {TICK} s"])
    return scene
