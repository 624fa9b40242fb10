"""Stop and wait: a slow zone and a stop zone, as a collision monitor [Macenski2023].

And the collision-free time of a constant twist among obstacles taken to be static.
"""

import math
from dataclasses import dataclass

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.controllers import StepContext
from qpavoid.compiled import compiled_once, entry
from qpavoid.lab.baselines.drive import Baseline, Command
from qpavoid.model.capsules import RADIUS, Segment, capsule_at, has_length
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limits_of, stopping_time
from qpavoid.types import Arrays, Twist

ROUNDING = 1e-9
"""m; tolerance of equal distances."""

LOOK_STEP = 2e-3
"""m; greatest motion of a footprint point between two samples of an obstacle."""


@compiled_once
def time_to_meet(
    setup: Setup, axis: Segment, wanted: float, twist: Twist, end: float
) -> float:
    """Return the time for which a twist keeps a distance to one obstacle, s.

    If it is nearer already: the time until it comes nearer. By conservative advancement
    with the speed of the fastest footprint point.

    Args:
        setup: Footprint and limits.
        axis: Of the obstacle, robot frame.
        wanted: Required distance, m.
        twist: v (m/s), ω (rad/s).
        end: s, at most.
    """
    (x1, y1, x2, y2), (v, omega), edges = axis, twist, setup.edges
    speed = abs(v) + abs(omega) * limits_of(setup.robot).circumradius
    time, before = 0.0, 0.0
    while True:
        x, y, heading = arc(0.0, 0.0, 0.0, v, omega, time)
        cos, sin = math.cos(heading), math.sin(heading)
        q_x, q_y = cos * (x1 - x) + sin * (y1 - y), cos * (y1 - y) - sin * (x1 - x)
        if x1 == x2 and y1 == y2:
            distance = point_contact(edges, q_x, q_y).distance
        else:
            e_x, e_y = cos * (x2 - x) + sin * (y2 - y), cos * (y2 - y) - sin * (x2 - x)
            distance = wall_contact(edges, Segment(q_x, q_y, e_x, e_y)).distance
        if time == 0.0:
            wanted = min(wanted, distance - ROUNDING)
        room = distance - wanted
        # The last sample with a margin: conservative by one step.
        if room < 0.0:
            return before
        if time >= end or room >= speed * (end - time):
            return end
        before = time
        time = min(end, time + max(room, LOOK_STEP) / speed)


@entry
@compiled_once
def free_time(
    setup: Setup, obstacles: Arrays, margin: float, twist: Twist, horizon: float
) -> float:
    """Return the time for which a twist keeps a margin to all obstacles, ≤ horizon; s.

    Obstacles are taken as static, regardless of their velocities.

    Args:
        setup: Footprint and limits.
        obstacles: Robot frame.
        margin: m.
        twist: v (m/s), ω (rad/s).
        horizon: s.
    """
    radius, (points, capsules) = limits_of(setup.robot).circumradius, obstacles
    speed, end = abs(twist[0]) + abs(twist[1]) * radius, horizon
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        if x * x + y * y < (radius + margin + speed * end) ** 2:
            end = time_to_meet(setup, Segment(x, y, x, y), margin, twist, end)
    for i in range(capsules.shape[0]):
        axis = capsule_at(capsules, i, 0.0)
        wanted = margin + capsules[i, RADIUS]
        # The distance of a wall's end is no bound of that of its middle.
        near = axis.x1**2 + axis.y1**2 < (radius + wanted + speed * end) ** 2
        if near or has_length(capsules, i):
            end = time_to_meet(setup, axis, wanted, twist, end)
    return end


@dataclass(frozen=True)
class StopController(Baseline):
    """Drive, drive slowly, or stop, with the curvature of the desired twist.

    The zones are swept by the footprint, inflated by ``margin``: within ``slow_time``
    on the desired twist (slow zone), and until rest on the slowed one (stop zone). A
    zone bends with the path, and obstacles beside it have no effect. Obstacles are
    taken as static. Static obstacles are never touched: the robot drives only twists
    that keep the margin until rest, and else brakes along its arc (the proof is that of
    :mod:`qpavoid.avoidance.verdict`).

    Attributes:
        margin: Required distance, in r_min of static obstacles.
        slow_time: s.
        slow_share: Share of the desired twist that is driven in the slow zone.
    """

    margin: float = 1.0
    slow_time: float = 1.0
    slow_share: float = 0.3

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the desired twist slowed down, or braking; None: the desired twist."""
        wanted = self.limited(desired, context)
        if self._is_free(wanted, obstacles, self.slow_time):
            return None
        slow = (self.slow_share * desired[0], self.slow_share * desired[1])
        slow = self.limited(slow, context)
        if self._is_free(slow, obstacles, 0.0):
            return Command(slow)
        return self.brake(context)

    def _is_free(self, twist: Twist, obstacles: Obstacles, least: float) -> bool:
        """Return whether a twist keeps the margin until rest, and for ``least`` s."""
        setup = self.setup
        time = max(least, stopping_time(setup.robot, *twist, self.settings.dt))
        margin = self.margin * self.settings.radius.r_min()
        return free_time(setup, obstacles.arrays, margin, twist, time) >= time
