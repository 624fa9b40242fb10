"""Rollouts of candidates in closed loop, and their costs.

A *candidate* is a behaviour for the next seconds: tracking the reference by the
tracking law; following it at an offset to its left and a share of its pace; or holding
a twist for a while and tracking then. It is simulated in ticks of 0.1 s, within the
robot's limits, among bodies of constant velocity, with a cost per tick of

    |p − r|² + heading·(1 − cos Δγ) + near·(soft − m + σt)²₊ + deep·(−m)₊

with r the reference at that time, limited to what the robot can reach by then, m the
margin (clearance − r_min), and σt ≤ :data:`MOST_SPREAD` with σ the standard deviation
of an obstacle's velocity. Robot frame of the present.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Scene, ends_at, line_contact
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.kinematics import TINY, Frame, moved_on, wrap_angle
from qpavoid.model.robot import RobotLimits, limit_twist, limits_of
from qpavoid.tracking.clock import LAST_ROW, TimedPlan, row_at
from qpavoid.tracking.kanayama import Reference, tracking_error
from qpavoid.tracking.station import track_step
from qpavoid.types import Array, MatrixWritten, Pair, Pose, Sizes, Twist

X, Y, HEADING, V, OMEGA = range(5)
"""Columns of the reference ahead, one row per tick from now on."""

PURSUIT, PURSUIT_TIME = 0.5, 0.4
"""m and s; pursuit distance ahead, plus that driven in so long."""

CATCH_UP = 1.5
"""1/s; increase of speed per m of lag behind the reference."""

TURN_ON_SPOT = 1.2
"""rad; bearing of the pursuit point from which on the robot turns on the spot."""

TOP_TWIST = 2.0
"""m/s and rad/s; limits of a robot without limits."""

PARK_GAIN, TURN_IN = 3.0, 4.0
"""1/s; v per m and ω per rad towards a pose at rest."""

AT, TURN_FROM = 0.008, 0.5
"""m; distance below which only the heading is corrected. rad; bearing above which the
robot turns on the spot."""


SAME_TURNS = 1e-9
"""rad; tolerance of equal turns of two manoeuvres: the forward one is taken."""


@compiled_once
def nearest_row(ahead: Array, row: int, at: Frame) -> int:
    """Return the row nearest to a position, searched from ``row`` on."""
    least = (ahead[row, X] - at.x) ** 2 + (ahead[row, Y] - at.y) ** 2
    while row + 1 < ahead.shape[0]:
        away = (ahead[row + 1, X] - at.x) ** 2 + (ahead[row + 1, Y] - at.y) ** 2
        if away > least:
            break
        row, least = row + 1, away
    return row


@compiled_once
def point_ahead(ahead: Array, row: int, way: float, offset: float) -> Pair:
    """Return the point ``way`` m beyond a row, at an offset; straight at the end."""
    last = ahead.shape[0] - 1
    while row < last and way > 0.0:
        d_x, d_y = ahead[row + 1, X] - ahead[row, X], ahead[row + 1, Y] - ahead[row, Y]
        way, row = way - math.sqrt(d_x * d_x + d_y * d_y), row + 1
    cos, sin = math.cos(ahead[row, HEADING]), math.sin(ahead[row, HEADING])
    way = max(way, 0.0)
    return (
        ahead[row, X] + way * cos - offset * sin,
        ahead[row, Y] + way * sin + offset * cos,
    )


@compiled_once
def follow_twist(
    robot: Array, ahead: Array, at: Frame, row: int, place: float, offset: float
) -> Twist:
    """Return the twist that follows the reference at an offset.

    Pure pursuit [Coulter1992]: ω = 2 v sin α / D to a point of the path ahead, at the
    distance D and bearing α; v is reduced with α.

    Args:
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        ahead: (n, 5) the reference, one row per tick.
        at: Frame of the robot.
        row: Nearest row of the reference.
        place: Scheduled progress of the robot, in ticks.
        offset: To its left, m.
    """
    limits = limits_of(robot)
    t = min(int(place), ahead.shape[0] - 2)
    share = min(place - t, 1.0)
    cos, sin = math.cos(ahead[t, HEADING]), math.sin(ahead[t, HEADING])
    lag = (ahead[t, X] - at.x) * cos + (ahead[t, Y] - at.y) * sin
    d_x, d_y = ahead[t + 1, X] - ahead[t, X], ahead[t + 1, Y] - ahead[t, Y]
    lag += share * (d_x * cos + d_y * sin)
    v = min(max(ahead[t, V] + CATCH_UP * lag, 0.0), min(limits.v_max, TOP_TWIST))
    x, y = point_ahead(ahead, row, PURSUIT + PURSUIT_TIME * v, offset)
    d_x, d_y = x - at.x, y - at.y
    along, aside = at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x
    angle, most = math.atan2(aside, along), min(limits.omega_max, TOP_TWIST)
    if abs(angle) > TURN_ON_SPOT:
        return 0.0, math.copysign(most, angle)
    v *= 1.0 - abs(angle) / TURN_ON_SPOT
    away = math.sqrt(d_x * d_x + d_y * d_y)
    omega = 2.0 * v * math.sin(angle) / max(away, 0.2) + angle * min(1.0, 5.0 * v)
    return v, min(max(omega, -most), most)


@compiled_once
def turn_in(turn: float, limits: RobotLimits) -> float:
    """Return ω towards a heading, rad/s, from which half the deceleration stops."""
    omega = min(TURN_IN * abs(turn), math.sqrt(limits.angular_acceleration * abs(turn)))
    return math.copysign(min(omega, limits.omega_max, TOP_TWIST), turn)


@compiled_once
def park_twist(robot: Array, goal: Pose) -> Twist:
    """Return the twist towards a pose at rest: turn to it, drive there, turn.

    Forwards or backwards, with the smaller turns.

    Args:
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        goal: Robot frame, m, m, rad.
    """
    (x, y, turn), limits = goal, limits_of(robot)
    way, ahead = math.sqrt(x * x + y * y), 1.0
    if way < AT:
        turn = wrap_angle(turn)
        if abs(turn) < AT:
            return 0.0, 0.0
        return 0.0, turn_in(turn, limits)
    bearing = math.atan2(y, x)
    behind = wrap_angle(bearing + math.pi)
    turns = abs(bearing) + abs(wrap_angle(turn - bearing))
    back = abs(behind) + abs(wrap_angle(turn - behind))
    if limits.v_min < 0.0 and back < turns - SAME_TURNS:
        bearing, ahead = behind, -1.0
    omega = turn_in(bearing, limits)
    if abs(bearing) > TURN_FROM:
        return 0.0, omega
    fastest = min(limits.v_max if ahead > 0.0 else -limits.v_min, TOP_TWIST)
    v = min(PARK_GAIN * way, math.sqrt(limits.acceleration * way), fastest)
    return ahead * v * (1.0 - abs(bearing) / TURN_FROM), omega


TICK = 0.1
"""s; step of a rollout."""

ROWS = 61
"""Ticks of the reference ahead, more than the horizon."""

TRACK, FOLLOW, HOLD, PARK = 0.0, 1.0, 2.0, 3.0
"""Kinds of candidates."""

STAY = 15
"""Ticks for which a parking place has to be clear."""

GRAZE, DEEP = 5e-3, 0.15
"""m within r_min: tolerance for rounding, and violation that ends a rollout."""

MOST_SPREAD = 0.4
"""m; the most by which the uncertainty of a velocity adds to the soft distance."""

VIOLATION_COST = 1e3
"""Cost per tick after such a violation."""


class Candidate(NamedTuple):
    """Behaviour for the next seconds.

    Attributes:
        kind: :data:`TRACK`, :data:`FOLLOW`, :data:`HOLD` or :data:`PARK`.
        a: Offset to the left, m; or v, m/s.
        b: Share of the reference's pace; or ω, rad/s.
        held: Ticks for which (v, ω) is held.
    """

    kind: float
    a: float
    b: float
    held: float


class Course(NamedTuple):
    """Rollout context: data shared by all rollouts of a step.

    Attributes:
        scene: Bodies, robot, twist driven last.
        ahead: (n, 5) the reference at its own pace, one row per tick.
        law: Of the tracker.
        settings: One :data:`qpavoid.guide.settings.RECORD`.
        pace: Greatest speed of axle and corners, m/s.
    """

    scene: Scene
    ahead: Array
    law: Array
    settings: npt.NDArray[np.void]
    pace: float


@compiled_once
def room_at_pose(scene: Scene, at: Frame, time: float, enough: float) -> Pair:
    """Return the least margin of all bodies at a pose and time, m, and that less σt.

    Bodies are skipped by their circles, and by those of groups of points.
    """
    least, radius = enough, limits_of(scene.robot).circumradius
    surest, i = enough, 0
    while i < scene.bodies.shape[0]:
        body = scene.bodies[i]
        i += 1
        if body.group >= 0:
            wall = scene.groups[body.group]
            d_x, d_y = wall.x - at.x, wall.y - at.y
            far = radius + wall.spread + max(least, surest)
            if far <= 0.0 or d_x * d_x + d_y * d_y >= far * far:
                i = wall.owner
                continue
        d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
        spread = min(body.sigma * time, MOST_SPREAD)
        far = radius + body.spread + max(least, surest + spread)
        if far > 0.0 and d_x * d_x + d_y * d_y < far * far:
            contact = line_contact(scene.edges, body, ends_at(body, time, at))
            least = min(least, contact.distance - body.required)
            surest = min(surest, contact.distance - body.required - spread)
    return least, surest


@compiled
def reference_at(ahead: Array, row: int) -> Reference:
    """Return a row of the reference ahead."""
    r = ahead[row]
    return Reference(r[X], r[Y], r[HEADING], r[V], r[OMEGA])


@entry
@compiled_once
def _fill_ahead_fits(
    plan: TimedPlan,
    place: float,
    pose: Pose,
    stride: float,
    ahead: Annotated[MatrixWritten, Sizes(0, 5)],
) -> bool:
    """Return whether all rows have a valid place in the plan."""
    end = place + stride * ahead.shape[0]
    return 0.0 <= place < LAST_ROW and 0.0 <= end < LAST_ROW


@entry_if(_fill_ahead_fits)
@compiled_once
def fill_ahead(
    plan: TimedPlan,
    place: float,
    pose: Pose,
    stride: float,
    ahead: Annotated[MatrixWritten, Sizes(0, 5)],
) -> None:
    """Fill in the reference ahead, robot frame, one row per tick, from ``place`` on.

    Args:
        plan: See :func:`qpavoid.tracking.clock.row_at`, world frame.
        place: Of the first row, in control steps.
        pose: Of the robot, world frame.
        stride: Control steps per tick.
        ahead: (m, 5).
    """
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(ahead.shape[0]):
        there = row_at(plan, place + i * stride)
        d_x, d_y = there.x - x, there.y - y
        ahead[i, X], ahead[i, Y] = cos * d_x + sin * d_y, cos * d_y - sin * d_x
        ahead[i, HEADING] = there.heading - heading
        ahead[i, V], ahead[i, OMEGA] = there.v, there.omega


@compiled
def at_pace(course: Course, twist: Twist) -> Twist:
    """Return a twist scaled along its arc: axle and corners within the pace."""
    corner = limits_of(course.scene.robot).circumradius * abs(twist[1])
    share = min(course.pace / max(abs(twist[0]), corner, TINY), 1.0)
    return share * twist[0], share * twist[1]


@compiled_once
def parking(course: Course, pose: Pose) -> Twist:
    """Return the twist of a robot parking at the end of the reference."""
    x, y, heading, _, _ = reference_at(course.ahead, course.ahead.shape[0] - 1)
    return park_twist(course.scene.robot, tracking_error(pose, (x, y, heading)))


@compiled_once
def arrival(course: Course, candidate: Candidate, soonest: int) -> int:
    """Return the ticks of parking after a held twist, if less than ``soonest``.

    And if it is clear of all bodies until :data:`STAY` ticks later.

    Args:
        course: The reference ahead, whose end is the goal.
        candidate: One to hold, or to park at once.
        soonest: Upper bound of the result.
    """
    scene, s = course.scene, course.settings[0]
    at, heading, twist, stayed = Frame(0.0, 0.0, 1.0, 0.0), 0.0, scene.last, 0
    level = min(s.clear, room_at_pose(scene, at, 0.0, s.clear)[0] - GRAZE)
    for k in range(soonest + STAY):
        target = (candidate.a, candidate.b)
        if k >= candidate.held:
            target = parking(course, (at.x, at.y, heading))
            if target == (0.0, 0.0):
                stayed += 1
                if stayed == STAY:
                    return k + 1 - STAY
        if stayed == 0 and k >= soonest:
            break
        twist = limit_twist(scene.robot, at_pace(course, target), twist, TICK)
        at = moved_on(at, twist[0], twist[1], TICK)
        heading += twist[1] * TICK
        if room_at_pose(scene, at, TICK * (k + 1), s.clear)[0] < level:
            break
    return soonest


@compiled_once
def roll_on(course: Course, candidate: Candidate, limit: float) -> float:
    """Return the cost of a candidate, m²; beyond ``limit`` only a lower bound."""
    scene, ahead, s = course.scene, course.ahead, course.settings[0]
    robot, last, n = scene.robot, ahead.shape[0] - 1, round(s.horizon / TICK)
    at, heading, row, mode = Frame(0.0, 0.0, 1.0, 0.0), 0.0, 0, 0
    twist, cost = scene.last, 0.0
    fastest = min(limits_of(robot).v_max, TOP_TWIST)
    for k in range(n):
        if candidate.kind == HOLD and k < candidate.held:
            target = (candidate.a, candidate.b)
        elif candidate.kind == FOLLOW:
            row = nearest_row(ahead, row, at)
            target = follow_twist(
                robot, ahead, at, row, candidate.b * (k + 1), candidate.a
            )
        elif candidate.kind == PARK:
            target = parking(course, (at.x, at.y, heading))
        else:
            j = min(k, last)
            pose, there = (at.x, at.y, heading), reference_at(ahead, j)
            v, omega, mode = track_step(course.law, robot, pose, there, mode)
            target = (v, omega)
        twist = limit_twist(robot, at_pace(course, target), twist, TICK)
        at = moved_on(at, twist[0], twist[1], TICK)
        heading += twist[1] * TICK
        time, j = TICK * (k + 1), min(k + 1, last)
        x, y = ahead[j, X], ahead[j, Y]
        share = min(1.0, fastest * time / max(math.sqrt(x * x + y * y), TINY))
        cost += (at.x - share * x) ** 2 + (at.y - share * y) ** 2
        cost += s.heading * (1.0 - math.cos(heading - ahead[j, HEADING]))
        if cost > limit:
            break
        room, surest = room_at_pose(scene, at, time, s.soft)
        cost += s.near * (s.soft - surest) ** 2
        if room < -GRAZE:
            cost += s.deep * -room
            if room < -DEEP:
                return float(cost + VIOLATION_COST * (n - k))
    return float(cost)
