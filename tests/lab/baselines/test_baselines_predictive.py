"""ORCA and what plans ahead: formulas against oracles, limits, closed loops."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines import AHEAD, PROGRAMS, SETTINGS, following, make
from qpavoid.lab.baselines.drive import round_robot, wide_discs
from qpavoid.lab.baselines.orca import Near
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT

coordinate = st.floats(-3.0, 3.0)


SCENE = """
title = "One disc"
duration_s = 25.0
dt_s = 0.05
ends_at_goal = true
[reference]
kind = "spline"
points_m = [[0.0, 0.0], [6.0, 0.0]]
speed_mps = 0.6
[tracking]
station_keeping = true
waiting = true
[[obstacles]]
kind = "disc"
"""
STANDS = SCENE + "position_m = [3.0, 0.4]\nradius_m = 0.2\n"
CROSSES = (
    SCENE + "position_m = [3.0, -2.0]\nradius_m = 0.2\nvelocity_mps = [0.0, 0.45]\n"
)


QUICK = [name for name in AHEAD if name not in PROGRAMS]


@pytest.mark.parametrize(
    ("name", "scene"),
    [(name, scene) for name in QUICK for scene in (STANDS, CROSSES)]
    + [pytest.param(x, STANDS, marks=pytest.mark.long) for x in PROGRAMS]
    + [pytest.param(x, CROSSES, marks=pytest.mark.slow) for x in PROGRAMS],
)
def test_a_disc_that_stands_or_crosses_is_passed(name, scene, tmp_path):
    make(name)
    file = tmp_path / "scene.toml"
    file.write_text(scene)
    result = metrics(run(load_scenario(file), name))
    assert result["min_clearance_m"] > 0.1
    assert result["outcome"] == "arrived"


def leaves(p, radius, velocity, horizon):
    """Return whether a relative velocity stays out of the velocity obstacle."""
    time = np.clip(p @ velocity / max(velocity @ velocity, 1e-12), 0.0, horizon)
    return np.hypot(*(p - time * velocity)) >= radius


def least_change(p, radius, relative, horizon):
    """Return the length of the least change that leaves, by brute force."""
    least = math.inf
    for angle in np.linspace(0, 2 * math.pi, 1000):
        way = np.array([math.cos(angle), math.sin(angle)])
        low, high = 0.0, 5.0
        for _ in range(25):
            middle = 0.5 * (low + high)
            out = leaves(p, radius, relative + middle * way, horizon)
            low, high = (low, middle) if out else (middle, high)
        least = min(least, high)
    return least


@pytest.mark.parametrize("velocity", [(0.6, 0.0), (0.4, 0.1), (0.9, -0.05)])
def test_orca_line_is_half_the_least_change_that_leaves_the_obstacle(velocity):
    method = make("orca", horizon=3.0, ahead=0.2)
    disc, moves = (2.5, 0.3, 0.4), np.array([-0.2, 0.05])
    discs = wide_discs(Obstacles(discs=[disc], disc_velocities=[moves]), SETTINGS)
    about = round_robot(ROBOT, method.ahead)
    near = Near(discs, [])
    world = method.world(near, about, 1.0)
    method.ask(world, near, velocity, velocity)
    _, point = world.get_agent_orca_line(0, 0)
    change = 2.0 * (np.array(point) - velocity)
    p = np.array(disc[:2]) - (method.ahead, 0.0)
    radius = discs[0, 2] + about
    relative = np.array(velocity) - moves
    assert not leaves(p, radius, relative, method.horizon)
    least = least_change(p, radius, relative, method.horizon)
    assert np.hypot(*change) == pytest.approx(least, abs=2e-3)
    guide = following(driven=(velocity[0], velocity[1] / method.ahead))
    found = method.evade(world, guide, velocity, near)
    left = least_change(p, radius, np.array(found) - moves, method.horizon)
    assert left < 0.12 * least


@given(st.lists(st.tuples(*[coordinate] * 4), min_size=1, max_size=4))
@settings(max_examples=20, deadline=None)
def test_orca_does_as_if_what_is_beyond_its_horizon_were_not_there(walls):
    far = [(20.0, y, 21.0, y + 0.5) for y in np.arange(-9.0, 9.0)]
    steps = make("orca").start(0.5), make("orca").start(0.5)
    for _ in range(2):
        near, both = (
            step(0.5, 0.0, Obstacles(walls=some), following(0.5, 0.0, (0.5, 0.0)))
            for step, some in zip(steps, (walls, [*walls, *far]), strict=True)
        )
        assert near[:3] == both[:3]
