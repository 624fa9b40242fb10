"""ROS messages as plain values; live or from a bag, by their fields.

Points are in the frame that the message names, in m. A beam of a ``LaserScan`` is an
echo between ``range_min`` and ``range_max``, both included; free above ``range_max``,
``inf`` included (REP 117); an echo at ``range_min`` if it is ``-inf``, too close; and
unknown if it is NaN, below ``range_min`` or below :data:`NO_RETURN`: no point, and not
valid. A point of a cloud is unknown if it is not finite or nearer to the origin of its
frame than that; an empty cloud is unknown as a whole.

Tracked obstacles are a ``PointCloud2`` with the fields x, y, radius (m), vx, vy (m/s
over ground, in the axes of its frame), one point per disc.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import to_world
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

DATA_TYPES = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), start=1))
"""Data types of a PointField, by its number."""

NANOSECOND = 1e-9
"""s."""

MOST_POINTS = 1_000_000
"""Greatest number of points of a message."""

NO_ROTATION = 0.1
"""Least deviation of a quaternion's length from 1 that counts as not filled in."""

NO_RETURN = 0.1
"""m; distance from the sensor below which there is no measurement: drivers put
no-returns there, as ranges of 0 or points (0, 0, 0)."""

STUCK_SHARE = 0.9
"""Share of beams with the same range from which on the range counts as a constant."""

RANGE_ROUNDING = 1e-6
"""Relative error of a range_max in single precision."""

MOST_ENDS_OFF = 1.5
"""Tolerance of angle_max in increments: drivers count n or n − 1 of them."""

UNREADABLE = ValueError, TypeError, AttributeError, OverflowError
"""Exceptions of reading a message that does not match its type."""

MOST_SPAN, MOST_TURNS = 1.0, 2.0
"""Greatest time from the first beam to the last: s, and multiples of scan_time."""

OCCUPIED = 100
"""Value of an occupied cell; lower ones are inflation, and -1 is unknown."""

TRACK_FIELDS = ("x", "y", "radius", "vx", "vy")


class Fan(NamedTuple):
    """Beams of a scan.

    Attributes:
        first: Angle of the first, rad.
        step: Angle from one to the next, rad, not 0 if there are two.
        ranges: (n,) m; ``inf``: free; NaN: unknown.
        span: Time from the first to the last, s.
        far: Greatest range, m.
    """

    first: float
    step: float
    ranges: Array
    span: float = 0.0
    far: float = math.inf

    @property
    def directions(self) -> Array:
        """(n, 2) Unit vectors of the beams, in the frame of the scan."""
        return directions(self.first, self.step, len(self.ranges))

    @property
    def unknown(self) -> npt.NDArray[np.bool_]:
        """(n,) Whether a beam is neither an echo nor free."""
        return np.isnan(self.ranges)


@lru_cache(maxsize=16)
def directions(first: float, step: float, count: int) -> Array:
    """Return the unit vectors (n, 2) of beams from an angle on, rad; not writable."""
    angles = first + step * np.arange(count)
    made = np.column_stack([np.cos(angles), np.sin(angles)])
    made.flags.writeable = False
    return made


class Sight(NamedTuple):
    """Obstacles of one message of a sensor.

    Attributes:
        stamp: s.
        frame: Its name.
        points: (N, 3) echoes in that frame, m.
        after: (N,) s from the stamp to each of them.
        valid: Share of its beams, or points, that are known.
        stuck: Whether the share :data:`STUCK_SHARE` of all beams are echoes at the same
            range, or more than half of the points of a cloud are equal.
        fan: The beams of a scan; None for a cloud.
        empty: Whether it is a cloud without points.
    """

    stamp: float
    frame: str
    points: Array
    after: Array
    valid: float
    stuck: bool = False
    fan: Fan | None = None
    empty: bool = False


class Poses(NamedTuple):
    """Poses (n, 3) in a frame: x, y in m, heading in rad."""

    stamp: float
    frame: str
    poses: Array


class Tracks(NamedTuple):
    """Tracked obstacles: discs (M, 3) in m, velocities (M, 2) in m/s."""

    stamp: float
    frame: str
    discs: Array
    velocities: Array


def seconds(stamp: Any) -> float:
    """Return a ``builtin_interfaces/Time`` in s."""
    return float(stamp.sec) + NANOSECOND * float(stamp.nanosec)


def read_scan(message: Any) -> Sight:
    """Return a ``sensor_msgs/LaserScan``; ``angle_max`` and times are optional.

    Raises:
        InvalidInputError: Its angles or limits are not finite, or all angles equal;
            ``angle_max`` or ``time_increment`` do not fit.
    """
    ranges = np.asarray(message.ranges, dtype=np.float64)
    near, far = float(message.range_min), float(message.range_max)
    first, step, span = _angles(message, ranges)
    want(0.0 <= near < far, "a scan needs finite angles, 0 <= min < max")
    near = max(near, NO_RETURN)
    known = np.where(ranges >= near, ranges, np.nan)
    known[ranges > far * (1.0 + RANGE_ROUNDING)] = np.inf
    known[ranges == np.inf], known[ranges == -np.inf] = np.inf, near
    beams, fan = np.flatnonzero(np.isfinite(known)), Fan(first, step, known, span, far)
    distances, many, all_of = known[beams], len(beams), len(ranges)
    points = np.zeros((many, 3))
    points[:, :2] = distances[:, None] * fan.directions[beams]
    valid = 1.0 - float(fan.unknown.mean()) if all_of else 0.0
    middle = np.partition(distances, many // 2)[many // 2] if many else math.nan
    same = np.count_nonzero(distances == middle)
    stuck = all_of > 2 and same >= STUCK_SHARE * all_of
    after = beams * np.float64(span / max(all_of - 1, 1))
    return Sight(*_header(message), points, after, valid, bool(stuck), fan)


def _angles(message: Any, ranges: Array) -> tuple[float, float, float]:
    """Return the first angle and the step of beams, rad, and their span, s."""
    first, step = float(message.angle_min), float(message.angle_increment)
    many = len(ranges) if ranges.ndim == 1 else MOST_POINTS + 1
    want(many <= MOST_POINTS, "a scan needs ranges")
    known = math.isfinite(first) and math.isfinite(first + step * many)
    want(known and math.isfinite(message.range_min), "a scan needs finite angles")
    if many < 2:
        return first, step, 0.0
    want(step != 0.0, "a scan needs an angle_increment")
    last = first + step * (many - 1)
    given = float(getattr(message, "angle_max", 0.0)) or last  # 0: not filled in
    problem = f"angle_max is {given:.4g} rad, but {many} beams end at {last:.4g} rad"
    want(abs(given - last) <= MOST_ENDS_OFF * abs(step), problem)
    span = float(getattr(message, "time_increment", 0.0)) * (many - 1)
    whole = float(getattr(message, "scan_time", 0.0))
    fits = abs(span) <= MOST_SPAN and not 0.0 < whole * MOST_TURNS < abs(span)
    want(fits, f"time_increment makes a scan of {span:.3g} s; scan_time is {whole:.3g}")
    return first, step, span


def read_cloud(message: Any) -> Sight:
    """Return a ``sensor_msgs/PointCloud2`` with fields x, y, z.

    Raises:
        InvalidInputError: It lacks one of them, or its data do not fit its fields.
    """
    points = _columns(message, ("x", "y", "z"))
    known = np.asarray(np.isfinite(points).all(axis=1))
    known[known] = (points[known] ** 2).sum(axis=1) > NO_RETURN**2
    seen, stuck = points[known], False
    if len(seen) > 2:
        same = (seen == np.median(seen, axis=0)).all(axis=1)
        stuck = bool(same.mean() > 0.5)
    valid = float(known.mean()) if len(points) else 0.0
    after, empty = np.zeros(len(seen)), not len(points)
    return Sight(*_header(message), seen, after, valid, stuck, empty=empty)


def read_tracks(message: Any) -> Tracks:
    """Return a ``sensor_msgs/PointCloud2`` of tracked discs.

    Raises:
        InvalidInputError: As :func:`read_cloud`; or a number is not finite, or a radius
            negative.
    """
    rows = _columns(message, TRACK_FIELDS)
    sound = np.isfinite(rows).all() and (rows[:, 2] >= 0.0).all()
    want(bool(sound), "tracked discs need finite numbers and radii of 0 or more")
    return Tracks(*_header(message), rows[:, :3].copy(), rows[:, 3:].copy())


def _columns(message: Any, names: tuple[str, ...]) -> Array:
    """Return some fields of a PointCloud2 as (N, k) floats."""
    fields = {field.name: field for field in message.fields}
    missing = [name for name in names if name not in fields]
    want(not missing, f"a cloud lacks {', '.join(missing)}; it has {list(fields)}")
    high, wide, step = map(int, (message.height, message.width, message.point_step))
    want(high * wide <= MOST_POINTS, f"a cloud of {high * wide} points is too large")
    want(not isinstance(message.data, int), "a cloud's data are not bytes")
    order = ">" if message.is_bigendian else "<"
    try:
        kinds = [order + DATA_TYPES[int(fields[name].datatype)] for name in names]
        offsets = [int(fields[name].offset) for name in names]
        layout: Any = {"names": names, "formats": kinds, "offsets": offsets}
        data = np.frombuffer(bytes(message.data), dtype=np.uint8)
        lines = data.reshape(high, -1)[:, : wide * step] if high * wide else data[:0]
        row = np.dtype(layout | {"itemsize": step})
        table: Any = np.frombuffer(lines.tobytes(), dtype=row)
    except (KeyError, ValueError, TypeError) as error:
        raise InvalidInputError(f"a cloud's data do not fit: {error}") from None
    want(len(table) == high * wide, "a cloud's data do not have its width and height")
    return np.column_stack([table[name].astype(np.float64) for name in names])


def read_odometry(message: Any) -> tuple[Pose, Twist]:
    """Return pose and twist of a ``nav_msgs/Odometry``.

    Raises:
        InvalidInputError: As :func:`read_pose` and :func:`read_twist`.
    """
    return read_pose(message.pose.pose), read_twist(message.twist)


def read_pose(place: Any) -> Pose:
    """Return a ``geometry_msgs/Pose``.

    Raises:
        InvalidInputError: A number is not finite, or the quaternion no rotation.
    """
    x, y, z, w = (float(getattr(place.orientation, name)) for name in "xyzw")
    turns = abs(math.hypot(x, y, z, w) - 1.0) < NO_ROTATION
    want(turns, "a pose needs a quaternion of length 1")
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pose = float(place.position.x), float(place.position.y), yaw
    want(all(map(math.isfinite, pose)), "a pose needs finite numbers")
    return pose


def read_poses(message: Any) -> Poses:
    """Return a ``PoseStamped`` or a ``nav_msgs/Path``; its frame is the path's.

    Raises:
        InvalidInputError: As :func:`read_pose`; or a path is empty.
    """
    listed = [one.pose for one in getattr(message, "poses", [message])]
    want(len(listed) > 0, "a path needs poses")
    return Poses(*_header(message), np.array([read_pose(one) for one in listed]))


def read_grid(message: Any) -> Poses:
    """Return the corners of the occupied cells of an ``OccupancyGrid``, heading 0.

    Corners among four occupied cells are left out.

    Raises:
        InvalidInputError: As :func:`read_pose`; or its data do not fit.
    """
    info, cells = message.info, np.asarray(message.data, dtype=np.int8)
    size, fits = float(info.resolution), cells.size == info.height * info.width
    want(fits and 0.0 < size < math.inf, "a costmap's data do not fit its size")
    full = np.pad(cells.reshape(info.height, info.width) >= OCCUPIED, 1).astype(int)
    around = full[1:, 1:] + full[:-1, 1:] + full[1:, :-1] + full[:-1, :-1]
    row, column = np.nonzero((around > 0) & (around < 4))
    corners = size * np.column_stack([column, row]).astype(np.float64)
    corners = to_world(corners, read_pose(info.origin))
    return Poses(*_header(message), np.column_stack([corners, np.zeros(len(row))]))


def read_polygon(message: Any) -> Poses:
    """Return the corners of a ``PolygonStamped``, counter-clockwise, heading 0."""
    corners = [(float(one.x), float(one.y), 0.0) for one in message.polygon.points]
    made = counter_clockwise(np.array(corners).reshape(-1, 3))
    return Poses(*_header(message), made)


def counter_clockwise(corners: Array) -> Array:
    """Return the corners (n, k) of a polygon, x and y first, counter-clockwise."""
    x, y = corners[:, 0], corners[:, 1]
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return corners if area > 0.0 else corners[::-1]


def read_twist(message: Any) -> Twist:
    """Return (v, ω) of a Twist or a TwistStamped.

    Raises:
        InvalidInputError: They are not finite.
    """
    moves = getattr(message, "twist", message)
    v, omega = float(moves.linear.x), float(moves.angular.z)
    want(math.isfinite(v) and math.isfinite(omega), "a twist needs finite numbers")
    return v, omega


def _header(message: Any) -> tuple[float, str]:
    return seconds(message.header.stamp), str(message.header.frame_id)


READERS: dict[str, Callable[[Any], Sight | Tracks | Poses]] = {
    "scan": read_scan,
    "cloud": read_cloud,
    "tracks": read_tracks,
    "costmap": read_grid,
}
"""Functions from messages with obstacles to values, by kind of topic."""
