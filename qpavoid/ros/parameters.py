"""Parameters of the node: keys of scenario files, ``radius.r_min_slow_m``, and its own.

Names, units, ranges and defaults are those that the settings declare
(:mod:`qpavoid.settings`); an invalid value is rejected by name, and the previous one
kept.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.inputs import Freshness
from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.errors import InvalidInputError, UnknownNameError
from qpavoid.guide.settings import GuideSettings
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot
from qpavoid.ros.messages import counter_clockwise
from qpavoid.ros.modes import DriveSettings
from qpavoid.ros.perceiver import NodePerception
from qpavoid.ros.wiring import GuardSetup
from qpavoid.settings import declared, want

PRESETS = "mir100", "mir100_rectangle", "jackal"

TABLES: dict[str, type[Any]] = {
    **PARTS,
    "filter": AvoidanceSettings,
    "freshness": Freshness,
    "perception": NodePerception,
    "guide": GuideSettings,
    "drive": DriveSettings,
    "robot": Limits,
}
"""Tables that can be changed at run time."""

SHAPE = "robot.footprint_m"
"""x1, y1, x2, y2, … counter-clockwise, ``nan`` between polygons of a union; empty: the
preset's."""


class Running(NamedTuple):
    """Parameters fixed at the start, besides the wiring.

    Attributes:
        dt_s: Control step: least time between two twists.
        robot_preset: As in scenario files.
        footprint_text: ``[[x, y], …]``, as of a costmap of Nav2; empty: the preset's.
        stamped: Commands are TwistStamped, in and out; else Twist.
        tf: Listen to ``/tf`` and ``/tf_static`` for frames that are not named.
        driven_from_odometry: Odometry's twist is the filter's ``driven``, as it always
            is in the guide role.
        autostart: Configure and activate at the start.
    """

    dt_s: float = 0.02
    robot_preset: str = "mir100"
    footprint_text: str = ""
    stamped: bool = False
    tf: bool = False
    driven_from_odometry: bool = False
    autostart: bool = True


def preset(name: str, outline: str = "") -> Robot:
    """Return a robot by the name of its preset; ``outline``: of another shape.

    Raises:
        UnknownNameError: There is none.
        InvalidInputError: The outline is not the text of a simple polygon.
    """
    if name not in PRESETS:
        raise UnknownNameError("robot", name, PRESETS)
    made: Robot = getattr(Robot, name)()
    if not outline:
        return made
    try:
        corners = np.array(json.loads(outline), dtype=np.float64).reshape(-1, 2)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"footprint_text: {error}") from None
    return replace(made, footprint=Footprint.polygon(counter_clockwise(corners)))


def defaults(robot: Robot) -> dict[str, Any]:
    """Return all parameters that can change at run time, with a robot's defaults."""
    found: dict[str, Any] = {SHAPE: ()}
    for table, kind in TABLES.items():
        for setting in declared(kind):
            like = getattr(robot.limits, setting.name, setting.default)
            values = setting.of(like if kind is Limits else setting.default)
            for key, value in zip(setting.keys, values, strict=False):
                found[f"{table}.{key}"] = value
    return found


def setup_of(values: Mapping[str, Any], robot: Robot, dt: float) -> GuardSetup:
    """Return the settings of some parameters.

    Args:
        values: By name, all of :func:`defaults`.
        robot: The preset.
        dt: Control step, s.

    Raises:
        InvalidInputError: A value is out of its range, or they do not fit together.
    """
    footprint = robot.footprint
    if len(values[SHAPE]):
        flat = np.asarray(values[SHAPE], dtype=np.float64)
        polygons = np.split(flat, np.flatnonzero(np.isnan(flat)))
        polygons = [polygons[0], *(x[1:] for x in polygons[1:])]
        want(not any(len(x) % 2 for x in polygons), f"{SHAPE} needs pairs of numbers")
        footprint = Footprint.union([x.reshape(-1, 2) for x in polygons])
    robot = replace(robot, footprint=footprint, limits=_made("robot", values))
    parts = {name: _made(name, values) for name in PARTS}
    settings = _made("filter", values, dt=dt, **parts)
    tables = "freshness", "perception", "guide", "drive"
    rest = (_made(name, values) for name in tables)
    return GuardSetup(robot, settings, *rest)


def _made(table: str, values: Mapping[str, Any], **given: Any) -> Any:
    """Return the settings of a table."""
    told = {}
    for setting in declared(TABLES[table]):
        keys = [f"{table}.{key}" for key in setting.keys]
        if keys:
            told[setting.name] = (
                tuple(values[k] for k in keys) if setting.many else values[keys[0]]
            )
    try:
        return TABLES[table](**told, **given)
    except InvalidInputError as error:
        raise InvalidInputError(f"{table}: {error}") from None
