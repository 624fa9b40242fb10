"""Perception: scans and odometry in, static and moving obstacles out."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import CAPSULE_WIDTH
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.validation import as_number, as_pose, as_rows
from qpavoid.perception.alignment import SYSTEM
from qpavoid.perception.local_map import CELL, CELL_STATE, HALF, SIDE
from qpavoid.perception.scan import NO_ECHO_FREE, NO_ECHO_UNKNOWN, RAY, Sensor
from qpavoid.perception.segments import GROUP, MOST_SEGMENTS
from qpavoid.perception.settings import Lidar, PerceptionSettings
from qpavoid.perception.tracks import FOLLOWED, MOST_TRACKS
from qpavoid.perception.update import (
    MAP_STATE,
    Found,
    Memory,
    Model,
    Scan,
    corrected,
    obstacles_at,
    perceive,
)
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

MOST_BEAMS = 100_000

NEAREST = 1e7
"""m; coordinates of the odometry are smaller: cells are counted exactly."""

LATEST_STAMP = 1e10
"""s; stamps are smaller: their differences count to a microsecond."""

LATE = 0.1
"""s by which a scan of another sensor may be older than the last one."""

POSE_JUMP, FASTEST_POSE = 0.5, 5.0
"""m, and m/s, that odometry does not exceed from scan to scan; else it has jumped, and
the map is begun anew."""

LONGEST_STEP, FASTEST_TWIST = 1.0, 100.0
"""s: from poses farther apart no twist is taken; m/s and rad/s of twists at most."""

MEANING = {"auto": 0.0, "free": NO_ECHO_FREE, "unknown": NO_ECHO_UNKNOWN}


class Track(NamedTuple):
    """A body that is followed, odometry frame.

    Attributes:
        name: Its number; it does not come again.
        position: x, y of its centre, m.
        velocity: m/s.
        sigma: σ of the velocity, m/s.
        radius: m, about the centre; it holds the body's echoes.
        confirmed: Whether it is handed out as a moving obstacle.
    """

    name: int
    position: tuple[float, float]
    velocity: tuple[float, float]
    sigma: float
    radius: float
    confirmed: bool


class Explanation(NamedTuple):
    """Map and tracks, for display; odometry frame as corrected.

    Attributes:
        pose: Of the robot at the last scan.
        tracks: All, confirmed or not.
        points: (n, 2) static points in the map, m.
        grid: (SIDE, SIDE) int8, rows along y: −1 unknown, 0 seen through, 1 ever-free,
            100 occupied.
        origin: x, y of the corner of grid[0, 0], m.
        resolution: Side of a cell, m.
    """

    pose: Pose
    tracks: tuple[Track, ...]
    points: Array
    grid: npt.NDArray[np.int8]
    origin: tuple[float, float]
    resolution: float


class Device:
    """A LiDAR with the number of its beams, once that is known."""

    def __init__(self, lidar: Lidar, beams: int) -> None:
        step, count = lidar.step(beams), np.arange(beams)
        angles = step * count - 0.5 * lidar.field_of_view
        share = count / max(beams - 1, 1) - 0.5
        after = lidar.sweep * share
        length = abs(lidar.sweep)
        shares = after / length if length else np.zeros(beams)
        self.beams = np.column_stack([np.cos(angles), np.sin(angles), shares, after])
        self.sensor = Sensor(
            lidar.mount,
            step,
            lidar.range_max,
            float(beams > 1 and lidar.is_round),
            lidar.angle_error,
            MEANING[lidar.no_echo],
        )
        self.rows, self.counts = np.zeros(beams, RAY), np.zeros(2)

    def scan(self, time: float, pose: Pose, twist: Twist, length: float) -> Scan:
        """Return the scan in the rows, whose middle is at a time and pose."""
        x, y, _ = arc(*pose, *twist, length)
        motion = (x - pose[0], y - pose[1], twist[1] * length)
        rows = self.rows.view(np.float64)
        known = rows, self.beams, self.sensor, self.counts
        return Scan(*known, time, pose, motion)


class Perception:
    """Static and moving obstacles from scans and odometry, bounded in time and memory.

    An echo belongs to a moving obstacle only where space was seen free before. All
    other echoes stay points at rest; those that leave the view are remembered. Moving
    obstacles are discs with velocities; a body wider than a person is several.

    Attributes:
        robot: Its footprint is left out of what is seen.
        lidars: By name.
        settings: Of bodies and memory.
        last_valid: Stamp of the last scan that had any known beam, s; ``-inf``: none.

    Raises:
        InvalidInputError: No LiDAR, or one that is none.
    """

    def __init__(
        self,
        robot: Robot,
        lidar: Lidar | Mapping[str, Lidar] | None = None,
        settings: PerceptionSettings | None = None,
    ) -> None:
        lidar = Lidar() if lidar is None else lidar
        self.lidars = {"": lidar} if isinstance(lidar, Lidar) else dict(lidar)
        self.settings = settings if settings is not None else PerceptionSettings()
        known = all(isinstance(one, Lidar) for one in self.lidars.values())
        want(bool(self.lidars) and known, "perception needs a Lidar, or some by name")
        want(
            isinstance(self.settings, PerceptionSettings),
            "settings must be PerceptionSettings",
        )
        self.fit(robot)
        self._devices: dict[str, Device] = {}
        self._found = Found(np.zeros((0, 2)), np.zeros((MOST_TRACKS, CAPSULE_WIDTH)))
        self.reset()

    def fit(self, robot: Robot) -> None:
        """Set the robot; what is known is kept, also of what a larger one covers."""
        s, inner = self.settings, max(robot.footprint.inner_radius, 0.0)
        self.robot = robot
        self.model = Model(inner, s.radius, s.acceleration, s.memory, s.memory_way)

    def reset(self) -> None:
        """Forget everything that was seen."""
        self.memory = Memory(
            np.zeros(1, MAP_STATE).view(np.float64),
            np.zeros(SIDE * SIDE, CELL_STATE).view(np.float64),
            np.zeros(MOST_TRACKS, FOLLOWED).view(np.float64),
            np.zeros(MOST_SEGMENTS, GROUP).view(np.float64),
            np.zeros(SYSTEM),
        )
        self._last: tuple[float, Pose] | None = None
        self.last_valid = -math.inf
        self._stamps: dict[str, float] = {}
        self._scan: Scan | None = None

    def set_lidar(self, sensor: str, lidar: Lidar) -> None:
        """Add a sensor, or replace one whose geometry has changed; the map stays."""
        self.lidars[sensor] = lidar
        self._devices.pop(sensor, None)

    def update(
        self,
        ranges: npt.ArrayLike | None = None,
        stamp: float = math.nan,
        odometry: npt.ArrayLike = (),
        *,
        points: npt.ArrayLike | None = None,
        sensor: str = "",
        twist: Twist | None = None,
    ) -> Obstacles:
        """Take a scan; return the obstacles at its stamp, robot frame.

        Args:
            ranges: (n,) m, from right to left; ``inf``: no echo; NaN, 0 and what is not
                within the LiDAR's limits: unknown.
            stamp: s. The stamp of a sensor's last scan again changes nothing.
            odometry: Pose x, y (m), γ (rad) of the robot at the stamp, in a frame at
                rest.
            points: In place of ranges: (n, 2) or (n, 3) x, y (and z) in m of a depth
                camera, sensor frame, without the floor; a direction without a point is
                unknown.
            sensor: Name of the LiDAR where there are several.
            twist: v (m/s) and ω (rad/s) of the robot at the stamp; by default that
                between the last two poses.

        Raises:
            InvalidInputError: Not such numbers, another number of ranges than before,
                no LiDAR of that name, or time runs backwards. Nothing is changed.
        """
        self.enter(ranges, stamp, odometry, points, sensor, twist)
        return self.obstacles(stamp, odometry)

    def enter(
        self, ranges: Any, stamp: Any, place: Any, points: Any, sensor: str, twist: Any
    ) -> None:
        """Take a scan as :meth:`update` does; ``place``: the pose by odometry."""
        time, pose = as_number(stamp, "stamp"), as_pose(place, "odometry")
        want(max(map(abs, pose[:2])) < NEAREST, f"odometry is beyond {NEAREST:g} m")
        want(abs(time) < LATEST_STAMP, "a stamp is a number of seconds")
        lidar = self._lidar(sensor)
        seen = self._ranges(lidar, ranges, points)
        device = self._devices.get(sensor) or Device(lidar, len(seen))
        known = len(device.rows)
        want(len(seen) == known, f"{len(seen)} ranges, but {known} before")
        velocity = self._twist(time, pose, twist)
        if time == self._stamps.get(sensor):
            return
        middle = time - lidar.delay + 0.5 * abs(lidar.sweep)
        middle = self._in_order(middle, sensor)
        if self._has_jumped(time, pose):
            self.reset()
        begin = arc(*pose, *velocity, middle - time)
        self._devices[sensor], device.rows["range"] = device, seen
        self._scan = device.scan(middle, begin, velocity, abs(lidar.sweep))
        perceive(self.memory, self._scan, self.model)
        self._last, self._stamps[sensor] = (time, pose), time
        unknown = np.isnan(seen) | (np.isinf(seen) & (lidar.no_echo == "unknown"))
        if not unknown.all():
            self.last_valid = time

    def _lidar(self, sensor: str) -> Lidar:
        try:
            return self.lidars[sensor]
        except (KeyError, TypeError):
            names = ", ".join(map(repr, self.lidars))
            raise InvalidInputError(
                f"no sensor {sensor!r}; there is {names}: name one in Perception.update"
            ) from None

    def _ranges(self, lidar: Lidar, ranges: Any, points: Any) -> Array:
        """Return ranges with NaN for all that is unknown."""
        want(
            (ranges is None) != (points is None), "update needs ranges, or else points"
        )
        if ranges is None:
            return virtual_ranges(lidar, points)
        values = np.ma.filled(ranges, math.nan) if np.ma.isMA(ranges) else ranges
        seen = as_rows(np.reshape(values, (-1, 1)), 1, "ranges").ravel().copy()
        want(0 < len(seen) <= MOST_BEAMS, f"a scan has 1 to {MOST_BEAMS} ranges")
        outside = (seen < lidar.range_min) | (seen <= 0.0)
        outside |= (seen >= lidar.range_max) & np.isfinite(seen)
        seen[outside] = math.nan
        return seen

    def _twist(self, time: float, pose: Pose, twist: Twist | None) -> Twist:
        """Return the robot's twist: the given one, or that between two poses."""
        if twist is not None:
            v, omega = as_number(twist[0], "v"), as_number(twist[1], "omega")
            want(max(abs(v), abs(omega)) <= FASTEST_TWIST, "the twist is too fast")
            return v, omega
        if self._last is None or not 0.0 < time - self._last[0] <= LONGEST_STEP:
            return 0.0, 0.0
        dt, (x, y, heading) = time - self._last[0], self._last[1]
        turn = wrap_angle(pose[2] - heading)
        middle = heading + 0.5 * turn
        ahead = (pose[0] - x) * math.cos(middle) + (pose[1] - y) * math.sin(middle)
        most = FASTEST_TWIST * dt
        return min(max(ahead, -most), most) / dt, min(max(turn, -most), most) / dt

    def _in_order(self, time: float, sensor: str) -> float:
        """Return the time of a scan, not before that of the last one."""
        if self._scan is None:
            return time
        late = self._scan.time - time
        other = len(self.lidars) > 1 and self._stamps.get(sensor, -math.inf) < time
        if late > (LATE if other else 0.0):
            raise InvalidInputError(
                f"time runs backwards, by {late:g} s; reset() for a new clock"
            )
        return max(time, self._scan.time)

    def _has_jumped(self, time: float, pose: Pose) -> bool:
        if self._last is None:
            return False
        way = math.dist(pose[:2], self._last[1][:2])
        return way > POSE_JUMP + FASTEST_POSE * (time - self._last[0])

    def obstacles(self, time: float, odometry: npt.ArrayLike) -> Obstacles:
        """Return the obstacles at a time, robot frame; before the first scan none.

        Args:
            time: s; moving obstacles are predicted to it.
            odometry: Pose of the robot then.

        Raises:
            InvalidInputError: Not finite numbers.
        """
        time, pose = as_number(time, "time"), as_pose(odometry, "odometry")
        if self._scan is None:
            return NO_OBSTACLES
        most = len(self._scan.beams) + SIDE * SIDE
        if len(self._found.points) < most:
            self._found = self._found._replace(points=np.zeros((most, 2)))
        points, discs = obstacles_at(
            self.memory, self._scan, self.robot.footprint.edges, pose, time, self._found
        )
        return Obstacles.of(self._found.points[:points], self._found.capsules[:discs])

    def explain(self) -> Explanation:
        """Return what is known after the last scan, for display."""
        memory = self.memory
        (state,), cells = memory.state.view(MAP_STATE), memory.cells.view(CELL_STATE)
        pose = (0.0, 0.0, 0.0) if self._last is None else self._last[1]
        tracks = tuple(
            Track(
                int(t.name),
                (float(t.x), float(t.y)),
                (float(t.v_x), float(t.v_y)),
                math.sqrt(t.p_vv),
                max(float(t.cover), self.settings.radius),
                bool(t.confirmed),
            )
            for t in memory.tracks.view(FOLLOWED)[: state.tracks]
        )
        held = cells["lives"] > 0
        points = np.column_stack([cells["x"][held], cells["y"][held]])
        kind = np.where(cells["free_count"] > 0, 0, -1)
        kind = np.where(cells["ever_free"] > 0, 1, kind)
        kind = np.where(held, 100, kind).astype(np.int8)
        low = int(state.middle_i) - HALF, int(state.middle_j) - HALF
        order = (np.arange(SIDE) + low[0]) % SIDE, (np.arange(SIDE) + low[1]) % SIDE
        grid = kind.reshape(SIDE, SIDE)[np.ix_(*order)].T
        origin = (CELL * low[0], CELL * low[1])
        return Explanation(
            corrected(memory.state, pose), tracks, points, grid, origin, CELL
        )


def virtual_ranges(lidar: Lidar, points: npt.ArrayLike) -> Array:
    """Return the ranges of beams of 1° to the nearest of points in the sensor frame, m.

    Directions without a point are NaN.

    Raises:
        InvalidInputError: Not finite numbers of shape (n, 2) or (n, 3).
    """
    columns = 3 if np.ndim(points) == 2 and np.shape(points)[1] == 3 else 2
    rows = as_rows(points, columns, "points")
    rows = rows[np.isfinite(rows).all(axis=1)]
    wide, round_ = lidar.field_of_view, lidar.is_round
    count = max(round(wide / math.radians(1.0)) + (0 if round_ else 1), 1)
    step = lidar.step(count)
    ranges = np.full(count, math.inf)
    away = np.hypot(rows[:, 0], rows[:, 1])
    beam = np.rint((np.arctan2(rows[:, 1], rows[:, 0]) + 0.5 * wide) / step).astype(int)
    beam = beam % count if round_ else beam
    near = (away >= lidar.range_min) & (away > 0.0) & (away < lidar.range_max)
    near &= (beam >= 0) & (beam < count)
    np.minimum.at(ranges, beam[near], away[near])
    return np.where(np.isinf(ranges), math.nan, ranges)
