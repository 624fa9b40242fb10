"""Station keeping: a law that corrects a lateral error at rest; Eq. 6 cannot.

In polar coordinates of the goal, ρ its distance, α its bearing from the robot's heading
and θ the bearing of the line of sight from the goal's heading, the law of [Aicardi1995]

    v = k_ρ ρ cos α,   ω = k_α α + k_ρ cos α (sin α / α)(α + k_θ θ)

brings all three to zero. Driving backwards, α and θ are measured from the rear. The
twist is scaled into the limits, which keeps its curvature and the path.
"""

import math
from dataclasses import astuple, dataclass
from typing import Annotated, NamedTuple

import numpy as np

from qpavoid.compiled import compiled, entry
from qpavoid.model.kinematics import wrap_angle
from qpavoid.model.robot import Limits, RobotLimits, limits_of
from qpavoid.settings import POSITIVE, check, want
from qpavoid.tracking.kanayama import Gains, Reference, Track, kanayama, tracking_error
from qpavoid.types import Array, LimitVector, Pose, Sizes, Twist, Vector

RESTING, FORWARDS, BACKWARDS = 0, 1, -1

STRAIGHT_AHEAD = 1e-6
"""rad; bearing below which sin α/α is 1, but for 2e-13."""

RELUCTANCE = 1.0
"""rad of |α| + |θ|; hysteresis of the driving direction."""


@dataclass(frozen=True)
class StationKeeping:
    """Settings of the law.

    Attributes:
        k_rho: Gain of the distance, 1/s.
        k_alpha: Gain of the bearing of the goal, 1/s.
        k_theta: Gain of the heading that is still to be turned.
        rest: m; distance below which the robot only turns, which keeps its position.
        wake: m; distance above which it drives again; more than ``rest`` as
            hysteresis.
        blend_speed: m/s; from this reference speed down to rest Eq. 6 is blended into
            this law.

    Raises:
        InvalidInputError: Not positive, or wake is not more than rest.
    """

    k_rho: Annotated[float, "per_s", POSITIVE] = 1.0
    k_alpha: Annotated[float, "per_s", POSITIVE] = 4.0
    k_theta: Annotated[float, POSITIVE] = 2.0
    rest: Annotated[float, "m", POSITIVE] = 0.003
    wake: Annotated[float, "m", POSITIVE] = 0.008
    blend_speed: Annotated[float, "mps", POSITIVE] = 0.05

    def __post_init__(self) -> None:
        check(self, "station keeping needs")
        want(self.rest < self.wake, "station keeping needs rest < wake")


class TrackingLaw(NamedTuple):
    """Gains of Eq. 6, and settings of the law at rest.

    Attributes:
        moving: k_x (1/s), k_y (rad/m²), k_γ (rad/s) of Eq. 6.
        resting: k_ρ (1/s), k_α (1/s), k_θ (1).
        rest: m.
        wake: m.
        blend_speed: m/s.
    """

    moving: tuple[float, float, float]
    resting: tuple[float, float, float]
    rest: float
    wake: float
    blend_speed: float


@compiled
def law_of(law: Array) -> TrackingLaw:
    """Return :attr:`Tracker.array` as a record."""
    moving, resting = (law[0], law[1], law[2]), (law[3], law[4], law[5])
    return TrackingLaw(moving, resting, law[6], law[7], law[8])


@compiled
def station_command(
    error: Pose,
    gains: tuple[float, float, float],
    near: float,
    reverse: bool,
    mode: int,
) -> tuple[float, float, int]:
    """Return (v, ω) towards a pose, without limits, and the next mode.

    Args:
        error: Goal in the robot frame, m, m, rad.
        gains: k_ρ (1/s), k_α (1/s), k_θ (1).
        near: Distance, m, below which only the heading is corrected.
        reverse: Whether the robot can drive backwards.
        mode: Last mode: RESTING, FORWARDS or BACKWARDS.
    """
    (e_x, e_y, e_gamma), (k_rho, k_alpha, k_theta) = error, gains
    rho = math.sqrt(e_x * e_x + e_y * e_y)
    if rho < near:
        return 0.0, k_alpha * e_gamma, RESTING
    alpha = math.atan2(e_y, e_x)
    theta = wrap_angle(alpha - e_gamma)
    # From the rear, the bearings are those of a robot that faces the other way.
    alpha_back, theta_back = wrap_angle(alpha + math.pi), wrap_angle(theta + math.pi)
    better_back = abs(alpha) + abs(theta) - abs(alpha_back) - abs(theta_back)
    if not reverse:
        mode = FORWARDS
    elif mode == RESTING:
        mode = BACKWARDS if better_back > 0.0 else FORWARDS
    # `mode` is the sign of the direction driven: by RELUCTANCE the other is better.
    elif better_back * mode > RELUCTANCE:
        mode = -mode
    if mode == BACKWARDS:
        alpha, theta = alpha_back, theta_back
    sinc = math.sin(alpha) / alpha if abs(alpha) > STRAIGHT_AHEAD else 1.0
    # Without reverse the robot turns on the spot towards a goal behind it.
    cos = math.cos(alpha) if reverse else max(math.cos(alpha), 0.0)
    omega = k_alpha * alpha + k_rho * cos * sinc * (alpha + k_theta * theta)
    return mode * k_rho * rho * cos, omega, mode


@compiled
def within_limits(v: float, omega: float, limits: RobotLimits) -> Twist:
    """Return the twist scaled into the limits; its curvature is kept."""
    scale = 1.0
    bound = limits.v_max if v > 0.0 else -limits.v_min
    if abs(v) > bound:
        scale = bound / abs(v)
    bound = limits.omega_max if omega > 0.0 else -limits.omega_min
    if abs(omega) * scale > bound:
        scale = bound / abs(omega)
    return scale * v, scale * omega


@entry
@compiled
def track_step(
    law: Annotated[Vector, Sizes(9)],
    robot: LimitVector,
    pose: Pose,
    reference: Reference,
    mode: int,
) -> tuple[float, float, int]:
    """Return the desired (v, ω) of one control step, and the next mode.

    Eq. 6 while the reference moves; from ``blend_speed`` down to rest it is blended
    into the station law.

    Args:
        law: :attr:`Tracker.array`; with ``blend_speed`` 0 Eq. 6 alone.
        robot: :attr:`qpavoid.model.robot.Robot.limit_vector`.
        pose: World frame.
        reference: World frame.
        mode: Last mode: RESTING, FORWARDS or BACKWARDS.
    """
    limits, record = limits_of(robot), law_of(law)
    x_r, y_r, heading_r, v_r, omega_r = reference
    error = tracking_error(pose, (x_r, y_r, heading_r))
    moving_v, moving_omega = kanayama(error, (v_r, omega_r), record.moving)
    if abs(v_r) >= record.blend_speed:
        return moving_v, moving_omega, RESTING
    # Hysteresis: resting until `wake`, driving until `rest`.
    near, reverse = record.wake if mode == RESTING else record.rest, limits.v_min < 0.0
    v, omega, mode = station_command(error, record.resting, near, reverse, mode)
    v, omega = within_limits(v, omega, limits)
    share = abs(v_r) / record.blend_speed
    share = share * share * (3.0 - 2.0 * share)
    v, omega = (1.0 - share) * v, (1.0 - share) * omega
    return share * moving_v + v, share * moving_omega + omega, mode


@dataclass(frozen=True)
class Tracker:
    """Eq. 6 while the reference moves; at rest the station law, if there is one.

    Attributes:
        gains: Of Eq. 6.
        station: Of the law at rest; None: Eq. 6 alone, as in the paper.
        limits: Of the robot.
    """

    gains: Gains
    station: StationKeeping | None
    limits: Limits

    @property
    def array(self) -> Array:
        """(9,) gains and settings in the order of their fields; zeros for no law."""
        resting = astuple(self.station) if self.station else [0.0] * 6
        return np.array([*astuple(self.gains), *resting])

    def start(self) -> Track:
        """Return the tracking law of a new run; its state is the driving direction."""
        law, mode = self.array, RESTING
        limits = np.array([*self.limits.numbers, 0.0])  # no circumradius is needed

        def track(pose: Pose, reference: Reference) -> Twist:
            nonlocal mode
            v, omega, mode = track_step(law, limits, pose, reference, mode)
            return v, omega

        return track
