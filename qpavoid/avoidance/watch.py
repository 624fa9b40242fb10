"""Input monitor: checks stamps and ages before a control step and latches faults."""

import math
from collections.abc import Callable
from time import monotonic
from typing import Any, NamedTuple, TypeVar

from qpavoid.avoidance.freshness import Fault, Freshness, InputWatch, Latch
from qpavoid.avoidance.validation import as_age
from qpavoid.errors import InvalidInputError, QPAvoidError

T = TypeVar("T")

SEEN = ("points", "discs")
"""Inputs with obstacles; at least one of them is stamped."""

INPUTS = (*SEEN, "odometry")

WAITING = "Inputs are valid again; the robot waits until they have been for a while."

PROBLEM = "The caller of the filter reported a fault."


class Stamps(NamedTuple):
    """Times of measurement of a step's inputs.

    An input that was stamped once is required from then on, and a step without stamps
    is then a fault. A repeated stamp is the same measurement, older; an earlier one is
    a fault.

    Attributes:
        now: Time of the stamps' clock at the step, s.
        points: Of sensed points, walls and polygons, s; None: nothing new.
        discs: Of tracked discs, s.
        odometry: Of the twist ``driven``, s.
        valid: Share of known beams: echoes, or free; 0 to 1.
        steady: Time of a monotonic clock, s; None: the machine's. If it goes back, all
            inputs are forgotten.
    """

    now: float
    points: float | None = None
    discs: float | None = None
    odometry: float | None = None
    valid: float = 1.0
    steady: float | None = None


class StepWatch:
    """Monitor of a filter's inputs, step by step.

    Args:
        freshness: Greatest ages, and when a fault ends.
        dt: Control step, s.

    Attributes:
        faults: Number of faults, by input and reason.
    """

    def __init__(self, freshness: Freshness, dt: float) -> None:
        self.freshness, self.faults = freshness, dict[str, int]()
        self._latch = Latch(freshness.good_steps(dt), is_open=True)
        self._awaited: set[str] = set()
        self._forget()

    def _forget(self) -> None:
        """Reset the monitors of all inputs."""
        fresh, self._steady = self.freshness, -math.inf
        self._inputs = {
            name: InputWatch(getattr(fresh, name), fresh.future) for name in INPUTS
        }

    def age(self, stamps: Stamps | None, age: float) -> float:
        """Return the age of a step's obstacles, s.

        Args:
            stamps: Of the inputs; None: only the age is used.
            age: Given by the caller, s.

        Raises:
            FaultError: An input is rejected.
            InvalidInputError: A number is missing or not finite.
        """
        age, found = as_age(age), dict[str, Fault]()
        if stamps is not None:
            found = self._found(stamps)
        elif self._awaited:
            found = dict.fromkeys(self._awaited, Fault.UNSTAMPED)
        if age > self.freshness.points:
            found.setdefault("points", Fault.STALE)
        if found:
            raise FaultError(found)
        return max([age, *self._ages(stamps)])

    def _ages(self, stamps: Stamps | None) -> list[float]:
        if stamps is None:
            return []
        now, steady = stamps.now, _steady(stamps)
        seen = self._awaited.intersection(SEEN)
        return [self._inputs[name].age(now, steady) for name in seen]

    def _found(self, stamps: Stamps) -> dict[str, Fault]:
        """Register stamps; return the faults by input."""
        now, steady, found = stamps.now, _steady(stamps), dict[str, Fault]()
        told = {name for name in INPUTS if getattr(stamps, name) is not None}
        self._awaited |= told
        if not (math.isfinite(now) and math.isfinite(steady)):
            raise InvalidInputError("the time of a step must be finite")
        if stamps.valid < 0.0 or stamps.valid > 1.0:
            raise InvalidInputError("the share of valid beams must be 0 to 1")
        went_back, self._steady = steady < self._steady, steady
        if went_back:
            self._forget()
            raise InvalidInputError("the steady clock of the stamps went back")
        for name, watch in self._inputs.items():
            stamp, fault = getattr(stamps, name), None
            if stamp is not None and (
                stamp != watch.stamp or stamp > now + watch.future
            ):
                fault = watch.receive(stamp, now, steady)
            if name in self._awaited:
                fault = fault or watch.fault(now, steady)
            if fault is not None:
                found[name] = fault
        if not self._awaited.intersection(SEEN):
            found["points"] = Fault.NEVER
        if not stamps.valid >= self.freshness.valid:
            # A repeated scan stays blind, regardless of its new share.
            blind = self._inputs["points"].judge(Fault.BLIND)
            found.setdefault("points", blind)
        return found

    def allows(self, error: BaseException | None) -> bool:
        """Return whether the robot may drive after a step with or without an error."""
        faults = error.faults if isinstance(error, FaultError) else {}
        if error is not None and not faults:
            faults = {"step": Fault.INVALID}
        for name, fault in faults.items():
            key = f"{name}: {fault}"
            self.faults[key] = self.faults.get(key, 0) + 1
        return self._latch.step(faults)

    @property
    def is_open(self) -> bool:
        """Whether the robot may drive after the last step."""
        return self._latch.is_open

    def acknowledge(self) -> None:
        """Let the robot drive again at once if the last step was good."""
        self._latch.acknowledge()


class FaultError(QPAvoidError):
    """An input of a step is rejected.

    Attributes:
        faults: By input.
    """

    def __init__(self, faults: dict[str, Fault]) -> None:
        self.faults = faults
        told = (f"{name}: {fault}. {fault.sentence}" for name, fault in faults.items())
        super().__init__(" ".join(told))


def caught(call: Callable[..., T], /, *given: Any, **named: Any) -> T | BaseException:
    """Return the result of a call, or its exception; Ctrl-C is raised."""
    try:
        return call(*given, **named)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, too: the robot is moving
        return error


def problem_of(error: BaseException) -> str:
    """Return the message of an error, with its class unless it is qpavoid's."""
    try:
        said = str.__str__(str(error))
    except BaseException:
        said = ""
    if isinstance(error, QPAvoidError):
        return said
    return f"{type.__dict__['__name__'].__get__(type(error))}: {said}"


def _steady(stamps: Stamps) -> float:
    return monotonic() if stamps.steady is None else stamps.steady
