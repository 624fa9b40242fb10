"""Eq. 6: errors in the robot's frame and the law of Kanayama."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qpavoid.model.kinematics import arc
from qpavoid.tracking.kanayama import kanayama, tracking_error

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


def test_law_by_hand():
    """v = 2 cos(π/3) + 9·0.1 and ω = 0.3 + 2·9·(−0.2) + 5 sin(π/3)."""
    v, omega = kanayama((0.1, -0.2, math.pi / 3), (2.0, 0.3), (9.0, 9.0, 5.0))
    assert v == pytest.approx(1.9)
    assert omega == pytest.approx(-3.3 + 2.5 * math.sqrt(3))


def test_a_parked_robot_is_blind_to_a_lateral_error():
    assert kanayama((0.0, 0.4, 0.0), (0.0, 0.0), (1.0, 1.0, 2.0)) == (0.0, 0.0)


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
