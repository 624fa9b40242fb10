"""A plan and calls for the baselines that look ahead."""

from dataclasses import replace

import pytest

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.c3bf import CollisionConeController
from qpavoid.lab.baselines.mppi import MppiController
from qpavoid.lab.baselines.nmpc import NmpcController
from qpavoid.lab.baselines.orca import OrcaController
from qpavoid.model.robot import Limits
from shapes import ROBOT

NAMES = ("orca", "c3bf", "mppi", "nmpc")


SETTINGS = AvoidanceSettings(dt=0.05)


SLOW_ROBOT = replace(
    ROBOT, limits=Limits(-0.5, 1.0, -1.5, 1.5, 1.0, 2.0, wheel_speed=1.1, track=0.4)
)


HERE = (0.0, 0.0, 0.0)


def make(name, robot=ROBOT, **changes):
    if name == "orca":
        pytest.importorskip("pyrvo")
    kinds = OrcaController, CollisionConeController, MppiController, NmpcController
    return dict(zip(NAMES, kinds, strict=True))[name](robot, SETTINGS, **changes)


def towards(v=0.5, omega=0.0, driven=(0.5, 0.0)):
    return StepContext(HERE, HERE, (v, omega), (8.0, 0.0, 0.0), driven)
