"""Methods of a user: a function, an object or a class."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from typing import Any

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.lab.baselines.drive import Baseline, Command
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import Twist

METHOD = "v", "omega", "obstacles", "context"
"""Arguments of its function."""


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
class OwnController(Baseline):
    """A method of one's own, driven like all others: cut to the limits, and timed.

    Attributes:
        name: What it is called.
        method: A function (v, ω, obstacles, context) → (v, ω), everything in the robot
            frame, m/s and rad/s; or what has ``start(v, omega)``, which returns such a
            function for every run. It may return a :class:`Decision` instead.
    """

    name: str
    method: Any

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        own = self._function(v, omega)

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

        return self.stepping((v, omega), plan)

    def _function(self, v: float, omega: float) -> Callable[..., Any]:
        """Return the function of a new run: the method, or what its start returns."""
        if not hasattr(self.method, "start"):
            function: Callable[..., Any] = self.method
            return function
        name = f"{self.name}.start"
        check_call(name, self.method.start, ("v", "omega"))
        function = self.method.start(v, omega)
        check_call(f"what {name} returns", function, METHOD)
        return function

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
    if isinstance(thing, type):
        check_call(name, thing, ("robot", "settings"))
        thing = thing(robot, settings)
    if not (callable(thing) or hasattr(thing, "start")):
        raise InvalidInputError(f"{name}: {thing!r} has no start and cannot be called")
    if not hasattr(thing, "start"):
        check_call(name, thing, METHOD)
    return OwnController(robot, settings, name, thing)
