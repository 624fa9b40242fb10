"""Every method by name: the controllers, and the baselines that others would take."""

from collections.abc import Iterable
from importlib import import_module
from typing import NamedTuple

from qpavoid.avoidance.controllers import CONTROLLERS, Controller, make_controller
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import UnknownNameError
from qpavoid.model.robot import Robot


class Baseline(NamedTuple):
    """Where a baseline stands; its module is loaded when it is asked for.

    Attributes:
        module: Below ``qpavoid.baselines``.
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
    "c3bf": Baseline(
        "collision_cone", "CollisionConeController", "collision-cone barriers in a QP"
    ),
    "mppi": Baseline("mppi", "MppiController", "model predictive path integral"),
    "nmpc": Baseline(
        "nmpc", "NmpcController", "nonlinear model predictive control, by CasADi"
    ),
}
"""Methods of others by name."""


def methods() -> dict[str, str]:
    """Return every method with what it is."""
    ours = {name: description for name, (_, description) in CONTROLLERS.items()}
    return ours | {name: each.description for name, each in BASELINES.items()}


def check_methods(names: Iterable[str]) -> None:
    """Raise UnknownNameError, which lists what there is, for the first unknown name."""
    for name in names:
        if name not in methods():
            raise UnknownNameError("controller", name, methods())


def make_method(
    name: str, robot: Robot, settings: AvoidanceSettings, solver: str = "exact"
) -> Controller:
    """Return a method by name.

    Raises:
        UnknownNameError: No method of that name; the message lists them.
        MissingExtraError: It needs a package that is not installed.
    """
    check_methods([name])
    if name in CONTROLLERS:
        return make_controller(name, robot, settings, solver)
    module = import_module(f"qpavoid.baselines.{BASELINES[name].module}")
    made: Controller = getattr(module, BASELINES[name].name)(robot, settings)
    return made
