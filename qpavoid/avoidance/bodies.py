"""Bodies: obstacles within reach, or their edges, each with its required distance.

In the robot frame of the present; bodies have constant velocities.
"""

import math

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST, wanted_distance
from qpavoid.avoidance.body_table import (
    CREEPS,
    MOVES,
    STANDS,
    Body,
    body_at,
    line_contact_now,
    set_body,
    sort_bodies,
)
from qpavoid.avoidance.groups import group_points
from qpavoid.avoidance.scene import Scene, look_box, tolerance
from qpavoid.avoidance.tangent import (
    ROUNDED_IN,
    Tangent,
    is_behind,
    no_tangent,
    tangent_at,
)
from qpavoid.compiled import compiled_once
from qpavoid.model.capsules import (
    OWNER,
    PIVOT_X,
    PIVOT_Y,
    RADIUS,
    SIGMA,
    TURN,
    V_X,
    V_Y,
    X1,
    X2,
    Y1,
    Y2,
    speed_bound,
)
from qpavoid.model.kinematics import TINY
from qpavoid.model.robot import limits_of, stopping_time
from qpavoid.types import Array, Arrays, Pair


@compiled_once
def bodies_in_reach(scene: Scene, obstacles: Arrays, age: float, horizon: float) -> int:
    """Fill in the bodies within reach of any rollout; return their number.

    Within ``horizon`` s (0: no look-ahead), static bodies also for the stopping time
    after it. If r_min grows with the closing speed, it is that of the axle's middle
    with the twist last driven. For static bodies inside r_min, and static bodies behind
    their tangents, the required distance is capped at the present one: a wall given as
    points is treated as a wall.
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
    one = tangent_of_nearest(scene, count, (0.0, 0.0))
    if one.distance < math.inf:
        cap_behind(scene, count, one)
        cap_behind(scene, count, tangent_of_nearest(scene, count, one.normal))
    if horizon > 0.0:
        group_points(scene, first)
    # Points keep the order of the scan, in which neighbours form groups.
    sort_bodies(bodies[first:count])
    return count


@compiled_once
def tangent_of_nearest(scene: Scene, count: int, side: Pair) -> Tangent:
    """Return the tangent of the nearest static body inside r_min, not in contact.

    With its inflation. Arguments as :func:`qpavoid.avoidance.tangent.nearest_tangent`.
    """
    slack, nearest = tolerance(scene), no_tangent(side)
    near = scene.settings[0].r_min_slow - slack - ROUNDED_IN
    for i in range(count):
        body = body_at(scene, i)
        distance = body.keep - body.inflation - slack
        within = 0.0 < distance < min(near, nearest.distance)
        if within and body.kind == STANDS:
            c = line_contact_now(scene.edges, body)
            if c.n_x * side[0] + c.n_y * side[1] <= 0.0:
                place, normal = (c.x, c.y), (c.n_x, c.n_y)
                nearest = tangent_at(scene.edges, place, normal, distance)
    return nearest


@compiled_once
def cap_behind(scene: Scene, count: int, tangent: Tangent) -> None:
    """Cap the required distance of static bodies behind a tangent at its distance."""
    for i in range(count):
        b, most = body_at(scene, i), tangent.distance + tolerance(scene)
        excess = b.keep - b.inflation - most
        if b.kind != STANDS or excess <= 0.0:
            continue
        one, other = (b.x + b.x1, b.y + b.y1), (b.x + b.x2, b.y + b.y2)
        behind = is_behind(tangent, one, b.inflation)
        if behind and is_behind(tangent, other, b.inflation):
            # fmt: off
            set_body(scene.bodies, i, Body(
                b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, b.keep - excess,
                b.inflation, b.spread - excess, b.speed, b.growth, b.kind, b.owner,
                -tolerance(scene), b.group, b.sigma))
            # fmt: on


@compiled_once
def point_body(scene: Scene, place: Pair, low: float, owner: int) -> Body:
    """Return a static point with the required distance ``low``, m."""
    (x, y), keep, margin, z = place, low, low - scene.settings[0].r_min_slow, 0.0
    if scene.settings[0].closing_gain > 0.0:
        keep += closing_margin(scene, place, (0.0, 0.0))
    # fmt: off
    return Body(x, y, z, z, z, z, z, z, z, keep, margin, keep, z, z, STANDS,
                float(owner), math.inf, -1.0, z)


@compiled_once
def capsule_body(
    scene: Scene, capsules: Array, i: int, age: float, horizon: float
) -> Body:
    """Return the body of a capsule: static, moving, or growing without look-ahead.

    Its end farther back comes first, independent of the order of input.

    Args:
        scene: Of the step.
        capsules: The table.
        i: Row of it.
        age: Of the measurement, s.
        horizon: Of the look-ahead, s; 0: none.
    """
    c, speed, growth = capsules[i], speed_bound(capsules, i), 0.0
    x, y, v_x, v_y = c[PIVOT_X], c[PIVOT_Y], c[V_X], c[V_Y]
    r_min, keep = wanted_distance(scene.settings, speed, age)
    keep += closing_margin(scene, (x, y), (v_x, v_y)) + c[RADIUS]
    x1, y1, x2, y2 = c[X1], c[Y1], c[X2], c[Y2]
    nearer, level = abs(y2) < abs(y1), abs(y2) == abs(y1)
    if x2 < x1 or (x2 == x1 and (nearer or (level and y2 < y1))):
        x1, y1, x2, y2 = x2, y2, x1, y1
    x1, y1, x2, y2 = x1 - x, y1 - y, x2 - x, y2 - y
    spread = keep + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    kind, turn = MOVES, c[TURN]
    sigma = c[SIGMA]
    still = speed <= SPEED_AT_REST and sigma == 0.0
    if still or horizon == 0.0:
        kind, growth = (STANDS, 0.0) if speed <= SPEED_AT_REST else (CREEPS, speed)
        v_x, v_y, turn, speed, sigma = 0.0, 0.0, 0.0, 0.0, 0.0
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, v_x, v_y, turn, keep, keep - r_min, spread, speed,
                growth, kind, c[OWNER], math.inf, -1.0, sigma)


@compiled_once
def keep_at_most(scene: Scene, body: Body) -> Body:
    """Cap the required distance of a static body at the present one plus ε."""
    far, b = limits_of(scene.robot).circumradius + body.spread, body
    if b.kind == MOVES or b.x**2 + b.y**2 >= far * far:
        return body
    distance, growth = line_contact_now(scene.edges, body).distance, b.growth
    # Inside r_min no plan keeps it, not even standing still; the rows of the present
    # lead out.
    missing = b.keep - distance - tolerance(scene)
    if missing > 0.0:
        growth = 0.0
    missing = max(missing, 0.0)
    keep, spread = b.keep - missing, b.spread - missing
    # fmt: off
    return Body(b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, keep,
                b.inflation, spread, b.speed, growth, b.kind, b.owner, distance - keep,
                b.group, b.sigma)


@compiled_once
def closing_margin(scene: Scene, place: Pair, velocity: Pair) -> float:
    """Return the increase of r_min with the closing speed, m."""
    closing, (x, y), (v_x, v_y) = scene.settings[0].closing_gain, place, velocity
    if closing == 0.0:
        return 0.0
    # The direction of the pivot approximates the contact's normal.
    apart = max(math.sqrt(x * x + y * y), TINY)
    return float(closing * max(((scene.last[0] - v_x) * x - v_y * y) / apart, 0.0))
