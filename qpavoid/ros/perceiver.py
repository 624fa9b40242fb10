"""Perception of the node: each topic of scans or clouds is a sensor of one map."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.perception.perception import Explanation, Perception
from qpavoid.perception.settings import STEEP, Lidar, NoEcho, PerceptionSettings
from qpavoid.ros.frames import Transform
from qpavoid.ros.messages import RANGE_ROUNDING, Fan, Sight
from qpavoid.ros.odometry import Trail
from qpavoid.types import Array, Pose

UPRIGHT = math.cos(math.radians(10.0))
"""Cosine of the tilt of a scanner from which on its beams are not in the plane: its
echoes are then points, and free nothing beyond them."""

SCAN_RANGE, CLOUD_RANGE = 1000.0, 30.0
"""m; greatest range of a scan, and of a cloud."""

LEAST_VIEW = 1e-3
"""rad; field of view of a single beam."""

SETBACK = 1.0
"""s by which a stamp lies before the newest one if the clock has been set back."""

SAME_SWEEP = 0.1
"""Relative change of the time of a sweep that is jitter of the driver."""


@dataclass(frozen=True)
class NodePerception(PerceptionSettings):
    """Settings of perception in the node.

    Attributes:
        enabled: Whether there are moving obstacles; without, all echoes are at rest.
        no_echo: Meaning of a beam without an echo, see :class:`qpavoid.Lidar`.
        angle_error: rad; σ of a beam's direction in the map.
    """

    enabled: bool = True
    no_echo: NoEcho = "auto"
    angle_error: Annotated[float, "rad", STEEP] = 0.025


class Perceiver:
    """Map and tracks of several sensors.

    Attributes:
        perception: None before the first message.
        taken: Topics whose last message is in the map.
    """

    def __init__(self, robot: Robot, settings: NodePerception) -> None:
        self.robot, self.settings = robot, settings
        self.forget()

    def forget(self) -> None:
        """Begin anew: without a map, and with no topic taken."""
        self.perception: Perception | None = None
        self.taken, self._beams, self._latest = set[str](), dict[str, int](), -math.inf

    def take(self, topic: str, seen: Sight, place: Transform, poses: Trail) -> str:
        """Enter a message into the map; return what is wrong, or an empty string.

        Args:
            topic: Name of the sensor.
            seen: Points (n, 2) of a cloud on the base, m, or the beams of a scan;
                without those of the robot itself.
            place: Of the sensor's frame on the base.
            poses: Of the robot by odometry.
        """
        if seen.stamp < self._latest - SETBACK:
            self.forget()
        self._latest, values, note = max(self._latest, seen.stamp), None, ""
        model, fan = self.settings, seen.fan
        upright = abs(place.rotation[2, 2]) >= UPRIGHT
        if fan is not None and upright and len(fan.ranges) <= turn_of(fan) + 1:
            lidar, values = planar(fan, place, model)
            many = self._beams.setdefault(topic, len(values))
            if many != len(values):
                note = f"{len(values)} beams, {many} before: it counts as a new sensor"
            self._beams[topic] = len(values)
        else:
            x, y = place.translation[:2].tolist()
            lidar = device(model, mount=(x, y, 0.0), range_max=CLOUD_RANGE)
        if self.perception is None:
            self.perception = Perception(self.robot, {topic: lidar}, model)
        known = self.perception.lidars.get(topic)
        if known is None or note or not is_same(known, lidar):
            self.perception.set_lidar(topic, lidar)
        pose = poses.at(seen.stamp)
        v, omega = poses.twist_to(seen.stamp, pose).tolist()
        points = None if values is not None else seen.points - lidar.mount[:2]
        try:
            scan = values, seen.stamp, pose, points
            self.perception.enter(*scan, sensor=topic, twist=(v, omega))
        except InvalidInputError as error:
            return f"its echoes count as at rest: {error}"
        self.taken.add(topic)
        return note

    def obstacles(self, now: float, pose: Pose) -> Obstacles:
        """Return the obstacles at a time (s) and pose by odometry, robot frame."""
        if self.perception is None or not self.taken:
            return NO_OBSTACLES
        return self.perception.obstacles(now, pose)

    def place_of(self, number: int) -> Array | None:
        """Return the place (2,) of a track in the odometry frame; None without it."""
        if number < 0 or self.perception is None:
            return None
        known = {one.name: one.position for one in self.perception.explain().tracks}
        return np.array(known[number]) if number in known else None

    def explain(self) -> Explanation | None:
        """Return map and tracks after the last message; None if none is in the map."""
        if self.perception is None or not self.taken:
            return None
        return self.perception.explain()


@lru_cache(maxsize=64)
def device(model: NodePerception, **known: Any) -> Lidar:
    """Return a sensor; its settings are checked once, not for every message."""
    known |= {"no_echo": model.no_echo, "angle_error": model.angle_error}
    return Lidar(range_min=0.0, **known)


def planar(fan: Fan, place: Transform, model: NodePerception) -> tuple[Lidar, Array]:
    """Return a scanner in the plane of the base, and its ranges from right to left, m.

    The scanner may be upside down; ranges are those on the base. A last beam in the
    direction of the first is one with it.
    """
    count, rotation, turn = len(fan.ranges), place.rotation, turn_of(fan)
    many = min(count, turn)
    ways = fan.directions[:many] @ rotation[:2, :2].T
    ranges = fan.ranges[:many] * np.hypot(*ways.T)
    if count > many:
        ranges[0] = np.fmin(ranges[0], fan.ranges[-1])
    is_mirrored = (fan.step < 0.0) != (rotation[2, 2] < 0.0)
    right = ways[-1 if is_mirrored else 0].tolist()
    whole = 1 < many == turn
    view = 2.0 * math.pi if whole else max(abs(fan.step) * (many - 1), LEAST_VIEW)
    heading = math.atan2(right[1], right[0]) + 0.5 * view
    lidar = device(
        model,
        field_of_view=view,
        mount=(*place.translation[:2].tolist(), heading),
        range_max=min(fan.far * (1.0 + 2.0 * RANGE_ROUNDING), SCAN_RANGE),
        sweep=-fan.span if is_mirrored else fan.span,
        delay=max(-fan.span, 0.0),
    )
    return lidar, ranges[::-1] if is_mirrored else ranges


def turn_of(fan: Fan) -> int:
    """Return the number of beams of a whole turn."""
    count = len(fan.ranges)
    return round(2.0 * math.pi / abs(fan.step)) if count > 1 else count


def is_same(known: Lidar, lidar: Lidar) -> bool:
    """Return whether two sensors are the same, but for jitter of the sweep's time."""
    if known == lidar:
        return True
    jitter = abs(lidar.sweep - known.sweep) <= SAME_SWEEP * abs(known.sweep)
    return jitter and replace(lidar, sweep=known.sweep, delay=known.delay) == known
