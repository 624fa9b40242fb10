"""Velocities of obstacles from their successive positions: one Kalman filter per id.

The model is constant velocity, disturbed in every interval T by white acceleration that
changes the velocity by a T (standard deviation, per axis); positions carry noise of
standard deviation σ. The covariance P is the same for x and y and depends on the times
alone. With F = [[1, T], [0, 1]] and

    P⁻ = F P Fᵀ + a² T² [[T²/3, T/2], [T/2, 1]],   S = P⁻_pp + σ²

the prediction is corrected by α = P⁻_pp / S times the innovation in position and by
β/T = P⁻_pv / S times it in velocity. At a constant T this becomes the α-β filter of the
tracking index Λ = a T²/σ [Kalata1984]: with ρ = √(1 − α),

    β = Λ ρ,   α = √(2β + β²/12) − β/2.

Behind an obstacle of constant acceleration a it then lags by σ ρ in position and by
a T (α/β − 1/2) in velocity: less than √(2 a σ) up to T = √(σ/a), and near it at high
rates, since the bandwidth √(a/σ) does not depend on T. Acceleration that is constant
within an interval, as in [Kalata1984], is a worse model: for T > √(σ/a) velocities ring
if an obstacle changes its acceleration in between.
"""

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.model.validation import FARTHEST, as_number, as_rows
from qpavoid.settings import Range, check, want
from qpavoid.types import Array

SOUND = Range(ge=1e-6, le=1e6, allow_inf_nan=False)
"""Range of the settings, in their units: fourth powers stay finite."""


@dataclass(frozen=True)
class EstimatorSettings:
    """Prior knowledge of obstacles and sensor.

    Attributes:
        acceleration: a, m/s²: greatest acceleration of obstacles. A larger value
            follows a turn faster and smooths less.
        noise: σ, m: standard deviation of a measured position, per axis. A larger value
            smooths more and follows later.
        speed: m/s: greatest speed of an obstacle that has been seen once.
        forget: s; an id not seen for longer is a new obstacle when it comes back.
    """

    acceleration: Annotated[float, "mps2", SOUND] = 1.0
    noise: Annotated[float, "m", SOUND] = 0.02
    speed: Annotated[float, "mps", SOUND] = 1.5
    forget: Annotated[float, "s", SOUND] = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            as_number(value, name)
        check(self, "estimation needs")


class Motion(NamedTuple):
    """Positions and velocities of obstacles in the frame of the measurements.

    Attributes:
        positions: (n, 2) filtered, m; never less certain than the measured ones.
        velocities: (n, 2) over ground, m/s.
        uncertainty: (n,) m/s, bound of the velocity's error in any direction:
            2 √P_vv + √(2 a σ ρ), two standard deviations and the lag. At a constant T
            and without noise, it holds for all accelerations up to a.
    """

    positions: Array
    velocities: Array
    uncertainty: Array


class VelocityEstimator:
    """Estimator of velocities from positions with ids, at any times.

    An obstacle seen for the first time has velocity 0 with uncertainty ``speed``. It
    need not be at rest: to be safe until the second measurement, use velocity plus
    uncertainty from the first call on.

    An id names the same obstacle from call to call; a tracker that exchanges two ids
    makes wrong velocities. Positions are in a frame fixed to the ground: in the robot
    frame, the robot's own motion would be estimated with them.

    Args:
        settings: Noise, acceleration, first speed and memory.

    Raises:
        InvalidInputError: The settings are of another type.
    """

    def __init__(self, settings: EstimatorSettings | None = None) -> None:
        known = settings is None or isinstance(settings, EstimatorSettings)
        want(known, f"settings must be EstimatorSettings, not {settings!r:.40}")
        self.settings = settings if settings is not None else EstimatorSettings()
        self._time = -math.inf
        self._tracks: dict[Hashable, Array] = {}

    def update(
        self, time: float, ids: Iterable[Hashable], positions: npt.ArrayLike
    ) -> Motion:
        """Return the motion of the obstacles that were measured at ``time``.

        Missing ids are predicted until ``forget`` is over. An id that was already
        measured at this time keeps its estimate: a repeated message changes nothing.

        Args:
            time: When the positions were measured, s, on any clock; not when they
                arrived.
            ids: n different ids: numbers, strings, anything hashable.
            positions: (n, 2) x, y in m, fixed frame.

        Raises:
            InvalidInputError: Shapes or numbers do not fit, an id is repeated, or time
                runs backwards. The estimator is then as it was before the call.
        """
        time = self._as_time(time)
        names, measured = as_sightings(ids, positions)
        a, noise = self.settings.acceleration, self.settings.noise
        tracks = {
            name: track
            for name, track in self._tracks.items()
            if time - track[0] <= self.settings.forget
        }
        first = first_sight(time, measured, noise, self.settings.speed)
        known = [tracks.get(name, row) for name, row in zip(names, first, strict=True)]
        before = np.array(known).reshape(-1, 8)
        after = kalman_step(before, time, measured, self.settings)
        tracks.update(zip(names, after, strict=True))
        self._time, self._tracks = time, tracks
        return as_motion(after, a, noise)

    def _as_time(self, time: float) -> float:
        time = as_number(time, "time")
        if not abs(time) < FARTHEST:
            raise InvalidInputError(f"time must be finite, not {time}")
        # A negative interval would make the covariance indefinite.
        if time < self._time:
            raise InvalidInputError(
                f"time runs backwards, from {self._time:g} to {time:g} s; "
                "start a new estimator with a new clock"
            )
        return time


def as_sightings(
    ids: Iterable[Hashable], positions: npt.ArrayLike
) -> tuple[list[Hashable], Array]:
    """Return n different ids and their (n, 2) finite positions.

    Raises:
        InvalidInputError: They are not; the message names the id.
    """
    measured = as_rows(positions, 2, "positions")
    try:
        names = list(islice(ids, len(measured) + 1))
        different = len(set(names))
    except Exception as error:  # of an iterator, a hash or a comparison of the caller
        raise InvalidInputError(f"ids must be a list of hashables: {error}") from None
    if len(names) != len(measured):
        many = f"{len(names)}{' or more' if len(names) > len(measured) else ''}"
        raise InvalidInputError(f"{many} ids for {len(measured)} positions")
    if different < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidInputError(f"the id {twice!r} is repeated")
    finite = (np.abs(measured) < FARTHEST).all(axis=1)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InvalidInputError(
            f"positions[{row}] = {measured[row].tolist()} of id {names[row]!r} is not "
            "finite; leave out what was not measured"
        )
    return names, measured


def first_sight(time: float, measured: Array, noise: float, speed: float) -> Array:
    """Return tracks (n, 8): time last seen, x, y, v_x, v_y, P_pp, P_pv, P_vv."""
    tracks = np.zeros((len(measured), 8))
    tracks[:, 0] = time
    tracks[:, 1:3] = measured
    tracks[:, 5] = noise**2
    tracks[:, 7] = (speed / 2) ** 2
    return tracks


def kalman_step(
    tracks: Array, time: float, measured: Array, settings: EstimatorSettings
) -> Array:
    """Return (n, 8) tracks predicted to ``time`` and corrected by (n, 2) positions."""
    a, noise = settings.acceleration, settings.noise
    p_pp, p_pv, p_vv = tracks.T[5:]
    dt = time - tracks[:, 0]
    pushed = (a * dt) ** 2
    p_pp = p_pp + dt * (2 * p_pv + dt * (p_vv + pushed / 3))
    p_pv = p_pv + dt * (p_vv + pushed / 2)
    p_vv = p_vv + pushed
    alpha, gain = p_pp / (p_pp + noise**2), p_pv / (p_pp + noise**2)

    predicted = tracks[:, 1:3] + dt[:, None] * tracks[:, 3:5]
    innovation = measured - predicted
    after = np.empty_like(tracks)
    after[:, 0] = time
    after[:, 1:3] = predicted + alpha[:, None] * innovation
    after[:, 3:5] = tracks[:, 3:5] + gain[:, None] * innovation
    after[:, 5] = alpha * noise**2
    after[:, 6] = gain * noise**2
    # Rounding may make it negative; its root is the uncertainty.
    after[:, 7] = np.maximum(p_vv - gain * p_pv, 0.0)
    return np.where(dt[:, None] > 0.0, after, tracks)


def as_motion(tracks: Array, a: float, noise: float) -> Motion:
    """Return positions, velocities and uncertainty of tracks (n, 8), as copies."""
    rho = np.sqrt(1.0 - tracks[:, 5] / noise**2)
    uncertainty = 2 * np.sqrt(tracks[:, 7]) + np.sqrt(2 * a * noise * rho)
    return Motion(tracks[:, 1:3].copy(), tracks[:, 3:5].copy(), uncertainty)
