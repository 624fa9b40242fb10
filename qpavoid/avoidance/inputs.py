"""Inputs of the filter: validation, freshness, and the last static map.

Every input carries the stamp of its measurement. Its age at a time ``now`` of the same
clock, and at a time ``steady`` of a monotonic clock, is

    max(now − stamp, steady − arrival),

which grows if a sensor is silent, repeats its stamps, or its clock stops. An input that
is older than its limit, from the future, never seen, or blind is a :class:`Fault`; the
robot then brakes among the static obstacles of the last good step, and drives again
only when a :class:`Latch` allows it. "No data" is never "no obstacles".
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from time import monotonic
from typing import Annotated, Any, NamedTuple, TypeVar

from qpavoid.avoidance.cbf_rows import SPEED_AT_REST
from qpavoid.errors import InvalidInputError, QPAvoidError
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import NO_CAPSULES, NO_POINTS, Obstacles
from qpavoid.model.robot import RELATIVE_ROUNDING, driven_twist
from qpavoid.model.validation import as_rows, check_finite
from qpavoid.settings import NOT_NEGATIVE, POSITIVE, SHARE, Range, check, want
from qpavoid.types import Array, Arrays, Pose


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


TEXT_TYPES = (str, bytes)
"""Types that Python would parse as numbers or iterate."""

OLDEST = 1e6
"""s; greatest age of obstacles."""


def as_twist(v: float, omega: float) -> tuple[float, float]:
    """Return both as Python floats, from any type of number."""
    try:
        if not (isinstance(v, TEXT_TYPES) or isinstance(omega, TEXT_TYPES)):
            return float(v), float(omega)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidInputError("the twist (v, omega) must be two numbers")


def as_age(age: float) -> float:
    """Return the age as a Python float, at least 0 and finite."""
    try:
        number = float(age)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0.0 <= number <= OLDEST:
        raise InvalidInputError(
            f"the age of the obstacles must be 0 to {OLDEST:g} s, not {age}"
        )
    return number


def as_driven(driven: tuple[float, float], robot: Array) -> tuple[float, float]:
    """Return the driven twist, cut to the limits along its arc or the axes.

    ``robot``: see :attr:`qpavoid.model.robot.Robot.limit_vector`.
    """
    try:
        v, omega = () if isinstance(driven, TEXT_TYPES) else driven
    except (TypeError, ValueError):
        raise InvalidInputError("the twist driven must be (v, omega)") from None
    v, omega = as_twist(v, omega)
    if not (math.isfinite(v) and math.isfinite(omega)):
        raise InvalidInputError("the twist driven must be finite")
    v, omega = driven_twist(robot, v, omega)
    return v, omega


def only_points(obstacles: Any, points: Any) -> Any:
    """Return points given by name, in place of no obstacles."""
    want(obstacles is NO_POINTS, "obstacles or points, not both")
    return points


def as_table(seen: Any) -> Arrays:
    """Return a caller's obstacles as points and capsules."""
    if type(seen) is Obstacles:
        return seen.arrays
    return as_rows(seen, 2, "points"), NO_CAPSULES


def why_invalid(seen: Any) -> InvalidInputError:
    """Return the error for invalid arguments: of an obstacle, else of the twist."""
    try:
        points, capsules = as_table(seen)
        check_finite(points, "points")
        check_finite(capsules, "capsules")
    except InvalidInputError as error:
        return error
    return InvalidInputError("the desired twist (v, omega) must be finite")


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


class FaultError(QPAvoidError):
    """An input of a step is rejected.

    Attributes:
        faults: By input.
    """

    def __init__(self, faults: dict[str, Fault]) -> None:
        self.faults = faults
        told = (f"{name}: {fault}. {fault.sentence}" for name, fault in faults.items())
        super().__init__(" ".join(told))


class LastSeen(NamedTuple):
    """Obstacles of a step, and the robot's motion since then.

    Points are the caller's, uncopied: later changes count.

    Attributes:
        seen: Obstacles, or points.
        pose: x, y (m), γ (rad) of the robot in the robot frame of that step.
    """

    seen: Any
    pose: Pose = (0.0, 0.0, 0.0)

    def after(self, v: float, omega: float, dt: float) -> "LastSeen":
        """Return the map after (v, ω) has been driven for dt, s."""
        return self._replace(pose=integrate(self.pose, (v, omega), 0.0, dt))

    def standing(self) -> Arrays:
        """Return the static obstacles in the present robot frame.

        Moving ones are left out: their positions are unknown.

        Raises:
            InvalidInputError: The arrays no longer hold valid obstacles.
        """
        seen = Obstacles.of(*as_table(self.seen))
        still = seen.capsules[seen.speeds <= SPEED_AT_REST]
        return Obstacles.of(seen.points, still).seen_from(self.pose).arrays


class InputMonitor:
    """Monitor of named inputs: stamps, ages, latch, and the last static map.

    Args:
        oldest: Greatest age by input, s.
        future: Tolerance of a stamp ahead of the clock, s.
        latch: Interlock of the robot.

    Attributes:
        watches: Monitors of the stamps, by input.
        awaited: Inputs without which a step is a fault; all, at first.
        latch: As given.
        last: Last static map; None: none yet.
        faults: Number of faults, by input and reason.
    """

    def __init__(self, oldest: Mapping[str, float], future: float, latch: Latch):
        self.watches = {name: InputWatch(age, future) for name, age in oldest.items()}
        self.latch, self.awaited, self.faults = latch, {*oldest}, dict[str, int]()
        self.last: LastSeen | None = None

    def found(self, now: float, steady: float) -> dict[str, Fault]:
        """Return the present faults by awaited input; times as of InputWatch."""
        all_of = ((k, x.fault(now, steady)) for k, x in self.watches.items())
        return {k: x for k, x in all_of if x is not None and k in self.awaited}

    def ages(self, now: float, steady: float) -> dict[str, float]:
        """Return the ages of the awaited inputs, s; ``inf``: never seen."""
        all_of = self.watches.items()
        return {k: x.age(now, steady) for k, x in all_of if k in self.awaited}

    def age(self, stamps: Stamps | None, age: float) -> float:
        """Return the age of a step's obstacles, s, whose stamps are monitored here."""
        want(stamps is None, "the inputs have a monitor of their own: no stamps")
        return as_age(age)

    def allows_after(self, error: BaseException | None) -> bool:
        """Register a step with or without an error; return whether the robot may drive.

        Faults are those of a :class:`FaultError`; of another error that of the step.
        """
        faults = error.faults if isinstance(error, FaultError) else {}
        if error is not None and not faults:
            faults = {"step": Fault.INVALID}
        for name, fault in faults.items():
            key = f"{name}: {fault}"
            self.faults[key] = self.faults.get(key, 0) + 1
        return self.latch.step(faults)

    def forget(self) -> None:
        """Forget all stamps."""
        for name, watch in self.watches.items():
            self.watches[name] = InputWatch(watch.oldest, watch.future)

    def moved(self, v: float, omega: float, dt: float) -> None:
        """Move the last static map by a twist driven for dt, s."""
        if self.last is not None:
            self.last = self.last.after(v, omega, dt)


class StepMonitor(InputMonitor):
    """Monitor of the inputs of :class:`Stamps`, awaited once they were stamped.

    Args:
        freshness: Greatest ages, and when a fault ends.
        dt: Control step, s.
    """

    def __init__(self, freshness: Freshness, dt: float) -> None:
        oldest = {name: getattr(freshness, name) for name in INPUTS}
        latch = Latch(freshness.good_steps(dt), is_open=True)
        super().__init__(oldest, freshness.future, latch)
        self.freshness, self._steady = freshness, -math.inf
        self.awaited.clear()

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
            try:
                found = self._registered(stamps)
            except (TypeError, AttributeError) as error:
                raise InvalidInputError(f"stamps must be Stamps: {error}") from None
        elif self.awaited:
            found = dict.fromkeys(self.awaited, Fault.UNSTAMPED)
        if age > self.freshness.points:
            found.setdefault("points", Fault.STALE)
        if found:
            raise FaultError(found)
        if stamps is None:
            return age
        ages = self.ages(stamps.now, _steady(stamps))
        return max([age, *(ages[name] for name in self.awaited.intersection(SEEN))])

    def _registered(self, stamps: Stamps) -> dict[str, Fault]:
        """Register stamps; return the faults by input."""
        now, steady, found = stamps.now, _steady(stamps), dict[str, Fault]()
        given = {name: getattr(stamps, name) for name in INPUTS}
        self.awaited |= {name for name, stamp in given.items() if stamp is not None}
        if not (math.isfinite(now) and math.isfinite(steady)):
            raise InvalidInputError("the time of a step must be finite")
        if stamps.valid < 0.0 or stamps.valid > 1.0:
            raise InvalidInputError("the share of valid beams must be 0 to 1")
        went_back, self._steady = steady < self._steady, steady
        if went_back:
            self.forget()
            raise InvalidInputError("the steady clock of the stamps went back")
        for name, stamp in given.items():
            watch = self.watches[name]
            ahead = stamp is not None and stamp > now + watch.future
            if stamp is not None and (ahead or stamp != watch.stamp):
                fault = watch.receive(stamp, now, steady)
                found |= {} if fault is None else {name: fault}
        found = self.found(now, steady) | found
        if not self.awaited.intersection(SEEN):
            found["points"] = Fault.NEVER
        if not stamps.valid >= self.freshness.valid:
            # A repeated scan stays blind, regardless of its new share.
            blind = self.watches["points"].judge(Fault.BLIND)
            found.setdefault("points", blind)
        return found


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


def seen_of(given: tuple[Any, ...], named: Mapping[str, Any]) -> Any:
    """Return the obstacles among the arguments of a call of the filter."""
    if len(given) > 2:
        return given[2]
    return named.get("points", named.get("obstacles", NO_POINTS))
