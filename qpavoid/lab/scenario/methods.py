"""The one registry of methods, and how names are put together.

``[planner+]method[+guide]``: ``astar+eq5`` tracks a path of its own planning, and
``qp-ahead+guide`` is guided by the coming seconds. A planner alone drives what tracking
asks for. A method of a user is ``module:Name``.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from qpavoid.avoidance.controllers import (
    Controller,
    FilterController,
    RepulsionController,
)
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import ConfigError, InvalidInputError, UnknownNameError
from qpavoid.lab.baselines.own import own_controller
from qpavoid.lab.planning.grid import SEARCHES
from qpavoid.lab.scenario.plug_ins import load_object, source_of
from qpavoid.model.robot import Robot
from qpavoid.qp.backends import find_back_end

Factory: TypeAlias = Callable[..., Controller]

NO_BACK_END = CLOSED_FORM, ITS_OWN = "closed form", "its own"
"""Solver in tables of Eq. 5 and Eq. 7, and of a baseline."""


class Entry(NamedTuple):
    """A method.

    Attributes:
        description: What it is.
        make: Makes it of robot and settings, and of a back end's name where it is a
            QP; or ``module:Class`` below ``qpavoid.lab.baselines``, loaded when used.
        solver: What tables say of its back end; empty: the one that is asked for.
        package: What it imports of the extra ``baselines``.
    """

    description: str
    make: Factory | str
    solver: str = ITS_OWN
    package: str = ""


REGISTRY: dict[str, Entry] = {
    "eq5": Entry(
        "Eq. 5: repulsive translation and rotation",
        partial(RepulsionController, 5),
        CLOSED_FORM,
    ),
    "eq7": Entry(
        "Eq. 7, as it is read: repulsive rotation only",
        partial(RepulsionController, 7),
        CLOSED_FORM,
    ),
    "qp": Entry(
        "QP filter: the nearest twist that keeps its distance, by the present alone",
        partial(FilterController, ahead=False),
        "",
    ),
    "qp-repulsion": Entry(
        "QP filter, P_r driven away at ẋ_0 as Eq. 5 wants it: no room to stop",
        lambda robot, settings, solver="exact": FilterController(
            robot, replace(settings, bound="repulsion"), solver, False
        ),
        "",
    ),
    "qp-ahead": Entry(
        "QP filter that looks ahead: keeps its distance in the seconds to come as well",
        FilterController,
        "",
    ),
    "alone": Entry("tracking alone: nothing is avoided", "drive:Baseline"),
    "stop": Entry(
        "stop and wait: slows down, stops, goes on when free", "stopping:StopController"
    ),
    "apf": Entry("artificial potential field", "apf:PotentialController"),
    "vfh": Entry("vector field histogram VFH+", "vfh:HistogramController"),
    "dwa": Entry("dynamic window", "dwa:WindowController"),
    "orca": Entry(
        "ORCA: reciprocal velocity obstacles",
        "orca:OrcaController",
        package="pyrvo",
    ),
    "omni": Entry(
        "omnidirectional base: the easy case, another machine", "omni:OmniController"
    ),
    "mppi": Entry("model predictive path integral", "mppi:MppiController"),
    "rpp": Entry(
        "regulated pure pursuit behind a collision monitor", "rpp:PursuitController"
    ),
    "ttc": Entry("NH-TTC: time to collision", "ttc:TimeToCollisionController"),
    "nmpc": Entry(
        "nonlinear model predictive control, by CasADi", "nmpc:NmpcController"
    ),
    "mpc-cbf": Entry("MPC with discrete-time barriers", "nmpc:MpcCbfController"),
    "teb": Entry("timed elastic band, by CasADi", "teb:TebController"),
}
"""Every method by name."""

OURS = ("eq5", "eq7", "qp", "qp-repulsion", "qp-ahead")
"""The paper's laws and the filters without a guide."""

STAGES = {
    "astar+NAME": "that plan before any of them",
    "NAME+guide": "any of them, guided by the coming seconds, and round what stalls it",
}
"""Prefixes and suffixes of a method's name."""


class Method(NamedTuple):
    """A method, parsed from its name.

    Attributes:
        controller: Its name; or a method of one's own itself.
        search: Of the planner before it; empty: it follows the scenario's reference.
        guided: Whether a guide is between tracking and it, whatever the scenario says.
    """

    controller: Any
    search: str = ""
    guided: bool = False


@lru_cache
def find_entry(name: str) -> Entry | None:
    """Return the entry of a name, the registry's first; none: there is none.

    Raises:
        ConfigError: It is to be loaded and cannot be.
    """
    if ":" not in name:
        return REGISTRY.get(name)
    thing = load_object(name)
    text = (getattr(thing, "__doc__", None) or name).strip().splitlines()[0]
    return Entry(text, partial(own_controller, name, thing))


def methods() -> dict[str, str]:
    """Return every method and planner with what it is; not the :data:`STAGES`."""
    known = {name: entry.description for name, entry in REGISTRY.items()}
    return known | SEARCHES


def name_of(method: Any) -> str:
    """Return what a method is called: its name, or that of the function or class."""
    if isinstance(method, str):
        return method
    return str(getattr(method, "__name__", type(method).__name__))


def find_method(name: Any) -> Method:
    """Return what a name stands for; what is no name stands for itself.

    Raises:
        UnknownNameError: It, or a part of it, is no name; the message lists them.
        ConfigError: A method of one's own cannot be loaded.
    """
    if not isinstance(name, str):
        return Method(name)
    # A plus that is left over belongs to no planner and no stage.
    method = parsed(name)
    if "+" in method.controller or find_entry(method.controller) is None:
        raise UnknownNameError("controller", name, {**methods(), **STAGES})
    return method


def parsed(name: str) -> Method:
    """Return the parts of a name, known or not: nothing is loaded for it."""
    parts = name.split("+")
    # First from behind, then from the front: ``astar+guide`` is then a planner with a
    # stage and nothing between, which tracking alone drives.
    guided = len(parts) > 1 and parts[-1] == "guide"
    parts = parts[:-1] if guided else parts
    search = parts.pop(0) if parts[0] in SEARCHES else ""
    return Method("+".join(parts) if parts else "alone", search, guided)


def solver_of(name: Any, solver: str) -> str:
    """Return the back end of a method's QP, or what tables say in its place."""
    entry = REGISTRY.get(parsed(name).controller) if isinstance(name, str) else None
    return ITS_OWN if entry is None else entry.solver or solver


def with_back_end(name: str) -> tuple[str, str]:
    """Return controller and back end of ``qp``, ``qp:casadi:daqp``, ``module:Name``.

    Raises:
        UnknownNameError: No such controller or back end.
        ConfigError: The controller has no QP, or is one's own and cannot be loaded.
    """
    controller, _, solver = name.partition(":")
    try:
        find_method(controller)
    except UnknownNameError:
        if not solver:
            raise
        find_method(name)
        return name, "exact"
    if solver and solver_of(controller, solver) != solver:
        raise ConfigError([f"{name}: {controller} has no QP, so no back end"])
    find_back_end(solver or "exact")
    return controller, solver or "exact"


def labelled(run: Mapping[str, Any], label: str = "") -> str:
    """Return the label of a run's method, with its back end unless default or none.

    Args:
        run: Row or metadata, with controller and solver.
        label: Of the method; empty: its name.
    """
    plain = run.get("solver") in (None, "exact", *NO_BACK_END)
    method = label or str(run["controller"])
    return method if plain else f"{method} ({run['solver']})"


def missing_extra(name: str) -> str:
    """Return the extra that a method of the package lacks here; empty: it has all."""
    entry = REGISTRY.get(name)
    package = "tcod" if name in SEARCHES else entry.package if entry else ""
    return "baselines" if package and find_spec(package) is None else ""


@lru_cache
def own_file(name: str) -> Path | None:
    """Return the source of a method of one's own; none for all others."""
    place = find_method(name).controller
    return source_of(place) if ":" in place else None


def check_methods(names: Iterable[str]) -> None:
    """Raise UnknownNameError, which lists what there is, for the first unknown name."""
    for name in names:
        find_method(name)


def make_controller(
    name: Any, robot: Robot, settings: AvoidanceSettings, solver: str = "exact"
) -> Controller:
    """Return a method by name, or one's own, without planner and stage.

    Raises:
        InvalidInputError: It is no name and nothing that could drive, or one with a
            planner or stage, which a run has and a controller has not.
        UnknownNameError: None of that name, or no such back end; lists them.
        MissingExtraError: It needs a package that is not installed.
        ConfigError: One of one's own cannot be loaded.
    """
    find_back_end(solver)
    if not isinstance(name, str):
        return own_controller(name_of(name), name, robot, settings)
    entry = find_entry(name)
    if entry is None:
        alone = parsed(name).controller
        if alone != name and find_entry(alone):
            raise InvalidInputError(
                f"{name!r}: planners and stages are of a run; a controller is {alone!r}"
            )
        raise UnknownNameError("controller", name, REGISTRY)
    make: Any = entry.make
    if isinstance(make, str):
        module, _, name = make.partition(":")
        make = getattr(import_module(f"qpavoid.lab.baselines.{module}"), name)
    # What tables call its solver says whether it takes one: a QP filter has no word of
    # its own there, and is handed the back end.
    made: Controller = make(robot, settings, *([] if entry.solver else [solver]))
    return made
