"""What is coming: obstacles in reach, the way of a plan, and the room along it.

A plan is two twists, one after the other, each reached from the one before at full
acceleration; obstacles keep their velocities. Robot frame of the present.

**Pruning never changes the answer.** The room of a body at a tick is the signed
distance of its line from the footprint less the distance wanted, and the least over
bodies and ticks is looked for. Left out are only looks that cannot give less:

1. A circle of radius R round the axle's middle holds the footprint, and one of radius
   h round its middle the body; signed distances grow as sets shrink, so that
   |m − p| − R − h − wanted ≤ room. A group of bodies has one circle of its own: m, and
   ``bound`` ≥ |m − m_i| + R + h_i + wanted_i, gives ≤ by the triangle's inequality.
2. From one tick to the next p moves at most |v|·tick, the body |v_o|·tick, and a point
   of the footprint |ω|·R·tick more. The signed distance of convex sets changes at most
   by the greatest shift of a point, the distance of the middles at most by theirs. A
   room c now is hence at least c − j·pace in j ticks, which is not below the least so
   far for j ≤ (c − least)/pace.

Both hold for numbers with rounding, too: bounds are drawn wider by :data:`ROUNDING`.
"""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.rows import STILL, wanted_distance
from qpavoid.compiled import compiled
from qpavoid.model.contact import Touch, point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Arrays

FASTEST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""

PASSING = 3.0
"""m; an obstacle that has come so far has passed."""

ROUNDING = 1e-9
"""m, and m a tick; by so much no bound is trusted."""

TOGETHER, WIDTH = 8, 0.25
"""Neighbours at rest that are looked at as one: at most so many, so near (m)."""

BODY, GROUP, POSE = 10, 9, 6
"""Columns of the tables in :data:`Scene`."""

Scene: TypeAlias = tuple[Array, Array, npt.NDArray[np.void], Array, Array, Array]
"""Edges, robot, settings, bodies, groups, poses: all that a look ahead wants to know.

bodies
    (m, 10) x1, y1, x2, y2 (equal for discs), distance wanted of that line (radius,
    r_min, and what may be lost between two ticks), v_x, v_y, ticks looked at, radius
    within which the middle has no room for certain, number of the obstacle.
groups
    (g, 9) middle (x, y), radius within which some body may have no room, v_x, v_y,
    speed, ticks looked at, first body, first body of the next.
poses
    (n + 1, 6) x, y, cos γ, sin γ, v, ω at every tick; the first is the present.
"""


@compiled
def bodies_in_reach(
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    last_v: float,
    bodies: Array,
) -> int:
    """Fill ``bodies`` with what the robot could meet within its horizon; return m.

    Where r_min grows with the closing speed it is that of the axle's middle, driven as
    last.

    Between two looks at most the way v·tick/2 to the nearest is missed; where the
    obstacle passes at a distance D that hides √(D² + (v·tick/2)²) − D.
    """
    s = settings[0]
    points, discs, disc_velocities, walls = obstacles
    fastest = min(max(-robot[0], robot[1]), FASTEST)
    turning = 0.5 * robot[8] * min(max(-robot[2], robot[3]), FASTEST)
    _, low = wanted_distance(settings, 0.0, age)
    n_points, n_discs = points.shape[0], discs.shape[0]
    count = 0
    for i in range(n_points + n_discs + walls.shape[0]):
        v_x = v_y = speed = radius = 0.0
        wanted, horizon = low, s.horizon_still
        if i < n_points:
            x1, y1 = points[i, 0], points[i, 1]
            x2, y2 = x1, y1
        elif i < n_points + n_discs:
            j = i - n_points
            x1, y1, radius = discs[j, 0], discs[j, 1], discs[j, 2]
            x2, y2 = x1, y1
            v_x, v_y = disc_velocities[j, 0], disc_velocities[j, 1]
            speed = math.sqrt(v_x * v_x + v_y * v_y)
            _, wanted = wanted_distance(settings, speed, age)
            wanted += radius
        else:
            j = i - n_points - n_discs
            x1, y1, x2, y2 = walls[j, 0], walls[j, 1], walls[j, 2], walls[j, 3]
        if speed > STILL:
            horizon = s.horizon
        x, y = 0.5 * (x1 + x2), 0.5 * (y1 + y2)
        if s.closing > 0.0:
            apart = max(math.sqrt(x * x + y * y), 1e-9)
            wanted += s.closing * max(((last_v - v_x) * x - v_y * y) / apart, 0.0)
        missed = 0.5 * s.tick * (speed + fastest + turning)
        wanted = math.sqrt(wanted * wanted + missed * missed)
        half = 0.5 * math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2)
        reach = half + wanted + robot[8] + (speed + fastest) * horizon
        if x * x + y * y < reach * reach:
            bodies[count, 0], bodies[count, 1] = x1, y1
            bodies[count, 2], bodies[count, 3] = x2, y2
            bodies[count, 4], bodies[count, 8] = wanted, half + wanted
            bodies[count, 5], bodies[count, 6] = v_x, v_y
            bodies[count, 7], bodies[count, 9] = round(horizon / s.tick), i
            count += 1
    return count


@compiled
def group_bodies(bodies: Array, groups: Array) -> int:
    """Fill ``groups`` with bodies that are looked at as one; return how many.

    Neighbours in the order of the bodies, as those of a scan are. What moves goes
    alone.
    """
    count = end = 0
    while end < bodies.shape[0]:
        begin = end
        x0 = x1 = 0.5 * (bodies[begin, 0] + bodies[begin, 2])
        y0 = y1 = 0.5 * (bodies[begin, 1] + bodies[begin, 3])
        still = bodies[begin, 5] == 0.0 and bodies[begin, 6] == 0.0
        end += 1
        still = still and bodies[begin, 8] == bodies[begin, 4]
        while still and end < min(bodies.shape[0], begin + TOGETHER):
            x = 0.5 * (bodies[end, 0] + bodies[end, 2])
            y = 0.5 * (bodies[end, 1] + bodies[end, 3])
            wide = max(max(x1, x) - min(x0, x), max(y1, y) - min(y0, y))
            if bodies[end, 5] != 0.0 or bodies[end, 6] != 0.0 or wide > WIDTH or bodies[end, 8] != bodies[end, 4]:
                break
            x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
            end += 1
        x, y, bound = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0
        for i in range(begin, end):
            a = 0.5 * (bodies[i, 0] + bodies[i, 2]) - x
            b = 0.5 * (bodies[i, 1] + bodies[i, 3]) - y
            bound = max(bound, math.sqrt(a * a + b * b) + bodies[i, 8])
        v_x, v_y = bodies[begin, 5], bodies[begin, 6]
        groups[count, 0], groups[count, 1], groups[count, 2] = x, y, bound
        groups[count, 3], groups[count, 4] = v_x, v_y
        groups[count, 5] = math.sqrt(v_x * v_x + v_y * v_y)
        groups[count, 6] = bodies[begin, 7]
        groups[count, 7], groups[count, 8] = begin, end
        count += 1
    return count


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


@compiled
def drive(
    robot: Array,
    tick: float,
    begin: int,
    end: int,
    target_v: float,
    target_omega: float,
    poses: Array,
) -> None:
    """Fill ``poses`` from tick ``begin`` on, where they stand, to ``end``.

    Towards the target twist at full acceleration.
    """
    x, y, cos, sin = poses[begin, 0], poses[begin, 1], poses[begin, 2], poses[begin, 3]
    v, omega = poses[begin, 4], poses[begin, 5]
    old_v = old_omega = math.inf
    step_x = step_y = step_sin = 0.0
    step_cos = 1.0
    for k in range(begin + 1, end + 1):
        v, mean_v = ramp(v, target_v, robot[4], tick)
        omega, mean_omega = ramp(omega, target_omega, robot[5], tick)
        if mean_v != old_v or mean_omega != old_omega:
            step_x, step_y, turn = arc(0.0, 0.0, 0.0, mean_v, mean_omega, tick)
            step_cos, step_sin = math.cos(turn), math.sin(turn)
            old_v, old_omega = mean_v, mean_omega
        x += cos * step_x - sin * step_y
        y += sin * step_x + cos * step_y
        cos, sin = cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin
        poses[k, 0], poses[k, 1], poses[k, 2], poses[k, 3] = x, y, cos, sin
        poses[k, 4], poses[k, 5] = v, omega


@compiled
def body_contact(
    edges: Array, bodies: Array, i: int, time: float, poses: Array, k: int
) -> Touch:
    """Return the contact with the line of body i, seen from the pose of tick k."""
    cos, sin = poses[k, 2], poses[k, 3]
    x = bodies[i, 0] + bodies[i, 5] * time - poses[k, 0]
    y = bodies[i, 1] + bodies[i, 6] * time - poses[k, 1]
    q_x, q_y = cos * x + sin * y, cos * y - sin * x
    if bodies[i, 0] == bodies[i, 2] and bodies[i, 1] == bodies[i, 3]:
        return point_contact(edges, q_x, q_y)
    x, y = bodies[i, 2] - poses[k, 0], bodies[i, 3] - poses[k, 1]
    return wall_contact(edges, q_x, q_y, cos * x + sin * y, cos * y - sin * x)


@compiled
def nearest_body(
    edges: Array, bodies: Array, begin: int, end: int, poses: Array, k: int
) -> tuple[float, int]:
    """Return the least room of the points of a group at tick k, m, and which has it."""
    least, which = math.inf, begin
    cos, sin = poses[k, 2], poses[k, 3]
    for i in range(begin, end):
        x, y = bodies[i, 0] - poses[k, 0], bodies[i, 1] - poses[k, 1]
        q_x, q_y = cos * x + sin * y, cos * y - sin * x
        room = point_contact(edges, q_x, q_y)[4] - bodies[i, 4]
        if room < least:
            least, which = room, i
    return least, which


@compiled
def least_room(
    edges: Array,
    robot: Array,
    tick: float,
    bodies: Array,
    groups: Array,
    poses: Array,
    begin: int,
    end: int,
    enough: float,
    at_once: bool,
    first: int,
) -> tuple[float, int, int, int]:
    """Return the least room after tick ``begin`` up to ``end``, m, and who has it.

    Exact where it is below ``enough``; the group, the body (−1: none), and the
    tick. The twist is to change in one direction meanwhile. The search starts with the group ``first``
    and ends, with ``at_once``, at the first room below ``enough``.
    """
    count = groups.shape[0]
    moving = tick * max(abs(poses[begin, 4]), abs(poses[end, 4])) + ROUNDING
    turning = tick * robot[8] * max(abs(poses[begin, 5]), abs(poses[end, 5]))
    least, where, body, when = enough, first, -1, end
    for j in range(count):
        g = first + j if first + j < count else first + j - count
        last, k = min(end, int(groups[g, 6])), begin + 1
        while k <= last:
            pace, time = moving + tick * groups[g, 5], tick * k
            x = groups[g, 0] + groups[g, 3] * time - poses[k, 0]
            y = groups[g, 1] + groups[g, 4] * time - poses[k, 1]
            room = math.sqrt(x * x + y * y) - robot[8] - groups[g, 2]
            if room < least + ROUNDING:
                cos, sin = poses[k, 2], poses[k, 3]
                q_x, q_y = cos * x + sin * y, cos * y - sin * x
                room = point_contact(edges, q_x, q_y)[4] - groups[g, 2]
                pace += turning
                which = int(groups[g, 7])
                if room < least + ROUNDING:
                    if groups[g, 8] - groups[g, 7] > 1:
                        room, which = nearest_body(
                            edges, bodies, which, int(groups[g, 8]), poses, k
                        )
                    elif groups[g, 2] != bodies[which, 4]:
                        room = body_contact(edges, bodies, which, time, poses, k)[4]
                        room -= bodies[which, 4]
                if room < least:
                    least, where, body, when = room, g, which, k
                    if at_once:
                        return least, where, body, when
            k += 1 + int(min(max(room - least - ROUNDING, 0.0) / pace, last))
    return least, where, body, when
