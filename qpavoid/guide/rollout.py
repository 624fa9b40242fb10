"""Rollouts of candidates: where a robot gets that goes on in closed loop, at what cost.

A *candidate* is something to do for the next seconds: to track the reference by the
tracking law; to follow it at an offset to its left and at a share of its pace; or to
hold a twist for a while and track then. It is driven on in ticks of 0.1 s, within the
robot's limits, among bodies that keep their velocities, and costs per tick

    |p − r|² + heading·(1 − cos Δγ) + near·(soft − room)²₊ + deep·(−room)₊

with r the place of the reference at that time, pulled in to what the robot could reach
by then, and room the clearance less r_min; and more, the sooner, for going within it.
Robot frame of the present.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Scene, body_at
from qpavoid.avoidance.motion import ends_at, line_contact
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.model.robot import limit_twist, limits_of
from qpavoid.tracking.clock import row_at
from qpavoid.tracking.kanayama import Reference
from qpavoid.tracking.station import track_step
from qpavoid.types import Array, Pair, Pose, Twist

TICK = 0.1
"""s of a rollout."""

X, Y, HEADING, V, OMEGA = range(5)
"""Columns of the reference ahead, a row a tick from now on."""

ROWS = 61
"""So many of them: who follows looks farther than the horizon."""

TRACK, FOLLOW, HOLD = 0.0, 1.0, 2.0
"""Kinds of candidates."""

LOOK, LOOK_TIME = 0.5, 0.4
"""m and s; who follows steers to the point of the path so far ahead, at his speed."""

CATCH_UP = 1.5
"""1/s; by so much per m of lag who follows is faster than the reference."""

STEEP = 1.2
"""rad; who looks so far aside from his heading turns on the spot."""

GRAZE, DEEP = 5e-3, 0.15
"""m within r_min: so little is rounding, and so much ends a rollout."""

LOST = 1e3
"""Cost of a tick after that."""

MOST = 2.0
"""m/s and rad/s; a robot without limits is taken to keep these."""


class Candidate(NamedTuple):
    """What to do for the next seconds.

    Attributes:
        kind: :data:`TRACK`, :data:`FOLLOW` or :data:`HOLD`.
        a: Offset to the left, m; or v, m/s.
        b: Share of the reference's pace; or ω, rad/s.
        held: Ticks for which (v, ω) is held.
    """

    kind: float
    a: float
    b: float
    held: float


class Course(NamedTuple):
    """What all rollouts of a step share.

    Attributes:
        scene: Bodies, robot, twist driven last.
        ahead: (n, 5) the reference at its own pace, a row a tick.
        law: Of the tracker.
        settings: One :data:`qpavoid.guide.settings.RECORD`.
    """

    scene: Scene
    ahead: Array
    law: Array
    settings: npt.NDArray[np.void]


class Judgement(NamedTuple):
    """What a rollout comes to.

    Attributes:
        cost: m².
        room: Least one, m, at most ``soft``.
    """

    cost: float
    room: float


@compiled_once
def room_at_pose(scene: Scene, at: Frame, time: float, enough: float) -> float:
    """Return the least room of all bodies for a robot at a pose at a time, m."""
    least, radius = enough, limits_of(scene.robot).circumradius
    for i in range(scene.bodies.shape[0]):
        body = body_at(scene, i)
        d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
        far = radius + body.spread + least
        if far > 0.0 and d_x * d_x + d_y * d_y < far * far:
            touch = line_contact(scene.edges, body, ends_at(body, time, at))
            least = min(least, touch.distance - body.keep)
    return least


@compiled
def reference_at(ahead: Array, row: int) -> Reference:
    """Return a row of the reference ahead."""
    r = ahead[row]
    return Reference(r[X], r[Y], r[HEADING], r[V], r[OMEGA])


@compiled_once
def fill_ahead(
    plan: Array, place: float, pose: Pose, stride: float, ahead: Array
) -> None:
    """Fill in the reference ahead, robot frame, a row a tick from a place on.

    Args:
        plan: As :func:`qpavoid.tracking.clock.row_at` takes it, world frame.
        place: Of the first row, in control steps.
        pose: Of the robot, world frame.
        stride: Control steps in a tick.
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


@compiled_once
def nearest_row(ahead: Array, row: int, at: Frame) -> int:
    """Return the row nearest to a place, from one on as long as they come nearer."""
    least = (ahead[row, X] - at.x) ** 2 + (ahead[row, Y] - at.y) ** 2
    while row + 1 < ahead.shape[0]:
        away = (ahead[row + 1, X] - at.x) ** 2 + (ahead[row + 1, Y] - at.y) ** 2
        if away > least:
            break
        row, least = row + 1, away
    return row


@compiled_once
def point_ahead(ahead: Array, row: int, way: float, offset: float) -> Pair:
    """Return the place a way further on than a row, beside it; straight on at last."""
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
    course: Course, at: Frame, row: int, place: float, offset: float
) -> Twist:
    """Return the twist that follows the reference at an offset.

    Pure pursuit [Coulter1992]: ω = 2 v sin α / D to a point of the path ahead, in the
    distance D at the bearing α, and as much slower as that lies aside.

    Args:
        course: The reference ahead, and the robot's limits.
        at: Where the robot is.
        row: The nearest of the reference.
        place: Where on it the robot should be by now, in ticks.
        offset: To its left, m.
    """
    ahead, limits = course.ahead, limits_of(course.scene.robot)
    t = min(int(place), ahead.shape[0] - 2)
    share = min(place - t, 1.0)
    cos, sin = math.cos(ahead[t, HEADING]), math.sin(ahead[t, HEADING])
    lag = (ahead[t, X] - at.x) * cos + (ahead[t, Y] - at.y) * sin
    d_x, d_y = ahead[t + 1, X] - ahead[t, X], ahead[t + 1, Y] - ahead[t, Y]
    lag += share * (d_x * cos + d_y * sin)
    v = min(max(ahead[t, V] + CATCH_UP * lag, 0.0), min(limits.v_max, MOST))
    x, y = point_ahead(ahead, row, LOOK + LOOK_TIME * v, offset)
    d_x, d_y = x - at.x, y - at.y
    along, aside = at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x
    angle, most = math.atan2(aside, along), min(limits.omega_max, MOST)
    if abs(angle) > STEEP:
        return 0.0, math.copysign(most, angle)
    v *= 1.0 - abs(angle) / STEEP
    away = math.sqrt(d_x * d_x + d_y * d_y)
    omega = 2.0 * v * math.sin(angle) / max(away, 0.2) + angle * min(1.0, 5.0 * v)
    return v, min(max(omega, -most), most)


@compiled_once
def roll_on(course: Course, candidate: Candidate, limit: float) -> Judgement:
    """Return what a candidate comes to; one dearer than ``limit`` not to its end."""
    scene, ahead, s = course.scene, course.ahead, course.settings[0]
    robot, last, n = scene.robot, ahead.shape[0] - 1, round(s.horizon / TICK)
    at, heading, row, mode = Frame(0.0, 0.0, 1.0, 0.0), 0.0, 0, 0
    twist, cost, least = scene.last, 0.0, s.soft
    fastest = min(limits_of(robot).v_max, MOST)
    for k in range(n):
        if candidate.kind == HOLD and k < candidate.held:
            target = (candidate.a, candidate.b)
        elif candidate.kind == FOLLOW:
            row = nearest_row(ahead, row, at)
            target = follow_twist(course, at, row, candidate.b * (k + 1), candidate.a)
        else:
            j = min(k, last)
            pose, there = (at.x, at.y, heading), reference_at(ahead, j)
            v, omega, mode = track_step(course.law, robot, pose, there, mode)
            target = (v, omega)
        twist = limit_twist(robot, target, twist, TICK)
        at = moved_on(at, twist[0], twist[1], TICK)
        heading += twist[1] * TICK
        time, j = TICK * (k + 1), min(k + 1, last)
        x, y = ahead[j, X], ahead[j, Y]
        share = min(1.0, fastest * time / max(math.sqrt(x * x + y * y), 1e-9))
        cost += (at.x - share * x) ** 2 + (at.y - share * y) ** 2
        cost += s.heading * (1.0 - math.cos(heading - ahead[j, HEADING]))
        room = room_at_pose(scene, at, time, s.soft)
        least, cost = min(least, room), cost + s.near * (s.soft - room) ** 2
        if room < -GRAZE:
            cost += s.deep * -room + s.enter * (n - k) / n
            if room < -DEEP:
                return Judgement(cost + LOST * (n - k), least)
        if cost > limit:
            break
    return Judgement(cost, least)
