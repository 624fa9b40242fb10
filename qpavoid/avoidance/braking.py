"""Room to brake: the rule that keeps the robot from driving into what stands still.

A robot that drives (v, ω) and has to stop brakes along its arc: both parts shrink
alike, u·(1 − k/n) in control step k, with the least n for which no step exceeds the
accelerations, n = ⌈max(|v|/(a·dt), |ω|/(α·dt))⌉, at least 1. Every one of these twists
has the same curvature, hence the robot stays on the arc of (v, ω) and comes to rest
where that arc ends after

    τ(u) = dt + dt·Σ_{k=1}^{n−1} (1 − k/n) = dt·(n + 1)/2.

**Rule.** Let h(u) be the least of d − r_min along the arc of u from 0 to τ(u), over all
obstacles at rest. A twist is driven only if h(u) ≥ min(−ε, h(u_b)); else the robot
brakes: it drives u_b = u_last·(1 − 1/n(u_last)).

**Theorem.** Let obstacles be at rest and measured exactly, twists be held for dt, the
limits hold 0, and the robot start at rest with d ≥ r_min − ε everywhere. Then
d ≥ r_min − ε at all times, between the steps too; with ε < r_min there is no contact.

Proof. Claim: after every step the arc of the twist last driven, from the pose reached,
keeps h ≥ −ε until the robot would stand: from 0 to τ(u) − dt. At the start the twist is
0 and this is the pose itself. Step with the claim given: braking from u_last takes
n − 1 further steps, and u_b·τ(u_b) = u_last·(1 − 1/n)·dt·n/2 = u_last·(τ(u_last) − dt),
so the arc of u_b is that rest of the arc of u_last and h(u_b) ≥ −ε. If u is driven by
the rule, h(u) ≥ min(−ε, h(u_b)) = −ε; if u_b is driven, h(u_b) ≥ −ε. Either way the
step itself, from 0 to dt, and the rest, from dt to τ, keep it: the claim holds again. ∎

Nothing here depends on how u was found. Obstacles that move are the business of the
look-ahead rows (:mod:`qpavoid.avoidance.ahead`); they do not enter h.

**Passive safety** [Bouraine2012]: where a contact cannot be avoided, be at rest when it
comes. Let g(u) be the least distance to what moves, which keeps its velocity, while
the robot drives u and then brakes, until it stands; ∞ for u = 0. With the setting
``passive``, and where there is contact or the plan with the least shortfall still falls
short by more than r_min, a twist has to pass the rule above and g(u) ≥ min(0, g(u_b))
as well: if g(u) ≥ 0 and nobody changes velocity, braking comes in time, and a robot at
rest that is touched holds. Where there is a plan without contact it may be driven:
standing still is not always best. u_b passes both, so that the proof holds with either.
"""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.rows import STILL
from qpavoid.avoidance.settings import widening
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import (
    OWNER,
    RADIUS,
    Arrays,
    capsule_at,
    chain_end,
    speed_bound,
)
from qpavoid.model.robot import braking_steps, braking_twist, stopping_time
from qpavoid.qp.exact import Pair

TOLERANCE = 1e-3
"""ε in m."""

ROUNDING = 1e-9
"""m; less is no difference."""

FINEST = 2e-3
"""m; the greatest way of a footprint point between two looks at an obstacle."""


@compiled
def braking_place(time: float, steps: float, dt: float) -> float:
    """Return how long (v, ω) drives to where braking in n steps has come by a time, s.

    With n = ∞ the time itself.
    """
    if steps == math.inf:
        return time
    k = min(float(math.floor(time / dt)), steps - 1.0)
    return dt * (k - 0.5 * k * (k - 1.0) / steps) + (time - dt * k) * (1.0 - k / steps)


@compiled_once
def room_along(
    edges: Array,
    x1: float,
    y1: float,
    x2: float,
    y2: float,
    v_x: float,
    v_y: float,
    radius: float,
    v: float,
    omega: float,
    steps: float,
    dt: float,
    speed: float,
    begin: float,
    end: float,
    wanted: float,
) -> float:
    """Return the least distance to one obstacle along the arc of (v, ω), m.

    The robot drives on if ``steps`` is infinite, else it brakes in so many. The
    distance changes at most at ``speed``, so that the next look can wait until it
    could have come down to ``wanted``: exact below, above it any value above.
    """
    is_point = x1 == x2 and y1 == y2
    least, time = math.inf, begin
    while True:
        x, y, heading = arc(0.0, 0.0, 0.0, v, omega, braking_place(time, steps, dt))
        x, y = x - v_x * time, y - v_y * time
        cos, sin = math.cos(heading), math.sin(heading)
        q_x, q_y = cos * (x1 - x) + sin * (y1 - y), cos * (y1 - y) - sin * (x1 - x)
        if is_point:
            distance = point_contact(edges, q_x, q_y)[4] - radius
        else:
            e_x, e_y = cos * (x2 - x) + sin * (y2 - y), cos * (y2 - y) - sin * (x2 - x)
            distance = wall_contact(edges, q_x, q_y, e_x, e_y)[4] - radius
        least = min(least, distance)
        room = distance - wanted
        if time >= end or speed == 0.0 or room >= speed * (end - time):
            return least
        time = min(end, time + max(room, FINEST) / speed)


@compiled_once
def room_to_stop(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    v: float,
    omega: float,
    begin: float,
    wanted: float,
) -> float:
    """Return h(u) from ``begin`` (s) on, m: exact below ``wanted``, else a value above.

    Only the obstacles of ``contacts`` are looked at: those beyond the reach of the rows
    cannot be met, nor what is at present too far to be met by then.
    """
    s = settings[0]
    points, capsules = obstacles
    speed = abs(v) + abs(omega) * robot[8]
    end = stopping_time(robot, v, omega, s.dt)
    driven = (v, omega, math.inf, s.dt)
    low = s.low + widening(0.0, age, s.error, s.obstacle_acceleration, s.dt)
    n_points, row = points.shape[0], 0
    least, previous = math.inf, -1
    near = low + wanted + speed * end + ROUNDING
    for k in range(contacts.shape[0]):
        if contacts[k, 4] > near or int(contacts[k, 7]) == previous:
            continue
        i = previous = int(contacts[k, 7])
        if i < n_points:
            x1, y1 = points[i, 0], points[i, 1]
            line = (x1, y1, x1, y1, 0.0, 0.0, low)
            room = room_along(edges, *line, *driven, speed, begin, end, wanted)
            least = min(least, room)
            continue
        row = row_of(capsules, row, i)
        if speed_bound(capsules, row) > STILL:
            continue
        for j in range(row, chain_end(capsules, row)):
            x1, y1, x2, y2 = capsule_at(capsules, j, 0.0)
            line = (x1, y1, x2, y2, 0.0, 0.0, low + capsules[j, RADIUS])
            room = room_along(edges, *line, *driven, speed, begin, end, wanted)
            least = min(least, room)
    return least


@compiled
def row_of(capsules: Array, row: int, owner: int) -> int:
    """Return the first row of an obstacle, from ``row`` on."""
    while capsules[row, OWNER] < owner:
        row += 1
    return row


@compiled_once
def room_till_rest(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    v: float,
    omega: float,
) -> float:
    """Return g(u), m: exact below 0, else a value above.

    What turns is taken to go straight on as its point nearest to the robot.
    """
    s, capsules, first = settings[0], obstacles[1], obstacles[0].shape[0]
    steps = braking_steps(robot, v, omega, s.dt)
    pace, end, least = abs(v) + abs(omega) * robot[8], s.dt * steps, math.inf
    row, previous = 0, -1
    for k in range(contacts.shape[0] if pace > 0.0 else 0):
        v_x, v_y, i = contacts[k, 5], contacts[k, 6], int(contacts[k, 7])
        speed = math.sqrt(v_x * v_x + v_y * v_y)
        wider = widening(speed, age, s.error, s.obstacle_acceleration, s.dt)
        far = contacts[k, 4] > wider + (pace + speed) * end
        if speed <= STILL or far or i < first or i == previous:
            continue
        previous, row = i, row_of(capsules, row, i)
        for j in range(row, chain_end(capsules, row)):
            x1, y1, x2, y2 = capsule_at(capsules, j, 0.0)
            line = (x1, y1, x2, y2, v_x, v_y, capsules[j, RADIUS] + wider)
            driven = (v, omega, steps, s.dt)
            room = room_along(edges, *line, *driven, pace + speed, 0.0, end, 0.0)
            least = min(least, room)
    return least


@compiled
def may_drive(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    yields: bool,
    last: Pair,
    v: float,
    omega: float,
) -> tuple[bool, float]:
    """Return whether the rules allow (v, ω) after the twist ``last``, and the lack.

    The second is the room, m, that its arc would have to keep more to obey the first.
    """
    known = (edges, robot, settings, obstacles, contacts, age)
    allowed, lacks = leaves_room(*known, last, v, omega)
    if allowed and yields:
        room = room_till_rest(*known, v, omega)
        if room < 0.0:
            braking = braking_twist(robot, last[0], last[1], settings[0].dt)
            allowed = room >= min(0.0, room_till_rest(*known, *braking))
    return allowed, lacks


@compiled
def leaves_room(
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    contacts: Array,
    age: float,
    last: Pair,
    v: float,
    omega: float,
) -> tuple[bool, float]:
    """Return whether the rule for what stands allows (v, ω), and what it lacks, m.

    In contact only what has more room from the end of this step on may be driven.
    """
    s = settings[0]
    known = (edges, robot, settings, obstacles, contacts, age)
    wanted = -min(TOLERANCE, s.low)
    room = room_to_stop(*known, v, omega, 0.0, wanted)
    if room >= wanted:
        return True, 0.0
    b_v, b_omega = braking_twist(robot, last[0], last[1], s.dt)
    braked = room_to_stop(*known, b_v, b_omega, 0.0, wanted)
    wanted = min(wanted, braked)
    if braked <= -s.low:
        after = room_to_stop(*known, v, omega, s.dt, wanted)
        return after > braked + ROUNDING and room >= wanted - ROUNDING, wanted - room
    return room >= wanted - ROUNDING, wanted - room
