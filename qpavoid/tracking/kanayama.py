"""Tracking errors and the law of Kanayama, Eq. 6 [Kanayama1990]."""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Annotated, Protocol, TypeAlias

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import wrap_angle
from qpavoid.settings import NOT_NEGATIVE, check
from qpavoid.tracking.path import Pose

Reference: TypeAlias = tuple[float, float, float, float, float]
"""x_r, y_r (m), γ_r (rad), v_r (m/s), ω_r (rad/s)."""

Track: TypeAlias = Callable[[Pose, Reference], tuple[float, float]]
"""From pose and reference to the desired twist."""


class Tracker(Protocol):
    """A tracking law with its settings; it holds no state of any run."""

    @property
    def array(self) -> Array:
        """(9,) numbers, as :func:`qpavoid.tracking.station.track_step` takes them."""
        ...

    def start(self) -> Track:
        """Return the law of a new run."""
        ...


@dataclass(frozen=True)
class Gains:
    """The recovery parameters of Eq. 6.

    Attributes:
        k_x: 1/s.
        k_y: rad/m².
        k_gamma: rad/s.
    """

    k_x: Annotated[float, "per_s", NOT_NEGATIVE] = 1.0
    k_y: Annotated[float, "rad_per_m2", NOT_NEGATIVE] = 1.0
    k_gamma: Annotated[float, "radps", NOT_NEGATIVE] = 2.0

    def __post_init__(self) -> None:
        check(self, "gains want")


@compiled
def tracking_error(
    x: float, y: float, heading: float, x_r: float, y_r: float, heading_r: float
) -> tuple[float, float, float]:
    """Return e = R(γ)ᵀ(x_r − x) in m, robot frame, and e_γ in (−π, π] rad."""
    cos, sin = math.cos(heading), math.sin(heading)
    d_x, d_y = x_r - x, y_r - y
    e_heading = wrap_angle(heading_r - heading)
    return cos * d_x + sin * d_y, cos * d_y - sin * d_x, e_heading


@compiled
def kanayama(
    e_x: float,
    e_y: float,
    e_gamma: float,
    v_r: float,
    omega_r: float,
    k_x: float,
    k_y: float,
    k_gamma: float,
) -> tuple[float, float]:
    """Return v_f of Eq. 6, m/s and rad/s.

    v_f = v_r cos e_γ + k_x e_x and ω_f = ω_r + v_r k_y e_y + k_γ sin e_γ. With v_r = 0
    nothing corrects e_y: a parked robot that was pushed aside stays beside its place.
    """
    return (
        v_r * math.cos(e_gamma) + k_x * e_x,
        omega_r + v_r * k_y * e_y + k_gamma * math.sin(e_gamma),
    )


@dataclass(frozen=True)
class KanayamaTracker:
    """Eq. 6 and nothing else, as in the paper.

    Attributes:
        gains: k_x, k_y, k_γ.
    """

    gains: Gains

    @property
    def array(self) -> Array:
        """(9,) the gains, then zeros: no law at rest."""
        return np.array([*astuple(self.gains), *[0.0] * 6])

    def start(self) -> Track:
        """Return the law of a new run."""
        k_x, k_y, k_gamma = self.gains.k_x, self.gains.k_y, self.gains.k_gamma

        def track(pose: Pose, reference: Reference) -> tuple[float, float]:
            x_r, y_r, heading_r, v_r, omega_r = reference
            error = tracking_error(*pose, x_r, y_r, heading_r)
            return kanayama(*error, v_r, omega_r, k_x, k_y, k_gamma)

        return track
