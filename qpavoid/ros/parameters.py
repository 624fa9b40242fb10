"""Parameters of the node: topics and frames, fixed at the start, and settings.

Settings are the keys of scenario files, such as ``radius.r_min_slow_m``. Names, units,
ranges and defaults are those that the settings declare (:mod:`qpavoid.settings`); an
invalid value is rejected by name, and the previous one kept.
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
from qpavoid.ros.frames import Transform
from qpavoid.ros.messages import counter_clockwise
from qpavoid.ros.modes import DriveSettings
from qpavoid.ros.perceiver import NodePerception
from qpavoid.settings import declared, want
from qpavoid.types import Array

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
"""``[[x, y], …]``, as of a costmap of Nav2, or a list of such polygons; empty: the
preset's."""


JITTER = 0.25
"""Default of ``actuation.jitter``: without scans a twist is held for so much longer."""

ROLES = "filter", "guide"

TF = "/tf"
"""As topic of odometry: poses of the base frame by tf."""


class GuardSetup(NamedTuple):
    """Settings that can change at run time; ``dt`` is the control step."""

    robot: Robot
    settings: AvoidanceSettings
    freshness: Freshness
    perception: NodePerception = NodePerception()
    guide: GuideSettings = GuideSettings()
    drive: DriveSettings = DriveSettings()

    @property
    def keep(self) -> float:
        """Required distance of static obstacles that have just been measured, m."""
        return self.settings.radius.r_min() + self.settings.margins.error


class Wiring(NamedTuple):
    """Parameters fixed at the start; an empty topic is not used.

    Attributes:
        dt_s: Control step: least time between two twists. The default with
            :data:`JITTER` fits a scanner of 40 Hz.
        robot_preset: As in scenario files.
        stamped: Commands are TwistStamped, in and out; else Twist.
        tf: Listen to ``/tf`` and ``/tf_static`` for frames that are not named.
        driven_from_odometry: Odometry's twist is the filter's ``driven``, as it always
            is in the guide role.
        autostart: Configure and activate at the start.
        bond_heartbeat_period: s; of heartbeats for a lifecycle manager, as of all nodes
            of Nav2; 0: none.
        role: ``filter``: commands are filtered; ``guide``: goals are driven to.
        scans: Topics of ``LaserScan``.
        clouds: Topics of ``PointCloud2``.
        odometry: Of ``Odometry``; ``/tf``: the base frame's pose in ``odom_frame`` by
            tf; without it the last twist counts as driven, and all echoes as at rest.
        tracks: Of tracked discs, see :mod:`qpavoid.ros.messages`.
        costmap: Of ``OccupancyGrid``; its occupied cells are static obstacles.
        costmap_s: Greatest age of it.
        footprint: Of ``PolygonStamped``, in the base frame or one by tf.
        dock_frame: Frame of the dock, by tf.
        dock_m: x1, y1, x2, y2, … of its region there, counter-clockwise.
        height_min_m: Points of clouds below this over the base's origin are floor.
        height_max_m: Points above this are ignored: they pass over the robot.
        mask_m: Points in the footprint grown by this may be the robot itself: those
            where a point was in the first messages of their topic
            (:mod:`qpavoid.ros.mask`).
        mask_boxes_m: x_min, y_min, x_max, y_max on the base of each box, concatenated;
            points in these boxes are the robot itself, and then no others are.
        blind_sector_deg: A run of unknown beams wider than this is an unknown sector,
            into which the robot does not drive; narrower ones are dropouts.
        last_beam_stamps: Topics of ``scans`` whose stamp is that of the last beam.
        empty_is_free: Topics of ``clouds`` whose empty clouds are free; others are
            blind.
        base_frame: The middle of the axle, x ahead.
        odom_frame: Fixed to the ground.
        frames: Names of the sensors' frames.
        frame_poses: x, y, z, roll, pitch, yaw on the base of each, concatenated.
    """

    dt_s: float = 0.022
    robot_preset: str = "mir100"
    stamped: bool = False
    tf: bool = False
    driven_from_odometry: bool = False
    autostart: bool = True
    bond_heartbeat_period: float = 0.0
    role: str = "filter"
    scans: tuple[str, ...] = ("scan",)
    clouds: tuple[str, ...] = ()
    odometry: str = "odom"
    tracks: str = ""
    costmap: str = ""
    costmap_s: float = 1.0
    footprint: str = ""
    dock_frame: str = ""
    dock_m: tuple[float, ...] = ()
    height_min_m: float = 0.05
    height_max_m: float = 2.0
    mask_m: float = 0.0
    mask_boxes_m: tuple[float, ...] = ()
    blind_sector_deg: float = 10.0
    last_beam_stamps: tuple[str, ...] = ()
    empty_is_free: tuple[str, ...] = ()
    base_frame: str = "base_link"
    odom_frame: str = "odom"
    frames: tuple[str, ...] = ()
    frame_poses: tuple[float, ...] = ()

    @property
    def topics(self) -> dict[str, str]:
        """Kinds of all required topics, keys of :data:`qpavoid.ros.messages.READERS`.

        Raises:
            InvalidInputError: No topic of obstacles, or one is repeated; or an entry of
                ``last_beam_stamps`` or ``empty_is_free`` is not among them; or the role
                is unknown.
        """
        want(self.role in ROLES, f"role must be one of {ROLES}, not {self.role!r}")
        want(self.role == "filter" or self.odometry != "", "a guide needs odometry")
        docks = (self.dock_frame == "") == (self.dock is None)
        want(docks, "a dock needs dock_frame and dock_m")
        want(bool(self.scans or self.clouds), "scans or clouds must name a topic")
        subsets = {"last_beam_stamps": self.scans, "empty_is_free": self.clouds}
        for key, of in subsets.items():
            wrong = sorted({*getattr(self, key)} - {*of})
            want(not wrong, f"{key} names {wrong}, not among {[*of]}")
        named = [(name, "scan") for name in self.scans]
        named += [(name, "cloud") for name in self.clouds]
        single = "odometry", "tracks", "costmap"
        named += [(getattr(self, kind), kind) for kind in single if getattr(self, kind)]
        found = dict(named)
        want(len(found) == len(named), f"a topic is repeated in {named}")
        return found

    def _rows(self, key: str, width: int) -> Array:
        """Return the numbers of a parameter as rows."""
        numbers = np.array(getattr(self, key), dtype=np.float64)
        want(len(numbers) % width == 0, f"{key} needs {width} numbers each")
        return numbers.reshape(-1, width)

    @property
    def boxes(self) -> Array:
        """The boxes (n, 4) of ``mask_boxes_m``, m.

        Raises:
            InvalidInputError: Not four numbers per box, or an empty box.
        """
        made = self._rows("mask_boxes_m", 4)
        sound = bool((made[:, :2] < made[:, 2:]).all())
        want(sound, "mask_boxes_m needs x_min, y_min < x_max, y_max")
        return made

    @property
    def dock(self) -> Footprint | None:
        """Region of the dock in its frame; None without one.

        Raises:
            InvalidInputError: Not a simple polygon, counter-clockwise.
        """
        corners = self._rows("dock_m", 2)
        return Footprint.polygon(corners) if len(corners) else None

    @property
    def sensors(self) -> dict[str, Transform]:
        """Transforms of the sensors' frames to the base.

        Raises:
            InvalidInputError: Not six numbers per frame, or angles not in rad.
        """
        poses = self._rows("frame_poses", 6)
        want(len(poses) == len(self.frames), "frame_poses needs 6 numbers each")
        made = map(Transform.of_angles, poses.tolist())
        return dict(zip(self.frames, made, strict=True))


def preset(name: str) -> Robot:
    """Return a robot by the name of its preset.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in PRESETS:
        raise UnknownNameError("robot", name, PRESETS)
    made: Robot = getattr(Robot, name)()
    return made


def footprint_of(text: str) -> Footprint:
    """Return the footprint of a text, see :data:`SHAPE`; corners in either order.

    Raises:
        InvalidInputError: Not such lists of numbers, or no simple polygons.
    """
    try:
        given = json.loads(text)
        polygons = given if np.ndim(given[0][0]) else [given]
        corners = [np.array(x, dtype=np.float64).reshape(len(x), 2) for x in polygons]
        return Footprint.union([counter_clockwise(x) for x in corners])
    except (InvalidInputError, TypeError, ValueError, LookupError) as error:
        raise InvalidInputError(f"{SHAPE}: {error}") from None


def defaults(robot: Robot) -> dict[str, Any]:
    """Return all parameters that can change at run time, with a robot's defaults."""
    found: dict[str, Any] = {SHAPE: ""}
    for table, kind in TABLES.items():
        for setting in declared(kind):
            like = getattr(robot.limits, setting.name, setting.default)
            values = setting.of(like if kind is Limits else setting.default)
            for key, value in zip(setting.keys, values, strict=False):
                found[f"{table}.{key}"] = value
    return found | {"actuation.jitter": JITTER}


def setup_of(values: Mapping[str, Any], robot: Robot, dt: float) -> GuardSetup:
    """Return the settings of some parameters.

    Args:
        values: By name, all of :func:`defaults`.
        robot: The preset.
        dt: Control step, s.

    Raises:
        InvalidInputError: A value is out of its range, or they do not fit together.
    """
    footprint = footprint_of(values[SHAPE]) if values[SHAPE] else robot.footprint
    robot = replace(robot, footprint=footprint, limits=_made("robot", values))
    parts = {name: _made(name, values) for name in PARTS}
    settings = _made("filter", values, dt=dt, **parts)
    tables = "freshness", "perception", "guide", "drive"
    rest = (_made(name, values) for name in tables)
    return GuardSetup(robot, settings, *rest)


def _made(table: str, values: Mapping[str, Any], **given: Any) -> Any:
    """Return the settings of a table."""
    found = {}
    for setting in declared(TABLES[table]):
        keys = [f"{table}.{key}" for key in setting.keys]
        if keys:
            found[setting.name] = (
                tuple(values[k] for k in keys) if setting.many else values[keys[0]]
            )
    try:
        return TABLES[table](**found, **given)
    except InvalidInputError as error:
        raise InvalidInputError(f"{table}: {error}") from None
