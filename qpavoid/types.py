"""Types that many modules share; nothing here has behaviour."""

from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]

Arrays: TypeAlias = tuple[Array, Array]
"""Obstacles: points (N, 2) at rest, of radius 0, and capsules (M, 11)."""

Pose: TypeAlias = tuple[float, float, float]
"""x, y in m and γ in rad."""

Pair: TypeAlias = tuple[float, float]
"""Of v and of ω: a twist, or weights."""

Twist: TypeAlias = tuple[float, float]
"""v in m/s and ω in rad/s."""


class Box(NamedTuple):
    """Twists between limits, possibly infinite.

    Attributes:
        v_min: m/s.
        v_max: m/s.
        omega_min: rad/s.
        omega_max: rad/s.
    """

    v_min: float
    v_max: float
    omega_min: float
    omega_max: float
