"""Things of one's own in a run: a method, a reference, a sensor, a base.

A class is called with robot and settings; an object or a function is taken as it is.

- A *method* is a function (v, ω, obstacles, context) → (v, ω), all in the robot frame;
  or has ``start(v, omega)``, which returns such a function for every run.
- A *reference* is a function times (n,) → (n, 5): x, y (m), γ (rad), v (m/s), ω
  (rad/s), world frame; or has it as ``sample``. It ends at rest.
- A *sensor* is a function (time, obstacles, pose) → obstacles: from those that there
  are, world frame, and the true pose to those that are seen, robot frame; or has
  ``start()``, which returns such a function for every run.
- A *base* is a function (v, ω, dt) → (v, ω): what it makes of a twist in a control
  step; or has ``start()``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any, Protocol, TypeAlias

import numpy as np

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.lab.baselines.drive import Command, stepping
from qpavoid.lab.load import load_object
from qpavoid.lab.sensing.plant import Drive
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.tracking.path import Path
from qpavoid.types import Array, Pose, Twist

METHOD = "v", "omega", "obstacles", "context"
SENSOR = "time", "obstacles", "pose"
BASE = "v", "omega", "dt"
"""What their functions are called with."""

See: TypeAlias = Callable[[float, Obstacles, Pose], Obstacles]
Move: TypeAlias = Callable[[float, float, float], Drive | Twist]


class Sensor(Protocol):
    """What sees the obstacles."""

    def start(self) -> See:
        """Return what sees in a new run."""
        ...


class Base(Protocol):
    """What moves the robot."""

    def start(self) -> Move:
        """Return what moves it in a new run; it stands at first."""
        ...


@dataclass(frozen=True)
class OwnPart:
    """A sensor or base of one's own.

    Attributes:
        name: What it is called.
        thing: It.
        told: What its function is called with.
    """

    name: str
    thing: Any
    told: tuple[str, ...]

    def start(self) -> Callable[..., Any]:
        """Return its function of a new run."""
        return started(self.name, self.thing, self.told)


@dataclass(frozen=True)
class OwnPath:
    """A reference of one's own, looked at.

    Attributes:
        name: What it is called.
        function: Its samples.
    """

    name: str
    function: Callable[[Array], Any]

    def sample(self, times: Array) -> Array:
        """Return the reference (n, 5) at the times (n,) in s.

        Raises:
            InvalidInputError: It is not finite, or has another shape.
        """
        rows = np.asarray(self.function(times), dtype=np.float64)
        if rows.shape != (len(times), 5) or not np.isfinite(rows).all():
            raise InvalidInputError(
                f"{self.name}: finite numbers (n, 5) are wanted for {len(times)} times"
            )
        return rows


def own_path(place: str, robot: Robot, settings: AvoidanceSettings) -> Path:
    """Return the reference that ``module:Name`` names."""
    thing = made(place, load_object(place), robot, settings)
    path = OwnPath(place, getattr(thing, "sample", thing))
    check_call(place, path.function, ("times",))
    path.sample(np.zeros(1))
    return path


def own_sensor(place: str, robot: Robot, settings: AvoidanceSettings) -> OwnPart:
    """Return the sensor that ``module:Name`` names."""
    thing = made(place, load_object(place), robot, settings, SENSOR)
    return OwnPart(place, thing, SENSOR)


def own_base(place: str, robot: Robot, settings: AvoidanceSettings) -> OwnPart:
    """Return the base that ``module:Name`` names."""
    thing = made(place, load_object(place), robot, settings, BASE)
    return OwnPart(place, thing, BASE)


def made(
    name: str,
    thing: Any,
    robot: Robot,
    settings: AvoidanceSettings,
    told: tuple[str, ...] = (),
) -> Any:
    """Return a thing of one's own, a class called with robot and settings.

    Args:
        name: What it is called.
        thing: It.
        robot: Of the run.
        settings: Of the run.
        told: What its function is called with; empty: it is a reference.

    Raises:
        InvalidInputError: It can neither be called so nor started.
    """
    if isinstance(thing, type):
        check_call(name, thing, ("robot", "settings"))
        thing = thing(robot, settings)
    other = "start" if told else "sample"
    if not (callable(thing) or hasattr(thing, other)):
        raise InvalidInputError(
            f"{name}: {thing!r} has no {other} and cannot be called"
        )
    if told and not hasattr(thing, other):
        check_call(name, thing, told)
    return thing


def started(
    name: str, thing: Any, told: tuple[str, ...], **at: float
) -> Callable[..., Any]:
    """Return the function of a new run: the thing itself, or what its start returns.

    Raises:
        InvalidInputError: It is none, or takes other arguments than it is told.
    """
    if hasattr(thing, "start"):
        name += ".start"
        check_call(name, thing.start, tuple(at))
        thing, name = thing.start(*at.values()), f"what {name} returns"
        check_call(name, thing, told)
    function: Callable[..., Any] = thing
    return function


def check_call(name: str, function: Any, told: tuple[str, ...]) -> None:
    """Raise InvalidInputError unless a function can be called with so many things."""
    try:
        signature(function).bind(*told)
    except TypeError as error:
        wanted = ", ".join(told)
        raise InvalidInputError(f"{name} is called with ({wanted}): {error}") from None
    except ValueError:  # a built-in one does not say what it takes
        return


@dataclass(frozen=True)
class OwnController:
    """A method of one's own, driven like all others: cut to the limits, and timed.

    Attributes:
        name: What it is called.
        method: A function (v, ω, obstacles, context) → (v, ω), everything in the robot
            frame, m/s and rad/s; or what has ``start(v, omega)``, which returns such a
            function for every run. It may return a :class:`Decision` instead.
        robot: Footprint and limits.
        settings: The control step.
    """

    name: str
    method: Any
    robot: Robot
    settings: AvoidanceSettings

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        own = started(self.name, self.method, METHOD, v=v, omega=omega)

        def plan(desired: Twist, obstacles: Obstacles, context: StepContext) -> Command:
            found = own(*desired, obstacles, context)
            # Who returns a Decision, say of our filter called inside, keeps its status
            # and slack in logs and tables; its twist is cut to the limits like all
            # others.
            if isinstance(found, Decision):
                twist = found.v, found.omega
                more = found.status, found.slack, found.shortfall, found.lateral
                return Command(twist, *more)
            return Command(self._twist(found))

        return stepping(self.robot, self.settings.dt, (v, omega), plan)

    def _twist(self, found: Any) -> Twist:
        try:
            v, omega = map(float, found)
        except (TypeError, ValueError):
            v = omega = math.nan
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise InvalidInputError(
                f"{self.name} returned {found!r}; a finite twist (v, omega) is wanted"
            )
        return v, omega


def own_controller(
    name: str, thing: Any, robot: Robot, settings: AvoidanceSettings
) -> OwnController:
    """Return a class (called with robot and settings), object or function as a method.

    Raises:
        InvalidInputError: It can neither be started nor called with what it is told.
    """
    method = made(name, thing, robot, settings, METHOD)
    return OwnController(name, method, robot, settings)
