"""The settings of the guide, and what their compiled functions take."""

from dataclasses import dataclass, fields
from typing import Annotated, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.guide.geodesic import CELL
from qpavoid.guide.room import inner_radius
from qpavoid.model.robot import Robot
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, SHARE, Range, check, want
from qpavoid.types import Record

BACK_SPEED = 0.2
"""m/s of backing out; cut to the robot's limit."""

MOST_REACH = 20.0
"""m."""


@dataclass(frozen=True)
class GuideSettings:
    """Settings of the guide: of its way round a stall, and of what it weighs.

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
        horizon: s that are looked ahead.
        soft: m beyond r_min within which being near costs.
        near: What being 1 m too near costs, a tick.
        deep: What 1 m within r_min costs, a tick.
        enter: m²; what it costs to go there at once.
        heading: m²; weight of 1 − cos of the heading error.
        hysteresis: Share by which something else must be cheaper to be taken up.
        preference: The same for tracking, which is left for what is so much cheaper.
        clear: m of room on its whole way with which a goal at rest is tracked.

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
    reach: Annotated[float, "m", Range(ge=2.0, le=MOST_REACH)] = 6.0
    interval: Annotated[float, "s", POSITIVE] = 0.5
    horizon: Annotated[float, "s", Range(gt=0.0, le=10.0)] = 3.0
    soft: Annotated[float, "m", POSITIVE] = 0.15
    near: Annotated[float, NOT_NEGATIVE] = 20.0
    deep: Annotated[float, "m", NOT_NEGATIVE] = 100.0
    enter: Annotated[float, "m2", NOT_NEGATIVE] = 2.0
    heading: Annotated[float, "m2", NOT_NEGATIVE] = 0.1
    hysteresis: Annotated[float, SHARE] = 0.1
    preference: Annotated[float, SHARE] = 0.05
    clear: Annotated[float, "m", NOT_NEGATIVE] = 0.03

    def __post_init__(self) -> None:
        check(self, "a guide wants")
        longer = self.stall_time < self.blocked_time
        want(longer, "a guide wants stall_time < blocked_time")

    def record(self, robot: Robot, radius: SafetyRadius) -> npt.NDArray[np.void]:
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
        want(drives, "a guide wants a robot that drives and turns")
        return np.array([tuple(values[n] for n in RECORD.names or ())], dtype=RECORD)


RECORD = np.dtype(
    [
        *((item.name, np.float64) for item in fields(SafetyRadius)),
        *((item.name, np.float64) for item in fields(GuideSettings)),
        ("back_speed", np.float64),
        ("inner", np.float64),
    ]
)
"""All that the compiled functions want to know, as one record."""

Settings: TypeAlias = Annotated[npt.NDArray[np.void], Record("guide_settings", RECORD)]
"""One of them, as :meth:`GuideSettings.record` returns it."""
