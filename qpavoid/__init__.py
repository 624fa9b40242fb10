"""qpavoid: polygon-exact obstacle avoidance for differential-drive robots.

    import qpavoid as qp

    robot = qp.Robot.mir100()
    safety = qp.SafetyFilter(robot)
    decision = safety.filter(v=0.6, omega=0.0, points=[(0.9, 0.1)])

Names are imported when first used, so that ``import qpavoid`` itself is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qpavoid.avoidance.decision import Decision, Status
    from qpavoid.avoidance.filter import SafetyFilter
    from qpavoid.avoidance.inputs import Freshness, Stamps
    from qpavoid.avoidance.settings import (
        Actuation,
        AvoidanceSettings,
        LookAhead,
        Margins,
        Repulsion,
        SafetyRadius,
    )
    from qpavoid.errors import (
        ConfigError,
        DataError,
        InvalidInputError,
        MissingExtraError,
        QPAvoidError,
        UnknownNameError,
    )
    from qpavoid.guide.guide import Guide
    from qpavoid.guide.settings import GuideSettings
    from qpavoid.lab.scenario.methods import make_controller
    from qpavoid.lab.scenario.scenario import Scenario, load_scenario
    from qpavoid.lab.simulation.log import Log
    from qpavoid.lab.simulation.run import run
    from qpavoid.lab.study.metrics import metrics
    from qpavoid.model.contacts import Contacts
    from qpavoid.model.footprint import Footprint
    from qpavoid.model.obstacles import Obstacles
    from qpavoid.model.prediction import Tracks
    from qpavoid.model.robot import Limits, Robot
    from qpavoid.perception.perception import Perception
    from qpavoid.perception.settings import Lidar, PerceptionSettings
    from qpavoid.qp.backends import back_end_names
    from qpavoid.qp.problem import FilterProblem, Solution, SolveStatus
    from qpavoid.qp.solve import solve

    __version__: str

_HOME = {
    "AvoidanceSettings": "avoidance.settings",
    "ConfigError": "errors",
    "Contacts": "model.contacts",
    "DataError": "errors",
    "Decision": "avoidance.decision",
    "FilterProblem": "qp.problem",
    "Footprint": "model.footprint",
    "Freshness": "avoidance.inputs",
    "Guide": "guide.guide",
    "GuideSettings": "guide.settings",
    "InvalidInputError": "errors",
    "Lidar": "perception.settings",
    "Limits": "model.robot",
    "Log": "lab.simulation.log",
    "LookAhead": "avoidance.settings",
    "Actuation": "avoidance.settings",
    "Margins": "avoidance.settings",
    "MissingExtraError": "errors",
    "Obstacles": "model.obstacles",
    "Perception": "perception.perception",
    "PerceptionSettings": "perception.settings",
    "QPAvoidError": "errors",
    "Repulsion": "avoidance.settings",
    "Robot": "model.robot",
    "SafetyFilter": "avoidance.filter",
    "SafetyRadius": "avoidance.settings",
    "Scenario": "lab.scenario.scenario",
    "Solution": "qp.problem",
    "SolveStatus": "qp.problem",
    "Stamps": "avoidance.inputs",
    "Status": "avoidance.decision",
    "Tracks": "model.prediction",
    "UnknownNameError": "errors",
    "back_end_names": "qp.backends",
    "load_scenario": "lab.scenario.scenario",
    "make_controller": "lab.scenario.methods",
    "metrics": "lab.study.metrics",
    "run": "lab.simulation.run",
    "solve": "qp.solve",
}

__all__ = [*sorted(_HOME), "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("qpavoid")
    if name in _HOME:
        value = getattr(import_module(f"qpavoid.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'qpavoid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
