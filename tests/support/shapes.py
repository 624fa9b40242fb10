"""Footprints, ordinary, long, sharp, away from the origin; and scenes for a filter."""

import math

import numpy as np
import pytest
from hypothesis import strategies as st

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
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
