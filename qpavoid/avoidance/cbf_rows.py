"""Control barrier function rows of the QP: d̂_oᵀ J_0 u ≥ b, one per contact.

A wall given as points, or in parts, is more than its nearest point. A robot inside its
r_min may drive along it as along one segment: the *tangent*, the line through the
nearest point perpendicular to the contact's normal, replaces all static obstacles
behind it.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import (
    FilterSettings,
    activation,
    come_since,
    radius_curve,
    safety_radius,
    widening,
)
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.capsules import greatest_speed
from qpavoid.model.contact import approach_row, corner_at
from qpavoid.model.contacts import (
    ObstacleContact,
)
from qpavoid.model.kinematics import TINY
from qpavoid.model.robot import braking_steps, limits_of, stopping_time
from qpavoid.qp.exact import A_OMEGA, A_V, ROW_OWNER, B
from qpavoid.types import Array, Box, Pair, Row, Table

BARRIER = 0

SPEED_AT_REST = 0.01
"""m/s; greatest speed of an obstacle that counts as static."""

R_MIN_TOLERANCE = 1e-3
"""ε in m: tolerance of r_min for rounding and iteration; at most half of r_min."""


@compiled
def tolerated(settings: npt.NDArray[np.void]) -> float:
    """Return ε, m."""
    return float(min(R_MIN_TOLERANCE, 0.5 * settings[0].r_min_slow))


@entry
@compiled
def required_distance(
    settings: FilterSettings, speed: float, age: float
) -> tuple[float, float]:
    """Return r_min(v_o), and the required distance: r_min and the inflation, in m."""
    s = settings[0]
    r_min = safety_radius(speed, radius_curve(settings))
    wider = widening(speed, age, s.error, s.obstacle_acceleration, s.dt)
    return r_min, r_min + wider


@compiled
def row_reach(
    robot: Array,
    settings: npt.NDArray[np.void],
    capsules: Array,
    age: float,
) -> float:
    """Return the distance, m, beyond which no row is violated and no stop obstructed.

    The distance shrinks at most at V = |v| + |ω|·R + |v_o|, hence a barrier row can
    only be violated where γ(d − r_min) < V, and a stop only be obstructed within V·τ; a
    repulsion row exists below r.
    """
    limits = limits_of(robot)
    s = settings[0]
    fastest = greatest_speed(capsules)
    r_min, required = required_distance(settings, fastest, age)
    if s.bound != BARRIER:
        return float(min(required + (s.zone_ratio - 1.0) * r_min, s.reach))
    v = max(-limits.v_min, limits.v_max)
    omega = max(-limits.omega_min, limits.omega_max)
    # No point of the footprint is farther than R from the axle's middle: |v| + |ω| R
    # bounds the speed of any P_r.
    speed = v + omega * limits.circumradius + fastest
    # 1/γ' of the gain γ' = γ/(1 + γκ) that a growing r_min leaves, see constraint_rows.
    time = 1.0 / s.gamma + s.closing_gain
    if not s.braking_room:
        return float(min(required + speed * time, s.reach))
    stop = speed * stopping_time(robot, v, omega, s.dt) * (1.0 + s.jitter)
    if s.passive:
        stop = speed * s.dt * braking_steps(robot, v, omega, s.dt)
    return float(required + max(min(speed * time, s.reach - required), stop))


@compiled
def least_value(coefficient: float, low: float, high: float) -> float:
    """Return the least value of coefficient · x for x in [low, high]."""
    if coefficient > 0.0:
        return coefficient * low
    return coefficient * high if coefficient < 0.0 else 0.0


@compiled
def is_redundant(row: Pair, bound: float, box: Box) -> bool:
    """Return whether a row holds for every twist of a box."""
    least = least_value(row[0], box.v_min, box.v_max)
    least += least_value(row[1], box.omega_min, box.omega_max)
    # Drops the rows of distant obstacles, which saves time in each round of the solver.
    return not least < bound


@compiled
def closing_bound(robot: Array, dt: float, row: Pair, stopping_margin: float) -> float:
    """Return the greatest closing speed, m/s, that allows a stop within a margin, m.

    At a speed c and a deceleration a that starts after dt, stopping takes
    c·dt + c²/(2a). The row's a is that of its stronger component; this guides the QP,
    :mod:`qpavoid.avoidance.verdict` verifies.
    """
    limits = limits_of(robot)
    if limits.acceleration == math.inf or limits.angular_acceleration == math.inf:
        return float(stopping_margin / dt)
    a_v, a_omega = row
    # The positive root of c² + 2a·dt·c = 2a·margin.
    a = max(abs(a_v) * limits.acceleration, abs(a_omega) * limits.angular_acceleration)
    return float(math.sqrt(a * a * dt * dt + 2.0 * a * stopping_margin) - a * dt)


@compiled
def speed_of(contact: ObstacleContact) -> float:
    """Return the speed of an obstacle at its contact, m/s."""
    return math.sqrt(contact.v_x * contact.v_x + contact.v_y * contact.v_y)


@compiled_once
def is_too_old(contacts: Table, settings: npt.NDArray[np.void], age: float) -> bool:
    """Return whether an obstacle may have moved by more than r_min since measured.

    See :class:`qpavoid.avoidance.settings.Margins`.
    """
    s = settings[0]
    for k in range(contacts.shape[0] if age > 0.0 else 0):
        c = contacts[k]
        _, required = required_distance(settings, speed_of(c), age)
        come = come_since(speed_of(c), age, s.obstacle_acceleration)
        if come > s.r_min_slow and c.distance < required:
            return True
    return False


@compiled
def contact_bound(
    contact: ObstacleContact,
    robot: Array,
    settings: npt.NDArray[np.void],
    distances: Pair,
    age: float,
) -> tuple[float, float, float]:
    """Return a_v (1), a_ω (m/rad) and b (m/s) of a contact; b = −∞ if it has no row.

    Args:
        contact: Of the obstacle.
        robot: Its limits.
        settings: Of the filter.
        distances: r_min(v_o), and the required distance, m.
        age: Of the measurement, s.
    """
    s, c, (r_min, required) = settings[0], contact, distances
    a_v, a_omega = approach_row(c.x, c.y, c.n_x, c.n_y)
    if s.bound == BARRIER:
        margin, speed = c.distance - required, speed_of(c)
        if margin < 0.0:
            # The measured position counts, without the inflation by age.
            margin = min(margin + come_since(speed, age, s.obstacle_acceleration), 0.0)
        # For a margin ≤ 0 the row requires separation, without a closing speed that
        # r_min would grow with: γ itself.
        bound = (
            -(s.gamma / (1.0 + s.gamma * s.closing_gain) if margin > 0.0 else s.gamma)
            * margin
        )
        # The stopping distance applies to static obstacles; moving ones are predicted.
        if s.braking_room and speed <= SPEED_AT_REST and margin > 0.0:
            bound = max(bound, -closing_bound(robot, s.dt, (a_v, a_omega), margin))
        return a_v, a_omega, bound - (c.n_x * c.v_x + c.n_y * c.v_y)
    r = required + (s.zone_ratio - 1.0) * r_min
    if c.distance >= r:
        return a_v, a_omega, -math.inf
    return a_v, a_omega, s.speed * activation(s.activation, c.distance, required, r)


@compiled
def set_row(row: Array, slope: Pair, bound: float, owner: int) -> None:
    """Write a row: a_v (1), a_ω (m/rad), b (m/s) and the obstacle."""
    row[A_V], row[A_OMEGA] = slope
    row[B], row[ROW_OWNER] = bound, owner


@compiled
def constraint_rows(
    contacts: Table,
    robot: Array,
    settings: npt.NDArray[np.void],
    box: Box,
    age: float,
    ahead: bool,
    rows: Array,
) -> int:
    """Fill in A, b and the obstacle of the contacts' rows; return their number.

    The row of a contact is d̂_oᵀ J_0 (1, m/rad). With the bound ``barrier`` the
    distance obeys ḋ = d̂_oᵀ(J_0 u − v_o) ≥ −γ(d − r_min), hence b = −γ(d − r_min) +
    d̂_oᵀ v_o, bounded for static obstacles by :func:`closing_bound`. If r_min grows by
    κ times the closing speed −ḋ, γ becomes γ/(1 + γκ). With ``repulsion`` b is ẋ_0
    times its activation. In m/s. Rows that hold for every admissible twist are left
    out: they cannot change the answer.

    Args:
        contacts: See :func:`qpavoid.model.contacts.contact_table`.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        box: Twists that can be driven next.
        age: Of the measurement, s.
        ahead: Only static obstacles nearer than r_min − ε, which the robot has to
            leave; all others are constrained by predictions.
        rows: (n + 4, 9) filled; see :data:`qpavoid.qp.exact.ROW_WIDTH`.
    """
    s, still, count = settings[0], required_distance(settings, 0.0, age), 0
    # Predictions tolerate r_min − ε: only nearer obstacles need a row of the present.
    near = still[1] - tolerated(settings)
    for k in range(contacts.shape[0]):
        c = contacts[k]
        speed = speed_of(c)
        if c.distance > s.reach or (
            ahead and (speed > SPEED_AT_REST or c.distance >= near)
        ):
            continue
        distances = still if speed == 0.0 else required_distance(settings, speed, age)
        a_v, a_omega, bound = contact_bound(c, robot, settings, distances, age)
        if not is_redundant((a_v, a_omega), bound, box):
            set_row(rows[count], (a_v, a_omega), bound, c.obstacle)
            count += 1
    return count


@compiled
def wheel_rows(robot: Array, rows: Array) -> int:
    """Fill in the wheels' rows, ±v ± ω b/2 ≥ −w_max; return their number."""
    limits, count = limits_of(robot), 0
    # Four half-planes, a diamond in (v, ω) with its corners on the axes.
    half, most = 0.5 * limits.track, limits.wheel_speed
    for forward in (1.0, -1.0):
        for side in (-1.0, 1.0):
            if most < math.inf:
                set_row(rows[count], (forward, half * side), -most, -1)
                count += 1
    return count


ROUNDED_IN = 1e-5
"""m; tolerance of r_min for rounding in successive steps."""

UNEVEN, SLANT = 0.01, 0.15
"""m, and m per m beyond the side in contact: tolerance by which parts of one wall may
be in front of its tangent, for the noise of a scan and a small angle to the wall."""


class Tangent(NamedTuple):
    """The line through an obstacle's nearest point, perpendicular to the normal.

    Attributes:
        normal: n, outward unit normal of the footprint at P_r.
        behind: n·z for all points z of the line, m.
        first: Least n × z of the footprint's side or corner in contact, m.
        last: Greatest n × z of it, m.
        distance: From the footprint, m; ``inf``: no tangent.
    """

    normal: Pair
    behind: float
    first: float
    last: float
    distance: float


@compiled
def no_tangent(side: Pair) -> Tangent:
    """Return the absent tangent of a side."""
    return Tangent(side, 0.0, 0.0, 0.0, math.inf)


@compiled_once
def tangent_at(edges: Array, place: Pair, normal: Pair, distance: float) -> Tangent:
    """Return the tangent of a contact of the footprint at P_r, m.

    None if the footprint, not convex, reaches beyond it.
    """
    (x, y), (n_x, n_y) = place, normal
    foremost, first = n_x * x + n_y * y, n_x * y - n_y * x
    last = first
    for i in range(edges.shape[0]):
        corner_x, corner_y = corner_at(edges, i)
        ahead = n_x * corner_x + n_y * corner_y
        if ahead > foremost + distance + TINY:
            return no_tangent(normal)
        if ahead > foremost - TINY:
            beside = n_x * corner_y - n_y * corner_x
            first, last = min(first, beside), max(last, beside)
    return Tangent(normal, foremost + distance, first, last, distance)


@compiled
def is_behind(tangent: Tangent, place: Pair, radius: float) -> bool:
    """Return whether a disc is behind a tangent, within the tolerance of one wall."""
    (n_x, n_y), (x, y) = tangent.normal, place
    beside = n_x * y - n_y * x
    beyond = max(tangent.first - beside, beside - tangent.last, 0.0)
    nearest = n_x * x + n_y * y - radius
    return nearest >= tangent.behind - UNEVEN - SLANT * beyond


@compiled_once
def nearest_tangent(edges: Array, contacts: Table, near: float, side: Pair) -> Tangent:
    """Return the tangent of the nearest static contact of 0 to ``near`` m.

    Contacts whose normal points to the same side as ``side`` are excluded.
    """
    nearest = no_tangent(side)
    for k in range(contacts.shape[0]):
        c = contacts[k]
        within = 0.0 < c.distance < min(near, nearest.distance)
        if within and c.v_x == 0.0 and c.v_y == 0.0:
            if c.n_x * side[0] + c.n_y * side[1] <= 0.0:
                nearest = tangent_at(edges, (c.x, c.y), (c.n_x, c.n_y), c.distance)
    return nearest


@compiled_once
def turn_to_walls(edges: Array, contacts: Table, near: float) -> None:
    """Replace the normals of static contacts behind the nearest tangent by its normal.

    The nearest tangent to either side, within ``near`` m; distances are then along its
    normal. Otherwise a wall's point ahead of a corner acts as a post, whose row stops
    the robot.
    """
    one = nearest_tangent(edges, contacts, near, (0.0, 0.0))
    if one.distance < math.inf:
        other = nearest_tangent(edges, contacts, near, one.normal)
        for k in range(contacts.shape[0]):
            c = contacts[k]
            if 0.0 < c.distance < near and c.v_x == 0.0 and c.v_y == 0.0:
                turn_to_wall(contacts[k], one)
                turn_to_wall(contacts[k], other)


@compiled
def turn_to_wall(c: Row, tangent: Tangent) -> None:
    """Replace the normal of a contact by that of a tangent in front of it."""
    x, y, (n_x, n_y) = c.x, c.y, tangent.normal
    place = (x + c.distance * c.n_x, y + c.distance * c.n_y)
    if tangent.distance < math.inf and is_behind(tangent, place, 0.0):
        c.n_x, c.n_y = n_x, n_y
        c.distance = n_x * (place[0] - x) + n_y * (place[1] - y)
