"""What is coming: obstacles in reach, the way of a plan, and the room along it.

A plan is two twists, one after the other, each reached from the one before at full
acceleration; obstacles keep their velocities. Robot frame of the present.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.rows import STILL, wanted_distance
from qpavoid.compiled import allocating
from qpavoid.model.contact import Touch, point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Arrays

FASTEST = 10.0
"""m/s and rad/s; the look-ahead of a robot without limits stays within these."""

PASSING = 3.0
"""m; an obstacle that has come so far has passed."""

FINEST = 0.05
"""m; the way of an obstacle between two looks at whether it passes."""


@allocating
def bodies_in_reach(
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    last: Array,
) -> tuple[Array, npt.NDArray[np.int64]]:
    """Return what the robot could meet within its horizon, (m, 8), and the numbers.

    Where r_min grows with the closing speed it is that of the axle's middle, driven as
    last.

    Columns: x1, y1, x2, y2 (equal for discs), distance wanted of that line (radius,
    r_min, and what may be lost between two ticks), v_x, v_y, ticks looked at.

    Between two looks at most the way v·tick/2 to the nearest is missed; where the
    obstacle passes at a distance D that hides √(D² + (v·tick/2)²) − D.
    """
    s = settings[0]
    points, discs, disc_velocities, walls = obstacles
    fastest = min(max(-robot[0], robot[1]), FASTEST)
    turning = 0.5 * robot[8] * min(max(-robot[2], robot[3]), FASTEST)
    n_points, n_discs = points.shape[0], discs.shape[0]
    capacity = n_points + n_discs + walls.shape[0]
    bodies = np.empty((capacity, 8))
    owner = np.empty(capacity, dtype=np.int64)
    count = 0
    for i in range(capacity):
        v_x = v_y = radius = 0.0
        if i < n_points:
            x1, y1 = points[i, 0], points[i, 1]
            x2, y2 = x1, y1
        elif i < n_points + n_discs:
            x1, y1, radius = discs[i - n_points]
            x2, y2 = x1, y1
            v_x, v_y = disc_velocities[i - n_points]
        else:
            x1, y1, x2, y2 = walls[i - n_points - n_discs]
        speed = math.sqrt(v_x * v_x + v_y * v_y)
        horizon = s.horizon if speed > STILL else s.horizon_still
        wanted = radius + wanted_distance(settings, speed, age)[1]
        if s.closing > 0.0:
            x, y = 0.5 * (x1 + x2), 0.5 * (y1 + y2)
            apart = max(math.sqrt(x * x + y * y), 1e-9)
            wanted += s.closing * max(((last[0] - v_x) * x - v_y * y) / apart, 0.0)
        missed = 0.5 * s.tick * (speed + fastest + turning)
        wanted = math.sqrt(wanted * wanted + missed * missed)
        length = math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2)
        reach = 0.5 * length + wanted + robot[8] + (speed + fastest) * horizon
        if (0.5 * (x1 + x2)) ** 2 + (0.5 * (y1 + y2)) ** 2 < reach * reach:
            bodies[count, 0], bodies[count, 1] = x1, y1
            bodies[count, 2], bodies[count, 3] = x2, y2
            bodies[count, 4] = wanted
            bodies[count, 5], bodies[count, 6] = v_x, v_y
            bodies[count, 7] = round(horizon / s.tick)
            owner[count] = i
            count += 1
    return bodies[:count], owner[:count]


@allocating
def ramp(value: float, target: float, rate: float, dt: float) -> tuple[float, float]:
    """Return the value after dt on its way to the target, and its mean meanwhile."""
    gap = target - value
    if abs(gap) >= rate * dt:
        end = value + math.copysign(rate * dt, gap)
        return end, 0.5 * (value + end)
    return target, target - 0.5 * gap * abs(gap) / (rate * dt)


@allocating
def drive(robot: Array, tick: float, last: Array, plan: Array, poses: Array) -> None:
    """Fill ``poses`` (n + 1, 5): x, y, cos γ, sin γ, γ at every tick of a plan.

    From the present pose at the twist ``last``, first towards the twist (plan 0, 1),
    after plan[2] seconds towards (plan 3, 4), both at full acceleration.
    """
    v, omega = last[0], last[1]
    old_v = old_omega = math.inf
    step_x = step_y = turn = step_sin = 0.0
    step_cos = 1.0
    poses[0] = (0.0, 0.0, 1.0, 0.0, 0.0)
    for k in range(poses.shape[0] - 1):
        stage = 0 if k * tick < plan[2] - 1e-9 else 3
        v, mean_v = ramp(v, plan[stage], robot[4], tick)
        omega, mean_omega = ramp(omega, plan[stage + 1], robot[5], tick)
        if mean_v != old_v or mean_omega != old_omega:
            step_x, step_y, turn = arc(0.0, 0.0, 0.0, mean_v, mean_omega, tick)
            step_cos, step_sin = math.cos(turn), math.sin(turn)
            old_v, old_omega = mean_v, mean_omega
        x, y, cos, sin = poses[k, 0], poses[k, 1], poses[k, 2], poses[k, 3]
        poses[k + 1, 0] = x + cos * step_x - sin * step_y
        poses[k + 1, 1] = y + sin * step_x + cos * step_y
        poses[k + 1, 2] = cos * step_cos - sin * step_sin
        poses[k + 1, 3] = sin * step_cos + cos * step_sin
        poses[k + 1, 4] = poses[k, 4] + turn


@allocating
def body_contact(edges: Array, body: Array, time: float, pose: Array) -> Touch:
    """Return the contact with the line of a body, seen from a pose at that time."""
    cos, sin = pose[2], pose[3]
    x, y = body[0] + body[5] * time - pose[0], body[1] + body[6] * time - pose[1]
    q_x, q_y = cos * x + sin * y, cos * y - sin * x
    if body[0] == body[2] and body[1] == body[3]:
        return point_contact(edges, q_x, q_y)
    x, y = body[2] - pose[0], body[3] - pose[1]
    return wall_contact(edges, q_x, q_y, cos * x + sin * y, cos * y - sin * x)


@allocating
def least_room(
    edges: Array,
    robot: Array,
    tick: float,
    bodies: Array,
    poses: Array,
    all_ticks: bool,
    enough: float,
    hopeless: float,
) -> tuple[float, int]:
    """Return the least of distance less distance wanted over all ticks, and its body.

    Exact where it is below ``enough``. A look is left out where the distance cannot
    have come down to the least so far; with ``all_ticks`` bodies at rest are looked at
    over the whole horizon. The search ends where it is not above ``hopeless``.
    """
    least, which = enough, -1
    fastest = min(max(-robot[0], robot[1]), FASTEST)
    fastest += robot[8] * min(max(-robot[2], robot[3]), FASTEST)
    for i in range(bodies.shape[0]):
        body = bodies[i]
        pace = tick * (fastest + math.sqrt(body[5] * body[5] + body[6] * body[6]))
        last = poses.shape[0] - 1 if all_ticks else int(body[7])
        half = 0.5 * math.sqrt((body[2] - body[0]) ** 2 + (body[3] - body[1]) ** 2)
        m_x, m_y = 0.5 * (body[0] + body[2]), 0.5 * (body[1] + body[3])
        k = 1
        while k <= last:
            x = m_x + body[5] * tick * k - poses[k, 0]
            y = m_y + body[6] * tick * k - poses[k, 1]
            room = math.sqrt(x * x + y * y) - robot[8] - half - body[4]
            if room < least:
                room = body_contact(edges, body, tick * k, poses[k])[4] - body[4]
                if room < least:
                    least, which = room, i
                    if least <= hopeless:
                        return least, which
            k += max(1, int((room - least) / pace))
    return least, which


@allocating
def lets_pass(
    edges: Array, robot: Array, tick: float, bodies: Array, poses: Array
) -> bool:
    """Return whether a robot that stands at the last pose is out of everybody's way.

    Looked at while each moves on for :data:`PASSING`. A way that does not let an
    obstacle pass may drive on before it for ever.
    """
    last = poses.shape[0] - 1
    for i in range(bodies.shape[0]):
        body = bodies[i]
        pace = math.sqrt(body[5] * body[5] + body[6] * body[6])
        time = tick * last
        end = time + PASSING / max(pace, STILL)
        while pace > STILL and time < end:
            x = body[0] + body[5] * time - poses[last, 0]
            y = body[1] + body[6] * time - poses[last, 1]
            room = math.sqrt(x * x + y * y) - robot[8] - body[4]
            if room < 0.0:
                room = body_contact(edges, body, time, poses[last])[4] - body[4]
                if room < 0.0:
                    return False
            time += max(FINEST, room) / pace
    return True
