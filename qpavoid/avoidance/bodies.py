"""Bodies: the obstacles in reach, each with the distance that is to be kept from it.

A body is an obstacle, or an edge of one. Robot frame of the present; bodies keep their
velocities.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST, tolerated, wanted_distance
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model import capsules as table
from qpavoid.model.capsules import Segment, from_segment, speed_bound
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.kinematics import TINY
from qpavoid.model.robot import limits_of, stopping_time
from qpavoid.types import Array, Arrays, Box, Pair

UNLIMITED_TWIST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""


class Body(NamedTuple):
    """A moving segment, and the distance to keep from it: r_min and the inflation.

    Attributes:
        x: Of the pivot, m.
        y: The same.
        x1: Of one end from the pivot, m.
        y1: The same.
        x2: Of the other end.
        y2: The same.
        v_x: Of the pivot, m/s.
        v_y: The same.
        turn: rad/s.
        keep: Distance to keep: radius, margins, r_min; m.
        inflation: What of it is not r_min, m.
        spread: Radius round the pivot that holds the line and what is kept, m.
        speed: Greatest of a point of it, m/s.
        growth: How fast the distance to keep grows, m/s.
        kind: :data:`STANDS`, :data:`MOVES` or :data:`CREEPS`.
        owner: Number of the obstacle.
        now: Room that there is now of what stands near, m, else ``inf``.
        group: Number of the group that begins with it; −1: none.
    """

    x: float
    y: float
    x1: float
    y1: float
    x2: float
    y2: float
    v_x: float
    v_y: float
    turn: float
    keep: float
    inflation: float
    spread: float
    speed: float
    growth: float
    kind: float
    owner: float
    now: float
    group: float


BODY = len(Body._fields)
KIND, OWNER, GROUP = map(Body._fields.index, ("kind", "owner", "group"))

STANDS, MOVES, CREEPS = 0.0, 1.0, 2.0
"""Kinds. What is slow creeps for a filter that does not look ahead: it stands, and
grows as fast as it moves, whatever its direction."""

FEW, MANY, WIDE = 4, 32, 0.3
"""Points that make a group, at least and at most; and how far the last may be from the
first, as a share of its distance."""


class Setup(NamedTuple):
    """Robot and settings, constant over a run.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
    """

    edges: Array
    robot: Array
    settings: npt.NDArray[np.void]


class Request(NamedTuple):
    """Input of a control step.

    Attributes:
        obstacles: Robot frame.
        age: Of their measurement, s.
        ahead: Whether to look ahead.
        desired: v (m/s), ω (rad/s).
    """

    obstacles: Arrays
    age: float
    ahead: bool
    desired: Pair


class Scene(NamedTuple):
    """Context of all predictions of a control step.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        bodies: (n, :data:`BODY`) in reach.
        last: v, ω driven last.
        pending: Sums of |v|, m/s, and of |ω|, rad/s, of the steps on their way.
        arcs: (:func:`most_arcs`, :data:`ARC`), memory for a rollout.
        groups: A wall each that holds as many bodies as follow one another: what keeps
            from it keeps from them. Its ``owner`` is the number of the body after them.
        longest: s that a control step lasts at most.
        drift: m/s by which the robot leaves the way of a rollout; what stands grows by
            it meanwhile.
        closest: m; no more of r_min is wanted of what stands. ``inf``: all of it.
    """

    edges: Array
    robot: Array
    settings: npt.NDArray[np.void]
    bodies: Array
    last: Pair
    pending: Pair
    arcs: Array
    groups: Array
    longest: float
    drift: float
    closest: float


@compiled
def altered(scene: Scene, bodies: Array, drift: float, closest: float) -> Scene:
    """Return the scene with other bodies, drift and ``closest``."""
    e, r, s, _, last, pending, arcs, groups, longest, _, _ = scene
    return Scene(e, r, s, bodies, last, pending, arcs, groups, longest, drift, closest)


@compiled
def tolerance(scene: Scene) -> float:
    """Return ε, m."""
    return tolerated(scene.settings)


@compiled_once
def look_box(robot: Array) -> Box:
    """Return the box of the twists that the look-ahead may aim at."""
    limits = limits_of(robot)
    return Box(
        max(limits.v_min, -UNLIMITED_TWIST),
        min(limits.v_max, UNLIMITED_TWIST),
        max(limits.omega_min, -UNLIMITED_TWIST),
        min(limits.omega_max, UNLIMITED_TWIST),
    )


@compiled
def body_at(scene: Scene, i: int) -> Body:
    """Return row i of the table, with what is wanted in this scene."""
    b = scene.bodies[i]
    keep, inflation, spread, kind, now = b[9], b[10], b[11], b[14], b[16]
    if kind != MOVES:
        waived = max(keep - inflation - scene.closest, 0.0)
        keep, spread, now = keep - waived, spread - waived, now + waived
    # fmt: off
    return Body(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], keep, inflation,
                spread, b[12], b[13], kind, b[15], now, b[17])
    # fmt: on


@compiled
def set_body(bodies: Array, i: int, body: Body) -> None:
    """Write row i of the table."""
    b = bodies[i]
    b[0], b[1], b[2], b[3] = body.x, body.y, body.x1, body.y1
    b[4], b[5], b[6], b[7] = body.x2, body.y2, body.v_x, body.v_y
    b[8], b[9], b[10], b[11] = body.turn, body.keep, body.inflation, body.spread
    b[12], b[13], b[14], b[15] = body.speed, body.growth, body.kind, body.owner
    b[16], b[17] = body.now, body.group


@compiled_once
def bodies_in_reach(scene: Scene, obstacles: Arrays, age: float, horizon: float) -> int:
    """Fill in the bodies within reach of any rollout; return how many.

    Within ``horizon`` s (0: not looked ahead), what stands also for as long as a stop
    takes then: wherever a plan may lead until it ends. Where r_min grows with the
    closing speed it is that of the axle's middle, driven as last. From what stands
    nearer than r_min no more is wanted than there is.
    """
    robot, s = scene.robot, scene.settings[0]
    radius = limits_of(robot).circumradius
    points, capsules = obstacles
    box, bodies = look_box(robot), scene.bodies
    fastest, turning = max(-box.v_min, box.v_max), max(-box.omega_min, box.omega_max)
    stop = stopping_time(robot, fastest, turning, s.dt) * scene.longest / s.dt
    if s.ramps != 0:
        stop *= 2.0
    _, low = wanted_distance(scene.settings, 0.0, age)
    still = radius + fastest * (horizon + stop)
    count = 0
    for i in range(points.shape[0]):
        body = point_body(scene, (points[i, 0], points[i, 1]), low, i)
        if body.x * body.x + body.y * body.y < (body.keep + still) ** 2:
            set_body(bodies, count, keep_at_most(scene, body))
            count += 1
    first = count
    if horizon > 0.0:
        group_points(scene, count)
    for i in range(capsules.shape[0]):
        body = capsule_body(scene, capsules, i, age, horizon)
        apart = math.sqrt(body.x * body.x + body.y * body.y) - body.spread
        near = apart < still
        if body.kind == MOVES:
            near = apart < radius + (body.speed + fastest) * horizon
        elif body.kind == CREEPS:
            near = body.growth <= s.speed_low and apart < still + body.growth * stop
        if near:
            set_body(bodies, count, keep_at_most(scene, body))
            count += 1
    sort_bodies(bodies[first:count])
    return count


@compiled_once
def comes_first(bodies: Array, i: int, j: int) -> bool:
    """Return whether row i comes before row j by the first number that differs."""
    for column in range(OWNER):
        if bodies[i, column] != bodies[j, column]:
            return bool(bodies[i, column] < bodies[j, column])
    return False


@compiled_once
def sort_bodies(bodies: Array) -> None:
    """Sort the rows, so that the order in which obstacles are given decides nothing.

    Shell's method, in place.
    """
    gap = count = bodies.shape[0]
    while gap > 1:
        gap = max(gap * 5 // 11, 1)
        for i in range(gap, count):
            j = i - gap
            while j >= 0 and comes_first(bodies, j + gap, j):
                for column in range(bodies.shape[1]):
                    kept = bodies[j, column]
                    bodies[j, column] = bodies[j + gap, column]
                    bodies[j + gap, column] = kept
                j -= gap


@compiled_once
def group_points(scene: Scene, count: int) -> None:
    """Gather points given one after the other that lie together, as those of a scan."""
    bodies, begin, made = scene.bodies, 0, 0
    for i in range(1, count + 1):
        a, b = bodies[begin], bodies[min(i, count - 1)]
        square = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
        near = square < WIDE * WIDE * (a[0] ** 2 + a[1] ** 2)
        if i < count and i - begin < MANY and near:
            continue
        if i - begin >= FEW and made < scene.groups.shape[0]:
            set_body(scene.groups, made, group_of(scene, begin, i))
            bodies[begin, GROUP] = made
            made += 1
        begin = i


@compiled_once
def group_of(scene: Scene, begin: int, end: int) -> Body:
    """Return the wall that has no more room than any of these points."""
    one, other = body_at(scene, begin), body_at(scene, end - 1)
    axis = Segment(one.x, one.y, other.x, other.y)
    keep, r_min, z = 0.0, math.inf, 0.0
    for i in range(begin, end):
        body = body_at(scene, i)
        d_x, d_y = from_segment(axis, body.x, body.y)
        keep = max(keep, body.keep + math.sqrt(d_x * d_x + d_y * d_y) + TINY)
        r_min = min(r_min, body.keep - body.inflation)
    x, y = 0.5 * (one.x + other.x), 0.5 * (one.y + other.y)
    x1, y1, x2, y2 = one.x - x, one.y - y, other.x - x, other.y - y
    spread = keep + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, z, z, z, keep, keep - r_min, spread, z, z,
                STANDS, float(end), math.inf, -1.0)
    # fmt: on


@compiled_once
def point_body(scene: Scene, place: Pair, low: float, owner: int) -> Body:
    """Return a point that stands, and from which ``low`` m are to be kept."""
    (x, y), keep, margin, z = place, low, low - scene.settings[0].r_min_slow, 0.0
    if scene.settings[0].closing_gain > 0.0:
        keep += closing_margin(scene, place, (0.0, 0.0))
    # fmt: off
    return Body(x, y, z, z, z, z, z, z, z, keep, margin, keep, z, z, STANDS,
                float(owner), math.inf, -1.0)
    # fmt: on


@compiled_once
def capsule_body(
    scene: Scene, capsules: Array, i: int, age: float, horizon: float
) -> Body:
    """Return a capsule that stands, moves, or creeps, where the horizon is 0.

    The end farther back comes first: which was given first decides nothing.

    Args:
        scene: Of the step.
        capsules: The table.
        i: Row of it.
        age: Of the measurement, s.
        horizon: Of the look-ahead, s; 0: there is none.
    """
    c, speed, growth = capsules[i], speed_bound(capsules, i), 0.0
    x, y, v_x, v_y = c[table.PIVOT_X], c[table.PIVOT_Y], c[table.V_X], c[table.V_Y]
    r_min, keep = wanted_distance(scene.settings, speed, age)
    keep += closing_margin(scene, (x, y), (v_x, v_y)) + c[table.RADIUS]
    x1, y1, x2, y2 = c[table.X1], c[table.Y1], c[table.X2], c[table.Y2]
    nearer, level = abs(y2) < abs(y1), abs(y2) == abs(y1)
    if x2 < x1 or (x2 == x1 and (nearer or (level and y2 < y1))):
        x1, y1, x2, y2 = x2, y2, x1, y1
    x1, y1, x2, y2 = x1 - x, y1 - y, x2 - x, y2 - y
    spread = keep + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    kind, turn = MOVES, c[table.TURN]
    if speed <= SPEED_AT_REST or horizon == 0.0:
        kind, growth = (STANDS, 0.0) if speed <= SPEED_AT_REST else (CREEPS, speed)
        v_x, v_y, turn, speed = 0.0, 0.0, 0.0, 0.0
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, v_x, v_y, turn, keep, keep - r_min, spread, speed,
                growth, kind, c[table.OWNER], math.inf, -1.0)
    # fmt: on


@compiled_once
def keep_at_most(scene: Scene, body: Body) -> Body:
    """Cap the distance to keep from a static body at the present one plus ε."""
    far, b = limits_of(scene.robot).circumradius + body.spread, body
    if b.kind == MOVES or b.x**2 + b.y**2 >= far * far:
        return body
    distance, growth = line_distance(scene.edges, body), b.growth
    missing = b.keep - distance - tolerance(scene)
    if missing > 0.0:
        growth = 0.0
    missing = max(missing, 0.0)
    keep, spread = b.keep - missing, b.spread - missing
    # fmt: off
    return Body(b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, keep,
                b.inflation, spread, b.speed, growth, b.kind, b.owner, distance - keep,
                b.group)
    # fmt: on


@compiled_once
def closing_margin(scene: Scene, place: Pair, velocity: Pair) -> float:
    """Return by how much r_min grows as robot and obstacle close in, m."""
    closing, (x, y), (v_x, v_y) = scene.settings[0].closing_gain, place, velocity
    if closing == 0.0:
        return 0.0
    apart = max(math.sqrt(x * x + y * y), TINY)
    return float(closing * max(((scene.last[0] - v_x) * x - v_y * y) / apart, 0.0))


@compiled
def moves(scene: Scene, i: int) -> bool:
    """Return whether body i moves."""
    return bool(scene.bodies[i, KIND] == MOVES)


@compiled
def is_point(body: Body) -> bool:
    """Return whether a body has no length."""
    return body.spread == body.keep


@compiled_once
def line_distance(edges: Array, body: Body) -> float:
    """Return the signed distance of the footprint from the line of a body now, m."""
    x, y = body.x, body.y
    if is_point(body):
        return point_contact(edges, x, y).distance
    wall = Segment(x + body.x1, y + body.y1, x + body.x2, y + body.y2)
    return wall_contact(edges, wall).distance
