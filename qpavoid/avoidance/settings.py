"""What can be set: safety radius (section 2), repulsion (Eq. 5, 7), and the QP."""

import math
from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled
from qpavoid.errors import InvalidInputError

ACTIVATIONS = ("step", "linear", "smooth")
BOUNDS = ("barrier", "repulsion")

NUMBERS = (
    *("low", "high", "speed_low", "speed_high", "ratio", "speed", "damping"),
    *("gamma", "reach", "slack_tolerance", "closing", "error", "obstacle_acceleration"),
    *("dt", "weight_v", "weight_omega", "horizon", "horizon_still", "tick"),
    *("hysteresis", "review", "closest", "delay", "jitter"),
)
CHOICES = ("ramps", "braking_room", "passive", "activation", "bound")
RECORD = np.dtype(
    [*((n, np.float64) for n in NUMBERS), *((n, np.int64) for n in CHOICES)]
)
"""All settings as one record, as the compiled functions take them."""


def want(holds: bool, what: str) -> None:
    """Raise InvalidInputError unless something holds."""
    if not holds:
        raise InvalidInputError(what)


@compiled
def safety_radius(
    speed: float, low: float, high: float, speed_low: float, speed_high: float
) -> float:
    """Return r_min for an obstacle's speed, in m: linear between two speeds.

    Args:
        speed: Of the obstacle, m/s.
        low: r_min of what is slow, m.
        high: r_min of what is fast, m.
        speed_low: Up to which it is slow, m/s.
        speed_high: From which on it is fast, m/s.
    """
    if speed <= speed_low:
        return low
    if speed >= speed_high:
        return high
    return low + (high - low) * (speed - speed_low) / (speed_high - speed_low)


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
    """r_min as a linear function of the obstacle's speed, and r = ratio · r_min.

    Attributes:
        low: r_min for slow obstacles, m.
        high: r_min for fast ones, m.
        speed_low: Speed up to which ``low`` holds, m/s.
        speed_high: Speed from which on ``high`` holds, m/s.
        ratio: r / r_min, at least 1; the repulsion acts from r on.
        closing: s; r_min grows by this times the speed at which robot and obstacle
            close in on each other, which the paper proposes as an enhancement.
    """

    low: float = 0.17
    high: float = 0.23
    speed_low: float = 0.1
    speed_high: float = 0.5
    ratio: float = 4.0 / 3.0
    closing: float = 0.0

    def __post_init__(self) -> None:
        _finite(self)
        want(0.0 <= self.low <= self.high, "a safety radius wants 0 <= low <= high")
        want(
            0.0 <= self.speed_low <= self.speed_high,
            "a safety radius wants 0 <= speed_low <= speed_high",
        )
        if self.ratio < 1.0:
            raise InvalidInputError("a safety radius wants ratio >= 1")
        if self.closing < 0.0:
            raise InvalidInputError("a safety radius wants closing >= 0")

    def r_min(self, speed: float = 0.0) -> float:
        """Return r_min in m for an obstacle's speed in m/s."""
        radius: float = safety_radius(
            abs(speed), self.low, self.high, self.speed_low, self.speed_high
        )
        return radius

    def r(self, speed: float = 0.0) -> float:
        """Return r in m for an obstacle's speed in m/s."""
        return self.ratio * self.r_min(speed)


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

    speed: float = 10.0
    activation: Literal["step", "linear", "smooth"] = "linear"
    damping: float = 0.0

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS:
            raise InvalidInputError(
                f"activation must be one of {', '.join(ACTIVATIONS)}, "
                f"not {self.activation!r}"
            )
        want(
            (0.0 <= self.speed < math.inf and 0.0 <= self.damping < math.inf),
            "repulsion wants speed >= 0 and damping >= 0",
        )


@dataclass(frozen=True)
class Margins:
    """What may be wrong about an obstacle; it widens every obstacle, for all methods.

    An obstacle measured ``age`` seconds ago at speed v_o is wider by
    error + age·(v_o + a·age) + a·dt²/2: as far as it can have come, and as far as it
    can stray from its velocity within a control step.

    Attributes:
        error: Of a measured position, m.
        acceleration: a, the greatest of an obstacle, m/s².
    """

    error: float = 0.0
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            want(0.0 <= value < math.inf, f"margins want {name} >= 0")


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
    strayed = 0.5 * acceleration * dt * dt
    return error + age * (speed + acceleration * age) + strayed


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

    delay: float = 0.0
    jitter: float = 0.0
    ramps: bool = False

    def __post_init__(self) -> None:
        for name in ("delay", "jitter"):
            want(0.0 <= getattr(self, name) < math.inf, f"actuation wants {name} >= 0")


MOST_PENDING = 8
"""Twists that may be on their way to the wheels."""


@dataclass(frozen=True)
class LookAhead:
    """How far ahead the look-ahead rows see, and how they choose a side.

    Attributes:
        horizon: s, for obstacles that move. Long enough to leave the way of a slow one.
        horizon_still: s, for those at rest: the robot can still turn or brake, and a
            long one only makes it hesitate. Not more than ``horizon``.
        tick: s between two looks along the arc; the clearance lost in between is added
            to the radius.
        hysteresis: Share by which another way round must be cheaper to change over.
        review: s between two searches for another way round.
        closest: m; so much of r_min is kept from what stands where what moves would
            touch the robot else; at least 0.01. ``inf``: always all of it.
    """

    horizon: float = 3.0
    horizon_still: float = 1.0
    tick: float = 0.05
    hysteresis: float = 0.4
    review: float = 0.4
    closest: float = 0.02

    def __post_init__(self) -> None:
        want(
            0.0 < self.tick <= self.horizon < math.inf,
            "look-ahead wants 0 < tick <= horizon",
        )
        if self.horizon / self.tick > 1000:
            raise InvalidInputError(
                "look-ahead wants at most 1000 ticks in its horizon"
            )
        want(
            0.0 <= self.horizon_still <= self.horizon,
            "look-ahead wants 0 <= horizon_still <= horizon",
        )
        want(0.0 <= self.hysteresis < 1.0, "look-ahead wants 0 <= hysteresis < 1")
        want(0.0 <= self.review < math.inf, "look-ahead wants review >= 0")
        want(self.closest >= 0.01, "look-ahead wants closest >= 0.01")


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
        dt: Control step, s: how long a twist is held before the next one.
        braking_room: Drive only what leaves room to stop; see
            :mod:`qpavoid.avoidance.braking`. Off, nothing is guaranteed.
        passive: Where the look-ahead sees no way without a contact, brake in time to
            be at rest when it comes; see the same module.
    """

    radius: SafetyRadius = field(default_factory=SafetyRadius)
    repulsion: Repulsion = field(default_factory=Repulsion)
    weights: tuple[float, float] = (1.0, 0.03)
    bound: Literal["barrier", "repulsion"] = "barrier"
    gamma: float = 2.0
    reach: float = math.inf
    slack_tolerance: float = 1e-3
    margins: Margins = field(default_factory=Margins)
    ahead: LookAhead = field(default_factory=LookAhead)
    actuation: Actuation = field(default_factory=Actuation)
    dt: float = 0.02
    braking_room: bool = True
    passive: bool = False

    def __post_init__(self) -> None:
        if self.bound not in BOUNDS:
            raise InvalidInputError(
                f"bound must be one of {', '.join(BOUNDS)}, not {self.bound!r}"
            )
        if len(self.weights) != 2 or not all(0.0 < w < math.inf for w in self.weights):
            raise InvalidInputError("weights must be two positive numbers")
        for name in ("gamma", "slack_tolerance", "dt"):
            want(0.0 < getattr(self, name) < math.inf, f"{name} must be positive")
        if self.gamma * self.dt > 1.0:
            raise InvalidInputError(
                f"gamma * dt = {self.gamma * self.dt:g} > 1: one step could pass r_min"
            )
        want(self.reach > 0.0, "reach must be positive")
        if self.actuation.delay > MOST_PENDING * self.dt * (1.0 + 1e-9):
            raise InvalidInputError(
                f"actuation wants delay <= {MOST_PENDING} dt, "
                f"not {self.actuation.delay} s"
            )
        if self.passive and not self.braking_room:
            raise InvalidInputError("passive wants braking_room")

    def record(self) -> npt.NDArray[np.void]:
        """Return all settings as an array of one :data:`RECORD`."""
        record = np.zeros(1, dtype=RECORD)
        parts = (self.radius, self.repulsion, self.ahead, self.actuation, self)
        values = {k: v for part in parts for k, v in vars(part).items()}
        values |= {
            "error": self.margins.error,
            "obstacle_acceleration": self.margins.acceleration,
            "weight_v": self.weights[0],
            "weight_omega": self.weights[1],
            "activation": ACTIVATIONS.index(self.repulsion.activation),
            "bound": BOUNDS.index(self.bound),
        }
        for name in RECORD.names or ():
            record[name] = values[name]
        return record


def _finite(settings: SafetyRadius) -> None:
    for item in fields(settings):
        want(math.isfinite(getattr(settings, item.name)), f"{item.name} must be finite")
