"""Validation of arrays from a caller: numbers, shapes, and errors that name them."""

from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.types import Array, Pose

FLOAT = np.dtype(np.float64)
FARTHEST = 1e100
"""m (and m/s); numbers from here on count as infinite, since their squares may be."""

MOST_ROWS = 1_000_000
"""Greatest number of rows of an array, and of polygons."""

NO_POLYGONS: Sequence[npt.ArrayLike] = ()

REAL = "fiu"
"""Kinds of numpy's types that are real numbers."""


def as_rows(value: npt.ArrayLike, columns: int, name: str) -> Array:
    """Return ``value`` as a C-contiguous float array of shape (n, columns).

    An array of that type and shape is returned uncopied. Whether the numbers are finite
    is checked where they are used.

    Raises:
        InvalidInputError: Another shape, more than :data:`MOST_ROWS`, masked, or not
            real numbers: text, dates, truth values and complex numbers are refused,
            not converted.
    """
    _want_few(value, columns, name)
    if (
        type(value) is np.ndarray
        and value.dtype is FLOAT
        and value.ndim == 2
        and value.shape[1] == columns
        and value.flags.carray
    ):
        return value
    array = _as_numbers(value, name)
    if array.shape == (0,):
        return np.empty((0, columns))
    if array.ndim != 2 or array.shape[1] != columns:
        raise InvalidInputError(
            f"{name} must have shape (n, {columns}), not {array.shape}"
        )
    return array


def finite_rows(value: npt.ArrayLike, columns: int, name: str) -> Array:
    """Return finite rows; as :func:`as_rows`, with InvalidInputError if one is not."""
    rows = as_rows(value, columns, name)
    check_finite(rows, name)
    return rows


def _want_few(value: Any, columns: int, name: str) -> None:
    """Raise InvalidInputError for too many rows, before any copy."""
    try:
        known = isinstance(value, np.ndarray)
        count = value.size // columns if known else len(value)
    except TypeError:
        return
    if count > MOST_ROWS:
        raise InvalidInputError(f"{name} has {count} rows, more than {MOST_ROWS}")


def as_number(value: Any, name: str) -> float:
    """Return a number as a float.

    Raises:
        InvalidInputError: Not a finite real number.
    """
    number = _as_numbers(value, name)
    if number.shape != () or not np.isfinite(number):
        raise InvalidInputError(f"{name} must be a finite number")
    return float(number)


def as_pose(value: Any, name: str) -> Pose:
    """Return x, y (m) and heading (rad) as floats.

    Raises:
        InvalidInputError: Not three finite real numbers.
    """
    numbers = _as_numbers(value, name)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise InvalidInputError(f"{name} must be three finite numbers: x, y, heading")
    x, y, heading = numbers.tolist()
    return x, y, heading


def _as_numbers(value: Any, name: str) -> Array:
    """Return a copy of real numbers of any shape as floats."""
    parts = value if isinstance(value, list | tuple) else [value]
    if any(isinstance(part, np.ma.MaskedArray) for part in parts):
        raise InvalidInputError(f"{name} must not be masked: leave out what is missing")
    try:
        array = np.asarray(value)
        if array.dtype == object and all(map(_is_real, array.flat)):
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInputError(f"{name} must be numbers: {error}") from None
    if array.dtype.kind not in REAL:
        raise InvalidInputError(
            f"{name} must be numbers, real and in equal rows, not {array.dtype}"
        )
    return np.array(array, dtype=np.float64, order="C", subok=False)


def _is_real(value: Any) -> bool:
    """Return whether an object is a real number, not a bool."""
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)


def as_velocities(value: npt.ArrayLike, count: int, columns: int, name: str) -> Array:
    """Return velocities (count, columns); zeros for an empty array.

    Raises:
        InvalidInputError: As :func:`finite_rows`, or another number of rows.
    """
    array = finite_rows(value, columns, name)
    if len(array) == count:
        return array
    if len(array):
        of = name.partition("_")[0] + "s"
        raise InvalidInputError(f"{name} has {len(array)} rows for {count} {of}")
    return np.zeros((count, columns))


def as_polygons(value: Any) -> list[Array]:
    """Return the vertices of every polygon, (n, 2), finite, with n of at least 3.

    Raises:
        InvalidInputError: Not a sequence of such arrays.
    """
    if value is NO_POLYGONS:
        return []
    if not (hasattr(value, "__len__") and hasattr(value, "__iter__")):
        raise InvalidInputError("polygons must be a sequence of (n, 2) vertices")
    _want_few(value, 1, "polygons")
    made = [finite_rows(one, 2, f"polygons[{i}]") for i, one in enumerate(value)]
    for i, vertices in enumerate(made):
        if len(vertices) < 3:
            raise InvalidInputError(
                f"polygons[{i}] has {len(vertices)} vertices; a polygon has at least 3"
            )
    return made


def check_finite(array: Array, name: str) -> None:
    """Raise InvalidInputError for the first row of (n, k) that is not finite."""
    finite = np.abs(array).sum(axis=1) < FARTHEST
    if not finite.all():
        row = int(np.argmin(finite))
        hint = "; leave out readings without an echo" if name == "points" else ""
        wrong = f"{name}[{row}] = {array[row].tolist()} is not finite, or above "
        raise InvalidInputError(f"{wrong}{FARTHEST:g}{hint}")


def check_not_negative(values: Array, name: str) -> None:
    """Raise InvalidInputError for the first of (n,) that is negative."""
    if (values < 0.0).any():
        row = int(np.argmax(values < 0.0))
        raise InvalidInputError(f"{name}[{row}] is negative: {values[row]:g}")
