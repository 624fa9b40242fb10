"""The decision of a control step: a twist, and a status with its sentence."""

from enum import StrEnum
from typing import NamedTuple


class Status(StrEnum):
    """Why the twist is what it is."""

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
        """Its place in :data:`STATUSES`."""
        return STATUSES.index(self)

    @property
    def sentence(self) -> str:
        """The status in a sentence."""
        return SENTENCES[self]


SENTENCES = {
    Status.TRACKING: "The desired twist is admissible and is driven as it is.",
    Status.FILTERED: (
        "The nearest twist that the obstacles and the limits allow is driven."
    ),
    Status.RELAXED: (
        "No admissible twist keeps every obstacle at bay; the one with the least "
        "violation is driven."
    ),
    Status.STOPPED: "The solver gave no answer that holds; the robot brakes.",
    Status.REPELLED: "The repulsive velocity is added to the desired twist.",
    Status.SINGULAR: (
        "The law has no value at this contact; the repulsion is left out."
    ),
    Status.BRAKING: (
        "No answer leaves room to stop; the robot brakes at full deceleration along "
        "its arc."
    ),
    Status.BLOCKED: "No path was found; the robot holds and needs a new plan.",
    Status.STEERED: "The method drives a twist of its own instead of the desired one.",
    Status.PLANNED: (
        "No answer of the QP keeps its distance; a plan that does is driven."
    ),
    Status.HOLDING: (
        "Nothing else is known to keep its distance; the robot holds still."
    ),
    Status.INVALID: (
        "What is known may not be driven by; the robot stops among what stood when it "
        "was seen last."
    ),
}
STATUSES = tuple(Status)
"""By the number that the compiled functions return."""

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
"""What the compiled functions return of an input that is not valid: no status."""

AT_REST = 1e-3
"""m/s and rad/s; a robot that drives less stands."""


class Decision(NamedTuple):
    """The twist to drive, and what is known about it.

    Attributes:
        v: Forward speed, m/s.
        omega: Yaw rate, rad/s.
        status: Why; ``status.sentence`` says it in words.
        clearance: Signed distance to the nearest obstacle, m; ``inf`` without any.
        slack: Violation that had to be allowed, m/s; 0 unless relaxed.
        residual: Greatest residual of our own check of the answer; 0 without a QP.
        active: Numbers of the obstacles that hold the twist: points, discs, walls,
            polygons.
        solve_time_s: Wall time of the whole call, s.
        shortfall: By how much the plan of the twist undercuts r_min of what moves, as
            far as can be foreseen, m; 0: by nothing, within the time that
            :attr:`qpavoid.avoidance.filter.SafetyFilter.foreseen` says. Of what stands,
            where that is nearer than before; what is nearer than r_min already may stay
            so near.
        lateral: Speed to the left, m/s; 0 but for an omnidirectional base.
        problem: What was wrong, in a sentence; empty: nothing. Of ``invalid`` always,
            and then the clearance is NaN: nothing is known of it.
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


def blocked_if(decision: Decision, no_way: bool) -> Decision:
    """Return a decision as ``blocked`` where there is no way and the robot stands.

    What still rolls out is not blocked yet, whoever found that there is no way.
    """
    stands = max(abs(decision.v), abs(decision.omega)) < AT_REST
    return decision._replace(status=Status.BLOCKED) if no_way and stands else decision
