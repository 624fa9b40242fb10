"""What a method takes the robot for: corners that only a polygon has change nothing
for a method of one disc, and something for one of the polygon."""

import importlib

import numpy as np
import pytest

from guided import HERE, make
from qpavoid.avoidance.controllers import StepContext
from qpavoid.lab.simulation.methods import REGISTRY
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from shapes import ROBOT

ABOUT = {"vfh": 0.0}
"""Centre of the disc of a method that has no ``ahead``, m before the axle."""

WHOLE = {"vfh": {"radius": 1.0}}
"""What makes the disc hold all corners, where the default lets them stand out."""


def filled(ahead):
    """The robot, and one whose corners lie all on its circle about a point."""
    x, y = ROBOT.footprint.vertices.T
    radius = np.hypot(x - ahead, y).max()
    angles = np.arctan2(y, x - ahead) + np.linspace(0.0, 2 * np.pi, 24)[:, None]
    angles = np.sort(np.unique(np.round(angles.ravel() % (2 * np.pi), 9)))
    corners = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return Footprint.polygon(corners + (ahead, 0.0))


def answers(name, robot):
    """Twists of single steps, near to points that stand and discs that move."""
    rng, twists = np.random.default_rng(6), []
    for _ in range(12):
        angle, away = rng.uniform(-1.2, 1.2, 3), rng.uniform(0.75, 1.3, 3)
        places = np.column_stack([away * np.cos(angle), away * np.sin(angle)])
        near = Obstacles(
            points=places[:2],
            discs=[(*places[2], 0.05)],
            disc_velocities=[rng.uniform(-0.3, 0.3, 2)],
        )
        towards = StepContext(HERE, HERE, (0.5, 0.0), (8.0, 0.0, 0.0), (0.4, 0.0))
        step = make(name, robot, **WHOLE.get(name, {})).start(0.4)
        twists.append(step(0.5, 0.0, near, towards)[:2])
    return np.array(twists)


def default(name, key):
    """The default of a setting of a method's class."""
    module, _, made = str(REGISTRY[name].make).partition(":")
    made = getattr(importlib.import_module(f"qpavoid.lab.baselines.{module}"), made)
    return made.__dataclass_fields__[key].default


SLOW = ("nmpc", "teb", "mpc-cbf")


@pytest.mark.parametrize("name", [n for n in REGISTRY if n not in SLOW])
def test_corners_count_for_who_knows_them(name):
    shape = REGISTRY[name].shape
    ahead = ABOUT.get(name, 0.0)
    if shape.startswith("disc") and name not in ABOUT:
        ahead = default(name, "ahead")
    round_one = Robot("round", filled(ahead), ROBOT.limits)
    same = np.allclose(answers(name, ROBOT), answers(name, round_one), atol=1e-4)
    assert same == (shape != "polygon" and shape != "two discs"), shape
