"""Statements of all baselines; closed loops of those that act on what is near."""

import math

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from baselines import (
    AHEAD,
    DT,
    HEAVY,
    NEAR,
    PROGRAMS,
    following,
    make,
    seeds,
    start,
    towards,
)
from qpavoid.avoidance.decision import Status
from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.methods import OURS, REGISTRY
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot, limit_twist, twist_box
from shapes import ROBOT as MIR
from shapes import scene

ODD = [
    Robot(name, MIR.footprint, Limits(*limits))
    for name, limits in (
        ("no limits", (-math.inf, math.inf, -math.inf, math.inf)),
        ("turret", (0.0, 0.0, -1.0, 1.0)),
        ("rail", (0.0, 1.0, 0.0, 0.0)),
    )
]
SMALL = {"mppi": {"samples": 16}}
SMALL |= {name: {"stages": 5, "nearest": 2} for name in PROGRAMS}
EVERY = [(name, robot) for name in NEAR for robot in (MIR, HEAVY, *ODD)]
EVERY += [(name, HEAVY) for name in AHEAD if name not in PROGRAMS]
EVERY += [pytest.param(name, HEAVY, marks=pytest.mark.long) for name in PROGRAMS]
methods = pytest.mark.parametrize("name", NEAR)


@pytest.mark.parametrize("name", [*NEAR, *AHEAD])
@pytest.mark.parametrize("guide", [None, following(0.45, 0.17, (0.45, 0.17))])
def test_far_from_everything_the_desired_twist_is_driven(name, guide):
    far = Obstacles([[50.0, 1.0]], [[-40, 7, 0.4]], walls=[[50, 9, -50, 90]])
    step = make(name).start(0.45, 0.17)
    for obstacles in (Obstacles(), far, far):
        decision = step(0.45, 0.17, obstacles, guide)
        assert decision[:3] == (0.45, 0.17, Status.TRACKING)


@pytest.mark.parametrize(("name", "robot"), EVERY)
@given(seed=seeds)
def test_twists_are_finite_and_within_the_limits(name, robot, seed):
    rng = np.random.default_rng(seed)
    obstacles, driven = Obstacles(**scene(rng)), (0.0, 0.0)
    step = make(name, robot, **SMALL.get(name, {})).start()
    for _ in range(4):
        x, y = rng.uniform(-4, 4, 2)
        guide = towards(x, y, driven, rng.uniform(-9, 9))
        v, omega = rng.uniform(-2, 2, 2)
        decision = step(v, omega, obstacles, guide)
        box = twist_box(robot.limit_vector, *driven, DT)
        cut = limit_twist(robot.limit_vector, (v, omega), driven, DT)
        assert box[0] - 1e-12 <= decision.v <= box[1] + 1e-12
        assert box[2] - 1e-12 <= decision.omega <= box[3] + 1e-12
        driven = decision[:2]
        assert np.isfinite(driven).all()
        if robot is HEAVY:
            assert abs(driven[0]) + 0.225 * abs(driven[1]) <= 1.1 + 1e-9
        if decision.status is Status.TRACKING:
            assert_allclose(driven, (v, omega) if name in NEAR else cut, atol=1e-8)
        if decision.status is Status.HOLDING:
            assert driven == (0.0, 0.0)


@methods
@given(seed=seeds)
def test_same_again_and_mirrored(name, seed):
    rng = np.random.default_rng(seed)
    parts, (x, y) = scene(rng), rng.uniform(-3, 3, 2)
    v, omega, driven = 0.6, rng.uniform(-1, 1), (0.4, rng.uniform(-1, 1))
    flip = {key: value.copy() for key, value in parts.items()}
    for array in flip.values():
        array[:, 1::2] *= -1.0
    flip["discs"][:, 2] = parts["discs"][:, 2]
    one = start(name)(v, omega, Obstacles(**parts), towards(x, y, driven))
    again = start(name)(v, omega, Obstacles(**parts), towards(x, y, driven))
    mirrored = (-omega, Obstacles(**flip), towards(x, -y, (driven[0], -driven[1])))
    other = start(name)(v, *mirrored)
    assert one[:7] == again[:7]
    assert other.status is one.status
    if one.v > 0.0 or name != "vfh":  # straight behind both ways are as good
        assert_allclose((other.v, -other.omega), one[:2], atol=1e-6)


@methods
def test_a_twist_that_is_not_finite_is_refused(name):
    with pytest.raises(InvalidInputError, match="twist"):
        start(name)(math.nan, 0.0, Obstacles())


BESIDE = {
    "title": "A disc a little beside the way",
    "duration_s": 30.0,
    "dt_s": DT,
    "ends_at_goal": True,
    "tracking": {"station_keeping": True, "waiting": True},
    "reference": {
        "kind": "spline",
        "points_m": [[0.0, 0.0], [5.0, 0.0]],
        "speed_mps": 0.5,
    },
}


@pytest.mark.parametrize(
    ("name", "aside", "arrives"),
    [
        ("stop", 0.15, False),
        ("stop", 0.75, True),
        ("apf", 0.15, False),
        ("apf", 0.75, True),
        ("vfh", 0.15, True),
        ("dwa", 0.15, False),
        ("dwa", 0.75, True),
    ],
)
def test_past_a_disc_or_stalled_before_it(name, aside, arrives, tmp_path):
    disc = {"kind": "disc", "position_m": [2.5, aside], "radius_m": 0.2}
    document = BESIDE | {"obstacles": [disc]}
    log = run(make_scenario(document, "beside", tmp_path / "beside.toml"), name)
    assert log["least_clearance_m"].min() > 0.0 and log.meta["solver"] == "its own"
    assert (math.dist(log.final[:2], (5.0, 0.0)) < 0.1) == arrives
    if name == "stop" and not arrives:
        assert log["status"][-1] == Status.HOLDING.number


def test_every_method_is_tested_here_or_among_those_that_look_ahead():
    apart = {"omni", "rpp"}  # in files of their own
    assert {*NEAR, *AHEAD, *apart, *OURS} == set(REGISTRY)
