"""Transforms between sensor frames."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from qpavoid.settings import want
from qpavoid.types import Array

MOST_ANGLE = 2.0 * math.pi + 0.02
"""rad; a greater angle of a frame is taken for degrees, and rejected."""


class Transform(NamedTuple):
    """Rigid transform p ↦ R p + t: rotation R (3, 3), t (3,) in m."""

    rotation: Array
    translation: Array

    @classmethod
    def of_quaternion(
        cls, place: Sequence[float], turn: Sequence[float]
    ) -> "Transform":
        """Return the transform of x, y, z in m and a quaternion x, y, z, w, not 0.

        Raises:
            InvalidInputError: Not finite, or the quaternion is 0.
        """
        numbers = np.array([*place, *turn])
        known = bool(np.isfinite(numbers).all()) and bool(numbers[3:].any())
        want(known, "a frame needs numbers")
        return cls(Rotation.from_quat(numbers[3:]).as_matrix(), numbers[:3])

    @classmethod
    def of_angles(cls, numbers: Sequence[float]) -> "Transform":
        """Return that of x, y, z (m), roll, pitch, yaw (rad): fixed axes, as URDF.

        Raises:
            InvalidInputError: One is not finite, or an angle above :data:`MOST_ANGLE`.
        """
        x, y, z, *angles = map(float, numbers)
        want(all(map(math.isfinite, (x, y, z, *angles))), "a frame needs numbers")
        most = max(angles, key=abs)
        said = f"an angle of a frame is {most:g} rad; {most:g} degrees are"
        said = f"{said} {math.radians(most):.4g} rad"
        want(abs(most) <= MOST_ANGLE, said)
        rotation = Rotation.from_euler("xyz", angles)
        return cls(rotation.as_matrix(), np.array([x, y, z]))

    def apply(self, points: Array) -> Array:
        """Return points (N, 3) of the frame in the other one, m."""
        return np.asarray(points @ self.rotation.T + self.translation)
