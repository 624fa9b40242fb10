"""Outcome of a closed loop: numbers by name, and a word."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import BLOCKED, RELAXED
from qpavoid.model.kinematics import wrap_angle
from qpavoid.types import Array, Pose, Twist

if TYPE_CHECKING:
    from qpavoid.lab.simulation.log import Log

MEASURES = (
    *("arrived_s", "time_s", "min_clearance_m", "start_clearance_m", "contacts_moving"),
    *("min_room_m", "max_error_m", "final_error_m", "final_heading_error_rad"),
    *("changed_s", "relaxed_s", "blocked_s", "still_s", "length_m", "jerk_mps3"),
)
"""When the robot had arrived for good (inf: never), how long it ran, least clearance,
that at time 0, how many contacts began in a step in which it drove faster than
:data:`CRAWL`, least clearance less r_min(v_o), greatest distance from the reference,
last errors, time with a twist other than the desired one, relaxed, and blocked, for how
long it had not come :data:`PROGRESS` far at the end, how far it drove, to and fro, and
mean jerk (:func:`mean_jerk`)."""

Outcome: TypeAlias = dict[str, float]
""":data:`MEASURES` of a run."""

CRAWL = 0.01
"""m/s; a robot none of whose points is faster stands."""

PROGRESS = 0.1
"""m"""

STALLED = 5.0
"""s without having come :data:`PROGRESS` far at the end of a run."""

UNCHANGED = 1e-6
"""m/s and rad/s; greatest difference that is not counted as a change of the twist."""


def differs(free: Twist, twist: Twist) -> bool:
    """Return whether a twist is not what the robot would drive if it were alone."""
    return abs(twist[0] - free[0]) + abs(twist[1] - free[1]) > UNCHANGED


class Goal(NamedTuple):
    """Criterion of arrival.

    Attributes:
        pose: World frame.
        near: Error allowed, m.
        aligned: The same of the heading, rad.
    """

    pose: Pose
    near: float
    aligned: float

    def holds(self, pose: Pose) -> bool:
        """Return whether a pose has arrived, world frame."""
        (x, y, heading), (x_goal, y_goal, heading_goal) = pose, self.pose
        near = math.sqrt((x - x_goal) ** 2 + (y - y_goal) ** 2) <= self.near
        return near and abs(wrap_angle(heading - heading_goal)) <= self.aligned


def mean_jerk(v: Array, dt: float) -> float:
    """Return the mean of |v_{k+1} − 2 v_k + v_{k−1}| / dt², m/s³, of a run's speeds."""
    return float(np.abs(np.diff(v, 2)).mean() / dt**2) if len(v) > 2 else 0.0


def contacts_moving(least: Array, pace: Array) -> npt.NDArray[np.intp]:
    """Return the steps in which a contact began while the robot moved.

    Args:
        least: (n,) least clearance within each step, m.
        pace: (n,) of its fastest point, m/s.
    """
    # A contact begins where the step before had none; one that lasts counts once.
    touched = np.concatenate([[False], least < 0.0])
    return np.flatnonzero(touched[1:] & ~touched[:-1] & (pace > CRAWL))


def outcome_of(log: "Log") -> Outcome:
    """Return the outcome of a run from its log."""
    dt, times, status = log.meta["dt_s"], log["t_s"], log["status"]
    x, y = (np.append(log[key], log.final[i]) for i, key in enumerate(("x_m", "y_m")))
    heading = np.append(log["heading_rad"], log.final[2])[1:]
    goal, (near, aligned) = log.final_reference, log.meta["arrival"]
    error = np.hypot(x[1:] - goal[0], y[1:] - goal[1])
    heading_error = np.abs([wrap_angle(angle - goal[2]) for angle in heading])
    # Arrived means for good: from the last step on that was too far away.
    away = np.flatnonzero((error > near) | (heading_error > aligned))
    settled = int(away[-1]) + 1 if len(away) else 0
    mark, marked = (x[0], y[0]), 0.0
    for k in range(len(times)):
        # Progress is measured from the last mark, not from step to step: whoever sways
        # to and fro on the spot makes none.
        if (x[k + 1] - mark[0]) ** 2 + (y[k + 1] - mark[1]) ** 2 > PROGRESS**2:
            mark, marked = (x[k + 1], y[k + 1]), times[k]
    reach = np.hypot(*log.vertices.T).max()
    pace = np.maximum(np.abs(log["v_mps"]), np.hypot(np.diff(x), np.diff(y)) / dt)
    pace += np.abs(log["omega_radps"]) * reach
    off = np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"])
    row = (
        times[settled] + dt if settled < len(times) else math.inf,
        times[-1],
        log["least_clearance_m"].min(),
        log["clearance_m"][0],
        len(contacts_moving(log["least_clearance_m"], pace)),
        log["room_m"].min(),
        off.max(),
        error[-1],
        heading_error[-1],
        dt * log["changed"].sum(),
        dt * (status == RELAXED).sum(),
        dt * (status == BLOCKED).sum(),
        times[-1] - marked,
        dt * np.abs(log["v_mps"]).sum(),
        mean_jerk(log["v_mps"], dt),
    )
    return dict(zip(MEASURES, map(float, row), strict=True))


LEAST = {"min_clearance_m", "min_room_m", "start_clearance_m"}
"""Of these the worst is the least, of all others the greatest."""


def worst_of(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the worst of every number.

    Of several robots those that have arrived do not count as standing still.
    """
    worst = {k: (min if k in LEAST else max)(x[k] for x in outcomes) for k in MEASURES}
    if len(outcomes) > 1:
        lost = [x["still_s"] for x in outcomes if x["arrived_s"] == math.inf]
        worst["still_s"] = max(lost, default=0.0)
    return worst


def verdict(noted: Mapping[str, float]) -> str:
    """Return what became of a run in a word, the same wherever one is said.

    ``touched``: the footprint met an obstacle. Else ``arrived``: at the end it was
    within the scenario's tolerance of the goal. Else ``stalled``: for the last
    :data:`STALLED` seconds it had not come :data:`PROGRESS` far. Else ``off goal``.

    Args:
        noted: Outcome.
    """
    if noted["min_clearance_m"] < 0.0:
        return "touched"
    if math.isfinite(noted["arrived_s"]):
        return "arrived"
    return "stalled" if noted["still_s"] > STALLED else "off goal"


def finite(value: float) -> float | None:
    """Return a number; ``None`` for one that is not finite: it does not apply."""
    return float(value) if math.isfinite(value) else None
