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
class Stateless:
    """A sensor or base that is a function and remembers nothing."""

    function: Callable[..., Any]

    def start(self) -> Callable[..., Any]:
        """Return the function."""
        return self.function


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
    thing = made(place, robot, settings)
    path = OwnPath(place, getattr(thing, "sample", thing))
    path.sample(np.zeros(1))
    return path


def own_part(place: str, robot: Robot, settings: AvoidanceSettings) -> Any:
    """Return the sensor or base that ``module:Name`` names."""
    thing = made(place, robot, settings)
    return thing if hasattr(thing, "start") else Stateless(thing)


def made(place: str, robot: Robot, settings: AvoidanceSettings) -> Any:
    """Return what ``module:Name`` names, a class called with robot and settings.

    Raises:
        ConfigError: It cannot be loaded.
        InvalidInputError: It is nothing that could be called or started.
    """
    thing = load_object(place)
    if isinstance(thing, type):
        thing = thing(robot, settings)
    if not (callable(thing) or hasattr(thing, "start") or hasattr(thing, "sample")):
        raise InvalidInputError(f"{place}: {thing!r} cannot be called or started")
    return thing


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
        own: Callable[..., Any] = self.method
        if hasattr(self.method, "start"):
            own = self.method.start(v, omega)

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
        InvalidInputError: It can neither be started nor called.
    """
    method = thing(robot, settings) if isinstance(thing, type) else thing
    if not (hasattr(method, "start") or callable(method)):
        raise InvalidInputError(f"{name}: {method!r} has no start and cannot be called")
    return OwnController(name, method, robot, settings)
