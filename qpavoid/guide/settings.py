"""Settings of the guide, and their record for compiled functions."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.guide.local_grid import CELL
from qpavoid.model.robot import Robot
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, SHARE, Range, check, want
from qpavoid.types import Record, record_type

MOST_REACH = 20.0
"""m; greatest ``reach``."""

SHORT_HORIZON = 0.5
"""s; greatest horizon of filter and guide among people who give way."""


@dataclass(frozen=True)
class GuideSettings:
    """Settings of the guide: detours after a stall, and scores of candidates.

    Attributes:
        stall_time: s without progress that count as a stall.
        progress: Motion that counts as progress, m.
        blocked_time: s without progress after which the stage reports ``blocked``.
        tolerance: m and rad; reference error below which there is no stall.
        speed: m/s on a detour; cut to the robot's limit.
        turn_rate: rad/s on a detour; cut to the robot's limit.
        clearance: Margin beyond r_min on a detour, m.
        reach: m; half the side of the searched square around the robot.
        interval: s between two checks of the obstacles while stalled or on a detour; a
            failed search is repeated after twice that.
        horizon: Of the rollouts, s.
        soft: Margin beyond r_min below which proximity costs, m.
        near: Cost per tick of a margin 1 m below ``soft``.
        deep: Cost per tick of 1 m within r_min.
        heading: m²; weight of 1 − cos of the heading error.
        hysteresis: Relative cost by which another candidate must be cheaper.
        clear: Margin on the whole path with which a goal at rest is tracked, m.
        yielding: Whether people give way to the robot. Guide and filter then take all
            obstacles to be at rest, and look at most 0.5 s ahead. Nothing is guaranteed
            against obstacles that move: only among people who see the robot.

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
    heading: Annotated[float, "m2", NOT_NEGATIVE] = 0.1
    hysteresis: Annotated[float, SHARE] = 0.1
    clear: Annotated[float, "m", NOT_NEGATIVE] = 0.03
    yielding: bool = False

    ORDERED: ClassVar = (("stall_time", "<", "blocked_time"),)

    def __post_init__(self) -> None:
        check(self, "a guide needs")

    def record(self, robot: Robot, radius: SafetyRadius) -> npt.NDArray[np.void]:
        """Return settings, safety radius and robot as an array of one RECORD."""
        limits = robot.limits
        values = {
            **vars(radius),
            **vars(self),
            "reach": CELL * round(self.reach / CELL),
            "speed": min(self.speed, limits.v_max),
            "turn_rate": min(self.turn_rate, limits.omega_max, -limits.omega_min),
            "inner": robot.footprint.inner_radius,
        }
        drives = min(values["speed"], values["turn_rate"]) > 0.0
        want(drives, "a guide needs a robot that drives and turns")
        return np.array([tuple(values[n] for n in RECORD.names or ())], dtype=RECORD)


RECORD = record_type(
    (name, np.float64)
    for name in (
        *(item.name for item in fields(SafetyRadius)),
        *(item.name for item in fields(GuideSettings) if item.name != "yielding"),
        "inner",
    )
)
"""All settings for compiled functions but ``yielding``, as one record."""

Settings: TypeAlias = Annotated[npt.NDArray[np.void], Record("guide_settings", RECORD)]
"""One of them, as :meth:`GuideSettings.record` returns it."""


def look_short(
    settings: AvoidanceSettings, guide: GuideSettings
) -> tuple[AvoidanceSettings, GuideSettings]:
    """Return settings of filter and guide, with ``yielding`` those of short horizons.

    These are at most :data:`SHORT_HORIZON`.
    """
    if not guide.yielding:
        return settings, guide
    ahead, still = settings.ahead, min(settings.ahead.horizon_still, SHORT_HORIZON)
    ahead = replace(
        ahead, horizon=min(ahead.horizon, SHORT_HORIZON), horizon_still=still
    )
    guide = replace(guide, horizon=min(guide.horizon, SHORT_HORIZON))
    return replace(settings, ahead=ahead), guide
