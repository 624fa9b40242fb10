"""A plan and calls for the baselines that look ahead."""

from dataclasses import replace

import pytest

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.robot import Limits
from shapes import ROBOT

NAMES = ("orca", "mppi", "nmpc", "ttc", "mpc-cbf", "teb")

SETTINGS = AvoidanceSettings(dt=0.05)

SLOW_ROBOT = replace(
    ROBOT, limits=Limits(-0.5, 1.0, -1.5, 1.5, 1.0, 2.0, wheel_speed=1.1, track=0.4)
)


HERE = (0.0, 0.0, 0.0)


def make(name, robot=ROBOT, **changes):
    if name == "orca":
        pytest.importorskip("pyrvo")
    return replace(make_controller(name, robot, SETTINGS), **changes)


def towards(v=0.5, omega=0.0, driven=(0.5, 0.0)):
    return StepContext(HERE, HERE, (v, omega), (8.0, 0.0, 0.0), driven)
