"""Validation of the filter's arguments: floats and obstacles."""

import math
from typing import Any

from qpavoid.errors import InvalidInputError
from qpavoid.model.given import given_obstacles, obstacle_arrays
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import driven_twist
from qpavoid.model.validation import check_finite
from qpavoid.types import Array, Arrays

TEXT_TYPES = (str, bytes)
"""Types that Python would parse as numbers or iterate."""

OLDEST = 1e6
"""s; greatest age of obstacles."""


def as_twist(v: float, omega: float) -> tuple[float, float]:
    """Return both as Python floats, from any type of number."""
    try:
        if not (isinstance(v, TEXT_TYPES) or isinstance(omega, TEXT_TYPES)):
            return float(v), float(omega)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidInputError("the twist (v, omega) must be two numbers")


def as_age(age: float) -> float:
    """Return the age as a Python float, at least 0 and finite."""
    try:
        number = float(age)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0.0 <= number <= OLDEST:
        raise InvalidInputError(
            f"the age of the obstacles must be 0 to {OLDEST:g} s, not {age}"
        )
    return number


def as_driven(driven: tuple[float, float], robot: Array) -> tuple[float, float]:
    """Return the driven twist, cut to the limits along its arc or the axes.

    ``robot``: see :attr:`qpavoid.model.robot.Robot.limit_vector`.
    """
    try:
        v, omega = () if isinstance(driven, TEXT_TYPES) else driven
    except (TypeError, ValueError):
        raise InvalidInputError("the twist driven must be (v, omega)") from None
    v, omega = as_twist(v, omega)
    if not (math.isfinite(v) and math.isfinite(omega)):
        raise InvalidInputError("the twist driven must be finite")
    v, omega = driven_twist(robot, v, omega)
    return v, omega


def as_table(points: Any, *others: Any) -> Arrays:
    """Return a caller's obstacles as points and capsules."""
    if type(points) is Obstacles:
        return points.arrays
    return obstacle_arrays(points, others)


def why_invalid(points: Any, *others: Any) -> InvalidInputError:
    """Return the error for invalid arguments: of an obstacle, else of the twist."""
    try:
        if isinstance(points, Obstacles):
            check_finite(points.points, "points")
            check_finite(points.capsules, "capsules")
        else:
            given_obstacles(points, *others).check()
    except InvalidInputError as error:
        return error
    return InvalidInputError("the desired twist (v, omega) must be finite")
