"""The settings of the detour stage, and what its compiled functions take of them."""

from dataclasses import dataclass, fields
from typing import Annotated, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.guide.room import inner_radius
from qpavoid.guide.way import CELL
from qpavoid.model.robot import Robot
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, Range, check, want

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
        InvalidInputError: Not in its range, or blocked_time not more than stall_time.
    """

    stall_time: Annotated[float, "s", POSITIVE] = 2.0
    progress: Annotated[float, "m", POSITIVE] = 0.15
    blocked_time: Annotated[float, "s", POSITIVE] = 10.0
    tolerance: Annotated[float, "m", POSITIVE] = 0.05
    speed: Annotated[float, "mps", POSITIVE] = 0.7
    turn_rate: Annotated[float, "radps", POSITIVE] = 1.0
    clearance: Annotated[float, "m", NOT_NEGATIVE] = 0.01
    reach: Annotated[float, "m", Range(ge=2.0, le=20.0, allow_inf_nan=False)] = 6.0
    interval: Annotated[float, "s", POSITIVE] = 0.5

    def __post_init__(self) -> None:
        check(self, "a detour wants")
        longer = self.stall_time < self.blocked_time
        want(longer, "a detour wants stall_time < blocked_time")

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
        drives = min(values["speed"], values["turn_rate"]) > 0.0
        want(drives, "a detour wants a robot that drives and turns")
        return np.array([tuple(values.values())], dtype=RECORD)


RECORD = np.dtype(
    [
        *((item.name, np.float64) for item in fields(SafetyRadius)),
        *((item.name, np.float64) for item in fields(DetourSettings)),
        ("back_speed", np.float64),
        ("inner", np.float64),
    ]
)
"""All that the compiled functions want to know, as one record."""
