"""Bodies: the obstacles in reach, each with the distance that is to be kept from it.

A body is an obstacle, or an edge of one. Robot frame of the present; bodies keep their
velocities.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import STILL, wanted_distance
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model import capsules as table
from qpavoid.model.capsules import Arrays, speed_bound
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.robot import stopping_time
from qpavoid.qp.exact import Box, Pair

TOLERANCE = 1e-3
"""ε in m: by how much r_min may be undercut, by rounding and iteration; half of r_min
where that is less."""


FASTEST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""


X, Y, LEVER_X1, LEVER_Y1, LEVER_X2, LEVER_Y2, V_X, V_Y, TURN = range(9)


KEEP, TOUCH, SPREAD, SPEED, GROWTH, KIND, OWNER, NOW = range(9, 17)


BODY = 17
"""Columns of a body, a line: its pivot, and its ends from there (m); velocity of the
pivot and rate of turn; the distance to keep (radius, margins, r_min), and what of it
is not r_min, m; the radius round the pivot that holds all that; the greatest speed of
a point of it, m/s; how fast the distance to keep grows, m/s; kind, and number of the
obstacle; and the room that there is now of what stands near, m, else ``inf``."""


STANDS, MOVES, CREEPS = 0.0, 1.0, 2.0
"""Kinds. What is slow creeps for a filter that does not look ahead: it stands, and
grows as fast as it moves, whatever its direction."""


class Scene(NamedTuple):
    """What all predictions of a control step share.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.numbers`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        bodies: (n, :data:`BODY`) in reach.
        last: v, ω driven last.
        arcs: (:func:`most_arcs`, :data:`ARC`), memory for a rollout.
        longest: s that a control step lasts at most.
        drift: m/s by which the robot leaves the way of a rollout; what stands grows by
            it meanwhile.
    """

    edges: Array
    robot: Array
    settings: npt.NDArray[np.void]
    bodies: Array
    last: Pair
    arcs: Array
    longest: float
    drift: float


@compiled
def tolerance(scene: Scene) -> float:
    """Return ε, m."""
    return float(min(TOLERANCE, 0.5 * scene.settings[0].low))


@compiled_once
def look_box(robot: Array) -> Box:
    """Return the twists that a target can be."""
    return (
        max(robot[0], -FASTEST),
        min(robot[1], FASTEST),
        max(robot[2], -FASTEST),
        min(robot[3], FASTEST),
    )


@compiled_once
def bodies_in_reach(
    scene: Scene, obstacles: Arrays, age: float, horizon: float, bodies: Array
) -> int:
    """Fill in the bodies that can be met; return how many.

    What moves within ``horizon`` s (0: not looked ahead), what stands within
    ``horizon_still`` and for as long as a stop takes. Where r_min grows with the
    closing speed it is that of the axle's middle, driven as last. From what stands
    nearer than r_min no more is wanted than there is.
    """
    robot, s = scene.robot, scene.settings[0]
    points, capsules = obstacles
    box = look_box(robot)
    fastest, turning = max(-box[0], box[1]), max(-box[2], box[3])
    stop = stopping_time(robot, fastest, turning, s.dt) * scene.longest / s.dt
    if s.ramps != 0:
        stop *= 2.0
    _, low = wanted_distance(scene.settings, 0.0, age)
    still = robot[8] + fastest * max(min(s.horizon_still, horizon), stop)
    margin, count = low - s.low, 0
    for i in range(points.shape[0]):
        x, y, keep = points[i, 0], points[i, 1], low
        if s.closing > 0.0:
            keep += closing_margin(scene, x, y, 0.0, 0.0)
        if x * x + y * y < (keep + still) ** 2:
            set_body(bodies, count, x, y, keep, i)
            bodies[count, TOUCH] = margin
            count += 1
    for i in range(capsules.shape[0]):
        speed = speed_bound(capsules, i)
        x, y = capsules[i, table.PIVOT_X], capsules[i, table.PIVOT_Y]
        v_x, v_y = capsules[i, table.V_X], capsules[i, table.V_Y]
        r_min, wanted = wanted_distance(scene.settings, speed, age)
        wanted += closing_margin(scene, x, y, v_x, v_y) + capsules[i, table.RADIUS]
        set_body(bodies, count, x, y, wanted, int(capsules[i, table.OWNER]))
        bodies[count, TOUCH] = wanted - r_min
        bodies[count, LEVER_X1] = capsules[i, table.X1] - x
        bodies[count, LEVER_Y1] = capsules[i, table.Y1] - y
        bodies[count, LEVER_X2] = capsules[i, table.X2] - x
        bodies[count, LEVER_Y2] = capsules[i, table.Y2] - y
        bodies[count, SPREAD] = wanted + longest_lever(bodies, count)
        apart = math.sqrt(x * x + y * y) - bodies[count, SPREAD]
        if speed <= STILL and apart < still:
            count += 1
        elif speed > STILL and horizon == 0.0:
            creeps = speed <= s.speed_low and apart < still + speed * stop
            bodies[count, GROWTH], bodies[count, KIND] = speed, CREEPS
            count += int(creeps)
        elif speed > STILL:
            bodies[count, V_X], bodies[count, V_Y] = v_x, v_y
            bodies[count, TURN], bodies[count, SPEED] = capsules[i, table.TURN], speed
            bodies[count, KIND] = MOVES
            count += int(apart < robot[8] + (speed + fastest) * horizon)
    for i in range(count):
        bodies[i, NOW] = math.inf
        if bodies[i, KIND] != MOVES:
            keep_at_most(scene, bodies, i)
    return count


@compiled_once
def keep_at_most(scene: Scene, bodies: Array, i: int) -> None:
    """Let a body want no more than there is now and ε, and not grow."""
    far = scene.robot[8] + bodies[i, SPREAD]
    if bodies[i, X] ** 2 + bodies[i, Y] ** 2 < far * far:
        distance = line_distance(scene.edges, bodies, i)
        missing = bodies[i, KEEP] - distance - tolerance(scene)
        if missing > 0.0:
            bodies[i, KEEP] -= missing
            bodies[i, SPREAD] -= missing
            bodies[i, GROWTH] = 0.0
        bodies[i, NOW] = distance - bodies[i, KEEP]


@compiled_once
def closing_margin(scene: Scene, x: float, y: float, v_x: float, v_y: float) -> float:
    """Return by how much r_min grows as robot and obstacle close in, m."""
    closing = scene.settings[0].closing
    if closing == 0.0:
        return 0.0
    apart = max(math.sqrt(x * x + y * y), 1e-9)
    return float(closing * max(((scene.last[0] - v_x) * x - v_y * y) / apart, 0.0))


@compiled
def set_body(
    bodies: Array, i: int, x: float, y: float, keep: float, owner: int
) -> None:
    """Write a body that is a point and stands."""
    for column in range(LEVER_X1, BODY):
        bodies[i, column] = 0.0
    bodies[i, X], bodies[i, Y] = x, y
    bodies[i, KEEP] = bodies[i, SPREAD] = keep
    bodies[i, OWNER] = owner


@compiled
def longest_lever(bodies: Array, i: int) -> float:
    """Return the greatest distance of an end from the pivot, m."""
    one = bodies[i, LEVER_X1] ** 2 + bodies[i, LEVER_Y1] ** 2
    return math.sqrt(max(one, bodies[i, LEVER_X2] ** 2 + bodies[i, LEVER_Y2] ** 2))


@compiled_once
def line_distance(edges: Array, bodies: Array, i: int) -> float:
    """Return the signed distance of the footprint from the line of a body now, m."""
    x, y = bodies[i, X], bodies[i, Y]
    if bodies[i, SPREAD] == bodies[i, KEEP]:
        return point_contact(edges, x, y)[4]
    return wall_contact(
        edges,
        x + bodies[i, LEVER_X1],
        y + bodies[i, LEVER_Y1],
        x + bodies[i, LEVER_X2],
        y + bodies[i, LEVER_Y2],
    )[4]
