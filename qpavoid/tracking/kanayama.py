"""Tracking errors and the law of Kanayama, Eq. 6 [Kanayama1990]."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple, TypeAlias

from qpavoid.compiled import compiled, entry
from qpavoid.model.kinematics import wrap_angle
from qpavoid.settings import NOT_NEGATIVE, check
from qpavoid.types import Pose, Twist


class Reference(NamedTuple):
    """Reference pose and twist.

    Attributes:
        x: x_r, m.
        y: y_r, m.
        heading: γ_r, rad.
        v: v_r, m/s.
        omega: ω_r, rad/s.
    """

    x: float
    y: float
    heading: float
    v: float
    omega: float


Track: TypeAlias = Callable[[Pose, Reference], Twist]
"""Function from pose and reference to the desired twist."""


@dataclass(frozen=True)
class Gains:
    """The recovery parameters of Eq. 6.

    Attributes:
        k_x: Of the error along the robot, 1/s.
        k_y: Of the error across it, rad/m².
        k_gamma: Of the sine of the error in heading, rad/s.
    """

    k_x: Annotated[float, "per_s", NOT_NEGATIVE] = 1.0
    k_y: Annotated[float, "rad_per_m2", NOT_NEGATIVE] = 1.0
    k_gamma: Annotated[float, "radps", NOT_NEGATIVE] = 2.0

    def __post_init__(self) -> None:
        check(self, "gains need")


@entry
@compiled
def tracking_error(pose: Pose, target: Pose) -> Pose:
    """Return e = R(γ)ᵀ(x_r − x) in m, robot frame, and e_γ in (−π, π] rad."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    d_x, d_y = target[0] - pose[0], target[1] - pose[1]
    e_heading = wrap_angle(target[2] - pose[2])
    return cos * d_x + sin * d_y, cos * d_y - sin * d_x, e_heading


@entry
@compiled
def kanayama(error: Pose, reference: Twist, gains: tuple[float, float, float]) -> Twist:
    """Return v_f of Eq. 6, m/s and rad/s, for gains k_x, k_y, k_γ.

    v_f = v_r cos e_γ + k_x e_x and ω_f = ω_r + v_r k_y e_y + k_γ sin e_γ. With v_r = 0
    nothing corrects e_y: a displaced robot at rest keeps its lateral error.
    """
    (e_x, e_y, e_gamma), (v_r, omega_r), (k_x, k_y, k_gamma) = error, reference, gains
    return (
        v_r * math.cos(e_gamma) + k_x * e_x,
        omega_r + v_r * k_y * e_y + k_gamma * math.sin(e_gamma),
    )
