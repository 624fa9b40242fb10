"""What a base makes of its commands, fitted to a recorded drive.

The model, for v and ω alike: a command is heard after a delay, and the velocity goes to
it at no more than an acceleration; of v a share is lost to slip, and ω is divided by a
factor of the wheel separation, by which a driver's multiplier is to be multiplied:

    v = (1 − slip) · ramp(v_c(t − delay)),    ω = ramp(ω_c(t − delay)) / factor.

Fitted by least squares to the mean velocities between samples. What is not in the model
(a motor's lag, grip that ends) goes into delay and accelerations. Intervals allow for
errors that last up to :data:`BLOCK`: the covariance is that of sums over blocks
[Liang1986].
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.errors import DataError, InvalidInputError
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.bags import odometry_and_commands
from qpavoid.model.kinematics import STRAIGHT, wrap_angle
from qpavoid.ros.messages import read_twist, seconds
from qpavoid.types import Array

BLOCK = 1.0
"""s"""

MOST_DELAY, MOST_RAMP = 1.0, 5.0
"""s, and s to gain 1 m/s or 1 rad/s: greater ones are not looked for."""

NAMES = "delay_s", "ramp_s2pm", "ramp_s2prad", "slip", "factor"
"""Of what is fitted; a ramp is 1 over its acceleration."""

LEAST = 20
"""Samples."""

LEAST_RAMP, INSTANT = 1e-9, 1e-6
"""A ramp of 0 jumps: in steps to gain 1, what is divided by instead; in s to gain 1,
up to where its acceleration is called infinite."""

LEAST_SPREAD, LEAST_ERROR, LEAST_LEFT = 1e-6, 1e-9, 1e-12
"""m/s and rad/s, far below what wheels tell: least scales of what was driven, of what
is left between two fits and after the last, where a drive stands or fits exactly."""

DELAY_STEP, RAMP_STEP, SHARE_STEP = 0.02, 1e-3, 1e-4
"""Of finite differences: of the delay in control steps, of a ramp in s to gain 1, of
slip and factor. Large beside rounding, small beside what is told apart."""

TOLD = 1e-6
"""Scaled change of all that is driven, up to which a parameter changes nothing."""


class Response(NamedTuple):
    """A recorded drive, at equal steps.

    Attributes:
        dt: s of a step.
        asked: (n, 2) v (m/s) and ω (rad/s) commanded at its beginning, and held.
        driven: (n, 2) The mean of what was driven within it.
    """

    dt: float
    asked: Array
    driven: Array


class Estimate(NamedTuple):
    """A number with its interval of 95 %; infinite where the drive does not tell it."""

    value: float
    low: float
    high: float


class Base(NamedTuple):
    """What a base makes of its commands.

    Attributes:
        delay: s
        acceleration: Of v, m/s².
        angular_acceleration: rad/s²
        slip: Share of v that is lost.
        factor: By which the wheel separation is to be multiplied.
        error: (2,) Root mean square of what is left of v and ω.
    """

    delay: Estimate
    acceleration: Estimate
    angular_acceleration: Estimate
    slip: Estimate
    factor: Estimate
    error: Array


def drive_of(log: Log) -> Response:
    """Return the drive of a run: its commands, and the arcs between its poses."""
    dt, keys = float(log.meta["dt_s"]), ("x_m", "y_m", "heading_rad")
    x, y, heading = (np.append(log[key], log.final[i]) for i, key in enumerate(keys))
    turned = np.array([wrap_angle(angle) for angle in np.diff(heading)])
    half = 0.5 * turned
    middle = heading[:-1] + half
    ahead = np.cos(middle) * np.diff(x) + np.sin(middle) * np.diff(y)
    curved = np.abs(half) > STRAIGHT
    ahead[curved] *= half[curved] / np.sin(half[curved])
    asked = np.column_stack([log["v_mps"], log["omega_radps"]])
    return Response(dt, asked, np.column_stack([ahead, turned]) / dt)


def bagged(path: Path, command: str = "") -> Response:
    """Return the drive of a bag: the twists of its odometry, and the last commands.

    Odometry that counts turns of wheels knows nothing of their slip.

    Args:
        path: As :func:`qpavoid.lab.study.bags.bag_drive` takes it.
        command: Topic of the commands.

    Raises:
        DataError: It cannot be read, or has no odometry or commands.
    """
    told: list[tuple[float, float, float]] = []
    seen: list[tuple[float, float, float]] = []
    for time, topic, message in odometry_and_commands(path, command):
        if topic == "command":
            told.append((time, *read_twist(message)))
        else:
            seen.append((seconds(message.header.stamp), *read_twist(message.twist)))
    if min(len(told), len(seen)) < LEAST:
        raise DataError(f"{path}: {LEAST} commands and odometry messages are wanted")
    return resampled(np.array(told), np.array(seen))


def resampled(told: Array, seen: Array) -> Response:
    """Return commands (n, 3) and odometry (m, 3) at equal steps: of time, v, ω each.

    A command counts from the nearest step on; odometry is the mean since the last one.
    """
    dt = float(np.median(np.diff(seen[:, 0])))
    if not dt > 0.0:
        raise DataError("the stamps of the odometry do not go on")
    first = min(np.searchsorted(told[:, 0], seen[0, 0]), len(told) - 1)
    times = np.arange(told[first, 0], seen[-1, 0] - dt, dt)
    last = np.searchsorted(told[:, 0], times + 0.5 * dt, side="right") - 1
    ends = times + dt
    driven = [np.interp(ends, seen[:, 0], seen[:, i]) for i in (1, 2)]
    return Response(dt, told[last, 1:], np.column_stack(driven))


@compiled
def ramped(asked: Array, delay: float, ramp: float, means: Array) -> None:
    """Write the mean within every step of what goes to the commands on a ramp.

    Args:
        asked: (n,) Commanded at the beginning of a step, and held.
        delay: Steps until it is heard.
        ramp: Steps to gain 1; 0: it jumps.
        means: (n,) What is written.
    """
    whole = math.floor(delay)
    late, now, most = delay - whole, asked[0], 1.0 / max(ramp, LEAST_RAMP)
    for k in range(len(asked)):
        means[k] = 0.0
        for part, heard in ((late, k - whole - 1), (1.0 - late, k - whole)):
            wanted, reach = asked[max(heard, 0)], part * most
            change = min(max(wanted - now, -reach), reach)
            ramping = abs(change) / most
            now += change
            means[k] += now * part - 0.5 * change * ramping


def predicted(drive: Response, parameters: Array) -> Array:
    """Return the means (n, 2) of v, ω that the model drives."""
    delay, ramp_v, ramp_omega, slip, factor = parameters.tolist()
    means, late = np.empty(drive.asked.shape), delay / drive.dt
    for i, ramp in enumerate((ramp_v, ramp_omega)):
        ramped(drive.asked[:, i], late, ramp / drive.dt, means[:, i])
    found: Array = means * np.array([1.0 - slip, 1.0 / factor])
    return found


def identify(drive: Response) -> Base:
    """Fit the model to a drive.

    Raises:
        InvalidInputError: It is too short, not finite, or nothing was commanded.
    """
    if len(drive.asked) < LEAST or not np.isfinite(drive.driven).all():
        raise InvalidInputError(f"identify wants {LEAST} finite samples or more")
    if not np.ptp(drive.asked, axis=0).any():
        raise InvalidInputError("identify wants commands that change")
    scales = np.maximum(drive.driven.std(axis=0), LEAST_SPREAD)
    found = _coarse(drive, scales)
    for _ in range(2):
        found = _fine(drive, scales, found)
        left = predicted(drive, found) - drive.driven
        scales = np.maximum(np.sqrt((left**2).mean(axis=0)), LEAST_ERROR)
    return _base(drive, found, left)


LOW = np.array([0.0, 0.0, 0.0, -0.5, 0.2])
HIGH = np.array([MOST_DELAY, MOST_RAMP, MOST_RAMP, 0.9, 5.0])


def _coarse(drive: Response, scales: Array) -> Array:
    """Return the best of a grid of delays and ramps."""
    delays = drive.dt * np.arange(0.0, min(MOST_DELAY / drive.dt, 60.0), 0.5)
    tried = [
        np.array([delay, ramp, ramp, 0.0, 1.0])
        for delay in delays
        for ramp in (0.01, 0.1, 0.3, 1.0)
    ]
    costs = [
        (((predicted(drive, one) - drive.driven) / scales) ** 2).sum() for one in tried
    ]
    return tried[int(np.argmin(costs))]


def _fine(drive: Response, scales: Array, start: Array) -> Array:
    """Return the least squares next to a start."""
    from scipy.optimize import least_squares

    def left(parameters: Array) -> Array:
        return ((predicted(drive, parameters) - drive.driven) / scales).ravel()

    steps = _steps(drive)
    inside = np.clip(start, LOW + steps, HIGH - steps)
    found = least_squares(
        left,
        inside,
        jac=lambda p: _jacobian(drive, p) / np.tile(scales, len(drive.asked))[:, None],
        bounds=(LOW, HIGH),
        x_scale=np.array([drive.dt, 0.1, 0.1, 0.1, 0.1]),
    )
    return np.asarray(found.x)


def _steps(drive: Response) -> Array:
    """Return the steps of finite differences."""
    delay = DELAY_STEP * drive.dt
    return np.array([delay, RAMP_STEP, RAMP_STEP, SHARE_STEP, SHARE_STEP])


def _jacobian(drive: Response, parameters: Array) -> Array:
    """Return the derivatives (2n, 5) of what the model drives, by differences."""
    columns = []
    for i, step in enumerate(_steps(drive)):
        high, low = parameters.copy(), parameters.copy()
        high[i], low[i] = parameters[i] + step, max(parameters[i] - step, LOW[i])
        change = predicted(drive, high) - predicted(drive, low)
        columns.append(change.ravel() / (high[i] - low[i]))
    return np.column_stack(columns)


def _base(drive: Response, found: Array, left: Array) -> Base:
    """Return the estimates with their intervals."""
    sigma = _sigmas(drive, found, left)
    low, high = found - sigma, found + sigma
    delay, ramp_v, ramp_omega, slip, factor = (
        Estimate(*map(float, one)) for one in zip(found, low, high, strict=True)
    )
    delay = delay._replace(low=max(delay.low, 0.0))
    ramps = _inverse(ramp_v), _inverse(ramp_omega)
    error = np.sqrt((left**2).mean(axis=0))
    return Base(delay, *ramps, slip, factor, error)


def _sigmas(drive: Response, found: Array, left: Array) -> Array:
    """Return half the widths (5,) of the intervals; ∞ of what changes nothing."""
    from scipy.stats import t as student

    scales = np.maximum(np.sqrt((left**2).mean(axis=0)), LEAST_LEFT)
    slopes = _jacobian(drive, found).reshape(len(left), 2, -1) / scales[:, None]
    told = np.abs(slopes).sum(axis=(0, 1)) > TOLD
    slopes = slopes[:, :, told]
    length = max(1, round(BLOCK / drive.dt))
    length = min(length, len(left) // (3 * told.sum()))
    scores = np.einsum("nij,ni->nj", slopes, left / scales)
    blocks = np.add.reduceat(scores, np.arange(0, len(left), max(length, 1)))
    inverse = np.linalg.pinv(np.einsum("nij,nik->jk", slopes, slopes))
    free = len(blocks) - slopes.shape[2]
    spread = inverse @ (blocks.T @ blocks) @ inverse * len(blocks) / free
    sigma = np.full(len(found), np.inf)
    sigma[told] = student.ppf(0.975, free) * np.sqrt(np.diag(spread))
    return sigma


def _inverse(ramp: Estimate) -> Estimate:
    """Return the acceleration of a ramp; one that cannot be told is infinite."""
    value, low, high = (1.0 / x if x > INSTANT else math.inf for x in ramp)
    return Estimate(value, high if math.isfinite(ramp.high) else 0.0, low)


def rows_of(base: Base) -> list[list[Any]]:
    """Return the table of a base: what, value, interval, unit."""
    units = ("s", "m/s²", "rad/s²", "", "")
    names = ("delay", "acceleration", "angular acceleration", "slip", "factor")
    return [
        [name, f"{one.value:.3g}", f"{one.low:.3g} … {one.high:.3g}", unit]
        for name, one, unit in zip(names, base[:5], units, strict=True)
    ]


def settings_of(base: Base) -> str:
    """Return the TOML that tells a filter of a base, on the safe side of intervals.

    With ``ramps`` only braking along the arc is trusted, which takes more room than
    there is in narrow places.
    """
    lines = ["[robot]"]
    for key, one in (
        ("acceleration_mps2", base.acceleration),
        ("angular_acceleration_radps2", base.angular_acceleration),
    ):
        if math.isfinite(one.value):
            lines.append(f"{key} = {one.low:.3g}")
    delay = math.ceil(1e3 * base.delay.high) / 1e3
    lines += ["", "[actuation]", f"delay_s = {delay:g}"]
    lines += ["ramps = true  # off: less room, plans are trusted", ""]
    lines += [f"# multiply the wheel separation by {base.factor.value:.3g}"]
    return "\n".join(lines)
