"""The settings of the detour stage, and what its compiled functions take of them."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.errors import InvalidInputError
from qpavoid.guide.room import inner_radius
from qpavoid.guide.way import CELL
from qpavoid.model.robot import Robot

RECORD = np.dtype(
    [
        (name, np.float64)
        for name in (
            "stall_time",
            "progress",
            "blocked_time",
            "tolerance",
            "speed",
            "turn_rate",
            "clearance",
            "reach",
            "interval",
            "back_speed",
            "inner",
            "low",
            "high",
            "speed_low",
            "speed_high",
        )
    ]
)
"""All that the compiled functions want to know, as one record."""

Settings: TypeAlias = npt.NDArray[np.void]

BACK_SPEED = 0.2
"""m/s of backing out; cut to the robot's limit."""


@dataclass(frozen=True)
class DetourSettings:
    """Settings of the stage.

    Attributes:
        stall_time: s without progress that count as a stall.
        progress: m; coming so far is progress.
        blocked_time: s without progress after which the stage says ``blocked``.
        tolerance: m and rad; nearer to the reference than this nothing is a stall.
        speed: m/s on a way round; cut to the robot's limit.
        turn_rate: rad/s on a way round; cut to the robot's limit.
        clearance: m beyond r_min that a way keeps.
        reach: m; half the side of the square, around the robot, that is searched.
        interval: s between two looks at the obstacles while stalled or on a way round;
            a search that failed is repeated after twice that.

    Raises:
        InvalidInputError: Not positive (clearance may be 0), blocked_time not more than
            stall_time, or reach more than 20 m.
    """

    stall_time: float = 2.0
    progress: float = 0.15
    blocked_time: float = 10.0
    tolerance: float = 0.05
    speed: float = 0.7
    turn_rate: float = 1.0
    clearance: float = 0.01
    reach: float = 6.0
    interval: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (0.0 < value < math.inf or (name == "clearance" and value == 0.0)):
                raise InvalidInputError(f"a detour wants {name} > 0")
        if not self.stall_time < self.blocked_time:
            raise InvalidInputError("a detour wants stall_time < blocked_time")
        if not 2.0 <= self.reach <= 20.0:
            raise InvalidInputError("a detour wants reach from 2 to 20 m")

    def record(self, robot: Robot, radius: SafetyRadius) -> Settings:
        """Return settings, safety radius and robot as an array of one RECORD."""
        limits = robot.limits
        values = {
            **vars(radius),
            **vars(self),
            "reach": CELL * round(self.reach / CELL),
            "speed": min(self.speed, limits.v_max),
            "turn_rate": min(self.turn_rate, limits.omega_max, -limits.omega_min),
            "back_speed": min(BACK_SPEED, -limits.v_min),
            "inner": inner_radius(robot.footprint),
        }
        if not min(values["speed"], values["turn_rate"]) > 0.0:
            raise InvalidInputError("a detour wants a robot that drives and turns")
        record = np.zeros(1, dtype=RECORD)
        for name in RECORD.names or ():
            record[name] = values[name]
        return record
