"""Eq. 5 and Eq. 7 with settings of their own, whatever a scenario says of them."""

from dataclasses import dataclass, replace
from typing import ClassVar

from qpavoid.avoidance.controllers import RepulsionController, Step
from qpavoid.avoidance.settings import Activation, AvoidanceSettings, Repulsion
from qpavoid.model.robot import Robot


@dataclass(frozen=True)
class PaperEq5:
    """Eq. 5 with ẋ_0 of the paper, calibrated on the times that it states.

    Activation and damping are those of the configs ``paper/test_case_1`` and ``_2``:
    with them the zones are entered and left when the paper says.

    Attributes:
        robot: Footprint and limits.
        settings: Radii; the repulsion is the one below.
        speed: ẋ_0, m/s.
        activation: Of the repulsion, by the distance.
        damping: λ, m.
        zone_ratio: r / r_min.
    """

    law: ClassVar[int] = 5
    robot: Robot
    settings: AvoidanceSettings
    speed: float = 10.0
    activation: Activation = "smooth"
    damping: float = 0.05
    zone_ratio: float = 4.0 / 3.0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        settings = replace(
            self.settings,
            repulsion=Repulsion(self.speed, self.activation, self.damping),
            radius=replace(self.settings.radius, zone_ratio=self.zone_ratio),
        )
        return RepulsionController(self.law, self.robot, settings).start(v, omega)


@dataclass(frozen=True)
class PaperEq7(PaperEq5):
    """Eq. 7 with the same settings."""

    law: ClassVar[int] = 7


@dataclass(frozen=True)
class TunedEq5(PaperEq5):
    """Eq. 5 with all four settings searched on the training cases of the others."""

    activation: Activation = "linear"
    damping: float = 0.4
    zone_ratio: float = 1.2


@dataclass(frozen=True)
class TunedEq7(PaperEq7):
    """Eq. 7, searched as Eq. 5 is."""

    activation: Activation = "linear"
    zone_ratio: float = 1.2
