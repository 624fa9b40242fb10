"""The settings of perception: the LiDARs of a robot, and what is known about bodies."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from qpavoid.settings import FINITE, NOT_NEGATIVE, POSITIVE, Range, check, want
from qpavoid.types import Pose

MOUNT = ("mount_x_m", "mount_y_m", "mount_heading_rad")
ROUND = Range(gt=0.0, le=2.0 * math.pi + 1e-9, allow_inf_nan=False)
ALL_ROUND = 2.0 * math.pi - 1e-6
"""rad; a wider view goes all round."""

SHORT = Range(ge=-1.0, le=1.0, allow_inf_nan=False)
STEEP = Range(ge=0.0, le=0.5, allow_inf_nan=False)

NoEcho = Literal["auto", "free", "unknown"]
"""Meaning of a beam without an echo."""


@dataclass(frozen=True)
class Lidar:
    """A planar LiDAR: beams from right to left, symmetric about its x axis.

    Attributes:
        field_of_view: rad between the first and the last beam; 2π: all round, where the
            last beam is one step before the first.
        mount: x, y (m), γ (rad) of the sensor in the robot frame.
        range_max: m; a beam without an echo is free to there.
        range_min: m; nearer echoes are unknown.
        sweep: s from the first to the last beam; negative: the last comes first.
        delay: s by which stamps are later than the first beam.
        no_echo: Meaning of a range of ``inf``: ``free``, as REP 117 says; ``unknown``,
            as with a cheap sensor that loses dark and oblique surfaces; ``auto``:
            free while at most 1 % of the echoes between two others are lost, in a scan
            with an echo beyond half of ``range_max``, or with few echoes.
        angle_error: rad; σ of a beam's direction in the map, from sensor and pose.

    Raises:
        InvalidInputError: A value is not in its range.
    """

    field_of_view: Annotated[float, "rad", ROUND] = 2.0 * math.pi
    mount: Annotated[Pose, FINITE, MOUNT] = (0.0, 0.0, 0.0)
    range_max: Annotated[float, "m", POSITIVE] = 10.0
    range_min: Annotated[float, "m", NOT_NEGATIVE] = 0.1
    sweep: Annotated[float, "s", SHORT] = 0.0
    delay: Annotated[float, "s", SHORT] = 0.0
    no_echo: NoEcho = "auto"
    angle_error: Annotated[float, "rad", STEEP] = 0.025

    def __post_init__(self) -> None:
        check(self, "a LiDAR needs")
        want(self.range_min < self.range_max, "a LiDAR needs range_min < range_max")

    @property
    def is_round(self) -> bool:
        """Whether the last beam is beside the first."""
        return self.field_of_view > ALL_ROUND

    def step(self, beams: int) -> float:
        """Return the angle between neighbouring beams of so many, rad."""
        return self.field_of_view / max(beams if self.is_round else beams - 1, 1)


@dataclass(frozen=True)
class PerceptionSettings:
    """Model of moving bodies, and the memory of obstacles out of view.

    Attributes:
        radius: Of a person, m; narrower bodies are found as well, wider ones become
            several discs.
        acceleration: White acceleration of bodies, m/s²: 1 for walkers, 3 for vehicles.
        memory: s for which a static obstacle is remembered after it left the view …
        memory_way: … or m that are driven, whichever is later.

    Raises:
        InvalidInputError: A value is not in its range.
    """

    radius: Annotated[float, "m", Range(gt=0.05, le=1.0)] = 0.25
    acceleration: Annotated[float, "mps2", Range(gt=0.0, le=100.0)] = 1.5
    memory: Annotated[float, "s", NOT_NEGATIVE] = 20.0
    memory_way: Annotated[float, "m", NOT_NEGATIVE] = 8.0

    def __post_init__(self) -> None:
        check(self, "perception needs")
