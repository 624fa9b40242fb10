"""What is coming: obstacles in reach, the way of a plan, and the room along it.

A plan is two twists, one after the other, each reached from the one before at full
acceleration; obstacles keep their velocities. Robot frame of the present.

The room of a body at a tick is its distance from the footprint less the distance
wanted; the least over all bodies and ticks is looked for. **Pruning never changes it**:
what is left out cannot have less.

1. Signed distances grow as sets shrink. A circle of radius R round the axle's middle p
   holds the footprint, one of radius ``spread`` round the middle m of a group all its
   bodies and the distances they want. Hence, with d the signed distance of m from the
   footprint, |p − m| − R − spread ≤ d − spread ≤ room.
2. From one tick to the next p moves at most |v|·tick, a point of the footprint
   |ω|·R·tick more, a body |v_o|·tick. The distance of two points changes at most by
   their shifts, the signed distance of convex sets by the greatest shift of any of
   their points.
   Where a bound is c now, the room j ticks on is at least c − j·pace, hence not below
   the least so far for all j ≤ (c − least)/pace.

Rounding does not break this: no bound is trusted by :data:`ROUNDING`.
"""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.rows import STILL, wanted_distance
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import Touch, point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import OWNER as CAPSULE_OWNER
from qpavoid.model.obstacles import RADIUS, Arrays, capsule_at, velocity_at

FASTEST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""

ROUNDING = 1e-9
"""m, and m a tick."""

TOGETHER, WIDTH = 8, 0.25
"""Neighbours at rest are looked at as one: at most so many, so near (m)."""

Scene: TypeAlias = tuple[Array, Array, npt.NDArray[np.void], Array, Array, Array]
"""Edges, robot, settings, bodies, groups, poses; the last three are tables of nine
columns, the poses (n + 1) have six: those of tick k = 0 … n, k = 0 is the present."""

X, Y, V_X, V_Y, SPREAD = 0, 1, 5, 6, 7
"""Of body and group: place, velocity, and the radius round its middle (the place of a
group) within which no footprint point may come."""

END_X, END_Y, WANTED, OWNER = 2, 3, 4, 8
"""Of a body, a line from its place (discs: to the same): its end, the distance wanted
(radius, r_min, and what may be lost between two ticks), the number of the obstacle."""

FIRST, PAST, TICKS, SPEED = 2, 3, 4, 8
"""Of a group: its first body, that of the next; how many ticks are looked at; |v_o|."""

COS, SIN, V, OMEGA = 2, 3, 4, 5
"""Of a pose, beside its place: cos γ, sin γ, and the twist driven there."""


@compiled_once
def bodies_in_reach(
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    last_v: float,
    bodies: Array,
) -> int:
    """Fill in the bodies that the robot could meet within its horizon; return how many.

    Where r_min grows with the closing speed it is that of the axle's middle, driven as
    last.

    What turns is taken to go straight on, each edge with the velocity of its middle.

    Between two looks at most the way v·tick/2 to the nearest is missed; where the
    obstacle passes at a distance D that hides √(D² + (v·tick/2)²) − D.
    """
    s = settings[0]
    points, capsules = obstacles
    fastest = min(max(-robot[0], robot[1]), FASTEST)
    turning = 0.5 * robot[8] * min(max(-robot[2], robot[3]), FASTEST)
    _, low = wanted_distance(settings, 0.0, age)
    n_points = points.shape[0]
    count = 0
    for i in range(n_points + capsules.shape[0]):
        v_x = v_y = speed = 0.0
        wanted, owner, j = low, i, i - n_points
        if j < 0:
            x1, y1 = points[i, 0], points[i, 1]
            x2, y2 = x1, y1
        else:
            x1, y1, x2, y2 = capsule_at(capsules, j, 0.0)
            owner = int(capsules[j, CAPSULE_OWNER])
            v_x, v_y = velocity_at(capsules, j, 0.5 * (x1 + x2), 0.5 * (y1 + y2))
            speed = math.sqrt(v_x * v_x + v_y * v_y)
            _, wanted = wanted_distance(settings, speed, age)
            wanted += capsules[j, RADIUS]
        x, y = 0.5 * (x1 + x2), 0.5 * (y1 + y2)
        if s.closing > 0.0:
            apart = max(math.sqrt(x * x + y * y), 1e-9)
            wanted += s.closing * max(((last_v - v_x) * x - v_y * y) / apart, 0.0)
        missed = 0.5 * s.tick * (speed + fastest + turning)
        wanted = math.sqrt(wanted * wanted + missed * missed)
        spread = 0.5 * math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2) + wanted
        horizon = s.horizon if speed > STILL else s.horizon_still
        reach = spread + robot[8] + (speed + fastest) * horizon
        if x * x + y * y < reach * reach:
            bodies[count, X], bodies[count, Y] = x1, y1
            bodies[count, END_X], bodies[count, END_Y] = x2, y2
            bodies[count, V_X], bodies[count, V_Y] = v_x, v_y
            bodies[count, WANTED], bodies[count, SPREAD] = wanted, spread
            bodies[count, OWNER] = owner
            count += 1
    return count


@compiled
def may_join(bodies: Array, i: int) -> bool:
    """Return whether body i is a point or disc that stands."""
    moves = bodies[i, V_X] != 0.0 or bodies[i, V_Y] != 0.0
    return not moves and bodies[i, SPREAD] == bodies[i, WANTED]


@compiled_once
def group_bodies(
    settings: npt.NDArray[np.void], bodies: Array, groups: Array
) -> tuple[int, int]:
    """Fill in the groups; return how many there are, and their greatest ticks.

    Neighbours in the order of the bodies, as those of a scan are, where they stand;
    what moves goes alone, and so do walls.
    """
    s, n = settings[0], bodies.shape[0]
    count = end = longest = 0
    while end < n:
        begin = end
        x0 = x1 = 0.5 * (bodies[begin, X] + bodies[begin, END_X])
        y0 = y1 = 0.5 * (bodies[begin, Y] + bodies[begin, END_Y])
        end += 1
        last = min(n, begin + TOGETHER) if may_join(bodies, begin) else end
        while end < last and may_join(bodies, end):
            x, y = bodies[end, X], bodies[end, Y]
            if max(x1 - x, x - x0, y1 - y, y - y0) > WIDTH:
                break
            x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
            end += 1
        x, y, spread = 0.5 * (x0 + x1), 0.5 * (y0 + y1), bodies[begin, SPREAD]
        for i in range(begin, end if end > begin + 1 else begin):
            d_x, d_y = bodies[i, X] - x, bodies[i, Y] - y
            away = math.sqrt(d_x * d_x + d_y * d_y)
            spread = max(spread, away + bodies[i, SPREAD])
        v_x, v_y = bodies[begin, V_X], bodies[begin, V_Y]
        speed = math.sqrt(v_x * v_x + v_y * v_y)
        ticks = round((s.horizon if speed > STILL else s.horizon_still) / s.tick)
        groups[count, X], groups[count, Y], groups[count, SPREAD] = x, y, spread
        groups[count, V_X], groups[count, V_Y], groups[count, SPEED] = v_x, v_y, speed
        groups[count, FIRST], groups[count, PAST] = begin, end
        groups[count, TICKS] = ticks
        longest = max(longest, ticks)
        count += 1
    return count, longest


@compiled
def ramp(value: float, target: float, rate: float, dt: float) -> tuple[float, float]:
    """Return the value after dt on its way to the target, and its mean meanwhile."""
    gap = target - value
    if gap == 0.0:
        return target, target
    if abs(gap) >= rate * dt:
        end = value + math.copysign(rate * dt, gap)
        return end, 0.5 * (value + end)
    return target, target - 0.5 * gap * abs(gap) / (rate * dt)


@compiled_once
def drive(scene: Scene, begin: int, end: int, v: float, omega: float) -> None:
    """Fill in the poses after tick ``begin`` to ``end``, towards (v, ω)."""
    _, robot, settings, _, _, poses = scene
    tick = settings[0].tick
    x, y, cos, sin = (
        poses[begin, X],
        poses[begin, Y],
        poses[begin, COS],
        poses[begin, SIN],
    )
    u_v, u_omega = poses[begin, V], poses[begin, OMEGA]
    old_v = old_omega = math.inf
    step_x = step_y = step_sin = 0.0
    step_cos = 1.0
    for k in range(begin + 1, end + 1):
        u_v, mean_v = ramp(u_v, v, robot[4], tick)
        u_omega, mean_omega = ramp(u_omega, omega, robot[5], tick)
        if mean_v != old_v or mean_omega != old_omega:
            step_x, step_y, turn = arc(0.0, 0.0, 0.0, mean_v, mean_omega, tick)
            step_cos, step_sin = math.cos(turn), math.sin(turn)
            old_v, old_omega = mean_v, mean_omega
        x += cos * step_x - sin * step_y
        y += sin * step_x + cos * step_y
        cos, sin = cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin
        poses[k, X], poses[k, Y], poses[k, COS], poses[k, SIN] = x, y, cos, sin
        poses[k, V], poses[k, OMEGA] = u_v, u_omega


@compiled
def seen_from(poses: Array, k: int, x: float, y: float) -> tuple[float, float]:
    """Return a place as the robot sees it from the pose of tick k."""
    d_x, d_y = x - poses[k, X], y - poses[k, Y]
    cos, sin = poses[k, COS], poses[k, SIN]
    return cos * d_x + sin * d_y, cos * d_y - sin * d_x


@compiled
def body_contact(scene: Scene, i: int, k: int) -> Touch:
    """Return the contact with the line of body i, seen from the pose of tick k."""
    edges, _, settings, bodies, _, poses = scene
    on_x = bodies[i, V_X] * (settings[0].tick * k)
    on_y = bodies[i, V_Y] * (settings[0].tick * k)
    x, y = seen_from(poses, k, bodies[i, X] + on_x, bodies[i, Y] + on_y)
    if bodies[i, SPREAD] == bodies[i, WANTED]:
        return point_contact(edges, x, y)
    x2, y2 = seen_from(poses, k, bodies[i, END_X] + on_x, bodies[i, END_Y] + on_y)
    return wall_contact(edges, x, y, x2, y2)


@compiled_once
def nearest_body(scene: Scene, g: int, k: int) -> tuple[float, int]:
    """Return the least room of the bodies of a group at tick k, m, and which has it."""
    bodies, groups = scene[3], scene[4]
    least, which = math.inf, -1
    for i in range(int(groups[g, FIRST]), int(groups[g, PAST])):
        room = body_contact(scene, i, k)[4] - bodies[i, WANTED]
        if room < least:
            least, which = room, i
    return least, which


@compiled
def look(scene: Scene, g: int, k: int, least: float) -> tuple[float, int]:
    """Return the least room of a group at tick k, m, and the body that has it.

    Exact where it is below ``least``, else a bound not below it. Body −1: the bound is
    that of the circles, whose distance does not change as the robot turns.
    """
    edges, robot, settings, bodies, groups, poses = scene
    time, spread = settings[0].tick * k, groups[g, SPREAD]
    x, y = groups[g, X] + groups[g, V_X] * time, groups[g, Y] + groups[g, V_Y] * time
    d_x, d_y = x - poses[k, X], y - poses[k, Y]
    room = math.sqrt(d_x * d_x + d_y * d_y) - robot[8] - spread
    if room >= least + ROUNDING:
        return room, -1
    room = point_contact(edges, *seen_from(poses, k, x, y))[4] - spread
    first = int(groups[g, FIRST])
    if room >= least + ROUNDING or spread == bodies[first, WANTED]:
        return room, first
    return nearest_body(scene, g, k)


@compiled_once
def least_room(
    scene: Scene, begin: int, end: int, enough: float, at_once: bool, first: int
) -> tuple[float, int, int, int]:
    """Return the least room after tick ``begin`` up to ``end``, m, and where it is.

    Exact where it is below ``enough``, else ``enough``; group, body (−1: none) and
    tick. The twist is to change in one direction meanwhile. The search starts with the
    group ``first`` and ends, if ``at_once``, at any room below ``enough``.
    """
    _, robot, settings, _, groups, poses = scene
    tick, count = settings[0].tick, groups.shape[0]
    moving = tick * max(abs(poses[begin, V]), abs(poses[end, V])) + ROUNDING
    turning = tick * robot[8] * max(abs(poses[begin, OMEGA]), abs(poses[end, OMEGA]))
    least, where, body, when = enough, first, -1, end
    for j in range(count):
        g = first + j if first + j < count else first + j - count
        last, k = min(end, int(groups[g, TICKS])), begin + 1
        while k <= last:
            room, which = look(scene, g, k, least)
            if which >= 0 and room < least:
                least, where, body, when = room, g, which, k
                if at_once:
                    return least, where, body, when
            pace = moving + tick * groups[g, SPEED]
            pace += turning if which >= 0 else 0.0
            k += 1 + int(min(max(room - least - ROUNDING, 0.0) / pace, last))
    return least, where, body, when
