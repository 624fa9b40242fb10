"""Footprints, ordinary, long, sharp, not convex; and scenes for a filter."""

import math

import numpy as np
import pytest
from hypothesis import strategies as st

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Robot

PENTAGON = Footprint.pentagon(0.890, 0.580, math.radians(40.0))
NEEDLE = Footprint.polygon([(-0.3, -0.1), (1.0, 0.0), (-0.3, 0.1)])
SHIFTED = Footprint.polygon([(0.2, -0.1), (0.7, -0.3), (0.9, 0.4), (0.1, 0.3)])
FOOTPRINTS = {
    "pentagon": PENTAGON,
    "rectangle": Footprint.rectangle(0.890, 0.580),
    "long": Footprint.rectangle(2.0, 0.2),
    "needle": NEEDLE,
    "shifted": SHIFTED,
}
ELL = Footprint.polygon(
    [(-0.4, -0.3), (0.5, -0.3), (0.5, -0.1), (-0.1, -0.1), (-0.1, 0.4), (-0.4, 0.4)]
)
STAR = Footprint.polygon(
    0.4
    * np.array(
        [(-0.04, -1.24), (0.28, -0.28), (1.24, -0.28), (0.44, 0.2), (0.76, 1.16)]
        + [(-0.04, 0.52), (-0.84, 1.16), (-0.52, 0.2), (-1.32, -0.28), (-0.36, -0.28)]
    )
)
FORKS = Footprint.union(
    [
        Footprint.rectangle(0.5, 0.6),
        [(-1.0, 0.1), (-0.3, 0.1), (-0.3, 0.25), (-1.0, 0.25)],
        [(-1.0, -0.25), (-0.2, -0.25), (-0.2, -0.1), (-1.0, -0.1)],
    ]
)
UNIONS = {"ell": ELL, "star": STAR, "forks": FORKS}
convex = pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
FOOTPRINTS = FOOTPRINTS | UNIONS
footprints = pytest.mark.parametrize("footprint", FOOTPRINTS.values(), ids=FOOTPRINTS)
places = st.tuples(st.floats(-2, 2), st.floats(-2, 2))

ROBOT = Robot.mir100()
SAFETY = SafetyFilter(ROBOT, AvoidanceSettings(braking_room=False), ahead=False)
"""The QP of the present rows alone, which has no memory."""


def clearance(obstacles, pose=(0.0, 0.0, 0.0)):
    """The least distance of the robot at a pose, m."""
    return Contacts.of(ROBOT.footprint, obstacles.seen_from(pose)).distance.min()


def scene(rng, size=4):
    """Points, moving discs and walls, near and far, some on the robot."""
    return {
        "points": rng.uniform(-2, 2, (size, 2)),
        "discs": np.abs(rng.normal(size=(size, 3))) * [2, 2, 0.2],
        "disc_velocities": rng.normal(size=(size, 2)) * 0.4,
        "walls": rng.uniform(-3, 3, (2, 4)),
    }


def every_kind(rng):
    """Some of every kind of obstacle, with every velocity that there is."""
    turns = [regular(n, rng) for n in (3, 4, 7)]
    return {
        "points": rng.normal(size=(3, 2)),
        "discs": np.abs(rng.normal(size=(2, 3))),
        "disc_velocities": rng.normal(size=(2, 2)),
        "walls": rng.normal(size=(2, 4)),
        "wall_velocities": rng.normal(size=(2, 2)),
        "polygons": turns,
        "polygon_velocities": rng.normal(size=(3, 3)),
    }


def regular(n, rng):
    """Corners on a circle, not evenly."""
    angles = (np.arange(n) + rng.uniform(0, 0.8, n)) * 2 * math.pi / n
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return rng.normal(size=2) * 3 + rng.uniform(0.2, 2) * circle


HALF = 6.0

RADIUS = SafetyRadius().curve


def box(x_1, y_1, x_2, y_2):
    corners = [(x_1, y_1), (x_2, y_1), (x_2, y_2), (x_1, y_2)]
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
