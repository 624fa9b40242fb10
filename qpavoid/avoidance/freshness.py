"""Freshness of inputs: ages, order, and a latch for faults.

Every input carries the stamp of its measurement. Its age at a time ``now`` of the same
clock, and at a time ``steady`` of a monotonic clock, is

    max(now − stamp, steady − arrival),

which grows if a sensor is silent, repeats its stamps, or its clock stops. An input that
is older than its limit, from the future, never seen, or blind is a :class:`Fault`; the
robot then brakes, and drives again only when a :class:`Latch` allows it. "No data" is
never "no obstacles".
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from qpavoid.model.robot import RELATIVE_ROUNDING
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, SHARE, Range, check


class Fault(StrEnum):
    """Reason why an input is rejected."""

    NEVER = "never seen"
    STALE = "stale"
    FUTURE = "future"
    UNORDERED = "unordered"
    UNSTAMPED = "unstamped"
    JUMPED = "jumped"
    IMPLAUSIBLE = "implausible"
    BLIND = "blind"
    INVALID = "invalid"

    @property
    def sentence(self) -> str:
        """Description of the fault, one sentence."""
        return SENTENCES[self]


SENTENCES = {
    Fault.NEVER: "Nothing has been received yet.",
    Fault.STALE: "The last message is too old.",
    Fault.FUTURE: "Its stamps lie in the future.",
    Fault.UNORDERED: "Its stamps do not increase; the last valid message is too old.",
    Fault.UNSTAMPED: "Earlier steps had stamps, and this one has none.",
    Fault.JUMPED: "It is farther from the last pose than the robot can have moved.",
    Fault.IMPLAUSIBLE: "Its twist fits neither its poses nor the robot's limits.",
    Fault.BLIND: "Too few of its beams are valid, or all are equal.",
    Fault.INVALID: "It cannot be read.",
}


@dataclass(frozen=True)
class Freshness:
    """Greatest ages of inputs, and when a fault ends.

    Attributes:
        points: Greatest age of sensed points, s.
        discs: Of tracked obstacles, s.
        odometry: Of odometry, s.
        command: Of the desired twist, s; an older one is replaced by standing still,
            which is no fault.
        future: Tolerance of a stamp ahead of the clock, s.
        valid: Least share of known beams: echoes, or free.
        good: s without a fault before the robot drives again; ``inf``: only after
            :meth:`Latch.acknowledge`.
    """

    points: Annotated[float, "s", POSITIVE] = 0.2
    discs: Annotated[float, "s", POSITIVE] = 0.5
    odometry: Annotated[float, "s", POSITIVE] = 0.1
    command: Annotated[float, "s", POSITIVE] = 0.5
    future: Annotated[float, "s", NOT_NEGATIVE] = 0.05
    valid: Annotated[float, SHARE] = 0.5
    good: Annotated[float, "s", Range(ge=0.0)] = 0.5

    def __post_init__(self) -> None:
        check(self, "freshness needs")

    def good_steps(self, dt: float) -> float:
        """Return the number of good steps of ``dt`` (s) after which a latch opens."""
        if self.good == math.inf:
            return math.inf
        return math.ceil(self.good / dt - RELATIVE_ROUNDING)


class InputWatch:
    """Monitor of the stamps of one input.

    Args:
        oldest: Greatest age, s.
        future: Tolerance of a stamp ahead of the clock, s.

    Attributes:
        stamp: Of the newest accepted message, s; ``-inf``: none.
        refused: Number of rejected messages, by reason.
    """

    def __init__(self, oldest: float, future: float) -> None:
        self.oldest, self.future = oldest, future
        self.stamp, self.refused = -math.inf, dict.fromkeys(Fault, 0)
        self._arrival = -math.inf
        self._last: Fault | None = None
        self._content: Fault | None = None

    def receive(self, stamp: float, now: float, steady: float) -> Fault | None:
        """Register a message; return the reason if it is rejected, else None.

        A stamp that is not later than the last one is rejected: a repeated, late or
        overtaken message. If the clock itself has gone back behind the last stamp, that
        stamp is reset.

        Args:
            stamp: Time of measurement, s.
            now: Time of the same clock, s.
            steady: Time of a monotonic clock, s.
        """
        # The clock was set back: no later stamp would be accepted.
        if self.stamp > now + self.future:
            self.stamp = -math.inf
        if not (math.isfinite(stamp) and math.isfinite(now)):
            return self._refuse(Fault.INVALID)
        if stamp > now + self.future:
            return self._refuse(Fault.FUTURE)
        if stamp <= self.stamp:
            return self._refuse(Fault.UNORDERED)
        self.stamp, self._arrival = stamp, steady
        self._last = self._content = None
        return None

    def judge(self, fault: Fault) -> Fault:
        """Mark the newest message as blind or invalid: a fault until the next one."""
        self.refused[fault] += 1
        self._content = fault
        return fault

    @property
    def is_blind(self) -> bool:
        """Whether the newest message was judged blind."""
        return self._content is Fault.BLIND

    def _refuse(self, fault: Fault) -> Fault:
        self.refused[fault] += 1
        self._last = fault
        return fault

    def age(self, now: float, steady: float) -> float:
        """Return the age of the newest accepted message, s, at least 0."""
        # By both clocks: a stamp may be wrong.
        return max(now - self.stamp, steady - self._arrival, 0.0)

    def fault(self, now: float, steady: float) -> Fault | None:
        """Return the present fault, or None.

        A rejected message is no fault as long as the last valid one is fresh.
        """
        if self.stamp > now + self.future:
            return Fault.FUTURE
        if self._content is not None:
            return self._content
        if self.age(now, steady) <= self.oldest:
            return None
        if self._last is not None:
            return self._last
        return Fault.NEVER if self.stamp == -math.inf else Fault.STALE


class Latch:
    """Interlock: closed by a fault; opened by k good steps in a row, or by hand.

    Args:
        steps: k; ``inf``: only by hand.
        is_open: Initial state.
    """

    def __init__(self, steps: float, is_open: bool = False) -> None:
        self.steps, self._good, self._open = steps, 0, is_open

    def step(self, faults: Mapping[str, Fault]) -> bool:
        """Return whether the robot may drive in this step; faults by input."""
        self._good = 0 if faults else self._good + 1
        self._open = not faults and (self._open or self._good >= self.steps)
        return self._open

    def acknowledge(self) -> None:
        """Open it if the last step was good; a later fault closes it again."""
        self._open = self._open or self._good > 0

    @property
    def is_open(self) -> bool:
        """Whether the robot may drive after the last step."""
        return self._open
