"""Settings: safety radius (section 2), repulsion (Eq. 5, 7), and QP filter."""

import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled, entry
from qpavoid.settings import NO_KEY, NOT_NEGATIVE, POSITIVE, Range, check
from qpavoid.types import Record, record_type

Activation: TypeAlias = Literal["step", "linear", "smooth"]
Bound: TypeAlias = Literal["barrier", "repulsion"]


class RadiusCurve(NamedTuple):
    """Fields of :class:`SafetyRadius` that give r_min, for compiled functions."""

    r_min_slow: float
    r_min_fast: float
    speed_low: float
    speed_high: float


@compiled
def radius_curve(settings: npt.NDArray[np.void]) -> RadiusCurve:
    """Return the curve of a settings record, of the filter or of the guide."""
    s = settings[0]
    return RadiusCurve(s.r_min_slow, s.r_min_fast, s.speed_low, s.speed_high)


@entry
@compiled
def safety_radius(speed: float, curve: RadiusCurve) -> float:
    """Return r_min for an obstacle's speed in m/s, in m: piecewise linear."""
    c = curve
    if speed <= c.speed_low:
        return c.r_min_slow
    if speed >= c.speed_high:
        return c.r_min_fast
    rise = (c.r_min_fast - c.r_min_slow) * (speed - c.speed_low)
    return c.r_min_slow + rise / (c.speed_high - c.speed_low)


@compiled
def least_radius(settings: npt.NDArray[np.void]) -> float:
    """Return r_min of an obstacle at rest, m, of a settings record."""
    return safety_radius(0.0, radius_curve(settings))


@entry
@compiled
def activation(kind: int, distance: float, r_min: float, r: float) -> float:
    """Return the share of ẋ_0 at a distance, from 0 (d ≥ r) to 1 (d ≤ r_min).

    Kind 0, ``step``: 1 below r, as printed. 1, ``linear``: q = (r − d)/(r − r_min).
    2, ``smooth``: 3q² − 2q³, without a kink at either end.
    """
    if distance >= r:
        return 0.0
    if kind == 0 or distance <= r_min:
        return 1.0
    share = (r - distance) / (r - r_min)
    return share if kind == 1 else share * share * (3.0 - 2.0 * share)


@dataclass(frozen=True)
class SafetyRadius:
    """Safety radius r_min, piecewise linear in the speed v_o; r = zone_ratio · r_min.

    Attributes:
        r_min_slow: Safety distance for slow obstacles, m.
        r_min_fast: Safety distance for fast obstacles, m.
        speed_low: Speed up to which an obstacle is slow, m/s.
        speed_high: Speed from which on it is fast, m/s.
        zone_ratio: r / r_min, at least 1; the repulsion acts below r.
        closing_gain: κ, s; r_min grows by κ times the closing speed of robot and
            obstacle, an enhancement that the paper proposes.
    """

    r_min_slow: Annotated[float, "m", NOT_NEGATIVE] = 0.17
    r_min_fast: Annotated[float, "m", NOT_NEGATIVE] = 0.23
    speed_low: Annotated[float, "mps", NOT_NEGATIVE] = 0.1
    speed_high: Annotated[float, "mps", NOT_NEGATIVE] = 0.5
    zone_ratio: Annotated[float, Range(ge=1.0, allow_inf_nan=False)] = 4.0 / 3.0
    closing_gain: Annotated[float, "s", NOT_NEGATIVE] = 0.0

    ORDERED: ClassVar = (
        ("r_min_slow", "<=", "r_min_fast"),
        ("speed_low", "<=", "speed_high"),
    )

    def __post_init__(self) -> None:
        check(self, "a safety radius needs")

    @staticmethod
    def keys_of(slow: float, fast: float) -> dict[str, float]:
        """Return the keys in files for r_min of slow and of fast obstacles, m."""
        return {"r_min_slow_m": slow, "r_min_fast_m": fast}

    @property
    def curve(self) -> RadiusCurve:
        """The curve for compiled functions."""
        return RadiusCurve(*(getattr(self, name) for name in RadiusCurve._fields))

    def r_min(self, speed: float = 0.0) -> float:
        """Return r_min in m for an obstacle's speed in m/s."""
        return float(safety_radius(abs(speed), self.curve))

    def r(self, speed: float = 0.0) -> float:
        """Return r in m for an obstacle's speed in m/s."""
        return self.zone_ratio * self.r_min(speed)


@dataclass(frozen=True)
class Repulsion:
    """The repulsive velocity ẋ_0 d̂_o of Eq. 5 and 7.

    Attributes:
        speed: ẋ_0, m/s: a gain, since the result is cut to the robot's limits.
        activation: ``step`` (as printed), ``linear`` or ``smooth``; see
            :func:`activation`.
        damping: λ in m: the laws' factor 1/x, with a lever x, becomes x/(x² + λ²). 0 is
            as printed; at x = 0, where the printed laws are singular, the repulsion is
            then left out and the status says so.
    """

    speed: Annotated[float, "mps", NOT_NEGATIVE] = 10.0
    activation: Activation = "linear"
    damping: Annotated[float, "m", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "repulsion needs")


@dataclass(frozen=True)
class Margins:
    """Uncertainty of obstacles; inflates every obstacle, for all methods.

    An obstacle measured ``age`` seconds ago at speed v_o is inflated by
    error + age·(v_o + a·age) + a·dt²/2: its possible displacement since then, and its
    deviation from its velocity within a control step. The filter does not move away
    because of the age: that would hold a robot back. It brakes once an obstacle may
    have moved by more than r_min.

    Attributes:
        error: Error of a measured position, m.
        acceleration: a, greatest acceleration of an obstacle, m/s².
    """

    error: Annotated[float, "m", NOT_NEGATIVE] = 0.0
    acceleration: Annotated[float, "mps2", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "margins need")


@compiled
def widening(
    speed: float, age: float, error: float, acceleration: float, dt: float
) -> float:
    """Return the inflation of an obstacle, m; see :class:`Margins`.

    Args:
        speed: Of the obstacle, m/s.
        age: Of its measurement, s.
        error: Of the measurement, m.
        acceleration: Greatest, of the obstacle, m/s².
        dt: Control step, s.
    """
    return error + come_since(speed, age, acceleration) + 0.5 * acceleration * dt * dt


@compiled
def come_since(speed: float, age: float, acceleration: float) -> float:
    """Return the greatest displacement of an obstacle since it was measured, m."""
    return age * (speed + acceleration * age)


@dataclass(frozen=True)
class Actuation:
    """Actuator model: delay, jitter, ramps. It only makes the filter more conservative.

    Attributes:
        delay: Dead time of a twist, s; earlier twists are driven meanwhile. At most
            :data:`MOST_PENDING` control steps.
        jitter: Greatest relative excess of a control step over dt: 1 means up to 2 dt.
            The accelerations count for dt.
        ramps: Velocities ramp to the twist at the robot's accelerations instead of
            jumping at the start of a control step. With ``jitter`` the filter then
            needs ``driven``.
    """

    delay: Annotated[float, "s", NOT_NEGATIVE] = 0.0
    jitter: Annotated[float, NOT_NEGATIVE] = 0.0
    ramps: bool = False

    def __post_init__(self) -> None:
        check(self, "actuation needs")


HORIZON_STEPS = 10_000
"""Greatest number of control steps of a horizon; memory grows with it."""

MOST_PENDING, HORIZON_TICKS = 8, 1000
"""Greatest numbers of twists that are pending because of the delay, and of ticks in a
horizon."""


@dataclass(frozen=True)
class LookAhead:
    """Look-ahead: horizons, and the choice of a passing side.

    Attributes:
        horizon: s, for moving obstacles; long enough to leave the path of a slow one.
            Plans last as many whole control steps as fit into it, at least one.
        horizon_still: s, for static obstacles: time to turn or brake; a long one makes
            the robot hesitate. At most ``horizon``.
        tick: Sampling period along the arc, s; the clearance lost in between is added
            to the radius.
        hysteresis: Relative cost by which another passing side must be cheaper.
        review: Period of the search for another passing side, s.
        min_clearance: Least clearance of static obstacles, m, instead of r_min, where a
            moving one would touch the robot otherwise. ``inf``: r_min is always kept.
    """

    horizon: Annotated[float, "s", POSITIVE] = 3.0
    horizon_still: Annotated[float, "s", NOT_NEGATIVE] = 1.0
    tick: Annotated[float, "s", POSITIVE] = 0.05
    hysteresis: Annotated[float, Range(ge=0.0, lt=1.0)] = 0.4
    review: Annotated[float, "s", NOT_NEGATIVE] = 0.4
    min_clearance: Annotated[float, "m", Range(ge=0.01)] = 0.02

    ORDERED: ClassVar = (
        ("tick", "<=", "horizon"),
        ("horizon_still", "<=", "horizon"),
        ("horizon", "<=", f"{HORIZON_TICKS} * tick"),
    )

    def __post_init__(self) -> None:
        check(self, "look-ahead needs")


@dataclass(frozen=True)
class AvoidanceSettings:
    """Settings of all methods: Eq. 5, Eq. 7 and the QP filter.

    Attributes:
        radius: r_min(v_o) and r.
        repulsion: ẋ_0, its activation and damping (Eq. 5, 7; QP with ``repulsion``).
        weights: Diagonal of the QP's W: 1 and m²/rad². A small second weight makes
            turning cheap (the robot evades), a large one makes it brake.
        bound: Right-hand side b of the QP's rows. ``barrier``: −γ(d − r_min) +
            d̂_oᵀv_o; ``repulsion``: ẋ_0 times the activation, for obstacles nearer than
            r, without look-ahead and braking check.
        gamma: γ in 1/s: greatest rate at which the distance decays to r_min; γ·dt ≤ 1.
        reach: Greatest distance of an obstacle with a row, m. ``inf``: every obstacle
            that an admissible twist could bring too near.
        slack_tolerance: m/s; see :func:`qpavoid.qp.exact.relaxation`.
        margins: Inflation of obstacles that are not known exactly.
        ahead: Of the look-ahead (controller ``qp-ahead``).
        actuation: Actuator model.
        dt: Control step, s: how long a twist is held. The default is a loop of 50 Hz: a
            faster loop only makes it more conservative, in a slower one nothing is
            guaranteed. In a scenario it is the scenario's own.
        braking_room: Drive only twists that allow a stop; see
            :mod:`qpavoid.avoidance.verdict`. Off, nothing is guaranteed.
        passive: If every predicted motion has a contact, brake in time to be at rest
            when it happens; see the same module.
    """

    radius: SafetyRadius = field(default_factory=SafetyRadius)
    repulsion: Repulsion = field(default_factory=Repulsion)
    weights: Annotated[
        tuple[float, float], POSITIVE, ("weight_v", "weight_omega_m2")
    ] = (1.0, 0.03)
    bound: Bound = "barrier"
    gamma: Annotated[float, "per_s", POSITIVE] = 2.0
    reach: Annotated[float, "m", Range(gt=0.0)] = math.inf
    slack_tolerance: Annotated[float, "mps", POSITIVE] = 1e-3
    margins: Margins = field(default_factory=Margins)
    ahead: LookAhead = field(default_factory=LookAhead)
    actuation: Actuation = field(default_factory=Actuation)
    dt: Annotated[float, NO_KEY, POSITIVE] = 0.02
    braking_room: bool = True
    passive: bool = False

    ORDERED: ClassVar = (
        ("gamma * dt", "<=", "1"),  # in one step r_min is not passed
        ("actuation.delay", "<=", f"{MOST_PENDING} * dt"),
        ("ahead.horizon", "<=", f"{HORIZON_STEPS} * dt"),
        ("passive", "<=", "braking_room"),
    )

    def __post_init__(self) -> None:
        check(self, "settings need")

    def values(self) -> dict[str, float]:
        """Return all settings by their names in :data:`RECORD`, and others."""
        parts = (self.radius, self.repulsion, self.ahead, self.actuation, self)
        return {name: x for part in parts for name, x in vars(part).items()} | {
            "horizon": max(self.ahead.horizon, self.dt),
            "error": self.margins.error,
            "obstacle_acceleration": self.margins.acceleration,
            "weight_v": self.weights[0],
            "weight_omega": self.weights[1],
            "activation": get_args(Activation).index(self.repulsion.activation),
            "bound": get_args(Bound).index(self.bound),
        }

    def record(self) -> npt.NDArray[np.void]:
        """Return all settings as an array of one :data:`RECORD`."""
        values = self.values()
        return np.array([tuple(values[n] for n in RECORD.names or ())], dtype=RECORD)


PARTS: dict[str, type[Any]] = {
    part.name: part.type
    for part in fields(AvoidanceSettings)
    if isinstance(part.type, type) and is_dataclass(part.type)
}
"""Nested settings by name, each a table of scenario files and of the ROS 2 node's
parameters."""

RECORD = record_type(
    (name, np.float64 if isinstance(value, float) else np.int64)
    for name, value in AvoidanceSettings().values().items()
    if isinstance(value, float | int)
)
"""All settings as one record, for compiled functions."""

FilterSettings: TypeAlias = Annotated[
    npt.NDArray[np.void], Record("filter_settings", RECORD)
]
"""One :data:`RECORD`, as :meth:`AvoidanceSettings.record` returns it."""
