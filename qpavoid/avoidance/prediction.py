"""What is coming: the bodies in reach, and the way of a plan.

A *body* is an obstacle, or an edge of one, with the distance that is to be kept from
it. A *plan* is two twists, one after the other, each reached from the one before at
full acceleration, and then braking to rest. Its *rollout* is the way that a robot goes
whose twist jumps at the start of a control step and is then held: arcs, one after the
other, exact. Robot frame of the present; bodies keep their velocities.
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
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.model.robot import braking_steps, limit_twist, stopping_time
from qpavoid.qp.exact import Box, Pair

TOLERANCE = 1e-3
"""ε in m: by how much r_min may be undercut, by rounding and iteration."""

FASTEST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""

X, Y, LEVER_X1, LEVER_Y1, LEVER_X2, LEVER_Y2, V_X, V_Y, TURN = range(9)
KEEP, TOUCH, SPREAD, SPEED, GROWTH, KIND, OWNER = range(9, 16)
BODY = 16
"""Columns of a body, a line: its pivot, and its ends from there (m); velocity of the
pivot and rate of turn; the distance to keep (radius, margins, r_min), and what of it is
not r_min, m; the radius round the pivot that holds all that; the greatest speed of a
point of it, m/s; how fast the distance to keep grows, m/s; kind, number of the obstacle.
"""

STANDS, MOVES, CREEPS = 0.0, 1.0, 2.0
"""Kinds. What is slow creeps for a filter that does not look ahead: it stands, and grows
as fast as it moves, whatever its direction."""

BEGIN, POSE_X, POSE_Y, COS, SIN, DRIVE_V, DRIVE_OMEGA, STEPS = range(8)
SHARE_V, SHARE_OMEGA, X_BY_V, Y_BY_V, X_BY_OMEGA, Y_BY_OMEGA, TURN_BY_OMEGA = range(
    8, 15
)
ARC = 15
"""Columns of an arc: when it begins, s; the pose there; its twist; in how many control
steps that is braked away (``inf``: it is kept); derivatives of twist and pose by the
first target."""


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


class Plan(NamedTuple):
    """A twist, from ``switch`` on another, from ``end`` on braking along the arc.

    Attributes:
        v: m/s, driven towards at full acceleration, as all parts.
        omega: rad/s.
        switch: s.
        v_then: m/s.
        omega_then: rad/s.
        end: s; at least one control step.
    """

    v: float
    omega: float
    switch: float
    v_then: float
    omega_then: float
    end: float


class Rollout(NamedTuple):
    """The way of a plan.

    Attributes:
        arcs: (n, :data:`ARC`); the last one goes on to its end.
        speed: Greatest |v|, m/s.
        turning: Greatest |ω|, rad/s.
        rest: From when on the robot stands, s.
    """

    arcs: Array
    speed: float
    turning: float
    rest: float


@compiled
def hold(v: float, omega: float, end: float) -> Plan:
    """Return the plan of one twist."""
    return Plan(v, omega, end, v, omega, end)


@compiled
def most_arcs(settings: npt.NDArray[np.void]) -> int:
    """Return how many arcs a rollout has at most."""
    return int(math.ceil(settings[0].horizon / settings[0].dt)) + 6


@compiled
def look_box(robot: Array) -> Box:
    """Return the twists that a target can be."""
    return (
        max(robot[0], -FASTEST),
        min(robot[1], FASTEST),
        max(robot[2], -FASTEST),
        min(robot[3], FASTEST),
    )


# ------------------------------------------------------------------------ bodies
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
        if bodies[i, KIND] != MOVES:
            keep_at_most(scene.edges, bodies, i, robot[8])
    return count


@compiled
def keep_at_most(edges: Array, bodies: Array, i: int, circumradius: float) -> None:
    """Let a body want no more than there is now, and :data:`TOLERANCE`."""
    far = circumradius + bodies[i, SPREAD]
    if bodies[i, X] ** 2 + bodies[i, Y] ** 2 < far * far:
        distance = line_distance(edges, bodies, i)
        missing = bodies[i, KEEP] - distance - TOLERANCE
        if missing > 0.0:
            bodies[i, KEEP] -= missing
            bodies[i, SPREAD] -= missing


@compiled
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


# ---------------------------------------------------------------------- rollouts
@compiled
def ramp(
    now: float, target: float, step: float, many: int
) -> tuple[float, float, float]:
    """Return a value after ``many`` steps towards the target, its mean, ∂mean/∂target.

    It moves by ``step`` at the start of each, as far as to the target.
    """
    gap = target - now
    full = min(float(many), math.floor(abs(gap) / step))
    moved = math.copysign(step, gap)
    end = target if full < many else now + many * moved
    rest = float(many) - full
    mean = (full * now + 0.5 * full * (full + 1.0) * moved + rest * target) / many
    return end, mean if full > 0.0 else target, rest / many


@compiled
def set_arc(
    arcs: Array, row: int, begin: float, at: Frame, twist: Pair, steps: float
) -> None:
    """Write an arc that does not depend on the target."""
    arcs[row, BEGIN], arcs[row, STEPS] = begin, steps
    arcs[row, POSE_X], arcs[row, POSE_Y] = at.x, at.y
    arcs[row, COS], arcs[row, SIN] = at.cos, at.sin
    arcs[row, DRIVE_V], arcs[row, DRIVE_OMEGA] = twist
    arcs[row, SHARE_V] = arcs[row, SHARE_OMEGA] = 0.0


@compiled_once
def roll_out(scene: Scene, plan: Plan, now: Pair, lead: float, many: int) -> Rollout:
    """Return the way of a plan: ``now`` is driven for ``lead`` s, then on from there.

    With a lead of a control step ``now`` is the twist to be driven next; with none it
    is the one driven last. Accelerations are counted in ``many`` control steps at
    once, by their mean; 1 is exact, and keeps the wheels' limits.
    """
    robot, dt, arcs = scene.robot, scene.settings[0].dt, scene.arcs
    at, time, row, hardly = Frame(0.0, 0.0, 1.0, 0.0), 0.0, 0, 1e-6 * dt
    speed, turning = 0.0, 0.0
    (twist_v, twist_omega), last = now, plan.end - dt
    if 0.0 < lead <= last + hardly:
        set_arc(arcs, 0, 0.0, at, now, math.inf)
        at, time, row = moved_on(at, now[0], now[1], lead), lead, 1
        speed, turning = abs(now[0]), abs(now[1])
    for part in range(2):
        until, v, omega = last, plan.v_then, plan.omega_then
        if part == 0:
            until, v, omega = min(plan.switch, last), plan.v, plan.omega
        while time < until - hardly and row < arcs.shape[0] - 1:
            lasts = min(many * dt, until - time)
            v_end, v_mean, v_share = ramp(twist_v, v, robot[4] * dt, many)
            w_end, w_mean, w_share = ramp(twist_omega, omega, robot[5] * dt, many)
            if many == 1:
                v_end, w_end = limit_twist(robot, v, omega, twist_v, twist_omega, dt)
                v_mean, w_mean = v_end, w_end
            if v_mean == v and w_mean == omega:
                lasts = until - time
            set_arc(arcs, row, time, at, (v_mean, w_mean), math.inf)
            if part == 0:
                arcs[row, SHARE_V], arcs[row, SHARE_OMEGA] = v_share, w_share
            at, time, row = moved_on(at, v_mean, w_mean, lasts), time + lasts, row + 1
            speed, turning = max(speed, abs(v_mean)), max(turning, abs(w_mean))
            twist_v, twist_omega = v_end, w_end
    if row > 0 or lead == 0.0:
        v, omega = plan.v_then, plan.omega_then
        if plan.switch > last + hardly:
            v, omega = plan.v, plan.omega
        twist_v, twist_omega = limit_twist(robot, v, omega, twist_v, twist_omega, dt)
    steps = braking_steps(robot, twist_v, twist_omega, dt)
    set_arc(arcs, row, time, at, (twist_v, twist_omega), steps)
    speed, turning = max(speed, abs(twist_v)), max(turning, abs(twist_omega))
    rest = time + scene.longest * steps if speed + turning > 0.0 else time
    return Rollout(arcs[: row + 1], speed, turning, rest)


@compiled
def braking_place(time: float, steps: float, dt: float) -> float:
    """Return how long (v, ω) drives to where braking in n steps has come by a time, s.

    The first of the steps is driven in full. With n = ∞ the time itself.
    """
    if steps == math.inf:
        return time
    k = min(float(math.floor(time / dt)), steps)
    place = dt * (k - 0.5 * k * (k - 1.0) / steps)
    return place + (time - dt * k) * (1.0 - k / steps)


@compiled
def braking_share(time: float, steps: float, dt: float) -> float:
    """Return the share of the twist that is driven at a time after its arc began."""
    if steps == math.inf:
        return 1.0
    return max(1.0 - math.floor(time / dt + 1e-9) / steps, 0.0)


@compiled
def frame_at(arcs: Array, row: int, time: float, dt: float) -> Frame:
    """Return where the robot is at a time on an arc of a rollout."""
    at = Frame(arcs[row, POSE_X], arcs[row, POSE_Y], arcs[row, COS], arcs[row, SIN])
    place = braking_place(time - arcs[row, BEGIN], arcs[row, STEPS], dt)
    return moved_on(at, arcs[row, DRIVE_V], arcs[row, DRIVE_OMEGA], place)
