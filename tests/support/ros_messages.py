"""Messages with the fields of ROS, without ROS."""

import math
from types import SimpleNamespace as Fields

import numpy as np


def header(time, frame="base_link"):
    sec = math.floor(time)
    stamp = Fields(sec=sec, nanosec=round((time - sec) * 1e9))
    return Fields(stamp=stamp, frame_id=frame)


def scan(time, ranges, frame="base_link", first=-math.pi, near=0.1, far=10.0):
    step = 2.0 * math.pi / len(ranges) if len(ranges) else 0.1
    return Fields(
        header=header(time, frame),
        angle_min=first,
        angle_increment=step,
        range_min=near,
        range_max=far,
        ranges=np.asarray(ranges, dtype=np.float32),
    )


def wall(time, distance, beams=72, frame="base_link"):
    """A wall ahead, ± 60 degrees; all else is free."""
    angles = -math.pi + 2.0 * math.pi / beams * np.arange(beams)
    ranges = np.full(beams, np.inf)
    ahead = np.abs(angles) < math.pi / 3
    ranges[ahead] = distance / np.cos(angles[ahead])
    return scan(time, ranges, frame)


def cloud(time, names, rows, frame="base_link", kind="f4", order="<"):
    number, size = {"f4": (7, 4), "f8": (8, 8)}[kind]
    rows = np.asarray(rows, dtype=order + kind).reshape(-1, len(names))
    step = size * len(names) + 4  # with four bytes of something else
    data = np.zeros((len(rows), step), dtype=np.uint8)
    data[:, : size * len(names)] = rows.view(np.uint8)
    fields = [
        Fields(name=name, offset=size * k, datatype=number, count=1)
        for k, name in enumerate(names)
    ]
    return Fields(
        header=header(time, frame),
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=order == ">",
        point_step=step,
        row_step=step * len(rows),
        data=data.tobytes(),
        is_dense=True,
    )


def tracks(time, rows, frame="odom", kind="f4"):
    return cloud(time, ("x", "y", "radius", "vx", "vy"), rows, frame, kind)


def twist(v, omega=0.0, time=None):
    moves = Fields(linear=Fields(x=v, y=0.0, z=0.0), angular=Fields(x=0, y=0, z=omega))
    return moves if time is None else Fields(header=header(time), twist=moves)


def odometry(time, pose=(0.0, 0.0, 0.0), v=0.0, omega=0.0):
    turn = Fields(x=0.0, y=0.0, z=math.sin(pose[2] / 2), w=math.cos(pose[2] / 2))
    posed = Fields(position=Fields(x=pose[0], y=pose[1], z=0.0), orientation=turn)
    return Fields(
        header=header(time, "odom"),
        pose=Fields(pose=posed),
        twist=Fields(twist=twist(v, omega)),
    )


def link(parent, child, place, turn=(0.0, 0.0, 0.0, 1.0), time=0.0, fixed=False):
    """A ``geometry_msgs/TransformStamped``; ``fixed``: of /tf_static."""
    moved = Fields(
        translation=Fields(**dict(zip("xyz", place, strict=True))),
        rotation=Fields(**dict(zip("xyzw", turn, strict=True))),
    )
    head = header(time, parent)
    return Fields(header=head, child_frame_id=child, transform=moved, fixed=fixed)
