"""Planned motions: the cubic of Eq. 2 and 3, a spline through way-points, a station.

Each is sampled into a reference, (n, 5): x_r, y_r (m), γ_r (rad, not wrapped), v_r
(m/s), ω_r (rad/s), the last two analytic derivatives, never differences.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import TINY
from qpavoid.model.validation import finite_rows
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, check
from qpavoid.types import Array, Pose

SPACING = 0.1
"""m; spacing at which a polyline is sampled before smoothing."""

LONGEST = 2e3
"""m; greatest length of a path: 200,000 rows of its table."""

MANY_POINTS, KNOT = 2_000, 3
"""Points of a polyline above which its spline has a fixed knot at every third of them:
the search for the fewest knots takes seconds for a rough polyline."""

DISTINCT = 1e-6
"""m, or of k; least length of a polyline or slope that has a direction."""


@runtime_checkable
class Path(Protocol):
    """A motion over time that ends at rest."""

    def sample(self, times: Array) -> Array:
        """Return the reference (n, 5) at the times (n,) in s."""
        ...


@dataclass(frozen=True)
class Station:
    """Rest at a pose (x, y, γ)."""

    pose: Pose

    def sample(self, times: Array) -> Array:
        """Return the pose, at rest, for all times."""
        return np.tile([*self.pose, 0.0, 0.0], (len(times), 1))


@dataclass(frozen=True)
class CubicPath:
    """The paper's point-to-point path with its fifth-order time law.

    Eq. 2: x(s) = −(s − 1)³ x_i + s³ x_f + α s²(s − 1) + β s (s − 1)², with Eq. 3:
    α = k (cos γ_f, sin γ_f) − 3 x_f and β = k (cos γ_i, sin γ_i) + 3 x_i. Its end
    tangents have length k. s = 10τ³ − 15τ⁴ + 6τ⁵ with τ = t/T starts and ends with
    zero speed and acceleration.

    Attributes:
        start: (x_i, y_i, γ_i).
        goal: (x_f, y_f, γ_f).
        k: Length of the end tangents, m.
        duration: T, s; afterwards the reference rests at the goal.

    Raises:
        InvalidInputError: k or T is not positive, or the path has a cusp, where its
            direction is not defined.
    """

    start: Pose
    goal: Pose
    k: Annotated[float, "m", POSITIVE]
    duration: Annotated[float, "s", POSITIVE]

    def __post_init__(self) -> None:
        check(self, "a cubic path needs")
        if not np.isfinite([*self.start, *self.goal]).all():
            raise InvalidInputError("a cubic path needs finite poses")
        _, slope, _ = self._curve(np.linspace(0.0, 1.0, 1001))
        # A cusp turns the slope by more than 90° between two samples.
        before, after = slope[:, :-1], slope[:, 1:]
        reverses = (before * after).sum(axis=0) <= 0.0
        if reverses.any() or np.hypot(*slope).min() < DISTINCT * self.k:
            raise InvalidInputError("the cubic path has a cusp; choose another k")

    def _curve(self, s: Array) -> tuple[Array, Array, Array]:
        """Return x(s), x′(s) and x″(s), each (2, n)."""
        initial, final = np.array([self.start[:2], self.goal[:2]])[:, :, None]
        directions = [[math.cos(p[2]), math.sin(p[2])] for p in (self.goal, self.start)]
        alpha, beta = self.k * np.array(directions)[:, :, None]
        alpha, beta = alpha - 3 * final, beta + 3 * initial
        r = s - 1
        return (
            -(r**3) * initial + s**3 * final + alpha * s**2 * r + beta * s * r**2,
            -3 * r**2 * initial
            + 3 * s**2 * final
            + alpha * (3 * s**2 - 2 * s)
            + beta * r * (3 * s - 1),
            -6 * r * initial + 6 * s * final + alpha * (6 * s - 2) + beta * (6 * s - 4),
        )

    def sample(self, times: Array) -> Array:
        """Return the reference; γ_r is the direction of x′(s), so it never vanishes."""
        tau = np.clip(np.asarray(times) / self.duration, 0.0, 1.0)
        # Quintic in time: at rest, and without acceleration, at both ends.
        s = tau**3 * (10 - 15 * tau + 6 * tau**2)
        rate = 30 * tau**2 * (1 - tau) ** 2 / self.duration
        position, slope, bend = self._curve(s)
        square = (slope**2).sum(axis=0)
        curl = slope[0] * bend[1] - slope[1] * bend[0]
        heading = np.unwrap(np.arctan2(slope[1], slope[0]))
        return np.column_stack(
            [*position, heading, np.sqrt(square) * rate, curl / square * rate]
        )


@dataclass(frozen=True, eq=False)
class SplinePath:
    """A smooth path near a polyline, within limits of speed, yaw rate and acceleration.

    A cubic smoothing spline [Dierckx1975] through the polyline, sampled evenly; along
    it the speed is the greatest that keeps ``speed``, ``turn_rate`` and
    ``acceleration``, ending at rest.

    Attributes:
        points: (n, 2) corners of the polyline, m; at least two distinct ones.
        speed: Greatest v_r, m/s.
        turn_rate: Greatest |ω_r|, rad/s.
        acceleration: Greatest |dv_r/dt|, m/s².
        smoothing: Allowed standard distance of the spline from the polyline, m.
        begin: Speed at its start, m/s, as far as the limits allow.

    Raises:
        InvalidInputError: Fewer than two distinct points, more than :data:`LONGEST`,
            limits not positive, or smoothing or begin negative.
    """

    points: Array
    speed: Annotated[float, "mps", POSITIVE]
    turn_rate: Annotated[float, "radps", POSITIVE] = 1.0
    acceleration: Annotated[float, "mps2", POSITIVE] = 0.5
    smoothing: Annotated[float, "m", NOT_NEGATIVE] = 0.02
    begin: Annotated[float, "mps", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "a path needs")
        position, slope, bend = self._curve(_evenly(self.points, SPACING))
        tangent = np.hypot(*slope)
        curvature = (slope[0] * bend[1] - slope[1] * bend[0]) / tangent**3
        # The curvature's speed limit, cut forwards and backwards by v² = v_0² + 2 a s.
        step = np.hypot(*np.diff(position, axis=1))
        v = np.minimum(self.speed, self.turn_rate / np.maximum(abs(curvature), TINY))
        v = self._within_acceleration(v, step)
        times = np.concatenate([[0.0], np.cumsum(step / (0.5 * (v[1:] + v[:-1])))])
        heading = np.unwrap(np.arctan2(slope[1], slope[0]))
        table = np.column_stack([*position, heading, v, v * curvature])
        object.__setattr__(self, "_times", times)
        object.__setattr__(self, "_table", table)

    def _curve(self, points: Array) -> tuple[Array, Array, Array]:
        """Return x(s), x′(s) and x″(s) on a fine grid, each (2, n)."""
        from scipy.interpolate import splev, splprep

        fixed, fine = {}, 50
        if len(points) > MANY_POINTS:
            inner = np.linspace(0.0, 1.0, len(points) // KNOT)[1:-1]
            knots = np.concatenate([[0.0] * 4, inner, [1.0] * 4])
            fixed, fine = {"task": -1, "t": knots}, 10
        try:
            spline, _ = splprep(points.T, s=len(points) * self.smoothing**2, **fixed)
        except (ValueError, ArithmeticError) as error:  # too large, or too alike
            raise InvalidInputError(f"a path has no spline: {error}") from None
        s = np.linspace(0.0, 1.0, fine * len(points))
        position, slope, bend = (np.array(splev(s, spline, der=d)) for d in range(3))
        return position, slope, bend

    def _within_acceleration(self, speeds: Array, steps: Array) -> Array:
        """Return the speeds (m/s) cut to the acceleration limit and rest at the end."""
        v, gain = speeds.tolist(), (2.0 * self.acceleration * steps).tolist()
        v[0], v[-1] = min(v[0], self.begin), 0.0
        for i in range(1, len(v)):
            v[i] = min(v[i], math.sqrt(v[i - 1] ** 2 + gain[i - 1]))
        for i in range(len(v) - 2, -1, -1):
            v[i] = min(v[i], math.sqrt(v[i + 1] ** 2 + gain[i]))
        return np.array(v)

    @property
    def duration(self) -> float:
        """Time to the end of the path, s."""
        return float(self._times[-1])  # type: ignore[attr-defined]

    def sample(self, times: Array) -> Array:
        """Return the reference, interpolated linearly in a fine table."""
        known, table = self._times, self._table  # type: ignore[attr-defined]
        reference = np.column_stack(
            [np.interp(times, known, column) for column in table.T]
        )
        reference[np.asarray(times) > known[-1], 3:] = 0.0
        return reference


def _evenly(points: Array, spacing: float) -> Array:
    """Return points (n, 2) on a polyline about every ``spacing`` m, ends included."""
    corners = finite_rows(points, 2, "way-points")
    with np.errstate(over="ignore"):
        steps = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if len(corners) < 2 or along[-1] < DISTINCT:
        raise InvalidInputError("a path needs two distinct way-points")
    if along[-1] > LONGEST:
        raise InvalidInputError(f"a path is at most {1e-3 * LONGEST:g} km long")
    places = np.linspace(0.0, along[-1], max(8, round(along[-1] / spacing)) + 1)
    return np.column_stack([np.interp(places, along, axis) for axis in corners.T])
