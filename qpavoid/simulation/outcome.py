"""What is noted of a closed loop: one row of :data:`OUTCOME`."""

import math

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import wrap_angle
from qpavoid.motion.tracking import Reference

OUTCOME = np.dtype(
    [
        ("clearance", np.float64),
        ("room", np.float64),
        ("deviation", np.float64),
        ("changed", np.float64),
        ("relaxed", np.float64),
        ("blocked", np.float64),
        ("arrived", np.float64),
        ("error", np.float64),
        ("heading_error", np.float64),
        ("still", np.float64),
        ("time", np.float64),
    ]
)
"""Least clearance (m), least clearance less r_min(v_o) (m), greatest distance from the
reference (m), seconds with a twist other than the desired one, relaxed, and blocked,
when it had arrived for good (s; inf: never), last errors (m, rad), for how long it had
not come a tenth of a metre far at the end, and how long it ran (s)."""

(
    CLEARANCE,
    ROOM,
    DEVIATION,
    CHANGED,
    RELAXED_TIME,
    BLOCKED_TIME,
    ARRIVED,
    ERROR,
    HEADING_ERROR,
    STILL,
    TIME,
) = range(11)

SETTLED = 1.0
"""s at the goal after which nothing more is expected to happen."""


@compiled
def is_over(time: float, quiet: float, outcome: Array) -> bool:
    """Return whether nothing more is expected to happen."""
    return bool(time > max(quiet, outcome[ARRIVED] + SETTLED))


@compiled
def note_arrival(
    outcome: Array, goal: Reference, x: float, y: float, heading: float, time: float
) -> None:
    """Write the errors at the goal, and since when they have been small enough."""
    error = math.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
    heading_error = abs(wrap_angle(heading - goal[2]))
    if error > goal[3] or heading_error > goal[4]:
        outcome[ARRIVED] = math.inf
    elif outcome[ARRIVED] == math.inf:
        outcome[ARRIVED] = time
    outcome[ERROR], outcome[HEADING_ERROR] = error, heading_error
