"""Poses by time: between two, after the last, and seen from one another."""

import math
from itertools import pairwise

import numpy as np
import pytest

from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import integrate, relative
from qpavoid.ros.trail import MOST_POSES, Trail, placed
from qpavoid.ros.transform import Transform


def compose(frame, pose):
    """The place of a pose in a frame, as seen from where that frame is."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    x, y = cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1]
    return frame[0] + x, frame[1] + y, frame[2] + pose[2]


def test_relative_and_placed_are_inverse():
    then, now = (1.0, -2.0, 3.0), (0.5, 4.0, -3.0)
    assert compose(then, relative(then, now))[:2] == pytest.approx(now[:2])
    assert relative(then, now)[2] == pytest.approx(2 * math.pi - 6.0)
    assert relative(then, then) == (0.0, 0.0, 0.0)


def test_between_two_and_after_the_last():
    trail = Trail()
    assert trail.at(3.0) == (0.0, 0.0, 0.0)
    trail.record(1.0, (0.0, 0.0, 3.1), (0.0, 0.0))
    trail.record(2.0, (1.0, 2.0, -3.1), (0.5, 0.3))
    x, y, heading = trail.at(1.5)
    assert (x, y) == pytest.approx((0.5, 1.0))
    assert math.cos(heading) == pytest.approx(-1.0, abs=1e-9)
    driven = integrate((1.0, 2.0, -3.1), (0.5, 0.3), 0.0, 0.4)
    assert trail.at(2.4) == pytest.approx(driven)
    assert trail.at(0.0) == (0.0, 0.0, 3.1)


def test_between_two_of_many_that_are_not_evenly_apart():
    trail, times = Trail(), (0.0, 1.0, 3.0, 3.5, 7.0)
    for time in times:
        trail.record(time, (time * time, -time, 0.1 * time), (9.0, 9.0))
    for a, b in pairwise(times):
        for share in (0.0, 0.3, 0.9):
            time = a + share * (b - a)
            x, y, heading = trail.at(time)
            assert x == pytest.approx(a * a + share * (b * b - a * a))
            assert (-y, 10 * heading) == pytest.approx((time, time))


def test_many_times_at_once_and_points_from_their_poses():
    trail = Trail()
    for k in range(9):
        trail.record(0.1 * k, (0.1 * k, 0.0, 0.7 * k), (1.0, 7.0))
    times = np.linspace(-0.1, 1.0, 40)
    poses = trail.along(times)
    np.testing.assert_allclose(poses, [trail.at(t) for t in times.tolist()])
    driven = integrate((0.8, 0.0, 5.6), (1.0, 7.0), 0.0, 0.2)
    np.testing.assert_allclose(np.exp(1j * poses[-1, 2]), np.exp(1j * driven[2]))
    np.testing.assert_allclose(poses[-1, :2], driven[:2])
    seen = placed(np.ones((40, 2)), poses)
    wanted = [compose(pose, (1.0, 1.0, 0.0))[:2] for pose in poses.tolist()]
    np.testing.assert_allclose(seen, wanted)


def test_twists_are_compared_with_poses():
    """On an arc at 8 Hz, told what is driven, and 0.3 m/s and 0.1 rad/s too much."""
    for more, turned in ((0.0, 0.0), (0.3, 0.1)):
        trail, pose = Trail(), (5.0, -3.0, 3.0)
        assert trail.twist_to(0.0, pose).tolist() == [0.0, 0.0]
        for k in range(30):
            moved = integrate(pose, (0.5, 1.0), 0.0, 0.125)
            trail.record(0.125 * k, moved, (0.5 + more, 1.0 + turned))
            pose = moved
        off, path = trail.drift()
        np.testing.assert_allclose(off, (more, turned), atol=2e-3)
        np.testing.assert_allclose(path, (0.5, 1.0), atol=1e-3)
        ahead = integrate(pose, (0.5, 1.0), 0.0, 0.125)
        np.testing.assert_allclose(trail.twist_to(3.75, ahead), (0.5, 1.0), atol=1e-3)


def test_a_clock_that_goes_back_begins_a_new_trail():
    trail = Trail()
    for k in range(3 * MOST_POSES):
        trail.record(float(k), (float(k), 0.0, 0.0), (0.0, 0.0))
    assert trail.at(0.0)[0] == 3 * MOST_POSES - MOST_POSES - 1
    trail.record(5.0, (7.0, 0.0, 0.0), (0.0, 0.0))
    assert trail.at(9.0) == (7.0, 0.0, 0.0) == trail.at(0.0)


def test_angles_and_quaternions_agree():
    """Yaw of 0.7 after pitch of -0.4 after roll of 0.3, by half angles."""
    (a, b, c), (d, e, f) = np.cos([0.15, -0.2, 0.35]), np.sin([0.15, -0.2, 0.35])
    x, y = d * b * c - a * e * f, a * e * c + d * b * f
    z, w = a * b * f - d * e * c, a * b * c + d * e * f
    turned = Transform.of_quaternion([1, 2, 3], 2.0 * np.array([x, y, z, w]))
    same = Transform.of_angles([1, 2, 3, 0.3, -0.4, 0.7])
    np.testing.assert_allclose(turned.rotation, same.rotation, atol=1e-12)
    np.testing.assert_allclose(same.rotation @ same.rotation.T, np.eye(3), atol=1e-12)
    with pytest.raises(InvalidInputError, match="a frame needs"):
        Transform.of_quaternion([0, 0, 0], [0, 0, 0, 0])
