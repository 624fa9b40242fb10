"""Types that many modules share; nothing here has behaviour."""

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]


class Buffer(NamedTuple):
    """What an array is to machine code that is handed one.

    Attributes:
        dimensions: 1 or 2, contiguous, of float64.
        written: Whether it is changed.
    """

    dimensions: int
    written: bool = False


class Record(NamedTuple):
    """The same of an array that holds one record.

    Attributes:
        name: Of its type.
        dtype: Its fields.
        written: Whether it is changed.
    """

    name: str
    dtype: np.dtype[Any]
    written: bool = False


Vector: TypeAlias = Annotated[Array, Buffer(1)]
Matrix: TypeAlias = Annotated[Array, Buffer(2)]
"""(n,) and (n, m), only read."""

VectorWritten: TypeAlias = Annotated[Array, Buffer(1, written=True)]
MatrixWritten: TypeAlias = Annotated[Array, Buffer(2, written=True)]
"""The same, written."""

Arrays: TypeAlias = tuple[Matrix, Matrix]
"""Obstacles: points (N, 2) at rest, of radius 0, and capsules (M, 11)."""

ArraysWritten: TypeAlias = tuple[MatrixWritten, MatrixWritten]
"""The same, to be filled in."""

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
