"""Localisation: motion capture, or UWB fused with odometry.

The filter of UWB is an extended Kalman filter [Thrun2005] on x, y, γ. It predicts along
the exact arc of the wheels' twist, whose variance is that of the wheels' slip
(:mod:`qpavoid.lab.sensing.plant`), and corrects with measured positions.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from qpavoid.lab.sensing.clock import Clock
from qpavoid.lab.sensing.plant import wheel_speeds
from qpavoid.model.kinematics import STRAIGHT, arc, wrap_angle
from qpavoid.settings import NO_KEY, NOT_NEGATIVE, POSITIVE, Range, check
from qpavoid.types import Array, Pose, Twist

Locate: TypeAlias = Callable[[Pose, float, Twist, float], Pose]
"""Function from the true pose, the time (s), the wheels' twist and its duration (s) to
the estimated pose."""


@dataclass(frozen=True)
class MotionCapture:
    """Motion capture: white noise on the true pose.

    Attributes:
        sigma: Of x and of y, m.
        heading_sigma: Of γ, rad.
        seed: Of the noise.
    """

    sigma: Annotated[float, "m", NOT_NEGATIVE] = 0.0005
    heading_sigma: Annotated[float, "rad", NOT_NEGATIVE] = 0.001
    seed: Annotated[int, NO_KEY, Range(ge=0)] = 0

    def __post_init__(self) -> None:
        check(self, "motion capture needs")

    def start(self, pose: Pose) -> Locate:
        """Return the localisation of a robot that starts at ``pose``."""
        random = np.random.default_rng(self.seed)
        sigmas = np.array([self.sigma, self.sigma, self.heading_sigma])

        def locate(pose: Pose, time: float, wheels: Twist, dt: float) -> Pose:
            x, y, heading = (pose + sigmas * random.standard_normal(3)).tolist()
            return x, y, heading

        return locate


@dataclass(frozen=True)
class Uwb:
    """Radio positions of the axle's middle, fused with odometry; γ is never measured.

    Attributes:
        sigma: Of a measured x and y, m.
        rate: Measurements a second, Hz.
        slip: Assumed slip of the wheels, as in
            :class:`~qpavoid.lab.sensing.plant.Plant`.
        track: m between the wheels.
        start_sigma: Of x and y (m) and of γ (rad) of the initial estimate.
        seed: Of the noise.
    """

    sigma: Annotated[float, "m", POSITIVE] = 0.1
    rate: Annotated[float, "hz", POSITIVE] = 10.0
    slip: Annotated[float, NOT_NEGATIVE] = 0.05
    track: Annotated[float, NO_KEY, POSITIVE] = 0.445
    start_sigma: Annotated[
        tuple[float, float], NOT_NEGATIVE, ("start_sigma_m", "start_sigma_rad")
    ] = (0.05, 0.05)
    seed: Annotated[int, NO_KEY, Range(ge=0)] = 0

    def __post_init__(self) -> None:
        check(self, "UWB needs")

    def start(self, pose: Pose) -> Locate:
        """Return the localisation of a robot that starts at ``pose``."""
        random = np.random.default_rng(self.seed)
        ekf, clock = self.filter(pose, random), Clock(self.rate)

        def locate(pose: Pose, time: float, wheels: Twist, dt: float) -> Pose:
            ekf.predict(*wheels, dt)
            if clock.ticks(time):
                measured = pose[:2] + self.sigma * random.standard_normal(2)
                ekf.correct(measured, self.sigma)
            return ekf.pose

        return locate

    def filter(self, pose: Pose, random: np.random.Generator) -> "PoseFilter":
        """Return the filter of a robot at ``pose``, with an initial error."""
        place, heading = self.start_sigma
        sigmas = np.array([place, place, heading])
        believed = np.array(pose) + sigmas * random.standard_normal(3)
        return PoseFilter(believed, np.diag(sigmas**2), self.slip, self.track)


class PoseFilter:
    """The extended Kalman filter.

    Attributes:
        mean: (3,) x, y (m), γ (rad); γ is not wrapped.
        covariance: (3, 3).
    """

    def __init__(
        self, mean: Array, covariance: Array, slip: float, track: float
    ) -> None:
        self.mean, self.covariance = mean.copy(), covariance.copy()
        self._slip, self._track = slip, track

    @property
    def pose(self) -> Pose:
        """The mean as a pose, γ in (−π, π]."""
        x, y, heading = self.mean.tolist()
        return x, y, wrap_angle(heading)

    def predict(self, v: float, omega: float, dt: float) -> None:
        """Predict along the arc of the wheels' twist (m/s, rad/s) for ``dt`` s."""
        by_pose, by_twist = arc_jacobians(float(self.mean[2]), v, omega, dt)
        half, turn = 0.5, 1.0 / self._track
        wheels = np.array([[half, half], [-turn, turn]])
        sigmas = self._slip * np.array(wheel_speeds(v, omega, self._track))
        by_wheels = by_twist @ wheels * sigmas
        x, y, heading = self.mean.tolist()
        self.mean = np.array(arc(x, y, heading, v, omega, dt))
        self.covariance = (
            by_pose @ self.covariance @ by_pose.T + by_wheels @ by_wheels.T
        )

    def correct(self, position: Array, sigma: float) -> None:
        """Correct by a measured position (2,) of standard deviation ``sigma``, m."""
        p = self.covariance
        gain = np.linalg.solve(p[:2, :2] + sigma**2 * np.eye(2), p[:2]).T
        self.mean = self.mean + gain @ (position - self.mean[:2])
        # Joseph's form stays symmetric and positive; (I − KH) P does not, for rounding.
        keep = np.eye(3) - gain @ np.eye(2, 3)
        self.covariance = keep @ p @ keep.T + sigma**2 * gain @ gain.T


def arc_jacobians(
    heading: float, v: float, omega: float, dt: float
) -> tuple[Array, Array]:
    """Return the derivatives of :func:`~qpavoid.model.kinematics.arc`.

    Returns:
        (3, 3) by the pose x, y, γ and (3, 2) by the twist v, ω.
    """
    half = 0.5 * omega * dt
    # Both quotients suffer from cancellation; the series are accurate to 1e-9.
    if abs(half) < STRAIGHT:
        sinc, slope = 1.0 - half * half / 6.0, -half / 3.0
    else:
        sinc = math.sin(half) / half
        slope = (math.cos(half) - sinc) / half
    cos, sin = math.cos(heading + half), math.sin(heading + half)
    chord = v * dt * sinc
    by_pose = np.array([(1.0, 0.0, -chord * sin), (0.0, 1.0, chord * cos), (0, 0, 1.0)])
    bend = 0.5 * v * dt * dt
    by_twist = np.array(
        [
            (dt * sinc * cos, bend * (slope * cos - sinc * sin)),
            (dt * sinc * sin, bend * (slope * sin + sinc * cos)),
            (0.0, dt),
        ]
    )
    return by_pose, by_twist
