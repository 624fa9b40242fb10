"""The first scenario of somebody's own robot: commented, and ready to run."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qpavoid.errors import InvalidInputError

MOST = 1e6
"""m, m/s, rad/s or m/s²; no robot is beyond."""


STOPPING = 0.5
"""m in which the robot stops from the speed of its reference."""

WALKING = 0.4
"""m/s of who crosses; of a robot below 1 m/s, as share of its greatest speed."""


class Told(NamedTuple):
    """What is known of the robot.

    Attributes:
        footprint: Corners, m, counter-clockwise, robot frame.
        v_max: Greatest speed, m/s.
        v_min: Least, m/s; 0: it never backs up.
        omega_max: Greatest yaw rate, rad/s.
        acceleration: Greatest, m/s².
        angular_acceleration: Greatest, rad/s²; None: twice the other.
        beams: Of its LiDAR; 0: it knows everything exactly.
        view: Of the LiDAR, rad.
        mount: Of the LiDAR on the robot: x, y (m), heading (rad).
    """

    footprint: Sequence[tuple[float, float]]
    v_max: float
    v_min: float
    omega_max: float
    acceleration: float
    angular_acceleration: float | None = None
    beams: int = 0
    view: float = 2.0 * math.pi
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)


TEXT = """\
# {title}: a robot of one's own on its way past a post, a wall and somebody who walks.
# qpavoid check {file}: what is wrong, if anything is
# qpavoid run {file}: figures and a log in out/
# qpavoid compare {file}: the same by several methods
# qpavoid schema: every key, with unit and default
title = "{title}"
duration_s = {duration:g}
dt_s = 0.05  # control step: how often your loop runs
ends_at_goal = true

[robot]
# Corners of the convex footprint in m, counter-clockwise; x is ahead, y to the left,
# and (0, 0) is the middle of the axle.
footprint_m = {corners}
v_min_mps = {v_min:g}  # 0.0: never backs up
v_max_mps = {v_max:g}
omega_min_radps = {omega_min:g}
omega_max_radps = {omega_max:g}
acceleration_mps2 = {acceleration:g}
angular_acceleration_radps2 = {angular:g}

[reference]
kind = "spline"
points_m = [[0.0, 0.0], [{half:g}, 0.0], [{length:g}, 0.0]]
speed_mps = {speed:g}

[tracking]
station_keeping = true  # corrects a lateral error at rest
waiting = true  # the reference waits for a robot that falls behind

[radius]
# r_min, kept from whatever is slow and from what is faster than 0.5 m/s.
r_min_slow_m = 0.1
r_min_fast_m = 0.15

[margins]
error_m = {error:g}  # of a measured position
{lidar}
[[obstacles]]
kind = "disc"  # a post beside the way
position_m = [{half:g}, {side:g}]
radius_m = 0.15

[[obstacles]]
kind = "disc"  # somebody who crosses
position_m = [{three:g}, {far:g}]
radius_m = 0.3
velocity_mps = [0.0, {pace:g}]

[[obstacles]]
kind = "wall"
start_m = [0.0, {wall:g}]
end_m = [{length:g}, {wall:g}]
"""

LIDAR = """
[lidar]
beams = {beams}
field_of_view_rad = {view!r}  # symmetric about its own x axis
mount_x_m = {mount[0]:g}
mount_y_m = {mount[1]:g}
mount_heading_rad = {mount[2]:.6g}
range_m = 10.0
noise_m = 0.01
tracks = true  # moving discs are made of the scans
"""


def first_scenario(path: Path, told: Told) -> str:
    """Return the file; the scene is as large as the robot, and as fast.

    Raises:
        InvalidInputError: A number is not finite, or not below a million.
    """
    limits = told.v_max, told.v_min, told.omega_max, told.acceleration
    if not (np.abs([*np.ravel(told.footprint), *limits]) < MOST).all():
        raise InvalidInputError("footprint and limits must be finite, and below 1e6")
    x, y = np.ptp(np.asarray(told.footprint), axis=0)
    size = float(max(x, y))
    speed = min(0.7 * told.v_max, (2.0 * told.acceleration * STOPPING) ** 0.5)
    pace = min(WALKING, WALKING * told.v_max)
    length = max(8.0, 8.0 * size)
    return TEXT.format(
        title=path.stem.replace("_", " ").replace('"', ""),
        file=path,
        duration=round(
            3.0 * length / max(speed, 1e-3) + 10.0 + 2.0 * speed / told.acceleration
        ),
        corners=[[float(a), float(b)] for a, b in told.footprint],
        v_min=told.v_min,
        v_max=told.v_max,
        omega_min=-told.omega_max,
        omega_max=told.omega_max,
        acceleration=told.acceleration,
        angular=told.angular_acceleration or 2.0 * told.acceleration,
        half=0.5 * length,
        three=0.75 * length,
        length=length,
        pace=pace,
        speed=float(f"{speed:.3g}"),
        error=0.02 if told.beams else 0.0,
        lidar=LIDAR.format(**told._asdict()) if told.beams else "",
        side=0.5 * size,
        far=round(-pace * 0.75 * length / max(speed, 1e-3) - 1.0, 2),
        wall=2.0 + 2.0 * size,
    )
