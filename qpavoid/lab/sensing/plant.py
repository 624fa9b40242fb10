"""Wheel model: actuator lag and slip.

A wheel turns at v ∓ ω b/2 (b: track) and moves its side of the robot by that times
1 + slip · n, n from a standard normal, drawn anew for each wheel in each control step.
Encoders see the wheels, not the slip.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from qpavoid.model.kinematics import STRAIGHT, wrap_angle
from qpavoid.settings import NO_KEY, NOT_NEGATIVE, POSITIVE, Range, check
from qpavoid.types import Pose, Twist


class Drive(NamedTuple):
    """The mean twists of one control step, m/s and rad/s.

    Attributes:
        wheels: Measured by the encoders.
        ground: Of the robot over ground.
        lateral: Sliding velocity to its left, m/s.
    """

    wheels: Twist
    ground: Twist
    lateral: float = 0.0


@dataclass(frozen=True)
class Plant:
    """A base with motors; the default is ideal.

    Attributes:
        slip: Standard deviation of a wheel's slip in a control step, a fraction.
        lag: Time constants of v and ω, s, of first order.
        track: b, m between the wheels.
        seed: Of the slip.
    """

    slip: Annotated[float, NOT_NEGATIVE] = 0.0
    lag: Annotated[Twist, NOT_NEGATIVE, ("lag_v_s", "lag_omega_s")] = (0.0, 0.0)
    track: Annotated[float, NO_KEY, POSITIVE] = 0.445
    seed: Annotated[int, NO_KEY, Range(ge=0)] = 0

    def __post_init__(self) -> None:
        check(self, "a plant needs")

    def start(self, pose: Pose = (0.0, 0.0, 0.0)) -> Callable[..., Drive]:
        """Return the step of a base at rest: a function of v, ω and time dt (s)."""
        random = np.random.default_rng(self.seed)
        now = [0.0, 0.0]

        def step(v: float, omega: float, dt: float) -> Drive:
            mean = [0.0, 0.0]
            for i, asked in enumerate((v, omega)):
                mean[i], now[i] = _lagged(now[i], asked, self.lag[i], dt)
            left, right = wheel_speeds(mean[0], mean[1], self.track)
            slips = 1.0 + self.slip * random.standard_normal(2)
            ground = wheel_twist(left * slips[0], right * slips[1], self.track)
            return Drive(
                (mean[0], mean[1]), ground if self.slip else (mean[0], mean[1])
            )

        return step


def _lagged(now: float, asked: float, lag: float, dt: float) -> tuple[float, float]:
    """Return the mean over a step and the value at its end, of first order."""
    if lag == 0.0:
        return asked, asked
    left = math.exp(-dt / lag)
    mean = asked + (now - asked) * (1.0 - left) * lag / dt
    return mean, asked + (now - asked) * left


def twist_between(start: Pose, end: Pose, dt: float) -> tuple[float, float, float]:
    """Return v, ω and the lateral velocity of the arc between two poses, dt s apart."""
    (x_0, y_0, heading_0), (x, y, heading) = start, end
    angle = wrap_angle(heading - heading_0)
    half = 0.5 * angle
    sinc = math.sin(half) / half if abs(half) > STRAIGHT else 1.0 - half**2 / 6.0
    cos, sin = math.cos(heading_0 + half), math.sin(heading_0 + half)
    ahead = (cos * (x - x_0) + sin * (y - y_0)) / (sinc * dt)
    return ahead, angle / dt, (cos * (y - y_0) - sin * (x - x_0)) / (sinc * dt)


def wheel_speeds(v: float, omega: float, track: float) -> tuple[float, float]:
    """Return the speeds of left and right wheel over ground, m/s."""
    return v - 0.5 * omega * track, v + 0.5 * omega * track


def wheel_twist(left: float, right: float, track: float) -> Twist:
    """Return v, ω of the robot from the speeds of its wheels."""
    return float(0.5 * (left + right)), float((right - left) / track)
