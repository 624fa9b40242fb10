"""Reference that waits: the path's clock slows down for a delayed robot.

The path is followed at its own progress s, in s, with ds/dt = ρ in [0, 1]. Its twist
becomes ρ v_r and ρ ω_r, so the reference stays the motion of a unicycle, only slower. ρ
depends on the lag alone, the distance to the reference along the reference's heading: a
robot beside its reference, or ahead of it, does not slow it.

The clock cannot stop for good. With ``least_rate`` above 0 it never stops: an obstacle
on the path needs the reference to pass it before the robot is drawn round it. With 0,
a robot that drives Eq. 6 catches up. For any ρ ≥ 0,
V = (e_x² + e_y²)/2 + (1 − cos e_γ)/k_y has V̇ = −k_x e_x² − (k_γ/k_y) sin² e_γ
[Kanayama1990], so |e_y| ≤ R with R² = 2 V(0). The lag is e_x cos e_γ + e_y sin e_γ;
where it exceeds ``free``, |e_x| > free/2 or |sin e_γ| > free/(2R), and V falls faster
than c = min(k_x, k_γ/(k_y R²)) free²/4: the total waiting time is at most V(0)/c.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, SHARE, check, want
from qpavoid.tracking.kanayama import Reference
from qpavoid.types import Array, Matrix, Pose, Sizes

Follow: TypeAlias = Callable[[Pose], tuple[Reference, float]]
"""Function from the robot's pose to the reference and its progress in control steps."""


@dataclass(frozen=True)
class Waiting:
    """Settings of the clock.

    After a delay T, Eq. 6 asks for at most v_r + k_x (wide + least_rate v_r T) instead
    of v_r + k_x v_r T.

    Attributes:
        free: m; up to this lag ρ = 1.
        wide: m; from this lag on ρ = ``least_rate``.
        least_rate: Least ρ, 0 to 1; with 1 the reference never waits.

    Raises:
        InvalidInputError: Not 0 ≤ free < wide, or least_rate not in [0, 1].
    """

    free: Annotated[float, "m", NOT_NEGATIVE] = 0.1
    wide: Annotated[float, "m", POSITIVE] = 0.4
    least_rate: Annotated[float, SHARE] = 0.05

    def __post_init__(self) -> None:
        check(self, "waiting needs")
        want(
            self.free < self.wide,
            f"waiting needs 0 <= free < wide, not {self.free:g} and {self.wide:g}",
        )

    @property
    def lags(self) -> tuple[float, float, float]:
        """Free, wide and least_rate, for the compiled functions."""
        return self.free, self.wide, self.least_rate

    def start(self, plan: Array, place: float = 0.0) -> Follow:
        """Return the clock of a new run along a plan (n, 5), one row per control step.

        It starts at ``place``, in rows.
        """
        lags = self.lags

        def follow(pose: Pose) -> tuple[Reference, float]:
            nonlocal place
            now = place
            reference, rate = waiting_reference(plan, now, pose, lags)
            place += rate
            return reference, now

        return follow


NEVER = Waiting(least_rate=1.0)
"""Clock that does not wait, as in the paper."""


@compiled
def progress_rate(lag: float, free: float, wide: float, least_rate: float) -> float:
    """Return ρ = ds/dt: 1 up to a lag of ``free`` m, least_rate from ``wide`` m on.

    In between ρ = ρ_0 + (1 − ρ_0)(3σ² − 2σ³) with ρ_0 the least rate and
    σ = (wide − lag)/(wide − free): smooth at both ends, never increasing.
    """
    if lag <= free:
        return 1.0
    if lag >= wide:
        return least_rate
    share = (wide - lag) / (wide - free)
    share = share * share * (3.0 - 2.0 * share)
    return min(least_rate + (1.0 - least_rate) * share, 1.0)


TimedPlan: TypeAlias = Annotated[Matrix, Sizes(2, 5)]
"""(n, 5): see :class:`Reference`, one row per control step."""


LAST_ROW = 1e9
"""Greatest row index of a plan."""


@entry
@compiled_once
def is_place(plan: TimedPlan, place: float) -> bool:
    """Return whether ``place`` is a valid row index; it may be beyond the last row."""
    return 0.0 <= place < LAST_ROW


@entry_if(is_place)
@compiled
def row_at(plan: TimedPlan, place: float) -> Reference:
    """Return the reference at a fractional row of a plan, by linear interpolation.

    Args:
        plan: (n, 5) x, y (m), γ (rad), v (m/s), ω (rad/s), one row per control step;
            n ≥ 2.
        place: In rows, at least 0; beyond the last one it is the last.
    """
    row = min(int(place), plan.shape[0] - 2)
    share = min(place - row, 1.0)
    old, a, b = 1.0 - share, plan[row], plan[row + 1]
    return Reference(
        old * a[0] + share * b[0],
        old * a[1] + share * b[1],
        old * a[2] + share * b[2],
        old * a[3] + share * b[3],
        old * a[4] + share * b[4],
    )


@entry_if(is_place)
@compiled
def waiting_reference(
    plan: TimedPlan, place: float, pose: Pose, lags: tuple[float, float, float]
) -> tuple[Reference, float]:
    """Return the reference, with the twist ρ v_r and ρ ω_r, and ρ.

    Args:
        plan: As :func:`row_at` takes it.
        place: Progress in control steps, at least 0. The next step's is place + ρ.
        pose: Of the robot, world frame.
        lags: As :attr:`Waiting.lags` gives them.
    """
    x_r, y_r, heading_r, v_r, omega_r = row_at(plan, place)
    lag = (x_r - pose[0]) * math.cos(heading_r) + (y_r - pose[1]) * math.sin(heading_r)
    rate = progress_rate(lag, lags[0], lags[1], lags[2])
    return Reference(x_r, y_r, heading_r, rate * v_r, rate * omega_r), rate
