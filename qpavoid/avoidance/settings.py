"""What can be set: safety radius (section 2), repulsion (Eq. 5, 7), and the QP."""

import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled, entry
from qpavoid.model.robot import RELATIVE_ROUNDING
from qpavoid.settings import (
    NO_KEY,
    NOT_NEGATIVE,
    POSITIVE,
    Range,
    check,
    want,
)
from qpavoid.types import Record

Activation: TypeAlias = Literal["step", "linear", "smooth"]
Bound: TypeAlias = Literal["barrier", "repulsion"]


class RadiusCurve(NamedTuple):
    """r_min over the speed of an obstacle: what compiled functions know of it.

    Attributes:
        r_min_slow: Of what is slow, m.
        r_min_fast: Of what is fast, m.
        speed_low: Up to which it is slow, m/s.
        speed_high: From which on it is fast, m/s.
    """

    r_min_slow: float
    r_min_fast: float
    speed_low: float
    speed_high: float


@compiled
def radius_curve(settings: npt.NDArray[np.void]) -> RadiusCurve:
    """Return the curve of a record of settings, of the filter or of the guide."""
    s = settings[0]
    return RadiusCurve(s.r_min_slow, s.r_min_fast, s.speed_low, s.speed_high)


@entry
@compiled
def safety_radius(speed: float, curve: RadiusCurve) -> float:
    """Return r_min for an obstacle's speed in m/s, in m: linear between two speeds."""
    c = curve
    if speed <= c.speed_low:
        return c.r_min_slow
    if speed >= c.speed_high:
        return c.r_min_fast
    rise = (c.r_min_fast - c.r_min_slow) * (speed - c.speed_low)
    return c.r_min_slow + rise / (c.speed_high - c.speed_low)


@entry
@compiled
def activation(kind: int, distance: float, r_min: float, r: float) -> float:
    """Return the share of ẋ_0 that acts at a distance, from 0 (d ≥ r) to 1 (d ≤ r_min).

    Kind 0, ``step``: all of it below r, as printed. 1, ``linear``: (r − d)/(r − r_min).
    2, ``smooth``: the same, q, as 3q² − 2q³, without a kink at either end.
    """
    if distance >= r:
        return 0.0
    if kind == 0 or distance <= r_min:
        return 1.0
    share = (r - distance) / (r - r_min)
    return share if kind == 1 else share * share * (3.0 - 2.0 * share)


@dataclass(frozen=True)
class SafetyRadius:
    """r_min as a linear function of the obstacle's speed, and r = zone_ratio · r_min.

    Attributes:
        r_min_slow: For slow obstacles, m.
        r_min_fast: For fast ones, m.
        speed_low: Up to which an obstacle is slow, m/s.
        speed_high: From which on it is fast, m/s.
        zone_ratio: r / r_min, at least 1; the repulsion acts from r on.
        closing_gain: κ, s; r_min grows by κ times the speed at which robot and
            obstacle close in on each other, which the paper proposes as an enhancement.
    """

    r_min_slow: Annotated[float, "m", NOT_NEGATIVE] = 0.17
    r_min_fast: Annotated[float, "m", NOT_NEGATIVE] = 0.23
    speed_low: Annotated[float, "mps", NOT_NEGATIVE] = 0.1
    speed_high: Annotated[float, "mps", NOT_NEGATIVE] = 0.5
    zone_ratio: Annotated[float, Range(ge=1.0, allow_inf_nan=False)] = 4.0 / 3.0
    closing_gain: Annotated[float, "s", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        wants = "a safety radius needs"
        check(self, wants)
        ordered = self.r_min_slow <= self.r_min_fast
        want(ordered, f"{wants} 0 <= r_min_slow <= r_min_fast")
        want(self.speed_low <= self.speed_high, f"{wants} 0 <= speed_low <= speed_high")

    @property
    def curve(self) -> RadiusCurve:
        """What compiled functions know of it."""
        slow, fast = self.r_min_slow, self.r_min_fast
        return RadiusCurve(slow, fast, self.speed_low, self.speed_high)

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
        speed: ẋ_0, m/s: a gain, since the limits of the robot cut what it asks for.
        activation: ``step`` (as printed), ``linear`` or ``smooth``; see
            :func:`activation`.
        damping: λ in m: where the laws divide by a lever x they multiply by
            x/(x² + λ²) instead. 0 is as printed; at x = 0 itself, where the printed
            laws have no value, the repulsion is then left out and the status says so.
    """

    speed: Annotated[float, "mps", NOT_NEGATIVE] = 10.0
    activation: Activation = "linear"
    damping: Annotated[float, "m", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "repulsion needs")


@dataclass(frozen=True)
class Margins:
    """What may be wrong about an obstacle; it widens every obstacle, for all methods.

    An obstacle measured ``age`` seconds ago at speed v_o is wider by
    error + age·(v_o + a·age) + a·dt²/2: as far as it can have come, and as far as it
    can stray from its velocity within a control step. The filter does not move away
    from where an age alone has it: that holds a robot back. Once an obstacle may have
    come farther than r_min, and so too near, the filter brakes.

    Attributes:
        error: Of a measured position, m.
        acceleration: a, the greatest of an obstacle, m/s².
    """

    error: Annotated[float, "m", NOT_NEGATIVE] = 0.0
    acceleration: Annotated[float, "mps2", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "margins need")


@compiled
def widening(
    speed: float, age: float, error: float, acceleration: float, dt: float
) -> float:
    """Return by how much an obstacle is widened, m; see :class:`Margins`.

    Args:
        speed: Of the obstacle, m/s.
        age: Of its measurement, s.
        error: Of it, m.
        acceleration: That the obstacle may have, m/s².
        dt: Control step, s.
    """
    return error + come_since(speed, age, acceleration) + 0.5 * acceleration * dt * dt


@compiled
def come_since(speed: float, age: float, acceleration: float) -> float:
    """Return how far an obstacle can have come since it was measured, m."""
    return age * (speed + acceleration * age)


@dataclass(frozen=True)
class Actuation:
    """What the base does to a twist; all it costs is room.

    Attributes:
        delay: s until a twist is driven; the twists given meanwhile are driven first.
            At most :data:`MOST_PENDING` control steps.
        jitter: Share by which a control step may last longer than dt: of 1 it lasts up
            to twice as long. The accelerations count for dt.
        ramps: The velocities do not jump at the start of a control step but go to the
            twist at the robot's accelerations. With ``jitter`` the filter then has to
            be told what is ``driven``.
    """

    delay: Annotated[float, "s", NOT_NEGATIVE] = 0.0
    jitter: Annotated[float, NOT_NEGATIVE] = 0.0
    ramps: bool = False

    def __post_init__(self) -> None:
        check(self, "actuation needs")


MOST_STEPS = 10_000
"""Control steps of a horizon; its memory grows with them."""

MOST_PENDING = 8
"""Twists that may be on their way to the wheels."""


@dataclass(frozen=True)
class LookAhead:
    """How far ahead the look-ahead rows see, and how they choose a side.

    Attributes:
        horizon: s, for obstacles that move. Long enough to leave the way of a slow one.
            Plans last as many whole control steps as fit into it, at least one.
        horizon_still: s, for those at rest: the robot can still turn or brake, and a
            long one only makes it hesitate. Not more than ``horizon``.
        tick: s between two looks along the arc; the clearance lost in between is added
            to the radius.
        hysteresis: Share by which another way round must be cheaper to change over.
        review: s between two searches for another way round.
        closest: m; so much of r_min is kept from what stands where what moves would
            touch the robot else; at least 0.01. ``inf``: always all of it.
    """

    horizon: Annotated[float, "s", POSITIVE] = 3.0
    horizon_still: Annotated[float, "s", NOT_NEGATIVE] = 1.0
    tick: Annotated[float, "s", POSITIVE] = 0.05
    hysteresis: Annotated[float, Range(ge=0.0, lt=1.0)] = 0.4
    review: Annotated[float, "s", NOT_NEGATIVE] = 0.4
    closest: Annotated[float, "m", Range(ge=0.01)] = 0.02

    def __post_init__(self) -> None:
        wants = "look-ahead needs"
        check(self, wants)
        want(self.tick <= self.horizon, f"{wants} 0 < tick <= horizon")
        few = self.horizon / self.tick <= 1000
        want(few, f"{wants} at most 1000 ticks in its horizon")
        shorter = self.horizon_still <= self.horizon
        want(shorter, f"{wants} 0 <= horizon_still <= horizon")


@dataclass(frozen=True)
class AvoidanceSettings:
    """The settings of all methods: Eq. 5, Eq. 7 and the QP filter.

    Attributes:
        radius: r_min(v_o) and r.
        repulsion: ẋ_0, its activation and damping (Eq. 5, 7; QP with ``repulsion``).
        weights: Diagonal of the QP's W: 1 and m²/rad². A small second weight makes
            turning cheap (the robot goes round), a large one makes it brake.
        bound: Right-hand side b of the QP's rows. ``barrier``: −γ(d − r_min) + d̂_oᵀv_o;
            ``repulsion``: ẋ_0 times the activation, for obstacles nearer than r; it
            knows neither look-ahead nor braking room.
        gamma: γ in 1/s: how fast the distance may shrink towards r_min; γ·dt ≤ 1.
        reach: m; obstacles farther than this get no row. ``inf``: every obstacle that
            some admissible twist could bring too near gets one.
        slack_tolerance: m/s; see :func:`qpavoid.qp.exact.relaxation`.
        margins: Widening of obstacles that are not known exactly.
        ahead: Of the look-ahead rows (controller ``qp-ahead``).
        actuation: What the base does to a twist.
        dt: Control step, s: how long a twist is held before the next one. The default
            is a loop of 50 Hz: in one that is faster it only costs room, in a slower
            one nothing is guaranteed. In a scenario it is the scenario's own.
        braking_room: Drive only what leaves room to stop; see
            :mod:`qpavoid.avoidance.judge`. Off, nothing is guaranteed.
        passive: Where the look-ahead sees no way without a contact, brake in time to
            be at rest when it comes; see the same module.
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

    def __post_init__(self) -> None:
        check(self, "settings need")
        gain, delay = self.gamma * self.dt, self.actuation.delay
        want(gain <= 1.0, f"gamma * dt = {gain:g} > 1: one step could pass r_min")
        want(
            delay <= MOST_PENDING * self.dt * (1.0 + RELATIVE_ROUNDING),
            f"actuation needs delay <= {MOST_PENDING} dt, not {delay} s",
        )
        want(self.braking_room or not self.passive, "passive needs braking_room")
        steps = self.ahead.horizon / self.dt
        want(
            steps <= MOST_STEPS,
            f"look-ahead needs a horizon of at most {MOST_STEPS} control steps of "
            f"dt = {self.dt:g} s, not {steps:.3g}",
        )

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
"""The settings that these are made of, each a table of scenario files and of the ROS 2
node's parameters, by its name."""

RECORD = np.dtype(
    [
        (name, np.float64 if isinstance(value, float) else np.int64)
        for name, value in AvoidanceSettings().values().items()
        if isinstance(value, float | int)
    ]
)
"""All settings as one record, as the compiled functions take them."""

FilterSettings: TypeAlias = Annotated[
    npt.NDArray[np.void], Record("filter_settings", RECORD)
]
"""One :data:`RECORD`, as :meth:`AvoidanceSettings.record` returns it."""
