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

_NAMES = {
    "avoidance.decision": "Decision Status",
    "avoidance.filter": "SafetyFilter",
    "avoidance.inputs": "Freshness Stamps",
    "avoidance.settings": "Actuation AvoidanceSettings LookAhead "
    "Margins Repulsion SafetyRadius",
    "errors": "ConfigError DataError InvalidInputError "
    "MissingExtraError QPAvoidError UnknownNameError",
    "guide.guide": "Guide",
    "guide.settings": "GuideSettings",
    "lab.scenario.methods": "make_controller",
    "lab.scenario.scenario": "Scenario load_scenario",
    "lab.simulation.log": "Log",
    "lab.simulation.run": "run",
    "lab.study.metrics": "metrics",
    "model.contacts": "Contacts",
    "model.footprint": "Footprint",
    "model.obstacles": "Obstacles",
    "model.prediction": "Tracks",
    "model.robot": "Limits Robot",
    "perception.perception": "Perception",
    "perception.settings": "Lidar PerceptionSettings",
    "qp.backends": "back_end_names",
    "qp.problem": "FilterProblem Solution SolveStatus",
    "qp.solve": "solve",
}
_HOME = {name: home for home, names in _NAMES.items() for name in names.split()}

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
