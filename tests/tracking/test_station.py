"""Station keeping: from any pose within 3 m, back to 1 cm and 1 degree, at rest."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.robot import Limits, Robot, limit_twist
from qpavoid.tracking.kanayama import Gains, kanayama, tracking_error
from qpavoid.tracking.path import CubicPath
from qpavoid.tracking.station import StationKeeping, Tracker

GAINS = Gains(1.0, 1.0, 2.0)
LIMITS = Robot.mir100().limits
AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0)
angles = st.floats(-math.pi, math.pi)


def tracker(limits=LIMITS, **settings):
    return Tracker(GAINS, StationKeeping(**settings), limits)


def drive(pose, law, seconds, dt=0.02):
    """Return poses and twists on the way to the origin."""
    track, poses, twists = law.start(), [pose], []
    for _ in range(round(seconds / dt)):
        twists.append(track(pose, AT_REST))
        pose = arc(*pose, *twists[-1], dt)
        poses.append(pose)
    return np.array(poses), np.array(twists)


def is_back(poses):
    away = np.hypot(poses[:, 0], poses[:, 1])
    turned = np.abs([wrap_angle(heading) for heading in poses[:, 2]])
    return (away <= 0.01) & (turned <= math.radians(1.0))


@given(st.floats(0.0, 3.0), angles, angles)
def test_every_pose_within_3_m_is_back_within_15_s(distance, bearing, heading):
    start = (distance * math.cos(bearing), distance * math.sin(bearing), heading)
    poses, twists = drive(start, tracker(), 15.0)
    assert is_back(poses[-1:]).all()
    assert (np.abs(twists) <= (1.0 + 1e-12, 1.5 + 1e-12)).all()


def test_a_lateral_error_is_what_eq_6_cannot_correct():
    start = (0.0, 0.15, 0.0)
    assert is_back(drive(start, tracker(), 15.0)[0][-1:]).all()
    poses, _ = drive(start, Tracker(GAINS, None, LIMITS), 15.0)
    np.testing.assert_allclose(poses[-1], start, atol=1e-12)


@given(st.floats(0.05, 3.0), angles, angles)
def test_no_chatter_at_rest(distance, bearing, heading):
    start = (distance * math.cos(bearing), distance * math.sin(bearing), heading)
    poses, twists = drive(start, tracker(), 25.0)
    assert is_back(poses[-500:]).all()
    assert not twists[-500:, 0].any()
    assert np.abs(twists[-500:, 1]).max() < 0.1
    assert (np.diff(np.sign(twists[-500:, 1])) == 0).sum() >= 497


def test_small_pushes_do_not_wake_it_and_larger_ones_do():
    track = tracker().start()
    for x, awake in ((0.002, False), (0.007, False), (0.009, True), (0.007, True)):
        assert (track((x, 0.0, 0.0), AT_REST)[0] != 0.0) is awake


@given(st.floats(0.0, 3.0), angles, angles)
def test_a_robot_that_cannot_back_up_comes_back_too(distance, bearing, heading):
    start = (distance * math.cos(bearing), distance * math.sin(bearing), heading)
    poses, twists = drive(start, tracker(Limits(0.0, 1.0, -1.5, 1.5)), 25.0)
    assert twists[:, 0].min() >= 0.0
    assert is_back(poses[-1:]).all()


def test_eq_6_hands_over_smoothly():
    """Eq. 6 above the blend speed, the law at rest, and no jump in between."""
    pose, speeds = (0.1, 0.2, 0.3), np.linspace(0.0, 0.06, 601)
    twists = np.array(
        [tracker().start()(pose, (0.3, 0.1, 0.0, v, 0.0)) for v in speeds]
    )
    moving, error = speeds >= 0.05, tracking_error(pose, (0.3, 0.1, 0.0))
    expected = [kanayama(error, (v, 0.0), (1.0, 1.0, 2.0)) for v in speeds[moving]]
    np.testing.assert_array_equal(twists[moving], expected)
    assert np.abs(np.diff(twists, axis=0)).max() < 0.02


def test_a_path_ends_at_its_goal():
    """With a lateral error that Eq. 6 alone would keep."""
    path = CubicPath((0.0, 0.0, 0.0), (2.0, 1.0, 0.5), 2.0, 6.0)
    times = 0.02 * np.arange(1000)
    track, pose = tracker().start(), (-0.5, 0.4, 0.3)
    numbers = Robot.mir100().limit_vector
    for row in path.sample(times).tolist():
        desired = track(pose, tuple(row))
        driven = limit_twist(numbers, desired, (0.0, 0.0), 0.02)
        pose = arc(*pose, *driven, 0.02)
    assert math.hypot(pose[0] - 2.0, pose[1] - 1.0) <= 0.01
    assert abs(pose[2] - 0.5) <= math.radians(1.0)


@pytest.mark.parametrize("controller", ["eq5", "eq7", "qp"])
def test_case_2_with_station_keeping_returns_under_every_method(controller):
    scenario = load_scenario("paper/test_case_2_station")
    result = metrics(run(scenario, controller))
    assert result["outcome"] == "arrived"
    assert result["final_error_m"] <= 0.01
    assert abs(result["final_heading_error_rad"]) <= math.radians(1.0)


coordinate = st.floats(-10, 10)
poses = st.tuples(coordinate, coordinate, st.floats(-12, 12))


@given(poses, poses)
def test_error_is_the_reference_seen_from_the_robot(pose, reference):
    """Oracle: complex numbers."""
    place = complex(*reference[:2]) - complex(*pose[:2])
    seen = place * np.exp(-1j * pose[2])
    e_x, e_y, e_gamma = tracking_error(pose, reference)
    assert (e_x, e_y) == pytest.approx((seen.real, seen.imag), abs=1e-12)
    assert -math.pi <= e_gamma <= math.pi
    turn = np.exp(1j * (reference[2] - pose[2]))
    assert np.exp(1j * e_gamma) == pytest.approx(turn, abs=1e-12)


@given(
    st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-1.0, 1.0), st.floats(-1, 1)
)
def test_a_moving_reference_is_caught(e_x, e_y, e_gamma, omega_r):
    """Closed loop: the errors of a robot that starts beside its reference vanish."""
    reference = (0.0, 0.0, 0.0)
    pose = (-e_x, -e_y, -e_gamma)
    for _ in range(2000):
        error = tracking_error(pose, reference)
        twist = kanayama(error, (0.5, omega_r), (2.0, 9.0, 5.0))
        pose = arc(*pose, *twist, 0.005)
        reference = arc(*reference, 0.5, omega_r, 0.005)
    assert np.abs(tracking_error(pose, reference)).max() < 5e-3
