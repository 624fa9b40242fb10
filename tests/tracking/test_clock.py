"""The reference that waits: its rate, its liveness, and a robot that is held up."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Limits
from qpavoid.tracking.clock import NEVER, Waiting, progress_rate
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.path import CubicPath, SplinePath
from qpavoid.tracking.station import Tracker

GAINS = Gains(2.0, 6.0, 4.0)
UNLIMITED = Limits.symmetric(math.inf, math.inf)
PATH = SplinePath(np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 2.0], [6.0, 2.0]]), 0.5)
GOAL = PATH.sample(np.array([1e9]))[0, :2]
DT = 0.02

HELD = """
title = "A great disc stands in the way until 10 s, then goes ahead"
duration_s = 40.0
dt_s = 0.02
[reference]
kind = "spline"
points_m = [[0.0, 0.0], [8.0, 0.0]]
speed_mps = 0.5
[tracking]
k_x_per_s = 2.0
k_y_rad_per_m2 = 6.0
k_gamma_radps = 4.0
waiting = true
[[obstacles]]
kind = "waypoints"
times_s = [10.0, 12.0]
positions_m = [[4.2, 0.0], [24.2, 0.0]]
radius_m = 2.0
"""

lags = st.floats(-5.0, 5.0)
rates = st.floats(0.0, 1.0)
reaches = st.tuples(st.floats(0.0, 2.0), st.floats(1e-6, 2.0))
angles = st.floats(-math.pi, math.pi)


def drive(start, waiting):
    """Return poses, references and progress (s) of a robot that nothing hinders."""
    times = DT * np.arange(1501)
    follow = waiting.start(PATH.sample(times))
    track, pose = Tracker(GAINS, None, UNLIMITED).start(), start
    poses, references, progress = [], [], []
    for _ in times[:-1]:
        reference, place = follow(pose)
        poses.append(pose)
        references.append(reference)
        progress.append(DT * place)
        v, omega = track(pose, reference)
        pose = arc(*pose, v, omega, DT)
    return np.array(poses), np.array(references), np.array(progress)


def held(tmp_path, text=HELD, **changes):
    file = tmp_path / "held.toml"
    file.write_text(text)
    return dataclasses.replace(load_scenario(file), **changes)


@given(lags, lags, reaches, rates)
def test_the_rate_stays_in_0_to_1_and_falls_with_the_lag(one, other, reach, least):
    free, wide = reach[0], reach[0] + reach[1]
    low, high = sorted((one, other))
    near, far = (progress_rate(lag, free, wide, least) for lag in (low, high))
    assert least <= far <= 1.0 and least <= near <= 1.0
    assert far <= near + 1e-15
    assert progress_rate(min(low, free), free, wide, least) == 1.0
    assert progress_rate(wide + abs(low), free, wide, least) == least


@pytest.mark.parametrize(
    ("pose", "rate"),
    [
        ((2.0, 1.0), 1.0),  # on it
        ((3.0, 1.0), 1.0),  # beside it: it heads for +y
        ((1.3, 0.95), 1.0),  # beside, a little behind
        ((2.0, 3.0), 1.0),  # ahead
        ((2.0, 0.5), 0.0),  # behind
    ],
)
def test_only_a_robot_behind_is_waited_for(pose, rate):
    plan = np.tile([2.0, 1.0, math.pi / 2, 0.8, -0.4], (3, 1))
    follow = Waiting(least_rate=0.0).start(plan)
    target, place = follow((*pose, 0.3))
    assert target == pytest.approx((2.0, 1.0, math.pi / 2, 0.8 * rate, -0.4 * rate))
    assert (place, follow((*pose, 0.3))[1]) == (0.0, rate)


def test_between_two_steps_the_plan_is_interpolated():
    plan = np.array([[0.0, 0, 0, 1, 0], [1.0, 2, 0.2, 3, 4], [5.0, 5, 0.4, 0, 0]])
    follow = Waiting(free=0.5, wide=1.5, least_rate=0.0).start(plan)
    assert follow((-1.0, 0.0, 0.0)) == ((0.0, 0.0, 0.0, 0.5, 0.0), 0.0)
    assert follow((9.0, 9.0, 0.0)) == ((0.5, 1.0, 0.1, 2.0, 2.0), 0.5)
    reference, place = follow((9.0, 9.0, 0.0))
    assert reference == pytest.approx((3.0, 3.5, 0.3, 1.5, 2.0))
    assert place == 1.5
    for place in (2.5, 3.5):  # the end of the plan
        assert follow((9.0, 9.0, 0.0)) == ((5.0, 5.0, 0.4, 0.0, 0.0), place)


@given(st.floats(0.2, 1.0), angles, st.floats(0.1, 1.0))
def test_the_slower_reference_is_still_a_unicycle_on_the_path(lag, heading, least):
    """Its pose moves with the very twist that is handed on."""
    path = CubicPath((0.0, 0.0, 0.0), (3.0, 1.5, 0.5), 3.0, 10.0)
    follow = Waiting(least_rate=least).start(path.sample(DT * np.arange(501)))
    before, _ = follow((-lag, 0.0, heading))
    for _ in range(400):
        after, _ = follow((before[0] - lag, before[1], heading))
        mean = 0.5 * (np.array(before[3:]) + after[3:])
        assert arc(*before[:3], *mean, DT) == pytest.approx(after[:3], abs=2e-4)
        before = after


@settings(max_examples=25)
@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), angles)
@pytest.mark.parametrize("least", [0.0, 0.05])
def test_from_any_offset_the_pair_finishes(least, x, y, heading):
    """V of the proof does not rise, but for what a step of 20 ms adds."""
    start = (x, y, 0.999 * heading)
    poses, references, progress = drive(start, Waiting(least_rate=least))
    assert progress[-1] > PATH.duration
    np.testing.assert_allclose(poses[-1, :2], GOAL, atol=0.02)
    apart = poses - references[:, :3]
    energy = 0.5 * (apart[:, :2] ** 2).sum(axis=1)
    energy += (1.0 - np.cos(apart[:, 2])) / GAINS.k_y
    assert np.diff(energy).max() < 1e-5
    assert DT * (len(progress) - 1) - progress[-1] < 2.0


@pytest.fixture(scope="module")
def held_logs(tmp_path_factory):
    scenario = held(tmp_path_factory.mktemp("held"))
    return [run(dataclasses.replace(scenario, waiting=w), "qp") for w in HOLDS]


HOLDS = (Waiting(), Waiting(least_rate=0.0), NEVER)


def test_a_robot_that_was_held_does_not_lunge(held_logs):
    """Held for 5 s and more; Eq. 6 then asks for v_r + k_x · lag."""
    k_x, v_r = 2.0, 0.5
    for log, waiting in zip(held_logs, HOLDS, strict=True):
        lag = log["x_ref_m"] - log["x_m"]
        stood = (np.abs(log["v_mps"]) < 0.01) & (log["t_s"] > 1.0) & (log["t_s"] < 10.1)
        assert 0.02 * stood.sum() >= 5.0
        behind = 0.02 * (lag > waiting.wide).sum()
        most = waiting.wide + waiting.least_rate * v_r * behind + 1e-3
        assert lag.max() <= most
        assert log["v_desired_mps"].max() <= v_r + k_x * most
        assert metrics(log)["outcome"] == "arrived"
        assert metrics(log)["min_clearance_m"] > 0.16
    waits, stops, never = (log["v_desired_mps"].max() for log in held_logs)
    assert stops <= waits < 0.35 * never
    assert never > 4.0


@pytest.mark.parametrize("bad", [{"free": 0.4}, {"wide": 0.05}])
def test_bad_settings(bad):
    with pytest.raises(InvalidInputError, match="waiting needs"):
        Waiting(**bad)
