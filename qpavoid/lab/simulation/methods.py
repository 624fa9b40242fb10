"""Every method by name: a controller or baseline, and what may stand before it.

``[planner+]controller[+detour]``: ``astar+eq5`` tracks a path of its own planning, and
``qp-ahead+detour`` is led round what stalls it. A planner alone drives what tracking
asks for.
"""

from collections.abc import Iterable
from dataclasses import replace
from importlib import import_module
from typing import NamedTuple

from qpavoid.avoidance.controllers import CONTROLLERS, Controller, make_controller
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import UnknownNameError
from qpavoid.guide.settings import DetourSettings
from qpavoid.lab.planning.search import SEARCHES
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.model.robot import Robot


class Baseline(NamedTuple):
    """Where a baseline stands; its module is loaded when it is asked for.

    Attributes:
        module: Below ``qpavoid.lab.baselines``.
        name: Of the class, made from robot and settings.
        description: What it is.
    """

    module: str
    name: str
    description: str


BASELINES: dict[str, Baseline] = {
    "alone": Baseline("alone", "AloneController", "tracking alone: nothing is avoided"),
    "stop": Baseline(
        "stop", "StopController", "stop and wait: slows down, stops, goes on when free"
    ),
    "apf": Baseline("potential", "PotentialController", "artificial potential field"),
    "vfh": Baseline("histogram", "HistogramController", "vector field histogram VFH+"),
    "dwa": Baseline("window", "WindowController", "dynamic window"),
    "orca": Baseline("orca", "OrcaController", "ORCA: reciprocal velocity obstacles"),
    "omni": Baseline(
        "omni", "OmniController", "omnidirectional base: the easy case, another machine"
    ),
    "c3bf": Baseline(
        "collision_cone", "CollisionConeController", "collision-cone barriers in a QP"
    ),
    "mppi": Baseline("mppi", "MppiController", "model predictive path integral"),
    "nmpc": Baseline(
        "nmpc", "NmpcController", "nonlinear model predictive control, by CasADi"
    ),
}
"""Methods of others by name."""


STAGES = {
    "astar+NAME": "that plan before any of them",
    "NAME+detour": "any of them, led round what stalls it",
}
"""What may stand before and after a name."""


class Method(NamedTuple):
    """What a name stands for.

    Attributes:
        controller: Or baseline.
        search: Of the planner before it; empty: it follows the scenario's reference.
        detour: Whether it is led round what stalls it, whatever the scenario says.
    """

    controller: str
    search: str = ""
    detour: bool = False

    def adapt(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the detour stage where the method brings its own."""
        if not self.detour or scenario.detour is not None:
            return scenario
        return replace(scenario, detour=DetourSettings())


def methods() -> dict[str, str]:
    """Return every method with what it is; planners and detour go before the others."""
    ours = {name: description for name, (_, description) in CONTROLLERS.items()}
    others = {name: each.description for name, each in BASELINES.items()}
    return ours | others | SEARCHES


def find_method(name: str) -> Method:
    """Return what a name stands for.

    Raises:
        UnknownNameError: It, or a part of it, is no name; the message lists them.
    """
    parts = name.split("+")
    detour = len(parts) > 1 and parts[-1] == "detour"
    if detour:
        del parts[-1]
    search = parts.pop(0) if parts[0] in SEARCHES else ""
    if search and not parts:
        parts = ["alone"]
    if len(parts) != 1 or parts[0] not in {**CONTROLLERS, **BASELINES}:
        raise UnknownNameError("controller", name, methods())
    return Method(parts[0], search, detour)


def check_methods(names: Iterable[str]) -> None:
    """Raise UnknownNameError, which lists what there is, for the first unknown name."""
    for name in names:
        find_method(name)


def make_method(
    name: str, robot: Robot, settings: AvoidanceSettings, solver: str = "exact"
) -> Controller:
    """Return a controller or baseline by name, without what may stand before it.

    Raises:
        UnknownNameError: None of that name; the message lists them.
        MissingExtraError: It needs a package that is not installed.
    """
    if name in CONTROLLERS:
        return make_controller(name, robot, settings, solver)
    if name not in BASELINES:
        raise UnknownNameError("controller", name, {**CONTROLLERS, **BASELINES})
    module = import_module(f"qpavoid.lab.baselines.{BASELINES[name].module}")
    made: Controller = getattr(module, BASELINES[name].name)(robot, settings)
    return made
