"""A robot: its footprint and the limits of its twist."""

import math
from dataclasses import dataclass

from qpavoid.errors import InvalidInputError
from qpavoid.model.footprint import Footprint


@dataclass(frozen=True)
class Limits:
    """The box of twists that the actuators can drive. ``inf`` means no limit.

    Attributes:
        v_min: Least forward speed, m/s; at most 0 (standing still is always allowed).
        v_max: Greatest forward speed, m/s; at least 0.
        omega_min: Least yaw rate, rad/s; at most 0.
        omega_max: Greatest yaw rate, rad/s; at least 0.

    Raises:
        InvalidInputError: The box does not hold the zero twist, or is not a number.
    """

    v_min: float
    v_max: float
    omega_min: float
    omega_max: float

    def __post_init__(self) -> None:
        for low, high in (("v_min", "v_max"), ("omega_min", "omega_max")):
            if not getattr(self, low) <= 0.0 <= getattr(self, high):
                raise InvalidInputError(
                    f"limits must hold {low} <= 0 <= {high}, "
                    f"not {getattr(self, low)} and {getattr(self, high)}"
                )
        if self.v_min == self.v_max and self.omega_min == self.omega_max:
            raise InvalidInputError("limits leave no twist but zero")

    @classmethod
    def symmetric(cls, v_max: float, omega_max: float) -> "Limits":
        """Return |v| ≤ v_max (m/s), |ω| ≤ omega_max (rad/s)."""
        return cls(-v_max, v_max, -omega_max, omega_max)

    def clip(self, v: float, omega: float) -> tuple[float, float]:
        """Return the twist with each component moved into its limits."""
        return (
            min(max(v, self.v_min), self.v_max),
            min(max(omega, self.omega_min), self.omega_max),
        )


@dataclass(frozen=True)
class Robot:
    """A differential-drive robot.

    Attributes:
        name: What tables and figures call it.
        footprint: Its outline in the robot frame.
        limits: Its actuator limits, the same for every controller.
    """

    name: str
    footprint: Footprint
    limits: Limits

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
