"""Response of a base to its commands, fitted to a recorded drive.

The model, for v and ω alike: a command is heard after a delay, and the velocity goes to
it at no more than an acceleration; of v a share is lost to slip, and ω is divided by a
factor of the wheel separation, by which a driver's multiplier is to be multiplied:

    v = (1 − slip) · ramp(v_c(t − delay)),    ω = ramp(ω_c(t − delay)) / factor.

Fitted by least squares to the velocities at samples, or their means in between. What is
not in the model (a motor's lag, grip that ends) goes into delay and accelerations.
Intervals allow for errors that last
up to :data:`BLOCK_TIME`: the covariance is that of sums over blocks [Liang1986].
"""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.errors import DataError, InvalidInputError
from qpavoid.lab.sensing.plant import twist_between
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.bags import found_commands, found_topics, read_bag, topic_of
from qpavoid.ros.messages import read_twist, seconds
from qpavoid.types import Array

BLOCK_TIME = 1.0
"""s"""

MOST_DELAY, MOST_RAMP = 1.0, 5.0
"""s, and s to gain 1 m/s or 1 rad/s: greater ones are not looked for."""

MOST_EARLY, EARLY = 0.5, 0.03
"""s; a response that is so much earlier than its command is looked for, and refused."""

FOLLOWED, COMMANDED = 0.1, 0.05
"""Least standard deviation of what is driven, of that of the commands, and of these in
m/s and rad/s, from where on the drive has to follow."""

UNEXPLAINED = 0.8
"""Standard deviation that a fit leaves, of that of what is driven: then it is none."""

STAMPED, COARSE = 1e-3, 0.01
"""s; stamps are no more exact, and the search begins with delays no nearer."""

SAMPLES = 20
"""Samples."""

LEAST_RAMP, INSTANT = 1e-9, 1e-6
"""s to gain 1. A ramp of 0 jumps: what is divided by instead, and up to where its
acceleration is called infinite."""

LEAST_SPREAD, LEAST_ERROR, LEAST_LEFT = 1e-6, 1e-9, 1e-12
"""m/s and rad/s, far below what wheels tell: least scales of what was driven, of what
is left between two fits and after the last, where a drive stands or fits exactly."""

DELAY_STEP, MOMENT_STEP, RAMP_STEP, SHARE_STEP = 0.02, 0.2, 1e-3, 1e-4
"""Of finite differences: of the delay in control steps, of a ramp in s to gain 1, of
slip and factor. Large beside rounding, small beside what is told apart."""

TOLD = 1e-6
"""Scaled change of all that is driven, up to which a parameter changes nothing."""


class Response(NamedTuple):
    """A recorded drive: commands and samples, at equal steps where no times are given.

    Attributes:
        dt: s of a step; of samples the median.
        asked: (n, 2) v (m/s) and ω (rad/s) commanded, and held until the next.
        driven: (m, 2) v and ω of samples.
        since: (n,) s, of the commands, in order; None: the beginnings of steps.
        knots: (m + 1,) s, increasing: sample k is of what was driven from knot k to
            k + 1; None: those of steps.
        moment: Whether a sample is the value at its last knot; else it is the mean.
    """

    dt: float
    asked: Array
    driven: Array
    since: Array | None = None
    knots: Array | None = None
    moment: bool = False


class Estimate(NamedTuple):
    """A number with its interval of 95 %; infinite where the drive does not tell it."""

    value: float
    low: float
    high: float


class Base(NamedTuple):
    """Parameters of a base's response to commands.

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
    columns = [np.append(log[key], log.final[i]) for i, key in enumerate(keys)]
    ends = pairwise(np.column_stack(columns).tolist())
    driven = np.array([twist_between(a, b, dt)[:2] for a, b in ends])
    return Response(dt, np.column_stack([log["v_mps"], log["omega_radps"]]), driven)


def bagged(path: Path, command: str = "") -> Response:
    """Return the drive of a bag: the twists of its odometry, and its commands.

    Odometry that counts turns of wheels does not contain their slip.

    Args:
        path: As :func:`qpavoid.lab.study.bags.bag_drive` takes it.
        command: Topic of the commands.

    Raises:
        DataError: It cannot be read, or has no odometry or commands.
    """

    def choose(held: dict[str, str]) -> dict[str, str]:
        odometry, desired = found_topics(held).odometry, command or found_commands(held)
        if not (odometry and desired):
            what = "Twist or TwistStamped" if odometry else "nav_msgs/msg/Odometry"
            raise DataError(f"{path}: no {what}")
        return {odometry: "odometry", topic_of(desired, held): "command"}

    told: list[tuple[float, float, float]] = []
    seen: list[tuple[float, ...]] = []
    for time, topic, message in read_bag(path, choose)[1]:
        if topic == "command":
            told.append((time, *read_twist(message)))
        elif not seen or seconds(message.header.stamp) > seen[-1][0]:
            twist = message.twist.twist
            time, v, omega = message.header.stamp, twist.linear.x, twist.angular.z
            seen.append((seconds(time), float(v), float(omega)))
    if min(len(told), len(seen)) < SAMPLES:
        raise DataError(f"{path}: {SAMPLES} commands and odometry messages are wanted")
    return paired(np.array(told), np.array(seen), str(path))


def paired(told: Array, seen: Array, name: str = "odometry") -> Response:
    """Return commands (n, 3) and odometry (m, 3), as they were at their times.

    Args:
        told: Time (s), v, ω.
        seen: Time (s), v, ω at that time.
        name: Beginning of an error.

    Raises:
        DataError: Odometry is not finite.
    """
    knots, driven = seen[:, 0], seen[1:, 1:]
    if not np.isfinite(driven).all():
        raise DataError(f"{name}: its odometry has numbers that are not finite")
    dt = float(np.median(np.diff(knots)))
    return Response(dt, told[:, 1:], driven, told[:, 0], knots, moment=True)


@compiled
def ramped(
    since: Array,
    asked: Array,
    knots: Array,
    delay: float,
    ramp: float,
    moment: bool,
    found: Array,
) -> None:
    """Write what goes to the commands on a ramp, between knots.

    Args:
        since: (n,) s, of the commands.
        asked: (n,) Commanded from then on.
        knots: (m + 1,) s
        delay: s until a command is heard.
        ramp: s to gain 1; 0: it jumps.
        moment: Whether the value at the end is written, else the mean.
        found: (m,) What is written, but for the first, by which it begins.
    """
    i, clock, most = 0, knots[1], 1.0 / max(ramp, LEAST_RAMP)
    while i + 1 < len(since) and since[i + 1] + delay <= clock:
        i += 1
    now = found[0] if moment else 0.5 * (found[0] + found[1])
    for k in range(1, len(found)):
        area, end = 0.0, knots[k + 1]
        while clock < end:
            until = end
            if i + 1 < len(since):
                until = min(since[i + 1] + delay, end)
            part = until - clock
            change = min(max(asked[i] - now, -part * most), part * most)
            now += change
            area += now * part - 0.5 * change * abs(change) / most
            clock = until
            if until < end:
                i += 1
        found[k] = now if moment else area / (end - knots[k])


def predicted(drive: Response, parameters: Array) -> Array:
    """Return v, ω (m, 2) of samples that the model drives."""
    delay, ramp_v, ramp_omega, slip, factor = parameters.tolist()
    gains = np.array([1.0 - slip, 1.0 / factor])
    found = drive.driven / gains
    steps = drive.dt * np.arange(len(found) + 1.0)
    since = steps[: len(drive.asked)] if drive.since is None else drive.since
    knots = steps if drive.knots is None else drive.knots
    for i, ramp in enumerate((ramp_v, ramp_omega)):
        asked, column = drive.asked[:, i].copy(), found[:, i].copy()
        ramped(since, asked, knots, delay, ramp, drive.moment, column)
        found[:, i] = column
    scaled: Array = found * gains
    return scaled


def identify(drive: Response) -> Base:
    """Fit the model to a drive.

    Raises:
        InvalidInputError: It is too short, not finite, nothing was commanded, or what
            was driven does not follow the commands, or comes before them.
    """
    if len(drive.asked) < SAMPLES or not np.isfinite(drive.driven).all():
        raise InvalidInputError(f"identify needs {SAMPLES} finite samples or more")
    if not np.ptp(drive.asked, axis=0).any():
        raise InvalidInputError("identify needs commands that change")
    _want_followed(drive, drive.driven.std(axis=0) < FOLLOWED * drive.asked.std(axis=0))
    base = _fitted(drive)
    _want_followed(drive, base.error > UNEXPLAINED * drive.driven.std(axis=0))
    if base.delay.high < -EARLY - drive.dt:
        raise InvalidInputError(
            f"identify: the base answers {-base.delay.value:.3g} s before it is "
            "commanded: commands and odometry are of two clocks"
        )
    return base._replace(delay=Estimate(*(max(x, 0.0) for x in base.delay)))


def _want_followed(drive: Response, lost: Any) -> None:
    """Raise InvalidInputError for what was commanded, and is lost (2,) of v and ω."""
    asked = drive.asked.std(axis=0) > COMMANDED
    for name in np.array(["v", "ω"])[lost & asked]:
        raise InvalidInputError(
            f"identify: {name} that was driven does not follow {name} that was "
            "commanded: odometry does not fill it in, or other commands were driven"
        )


def _fitted(drive: Response) -> Base:
    """Return the fit of a drive whose kind of samples is known."""
    scales = np.maximum(drive.driven.std(axis=0), LEAST_SPREAD)
    found = _coarse(drive, scales)
    for _ in range(2):
        found = _fine(drive, scales, found)
        left = predicted(drive, found) - drive.driven
        scales = np.maximum(np.sqrt((left**2).mean(axis=0)), LEAST_ERROR)
    return _base(drive, found, left)


RAMPS = np.array([0.001, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.2, 2.5])
LOW = np.array([-MOST_EARLY, 0.0, 0.0, -0.5, 0.2])
HIGH = np.array([MOST_DELAY, MOST_RAMP, MOST_RAMP, 0.9, 5.0])


def _coarse(drive: Response, scales: Array) -> Array:
    """Return the best of a grid of delays and ramps, and of finer ones about it."""
    delays = np.arange(-MOST_EARLY, MOST_DELAY, max(0.5 * drive.dt, COARSE))
    found = _best(drive, scales, delays, RAMPS[:, None] * np.ones(2))
    for share, factor in ((1.0, 2.5), (0.1, 1.25)):
        delays = found[0] + share * drive.dt * np.linspace(-1.0, 1.0, 33)
        factors = np.geomspace(1.0 / factor, factor, 13)[:, None]
        found = _best(drive, scales, delays, factors * found[1:3])
    return found


def _best(drive: Response, scales: Array, delays: Array, ramps: Array) -> Array:
    """Return the best parameters of (d,) delays and (r, 2) ramps of v and ω."""
    costs = np.empty((len(delays), *ramps.shape))
    for i, delay in enumerate(delays):
        for k, pair in enumerate(ramps):
            left = predicted(drive, np.array([delay, *pair, 0.0, 1.0])) - drive.driven
            costs[i, k] = ((left / scales) ** 2).sum(axis=0)
    i = int(costs.min(axis=1).sum(axis=1).argmin())
    first, second = costs[i].argmin(axis=0)
    return np.array([delays[i], ramps[first, 0], ramps[second, 1], 0.0, 1.0])


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
        jac=lambda p: _jacobian(drive, p) / np.tile(scales, len(drive.driven))[:, None],
        bounds=(LOW, HIGH),
        x_scale=np.array([drive.dt, 0.1, 0.1, 0.1, 0.1]),
    )
    return np.asarray(found.x)


def _steps(drive: Response) -> Array:
    """Return the steps of finite differences."""
    delay = (MOMENT_STEP if drive.moment else DELAY_STEP) * drive.dt
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
    if drive.since is not None and drive.knots is not None:
        sigma[:3] = np.hypot(sigma[:3], STAMPED)
        sigma[0] = np.hypot(sigma[0], 0.5 * np.diff(drive.knots).std())
    steps = np.abs(np.diff(drive.asked, axis=0)).max(axis=0)
    lasts = (steps * found[1:3]).max() / drive.dt
    if drive.moment and lasts < 2.0:
        # Ramps with a sample at most: later and steeper ones may fit as well.
        sigma[0] = max(sigma[0], drive.dt if lasts < 1.0 else 0.5 * drive.dt)
    low, high = found - sigma, found + sigma
    delay, ramp_v, ramp_omega, slip, factor = (
        Estimate(*map(float, one)) for one in zip(found, low, high, strict=True)
    )
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
    length = max(1, round(BLOCK_TIME / drive.dt))
    length = min(length, len(left) // (3 * told.sum()))
    scores = np.einsum("nij,ni->nj", slopes, left / scales)
    blocks = np.add.reduceat(scores, np.arange(0, len(left), max(length, 1)))
    inverse = np.linalg.pinv(np.einsum("nij,nik->jk", slopes, slopes))
    free = len(blocks) - slopes.shape[2]
    spread = inverse @ (blocks.T @ blocks) @ inverse * len(blocks) / free
    sigma = np.full(len(found), np.inf)
    sigma[told] = student.ppf(0.975, free) * np.sqrt(np.maximum(np.diag(spread), 0.0))
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
