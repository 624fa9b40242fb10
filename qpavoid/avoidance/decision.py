"""The decision of a control step: a twist, and a status with its sentence."""

from enum import StrEnum
from typing import NamedTuple


class Status(StrEnum):
    """Reason for the twist of a step."""

    TRACKING = "tracking"
    FILTERED = "filtered"
    RELAXED = "relaxed"
    STOPPED = "stopped"
    REPELLED = "repelled"
    SINGULAR = "singular"
    BRAKING = "braking"
    HOLDING = "holding"
    BLOCKED = "blocked"
    STEERED = "steered"
    PLANNED = "planned"
    INVALID = "invalid"

    @property
    def number(self) -> int:
        """Index in :data:`STATUSES`."""
        return STATUSES.index(self)

    @property
    def sentence(self) -> str:
        """Description of the status, one sentence."""
        return SENTENCES[self]


SENTENCES = {
    Status.TRACKING: "The desired twist is admissible and is driven unchanged.",
    Status.FILTERED: (
        "The nearest twist that the obstacles and the limits allow is driven."
    ),
    Status.RELAXED: (
        "No admissible twist keeps all required distances; the one with the least "
        "violation is driven."
    ),
    Status.STOPPED: (
        "The solver's answer failed its check; a plan without it is driven, or the "
        "robot brakes."
    ),
    Status.REPELLED: "The repulsive velocity is added to the desired twist.",
    Status.SINGULAR: (
        "The law is singular at this contact; the repulsion is left out."
    ),
    Status.BRAKING: (
        "No safe twist was found; the robot brakes at full deceleration along its arc."
    ),
    Status.BLOCKED: "No path was found; the robot holds and needs a new plan.",
    Status.STEERED: "The method drives a twist of its own instead of the desired one.",
    Status.PLANNED: (
        "The last plan, or one of two twists, is driven instead of a QP solution; it "
        "keeps the required distances."
    ),
    Status.HOLDING: ("No other motion is known to be safe; the robot holds still."),
    Status.INVALID: (
        "Sensor data are invalid or stale; the robot stops clear of the last known "
        "static obstacles."
    ),
}
STATUSES = tuple(Status)
"""All statuses, by the number that compiled functions return."""

(
    TRACKING,
    FILTERED,
    RELAXED,
    STOPPED,
    REPELLED,
    SINGULAR,
    BRAKING,
    HOLDING,
    BLOCKED,
    STEERED,
    PLANNED,
) = range(11)
INVALID = -1
"""Code of compiled functions for invalid input; not a status."""


class Decision(NamedTuple):
    """Twist of a step, with its status and checks.

    Attributes:
        v: Forward speed, m/s.
        omega: Yaw rate, rad/s.
        status: Reason; ``status.sentence`` describes it.
        clearance: Signed distance to the nearest obstacle, m; ``inf`` without any.
        slack: Violation that had to be allowed, m/s; 0 unless relaxed.
        residual: Greatest residual of the certificate; 0 without a QP.
        active: Numbers of the obstacles with active constraints: points, discs, walls,
            polygons.
        solve_time_s: Wall time of the whole call, s.
        shortfall: Greatest predicted violation of r_min, m; 0: none. Of moving
            obstacles within
            :attr:`qpavoid.avoidance.filter.SafetyFilter.foreseen`, of static ones only
            what exceeds their present violation.
        lateral: Speed to the left, m/s; 0 but for an omnidirectional base.
        problem: Fault, a sentence; empty: none. With ``invalid`` always set, and then
            the clearance is NaN.
    """

    v: float
    omega: float
    status: Status
    clearance: float
    slack: float
    residual: float
    active: tuple[int, ...]
    solve_time_s: float
    shortfall: float = 0.0
    lateral: float = 0.0
    problem: str = ""
