"""Bodies: obstacles within reach, or their edges, each with its required distance.

In the robot frame of the present; bodies have constant velocities. They are rows of a
table in the :class:`Scene`, the data shared by all predictions of a control step. Most
points of a scan lie on a few surfaces: successive neighbouring ones are a group, and
one check of its wall clears them all (:mod:`qpavoid.avoidance.margin`).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.cbf_rows import (
    ROUNDED_IN,
    SPEED_AT_REST,
    Tangent,
    is_behind,
    no_tangent,
    required_distance,
    tangent_at,
    tolerated,
)
from qpavoid.avoidance.settings import (
    AvoidanceSettings,
    FilterSettings,
    least_radius,
)
from qpavoid.compiled import compiled, compiled_once
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
    Segment,
    from_segment,
    speed_bound,
)
from qpavoid.model.contact import (
    Contact,
    Part,
    point_contact,
    point_contact_of,
    wall_contact,
    wall_contact_of,
)
from qpavoid.model.kinematics import TINY, Frame
from qpavoid.model.robot import UNLIMITED_TWIST, Robot, limits_of, stopping_time
from qpavoid.types import (
    Array,
    Arrays,
    Box,
    Edges,
    LimitVector,
    Pair,
    Row,
    Table,
    layout,
)

REPLAY_ROUNDING = 1e-8
"""m; tolerance of a plan's margin when it is carried on."""


class Setup(NamedTuple):
    """Robot and settings, constant over a run.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
    """

    edges: Edges
    robot: LimitVector
    settings: FilterSettings

    @classmethod
    def of(cls, robot: Robot, settings: AvoidanceSettings) -> "Setup":
        """Return robot and settings for compiled functions."""
        return cls(robot.footprint.edges, robot.limit_vector, settings.record())


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
        bodies: (n,) of :class:`Body`, in reach.
        last: v, ω driven last.
        pending: Sums of |v|, m/s, and of |ω|, rad/s, over the pending steps.
        arcs: Memory for a rollout: :class:`qpavoid.avoidance.plan.Arc`.
        groups: Walls, each containing successive bodies. The ``owner`` is the number of
            the body after them.
        longest: Greatest duration of a control step, s.
        drift: Velocity error of the robot, m/s; static bodies grow by it.
        clearance: Of the nearest obstacle, m.
    """

    edges: Array
    robot: Array
    settings: npt.NDArray[np.void]
    bodies: Table
    last: Pair
    pending: Pair
    arcs: Table
    groups: Table
    longest: float
    drift: float
    clearance: float


@compiled
def with_bodies(scene: Scene, bodies: Table, drift: float) -> Scene:
    """Return the scene with other bodies and another velocity error, m/s."""
    # Compiled functions have no NamedTuple._replace.
    e, r, s, _, last, pending, arcs, groups, longest, _, near = scene
    return Scene(e, r, s, bodies, last, pending, arcs, groups, longest, drift, near)


@compiled
def tolerance(scene: Scene) -> float:
    """Return ε, m."""
    return tolerated(scene.settings)


@compiled
def threshold(scene: Scene) -> float:
    """Return −ε: the least margin of a clear plan, m."""
    return -tolerance(scene) - REPLAY_ROUNDING


@compiled_once
def look_box(robot: Array) -> Box:
    """Return the limits of the look-ahead's target twist."""
    limits = limits_of(robot)
    return Box(
        max(limits.v_min, -UNLIMITED_TWIST),
        min(limits.v_max, UNLIMITED_TWIST),
        max(limits.omega_min, -UNLIMITED_TWIST),
        min(limits.omega_max, UNLIMITED_TWIST),
    )


class Body(NamedTuple):
    """A moving segment with its required distance: r_min and the inflation.

    Attributes:
        x: Of the pivot, m.
        y: Of the pivot, m.
        x1: Of one end from the pivot, m.
        y1: Of one end from the pivot, m.
        x2: Of the other end.
        y2: Of the other end.
        v_x: Of the pivot, m/s.
        v_y: Of the pivot, m/s.
        turn: rad/s.
        required: Required distance: radius, inflation, r_min; m.
        beyond_r_min: Required distance minus r_min, m.
        spread: Radius about the pivot of segment and required distance, m.
        speed: Greatest of its points, m/s.
        margin_now: Present margin of a static body near the robot, m; else ``inf``.
        sigma: σ of the velocity of a moving body, m/s.
        kind: :data:`STANDS` or :data:`MOVES`.
        owner: Number of the obstacle.
        group: Number of the group that begins with it, or −1.
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
    required: float
    beyond_r_min: float
    spread: float
    speed: float
    margin_now: float
    sigma: float
    kind: int
    owner: int
    group: int


BODY = layout(Body)
BODY_SIZE = BODY.itemsize // 8
"""Layout of the table of bodies, and numbers of memory per body."""

STANDS, MOVES = 0, 1
"""Kinds: static, moving. Without look-ahead slow obstacles are checked until the robot
stands, like static ones but with their velocity; faster ones only have rows."""


@compiled
def copied(b: Body) -> Body:
    """Return a copy of a row of the table."""
    # fmt: off
    return Body(b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, b.required,
                b.beyond_r_min, b.spread, b.speed, b.margin_now, b.sigma,
                b.kind, b.owner, b.group)
    # fmt: on


@compiled_once
def precedes(bodies: Table, i: int, j: int) -> bool:
    """Return whether row i is before row j in lexicographic order."""
    a, b = bodies[i], bodies[j]
    # fmt: off
    one = (a.x, a.y, a.x1, a.y1, a.x2, a.y2, a.v_x, a.v_y, a.turn, a.required,
           a.beyond_r_min,
           a.spread, a.speed, a.kind)
    other = (b.x, b.y, b.x1, b.y1, b.x2, b.y2, b.v_x, b.v_y, b.turn, b.required,
             b.beyond_r_min, b.spread, b.speed, b.kind)
    # fmt: on
    return one < other


@compiled_once
def sort_bodies(bodies: Table) -> None:
    """Sort the rows by Shell's method, independent of the order of input."""
    # Not numpy's sort, which allocates and is not in the C export.
    gap = count = bodies.shape[0]
    while gap > 1:
        gap = max(gap * 5 // 11, 1)
        for i in range(gap, count):
            j = i - gap
            while j >= 0 and precedes(bodies, j + gap, j):
                copy = copied(bodies[j])
                bodies[j] = bodies[j + gap]
                bodies[j + gap] = copy
                j -= gap


@compiled
def moves(scene: Scene, i: int) -> bool:
    """Return whether body i moves."""
    return bool(scene.bodies[i].kind == MOVES)


@compiled_once
def any_moves(scene: Scene) -> bool:
    """Return whether any body in reach moves."""
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i):
            return True
    return False


@compiled
def is_point(body: Body) -> bool:
    """Return whether a body has no length."""
    return body.spread == body.required


class End(NamedTuple):
    """One end of a body's segment.

    Attributes:
        x: Robot frame, m.
        y: Robot frame, m.
        v_x: Over ground, in the robot's axes, m/s.
        v_y: Over ground, in the robot's axes, m/s.
    """

    x: float
    y: float
    v_x: float
    v_y: float


class Ends(NamedTuple):
    """Both ends of a body's segment at a time; equal for a point."""

    one: End
    other: End


@compiled_once
def ends_at(body: Body, time: float, at: Frame) -> Ends:
    """Return the ends of a body at a time, in a frame."""
    v_x, v_y, c, s = body.v_x, body.v_y, at.cos, at.sin
    p_x, p_y = body.x + time * v_x - at.x, body.y + time * v_y - at.y
    if is_point(body):
        x, y = c * p_x + s * p_y, c * p_y - s * p_x
        end = End(x, y, c * v_x + s * v_y, c * v_y - s * v_x)
        return Ends(end, end)
    x1, y1, x2, y2, spin = body.x1, body.y1, body.x2, body.y2, body.turn
    # A rotating obstacle turns its segment about the pivot, which moves straight.
    if spin != 0.0:
        cos, sin = math.cos(spin * time), math.sin(spin * time)
        x1, y1 = cos * x1 - sin * y1, sin * x1 + cos * y1
        x2, y2 = cos * x2 - sin * y2, sin * x2 + cos * y2
    v_x1, v_y1 = v_x - spin * y1, v_y + spin * x1
    v_x2, v_y2 = v_x - spin * y2, v_y + spin * x2
    x1, y1, x2, y2 = p_x + x1, p_y + y1, p_x + x2, p_y + y2
    w_x1, w_y1 = c * v_x1 + s * v_y1, c * v_y1 - s * v_x1
    w_x2, w_y2 = c * v_x2 + s * v_y2, c * v_y2 - s * v_x2
    x1, y1 = c * x1 + s * y1, c * y1 - s * x1
    x2, y2 = c * x2 + s * y2, c * y2 - s * x2
    return Ends(End(x1, y1, w_x1, w_y1), End(x2, y2, w_x2, w_y2))


@compiled_once
def part_contact(edges: Array, part: Part, body: Body, ends: Ends) -> Contact:
    """Return the contact of a convex part with the segment of a body."""
    one, other = ends.one, ends.other
    if is_point(body):
        return point_contact_of(edges, part, one.x, one.y)
    return wall_contact_of(edges, part, Segment(one.x, one.y, other.x, other.y))


@compiled_once
def line_contact(edges: Array, body: Body, ends: Ends) -> Contact:
    """Return the contact of the footprint with the segment of a body."""
    one, other = ends.one, ends.other
    if is_point(body):
        return point_contact(edges, one.x, one.y)
    return wall_contact(edges, Segment(one.x, one.y, other.x, other.y))


@compiled_once
def contact_now(edges: Array, body: Body) -> Contact:
    """Return the present contact of the footprint with the segment of a body."""
    return line_contact(edges, body, ends_at(body, 0.0, Frame(0.0, 0.0, 1.0, 0.0)))


FEW, MOST_GROUPED, WIDEST_GROUP = 4, 32, 0.3
"""Least and greatest number of points of a group; greatest distance of its last point
from the first, as a share of their range."""


@compiled_once
def group_points(scene: Scene, count: int) -> None:
    """Group successive neighbouring points, as those of a scan."""
    bodies, begin, made = scene.bodies, 0, 0
    for i in range(1, count + 1):
        a, b = bodies[begin], bodies[min(i, count - 1)]
        square = (b.x - a.x) ** 2 + (b.y - a.y) ** 2
        # In proportion to the range: a distant wall may be longer.
        near = square < WIDEST_GROUP * WIDEST_GROUP * (a.x**2 + a.y**2)
        if i < count and i - begin < MOST_GROUPED and near:
            continue
        if i - begin >= FEW and made < scene.groups.shape[0]:
            scene.groups[made] = group_of(scene, begin, i)
            bodies[begin].group = made
            made += 1
        begin = i


@compiled_once
def group_of(scene: Scene, begin: int, end: int) -> Body:
    """Return a wall whose margin is at most that of any of these points."""
    one, other = scene.bodies[begin], scene.bodies[end - 1]
    axis = Segment(one.x, one.y, other.x, other.y)
    required, r_min, z = 0.0, math.inf, 0.0
    for i in range(begin, end):
        body = scene.bodies[i]
        d_x, d_y = from_segment(axis, body.x, body.y)
        # The axis joins the first and the last point; the required distance includes
        # the greatest deviation from it. TINY covers rounding.
        required = max(
            required, body.required + math.sqrt(d_x * d_x + d_y * d_y) + TINY
        )
        r_min = min(r_min, body.required - body.beyond_r_min)
    x, y = 0.5 * (one.x + other.x), 0.5 * (one.y + other.y)
    x1, y1, x2, y2 = one.x - x, one.y - y, other.x - x, other.y - y
    spread = required + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, z, z, z, required, required - r_min, spread, z,
                math.inf, z, STANDS, end, -1)


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
    _, required = required_distance(scene.settings, 0.0, age)
    still = radius + fastest * (horizon + stop)
    count = 0
    for i in range(points.shape[0]):
        body = point_body(scene, (points[i, 0], points[i, 1]), required, i)
        if body.x * body.x + body.y * body.y < (body.required + still) ** 2:
            bodies[count] = body
            cap_now(scene, bodies[count])
            count += 1
    first = count
    for i in range(capsules.shape[0]):
        body = capsule_body(scene, capsules, i, age, horizon)
        apart = math.sqrt(body.x * body.x + body.y * body.y) - body.spread
        near = body.speed <= s.speed_low and apart < still + 2.0 * body.speed * stop
        if body.kind == MOVES:
            near = apart < radius + (body.speed + fastest) * horizon
        if near:
            bodies[count] = body
            cap_now(scene, bodies[count])
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

    With its inflation. Arguments as :func:`qpavoid.avoidance.cbf_rows.nearest_tangent`.
    """
    slack, nearest = tolerance(scene), no_tangent(side)
    near = least_radius(scene.settings) - slack - ROUNDED_IN
    for i in range(count):
        body = scene.bodies[i]
        distance = body.required - body.beyond_r_min - slack
        within = 0.0 < distance < min(near, nearest.distance)
        if within and body.kind == STANDS:
            c = contact_now(scene.edges, body)
            if c.n_x * side[0] + c.n_y * side[1] <= 0.0:
                place, normal = (c.x, c.y), (c.n_x, c.n_y)
                nearest = tangent_at(scene.edges, place, normal, distance)
    return nearest


@compiled_once
def cap_behind(scene: Scene, count: int, tangent: Tangent) -> None:
    """Cap the required distance of static bodies behind a tangent at its distance."""
    for i in range(count):
        b, most = scene.bodies[i], tangent.distance + tolerance(scene)
        excess = b.required - b.beyond_r_min - most
        if b.kind != STANDS or excess <= 0.0:
            continue
        one, other = (b.x + b.x1, b.y + b.y1), (b.x + b.x2, b.y + b.y2)
        behind = is_behind(tangent, one, b.beyond_r_min)
        if behind and is_behind(tangent, other, b.beyond_r_min):
            b.required, b.spread = b.required - excess, b.spread - excess
            b.margin_now = -tolerance(scene)


@compiled_once
def point_body(scene: Scene, place: Pair, required: float, owner: int) -> Body:
    """Return a static point with the required distance ``required``, m."""
    (x, y), z = place, 0.0
    beyond = required - least_radius(scene.settings)
    if scene.settings[0].closing_gain > 0.0:
        required += closing_margin(scene, place, (0.0, 0.0))
    # fmt: off
    return Body(x, y, z, z, z, z, z, z, z, required, beyond, required, z, math.inf, z,
                STANDS, owner, -1)


@compiled_once
def capsule_body(
    scene: Scene, capsules: Array, i: int, age: float, horizon: float
) -> Body:
    """Return the body of a capsule, static or moving.

    Its end farther back comes first, independent of the order of input.

    Args:
        scene: Of the step.
        capsules: The table.
        i: Row of it.
        age: Of the measurement, s.
        horizon: Of the look-ahead, s; 0: none.
    """
    c, speed, kind = capsules[i], speed_bound(capsules, i), MOVES
    x, y, v_x, v_y = c[PIVOT_X], c[PIVOT_Y], c[V_X], c[V_Y]
    r_min, required = required_distance(scene.settings, speed, age)
    required += closing_margin(scene, (x, y), (v_x, v_y)) + c[RADIUS]
    x1, y1, x2, y2 = c[X1], c[Y1], c[X2], c[Y2]
    nearer, level = abs(y2) < abs(y1), abs(y2) == abs(y1)
    if x2 < x1 or (x2 == x1 and (nearer or (level and y2 < y1))):
        x1, y1, x2, y2 = x2, y2, x1, y1
    x1, y1, x2, y2 = x1 - x, y1 - y, x2 - x, y2 - y
    spread = required + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    turn, sigma = c[TURN], c[SIGMA]
    if horizon == 0.0:
        kind, sigma = STANDS, 0.0
    if speed <= SPEED_AT_REST and sigma == 0.0:
        kind, v_x, v_y, turn, speed = STANDS, 0.0, 0.0, 0.0, 0.0
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, v_x, v_y, turn, required, required - r_min,
                spread, speed, math.inf, sigma, kind, int(c[OWNER]), -1)


@compiled_once
def cap_now(scene: Scene, body: Row) -> None:
    """Cap the required distance of a static body at the present one plus ε."""
    far = limits_of(scene.robot).circumradius + body.spread
    if body.kind == MOVES or body.x**2 + body.y**2 >= far * far:
        return
    distance = contact_now(scene.edges, body).distance
    # Inside r_min no plan keeps it, not even standing still; the rows of the present
    # lead out.
    missing = body.required - distance - tolerance(scene)
    if missing > 0.0:
        body.required, body.spread = body.required - missing, body.spread - missing
        # A slow obstacle counts as at rest: else no plan would be clear, not even one
        # away from it.
        body.v_x, body.v_y, body.turn, body.speed = 0.0, 0.0, 0.0, 0.0
    body.margin_now = distance - body.required


@compiled_once
def closing_margin(scene: Scene, place: Pair, velocity: Pair) -> float:
    """Return the increase of r_min with the closing speed, m."""
    closing, (x, y), (v_x, v_y) = scene.settings[0].closing_gain, place, velocity
    if closing == 0.0:
        return 0.0
    # The direction of the pivot approximates the contact's normal.
    apart = max(math.sqrt(x * x + y * y), TINY)
    return float(closing * max(((scene.last[0] - v_x) * x - v_y * y) / apart, 0.0))
