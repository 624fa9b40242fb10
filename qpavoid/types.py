"""Shared types, without behaviour."""

from collections.abc import Iterable
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]


class Buffer(NamedTuple):
    """Memory layout of an array argument of machine code.

    Attributes:
        dimensions: 1 or 2, contiguous, of float64.
        written: Whether the function changes it.
    """

    dimensions: int
    written: bool = False


class Sizes(NamedTuple):
    """Least sizes of an array argument, below which machine code would read beyond it.

    Attributes:
        rows: Or length of a vector.
        columns: Of a matrix.
    """

    rows: int
    columns: int = 0


class Record(NamedTuple):
    """Memory layout of an array argument that holds one record.

    Attributes:
        name: Of its type.
        dtype: Its fields.
        written: Whether the function changes it.
    """

    name: str
    dtype: np.dtype[Any]
    written: bool = False


Table: TypeAlias = npt.NDArray[np.void]
"""Array of records: rows of a :func:`layout`."""

Row: TypeAlias = Any
"""Row of a table, that is written through: a view with the fields of its layout."""

LAYOUTS: dict[np.dtype[Any], type] = {}
"""Named tuples by the layout of their tables."""


def record_type(fields: Iterable[tuple[str, Any]]) -> np.dtype[Any]:
    """Return the type of records with such fields, laid out as a struct of C.

    Python reads a field as an attribute, as compiled code does.
    """
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


def layout(of: type) -> np.dtype[Any]:
    """Return the memory layout of a named tuple of numbers: that of a struct of C.

    A table of such records takes a named tuple for a row; a row that is read is a view
    with the same fields.
    """
    kinds = {float: np.float64, int: np.intc}
    made = record_type((name, kinds[of]) for name, of in of.__annotations__.items())
    if LAYOUTS.setdefault(made, of) is not of:
        raise ValueError(f"{of.__name__} and {LAYOUTS[made].__name__} have one layout")
    return made


Vector: TypeAlias = Annotated[Array, Buffer(1)]
Matrix: TypeAlias = Annotated[Array, Buffer(2)]
"""(n,) and (n, m), read only."""

VectorWritten: TypeAlias = Annotated[Array, Buffer(1, written=True)]
MatrixWritten: TypeAlias = Annotated[Array, Buffer(2, written=True)]
"""(n,) and (n, m), written."""

LimitVector: TypeAlias = Annotated[Vector, Sizes(9)]
"""(9,) :attr:`qpavoid.model.robot.Robot.limit_vector`."""

Edges: TypeAlias = Annotated[Matrix, Sizes(1, 6)]
"""(n, 6) edges of a footprint; see :class:`qpavoid.model.footprint.Footprint`."""

Points: TypeAlias = Annotated[Matrix, Sizes(0, 2)]
"""(N, 2), m."""

Discs: TypeAlias = Annotated[Matrix, Sizes(0, 5)]
"""(m, 5): x, y, radius, m, and velocity, m/s."""

Capsules: TypeAlias = Annotated[Matrix, Sizes(0, 12)]
CapsulesWritten: TypeAlias = Annotated[MatrixWritten, Sizes(0, 12)]
"""(M, 12): see :mod:`qpavoid.model.capsules`."""

Arrays: TypeAlias = tuple[Points, Capsules]
"""Obstacles: points (N, 2) at rest, of radius 0, and capsules (M, 12)."""

ArraysWritten: TypeAlias = tuple[Annotated[MatrixWritten, Sizes(0, 2)], CapsulesWritten]
"""Obstacles as :data:`Arrays`, written."""

Pose: TypeAlias = tuple[float, float, float]
"""x, y in m and γ in rad."""

Pair: TypeAlias = tuple[float, float]
"""One number for v and one for ω: a twist, or weights."""

Twist: TypeAlias = tuple[float, float]
"""v in m/s and ω in rad/s."""


class Box(NamedTuple):
    """Bounds of a twist, possibly infinite.

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
