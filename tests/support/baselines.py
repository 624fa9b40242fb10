"""Methods, robots, obstacles and calls for the tests of baselines."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from shapes import ROBOT, clearance, scene

NEAR = ("alone", "stop", "apf", "vfh", "dwa")
AHEAD = ("orca", "mppi", "nmpc", "ttc", "mpc-cbf", "teb")
"""Methods that act on what is near, and those that look ahead."""

PROGRAMS = "nmpc", "mpc-cbf", "teb"
"""Methods that IPOPT solves, which takes seconds a run."""

HEAVY = replace(
    ROBOT, limits=Limits(-0.4, 1.0, -1.2, 1.5, 0.6, 1.5, wheel_speed=1.1, track=0.45)
)
DT = 0.05
SETTINGS = AvoidanceSettings(dt=DT)
HERE = (0.0, 0.0, 0.0)

seeds = st.integers(0, 2**32 - 1)


def make(name, robot=ROBOT, **changes):
    if name == "orca":
        pytest.importorskip("pyrvo")
    return replace(make_controller(name, robot, SETTINGS), **changes)


def start(name, robot=ROBOT, v=0.0, omega=0.0):
    return make(name, robot).start(v, omega)


def towards(x, y, driven=(0.0, 0.0), heading=0.0):
    """A context whose reference rests at a place, robot frame."""
    target = (x, y, 0.0)
    return StepContext((0.0, 0.0, heading), target, (0.0, 0.0), target, driven)


def following(v=0.5, omega=0.0, driven=(0.5, 0.0)):
    """A context whose reference is here and moves to a goal 8 m ahead."""
    return StepContext(HERE, HERE, (v, omega), (8.0, 0.0, 0.0), driven)


def standing(rng, size=4):
    """A scene at rest that leaves the robot 0.15 m."""
    while True:
        parts = scene(rng, size) | {"disc_velocities": np.zeros((size, 2))}
        parts["points"] += 0.8 * np.sign(parts["points"])
        parts["discs"][:, :2] *= rng.choice([-1.0, 1.0], (size, 2))
        obstacles = Obstacles(**parts)
        if clearance(obstacles) > 0.15:
            return obstacles
