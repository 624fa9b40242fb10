"""Robots, obstacles and calls for the baselines that act on what is near."""

import numpy as np
from hypothesis import strategies as st

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from shapes import ROBOT as MIR
from shapes import clearance, scene

HEAVY = Robot(
    "heavy",
    MIR.footprint,
    Limits(-0.4, 1.0, -1.2, 1.5, 0.6, 1.5, wheel_speed=1.1, track=0.45),
)


DT = 0.05

SETTINGS = AvoidanceSettings(dt=DT)


seeds = st.integers(0, 2**32 - 1)


def start(name, robot=MIR, v=0.0, omega=0.0):
    return make_controller(name, robot, SETTINGS).start(v, omega)


def towards(x, y, driven=(0.0, 0.0), heading=0.0):
    """A context whose reference rests at a place, robot frame."""
    pose, target = (0.0, 0.0, heading), (x, y, 0.0)
    return StepContext(pose, target, (0.0, 0.0), target, driven)


def standing(rng, size=4):
    """A scene at rest that leaves the robot 0.15 m."""
    while True:
        parts = scene(rng, size) | {"disc_velocities": np.zeros((size, 2))}
        parts["points"] += 0.8 * np.sign(parts["points"])
        parts["discs"][:, :2] *= rng.choice([-1.0, 1.0], (size, 2))
        obstacles = Obstacles(**parts)
        if clearance(obstacles) > 0.15:
            return obstacles
