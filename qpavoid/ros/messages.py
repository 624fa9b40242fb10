"""ROS messages as plain values: of whatever has their fields, live or out of a bag.

Points are in the frame that the message names, in m. A beam of a ``LaserScan`` is an
echo between ``range_min`` and ``range_max``; free from ``range_max`` on, ``inf``
included (REP 117); an echo at ``range_min`` where it says ``-inf``, too close; and
unknown where it is NaN or below ``range_min``: no point, and not valid.

Tracked obstacles are a ``PointCloud2`` with the fields x, y, radius (m), vx, vy (m/s
over ground, in the axes of its frame), one point a disc.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

DATA_TYPES = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), start=1))
"""Of a PointField, by its number."""

NANOSECOND = 1e-9
"""s."""

MOST_POINTS = 1_000_000
"""In one message; more is no sensor."""

NO_ROTATION = 0.1
"""A quaternion whose length is so far from 1 was never filled in."""

TRACK_FIELDS = ("x", "y", "radius", "vx", "vy")


class Sight(NamedTuple):
    """What a sensor saw.

    Attributes:
        stamp: s.
        frame: Its name.
        points: (N, 3) echoes in that frame, m.
        valid: Share of its beams, or points, that are known.
        stuck: Whether every beam is an echo at the very same range.
        each: Share of one beam.
    """

    stamp: float
    frame: str
    points: Array
    valid: float
    stuck: bool = False
    each: float = 0.0


class Tracks(NamedTuple):
    """Obstacles that somebody tracks: discs (M, 3) in m, velocities (M, 2) in m/s."""

    stamp: float
    frame: str
    discs: Array
    velocities: Array


def seconds(stamp: Any) -> float:
    """Return a ``builtin_interfaces/Time`` in s."""
    return float(stamp.sec) + NANOSECOND * float(stamp.nanosec)


def read_scan(message: Any) -> Sight:
    """Return a ``sensor_msgs/LaserScan``.

    Raises:
        InvalidInputError: Its angles or limits are not finite, or all angles the same.
    """
    ranges = np.asarray(message.ranges, dtype=np.float64)
    near, far = float(message.range_min), float(message.range_max)
    first, step = float(message.angle_min), float(message.angle_increment)
    last = first + step * ranges.size
    known = math.isfinite(near) and math.isfinite(first) and math.isfinite(last)
    want(known and 0.0 <= near < far, "a scan wants finite angles, 0 <= min < max")
    want(ranges.ndim == 1 and len(ranges) <= MOST_POINTS, "a scan wants ranges")
    want(step != 0.0 or len(ranges) < 2, "a scan wants an angle_increment")
    close, free = ranges == -np.inf, ranges >= far
    echo = ((ranges >= near) & ~free) | close
    angles = first + step * np.flatnonzero(echo)
    distances = np.where(close, near, ranges)[echo]
    points = np.zeros((len(distances), 3))
    points[:, 0], points[:, 1] = distances * np.cos(angles), distances * np.sin(angles)
    valid = float((echo | free).mean()) if len(ranges) else 0.0
    stuck = len(distances) > 2 and not free.any() and np.ptp(distances) == 0.0
    each = 1.0 / max(len(ranges), 1)
    return Sight(*_header(message), points, valid, bool(stuck), each)


def read_cloud(message: Any) -> Sight:
    """Return a ``sensor_msgs/PointCloud2`` with fields x, y, z.

    Raises:
        InvalidInputError: It lacks one of them, or its data do not fit its fields.
    """
    points = _columns(message, ("x", "y", "z"))
    known = np.isfinite(points).all(axis=1)
    valid = float(known.mean()) if len(points) else 1.0
    return Sight(*_header(message), points[known], valid)


def read_tracks(message: Any) -> Tracks:
    """Return a ``sensor_msgs/PointCloud2`` of tracked discs.

    Raises:
        InvalidInputError: As :func:`read_cloud`; or a number is not finite, or a radius
            negative.
    """
    rows = _columns(message, TRACK_FIELDS)
    sound = np.isfinite(rows).all() and (rows[:, 2] >= 0.0).all()
    want(bool(sound), "tracked discs want finite numbers and radii of 0 or more")
    return Tracks(*_header(message), rows[:, :3].copy(), rows[:, 3:].copy())


def _columns(message: Any, names: tuple[str, ...]) -> Array:
    """Return some fields of a PointCloud2 as (N, k) floats."""
    fields = {field.name: field for field in message.fields}
    missing = [name for name in names if name not in fields]
    want(not missing, f"a cloud lacks {', '.join(missing)}; it has {list(fields)}")
    high, wide, step = map(int, (message.height, message.width, message.point_step))
    want(high * wide <= MOST_POINTS, f"a cloud of {high * wide} points is too large")
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
    want(len(table) == high * wide, "a cloud's data are not as long as it says")
    return np.column_stack([table[name].astype(np.float64) for name in names])


def read_odometry(message: Any) -> tuple[Pose, Twist]:
    """Return pose and twist of a ``nav_msgs/Odometry``.

    Raises:
        InvalidInputError: A number is not finite, or the quaternion no rotation.
    """
    place, moves = message.pose.pose, message.twist.twist
    x, y, z, w = (float(getattr(place.orientation, name)) for name in "xyzw")
    turns = abs(math.hypot(x, y, z, w) - 1.0) < NO_ROTATION
    want(turns, "odometry wants a quaternion of length 1")
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    pose = float(place.position.x), float(place.position.y), yaw
    twist = float(moves.linear.x), float(moves.angular.z)
    want(all(map(math.isfinite, (*pose, *twist))), "odometry wants finite numbers")
    return pose, twist


def read_twist(message: Any) -> Twist:
    """Return (v, ω) of a Twist or a TwistStamped.

    Raises:
        InvalidInputError: They are not finite.
    """
    moves = getattr(message, "twist", message)
    v, omega = float(moves.linear.x), float(moves.angular.z)
    want(math.isfinite(v) and math.isfinite(omega), "a twist wants finite numbers")
    return v, omega


def _header(message: Any) -> tuple[float, str]:
    return seconds(message.header.stamp), str(message.header.frame_id)
