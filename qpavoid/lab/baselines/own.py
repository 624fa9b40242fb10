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
from qpavoid.settings import want
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
        own: Callable[..., Any] = self.method
        if hasattr(self.method, "start"):
            name = f"{self.name}.start"
            check_call(name, self.method.start, ("v", "omega"))
            own = self.method.start(v, omega)
            check_call(f"what {name} returns", own, METHOD)

        def plan(desired: Twist, obstacles: Obstacles, context: StepContext) -> Command:
            found = own(*desired, obstacles, context)
            # Who returns a Decision, say of our filter called inside, keeps its status
            # and slack in logs and tables; its twist is cut to the limits like all
            # others.
            if isinstance(found, Decision):
                twist = found.v, found.omega
                more = found.status, found.slack, found.shortfall, found.lateral
                return Command(twist, *more)
            try:
                ahead, turn = map(float, found)
            except (TypeError, ValueError):
                ahead = turn = math.nan
            finite, wanted = math.isfinite(ahead + turn), "a finite twist (v, omega)"
            want(finite, f"{self.name} returned {found!r}; {wanted} is wanted")
            return Command((ahead, turn))

        return self.stepping((v, omega), plan)


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
    if not hasattr(thing, "start"):
        want(callable(thing), f"{name}: {thing!r} has no start and cannot be called")
        check_call(name, thing, METHOD)
    return OwnController(robot, settings, name, thing)
