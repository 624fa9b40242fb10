"""Robot: footprint and limits of the twist."""

import math
from dataclasses import astuple, dataclass
from typing import Annotated, NamedTuple

import numpy as np

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import TINY
from qpavoid.settings import NOT_NEGATIVE, Range, check, want
from qpavoid.types import Array, Box, LimitVector, Twist

UNLIMITED_TWIST = 10.0
"""m/s and rad/s; greatest twist of a robot whose limits are infinite."""

GREATEST = 1e3
"""m/s and rad/s; greatest value of a measured or desired twist."""

RELATIVE_ROUNDING = 1e-9
"""Relative tolerance for rounding, of a quantity or a control step: so small an excess
adds no step to a count and violates no limit."""


@dataclass(frozen=True)
class Limits:
    """The twists that the actuators can drive. ``inf`` means no limit.

    Attributes:
        v_min: Least forward speed, m/s; at most 0 (standing still is always allowed).
        v_max: Greatest forward speed, m/s; at least 0.
        omega_min: Least yaw rate, rad/s; at most 0.
        omega_max: Greatest yaw rate, rad/s; at least 0.
        acceleration: Greatest |v̇|, m/s².
        angular_acceleration: Greatest |ω̇|, rad/s².
        wheel_speed: w_max, m/s over ground: |v ± ω b/2| ≤ w_max.
        track: b, distance between the wheels, m.
        v_dead: Dead band of the motors, m/s: a twist with |v| < v_dead and
            |ω| < omega_dead does not move the robot. Filter and guide command no such
            twist but zero; the other methods do not use the dead band.
        omega_dead: Dead band of the yaw rate, rad/s. If only one is given, the other
            component moves the robot unless it is 0.

    Raises:
        InvalidInputError: The box holds no zero twist or no other, a limit is not
            positive, a wheel speed is given without a track, or a dead band is not less
            than the greatest speed.
    """

    v_min: Annotated[float, "mps", Range(le=0.0)]
    v_max: Annotated[float, "mps", Range(ge=0.0)]
    omega_min: Annotated[float, "radps", Range(le=0.0)]
    omega_max: Annotated[float, "radps", Range(ge=0.0)]
    acceleration: Annotated[float, "mps2", Range(gt=0.0)] = math.inf
    angular_acceleration: Annotated[float, "radps2", Range(gt=0.0)] = math.inf
    wheel_speed: Annotated[float, "mps", Range(gt=0.0)] = math.inf
    track: Annotated[float, "m", NOT_NEGATIVE] = 0.0
    v_dead: Annotated[float, "mps", NOT_NEGATIVE] = 0.0
    omega_dead: Annotated[float, "radps", NOT_NEGATIVE] = 0.0

    def __post_init__(self) -> None:
        check(self, "limits need")
        fast = max(self.v_max, -self.v_min), max(self.omega_max, -self.omega_min)
        for name, dead, most in zip("v omega".split(), self.dead, fast, strict=True):
            want(dead == 0.0 or dead < most, f"limits need {name}_dead < {most:g}")
        moves = self.v_min < self.v_max or self.omega_min < self.omega_max
        want(moves, "limits leave no twist but zero")
        known = self.wheel_speed == math.inf or self.track > 0.0
        want(known, "limits need a track where wheel_speed is given")

    @classmethod
    def symmetric(cls, v_max: float, omega_max: float) -> "Limits":
        """Return |v| ≤ v_max (m/s), |ω| ≤ omega_max (rad/s)."""
        return cls(-v_max, v_max, -omega_max, omega_max)

    @property
    def dead(self) -> Twist:
        """Dead band of the motors, m/s and rad/s."""
        return self.v_dead, self.omega_dead

    def moves(self, v: float, omega: float) -> bool:
        """Return whether a twist other than zero is beyond the dead band."""
        moves_on = abs(v) >= self.v_dead and v != 0.0
        return moves_on or (abs(omega) >= self.omega_dead and omega != 0.0)

    def within_band(self, v: float, omega: float) -> Twist:
        """Return the nearest twist of the dead band with its edge."""
        v_dead, omega_dead = self.dead
        return min(max(v, -v_dead), v_dead), min(max(omega, -omega_dead), omega_dead)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Limits for compiled functions, without the dead band."""
        return astuple(self)[:8]


class RobotLimits(NamedTuple):
    """:class:`Limits` and circumradius, m, for compiled functions."""

    v_min: float
    v_max: float
    omega_min: float
    omega_max: float
    acceleration: float
    angular_acceleration: float
    wheel_speed: float
    track: float
    circumradius: float


@entry
@compiled
def limits_of(robot: LimitVector) -> RobotLimits:
    """Return :attr:`Robot.limit_vector` by name."""
    r = robot
    return RobotLimits(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8])


@entry
@compiled
def twist_box(robot: LimitVector, v: float, omega: float, dt: float) -> Box:
    """Return the twists that can follow (v, ω) after dt.

    The box of the limits, cut to ±acceleration·dt round the twist last driven, which is
    first projected onto the limits.
    """
    limits = limits_of(robot)
    v = min(max(v, limits.v_min), limits.v_max)
    omega = min(max(omega, limits.omega_min), limits.omega_max)
    step_v, step_omega = limits.acceleration * dt, limits.angular_acceleration * dt
    return Box(
        max(limits.v_min, v - step_v),
        min(limits.v_max, v + step_v),
        max(limits.omega_min, omega - step_omega),
        min(limits.omega_max, omega + step_omega),
    )


@compiled
def braking_steps(robot: Array, v: float, omega: float, dt: float) -> float:
    """Return n, the number of control steps that braking from (v, ω) takes; ≥ 1."""
    limits = limits_of(robot)
    steps = 1.0
    if limits.acceleration < math.inf:
        steps = max(steps, abs(v) / (limits.acceleration * dt))
    if limits.angular_acceleration < math.inf:
        steps = max(steps, abs(omega) / (limits.angular_acceleration * dt))
    return float(np.ceil(steps - RELATIVE_ROUNDING))


@entry
@compiled
def braking_twist(robot: LimitVector, v: float, omega: float, dt: float) -> Twist:
    """Return u_b, the next twist when braking from (v, ω) along its arc."""
    share = 1.0 - 1.0 / braking_steps(robot, v, omega, dt)
    return share * v, share * omega


@compiled
def clipped(twist: Twist, box: Box) -> Twist:
    """Return the nearest twist within a box."""
    v = min(max(twist[0], box.v_min), box.v_max)
    return v, min(max(twist[1], box.omega_min), box.omega_max)


@compiled
def within_wheels(robot: Array, twist: Twist) -> Twist:
    """Return a twist scaled down to the wheels' limit: its curvature is kept."""
    limits = limits_of(robot)
    (v, omega), most = twist, limits.wheel_speed
    fastest = abs(v) + 0.5 * limits.track * abs(omega)
    if fastest > most:
        v, omega = v * most / fastest, omega * most / fastest
    return v, omega


@compiled_once
def nearest_on_wheels(twist: Twist, box: Box, half: float, most: float) -> Twist:
    """Return the nearest twist on |v| + half·|ω| = most within a box.

    Each of the four edges, s·v + half·t·ω = most with s, t = ±1, is a segment with the
    parameter t·ω.

    Args:
        twist: (v, ω), m/s and rad/s.
        box: It contains a twist with a smaller left side.
        half: Half the track, m.
        most: Wheel speed, m/s.
    """
    best, least = clipped((0.0, 0.0), box), math.inf
    per_half = 1.0 / max(half, TINY)  # without a track only v is limited
    for edge in range(4):
        s, t = 1.0 - 2.0 * (edge // 2), 1.0 - 2.0 * (edge % 2)
        v_low, v_high = s * box.v_min, s * box.v_max
        low, high = t * box.omega_min, t * box.omega_max
        if s < 0.0:
            v_low, v_high = v_high, v_low
        if t < 0.0:
            low, high = high, low
        low = max(low, 0.0, (most - v_high) * per_half)
        high = min(high, (most - max(v_low, 0.0)) * per_half)
        if low > high:
            continue
        turn = (t * twist[1] + half * (most - s * twist[0])) / (1.0 + half * half)
        turn = min(max(turn, low), high)
        v, omega = s * (most - half * turn), t * turn
        away = (v - twist[0]) ** 2 + (omega - twist[1]) ** 2
        if away < least:
            best, least = (v, omega), away
    return best


@entry
@compiled
def limit_twist(robot: LimitVector, twist: Twist, last: Twist, dt: float) -> Twist:
    """Return the twist within all limits for a commanded twist.

    A twist beyond the wheels' limit is first scaled down to it, which keeps its
    curvature. The result is the nearest point to that, in (v, ω), of the convex polygon
    of the twists that can follow the last one: :func:`twist_box` and the wheels'
    |v| + |ω| b/2 ≤ w_max. If the polygon is empty, because the last twist is beyond
    the wheels' limit, it is :func:`braking_twist`.
    """
    (v, omega), limits = within_wheels(robot, twist), limits_of(robot)
    half, most = 0.5 * limits.track, limits.wheel_speed
    box = twist_box(robot, last[0], last[1], dt)
    in_box = clipped((v, omega), box)
    if abs(in_box[0]) + half * abs(in_box[1]) <= most:
        return in_box
    slowest = clipped((0.0, 0.0), box)
    if abs(slowest[0]) + half * abs(slowest[1]) > most:
        return braking_twist(robot, last[0], last[1], dt)
    return nearest_on_wheels((v, omega), box, half, most)


@entry
@compiled
def driven_twist(robot: LimitVector, v: float, omega: float) -> Twist:
    """Return the nearest admissible twist to a measured (v, ω).

    Along its arc or the axes, and at most :data:`GREATEST`.
    """
    share = GREATEST / max(GREATEST, abs(v), abs(omega))
    return limit_twist(robot, (share * v, share * omega), (0.0, 0.0), math.inf)


@entry
@compiled
def stopping_time(robot: LimitVector, v: float, omega: float, dt: float) -> float:
    """Return τ(u), s: driving (v, ω) for so long covers the braking arc."""
    return 0.5 * dt * (braking_steps(robot, v, omega, dt) + 1.0)


@dataclass(frozen=True)
class Robot:
    """A differential-drive robot.

    Attributes:
        name: Label in tables and figures.
        footprint: Its outline in the robot frame.
        limits: Its actuator limits, the same for every controller.
    """

    name: str
    footprint: Footprint
    limits: Limits

    @property
    def limit_vector(self) -> Array:
        """(9,) :attr:`Limits.numbers`, then the circumradius in m.

        The argument ``robot`` of compiled functions.
        """
        return np.array([*self.limits.numbers, self.footprint.circumradius])

    @classmethod
    def mir100(cls, tip_angle: float = math.radians(40.0)) -> "Robot":
        """Return the paper's robot: 890 × 580 mm with a tip of 40°, five segments.

        Limits are those of the MiR100's public driver: 1.0 m/s, 1.5 rad/s.
        """
        footprint = Footprint.pentagon(0.890, 0.580, tip_angle)
        return cls("MiR100 with tip", footprint, Limits.symmetric(1.0, 1.5))

    @classmethod
    def mir100_rectangle(cls) -> "Robot":
        """Return the paper's robot without the tip: four segments (Fig. 2a)."""
        footprint = Footprint.rectangle(0.890, 0.580)
        return cls("MiR100", footprint, Limits.symmetric(1.0, 1.5))

    @classmethod
    def jackal(cls) -> "Robot":
        """Return a Clearpath Jackal: 508 × 430 mm, 2.0 m/s, 4.0 rad/s."""
        footprint = Footprint.rectangle(0.508, 0.430)
        return cls("Jackal", footprint, Limits.symmetric(2.0, 4.0))
