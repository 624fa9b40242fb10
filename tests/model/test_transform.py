"""Frames seen from others, by angles and by quaternions."""

import math

import numpy as np
import pytest

from qpavoid.errors import InvalidInputError
from qpavoid.model.transform import Transform


def test_a_laser_upside_down():
    """Roll of half a turn: what it sees to its left is to the robot's right."""
    place = Transform.of_angles([0.2, 0.1, 0.3, math.pi, 0.0, 0.0])
    moved = place.apply(np.array([[1.0, 0.5, 0.0]]))
    np.testing.assert_allclose(moved, [[1.2, -0.4, 0.3]], atol=1e-12)


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
