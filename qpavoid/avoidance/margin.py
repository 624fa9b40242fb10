"""Clearance of a plan: the margins of bodies along a rollout, in continuous time.

The *margin* of a body is its distance from the footprint minus the required distance.
After a sample at time t the next one is where a bound of the margin reaches the
threshold [Mirtich1996]; a margin found above a threshold is so between samples, too.

Beyond an arc, and far away, the bound is that of the circles round footprint and body.
Elsewhere it is as follows.

Let m be the margin, n the normal of the contact and P_r its point, in the robot frame.
No point of a convex part lies beyond the line across n at P_r. Hence, for an end e of
the body's segment, m(t + τ) ≥ m_e + n·(e(t + τ) − e(t)), and the least over both ends
bounds that of the segment; the least bound of all parts is that of the footprint. With
the robot driving u = (v, ω), and the end moving at w over ground (in the robot's axes)
on an obstacle that spins at σ with lever l,

    n·(e(t + τ) − e(t)) ≥ s τ − ½ Q τ²     for |ω| τ ≤ 1,     s = n·w − n·J_e u,
    Q = max(ω² n·e − ω v n_y, 0) + ⅓ |ω| max(−n·J_e u, 0) + 2 |ω| |w| + σ² l.

In the robot frame a static point moves on a circle round the centre of rotation, where
1 − cos φ ≤ φ²/2 and sin φ ≥ φ − φ²/6 for φ in [0, 1]: the first two terms. The others
bound the rotation of w in the robot's axes, and by the spin. While the robot brakes
along its arc it drives a part of u, and only components that approach are counted.

Where the margin stays at the threshold the steps would vanish: ``slack`` is the part of
the threshold that may be missed between samples.

**Complexity.** A body or group is sampled at most :data:`LOOKS` times along a rollout,
and once per arc; if that does not decide, it counts as too near. A call of the filter
rolls out fewer than 1,400 plans for any input, typically fewer than twenty.

**Broad phase.** Bodies are skipped by the circles round footprint and body, and in
groups. Successive points, as of a scan, share a wall whose margin is at most that of
any of them (:func:`qpavoid.avoidance.bodies.group_of`): if the wall's keeps the
threshold, and :data:`SPARE` at every sample, none of the points is checked.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import (
    MOVES,
    Body,
    End,
    Ends,
    Scene,
    ends_at,
    is_point,
    line_contact,
    moves,
    part_contact,
    precedes,
    threshold,
    with_bodies,
)
from qpavoid.avoidance.plan import (
    Arc,
    Rollout,
    arc_index,
    frame_at,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import Contact, part_at
from qpavoid.model.kinematics import Frame
from qpavoid.model.robot import RELATIVE_ROUNDING, limits_of
from qpavoid.types import Array, Pair


@compiled
def circle_margin(scene: Scene, body: Body, time: float, at: Frame) -> float:
    """Return a lower bound of the margin, m: that of the circles round both."""
    # The circles are independent of the headings.
    d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
    apart = math.sqrt(d_x * d_x + d_y * d_y)
    return float(apart - limits_of(scene.robot).circumradius - body.spread)


@compiled
def growth_of(scene: Scene, body: Body) -> float:
    """Return the rate of growth of a body's required distance, m/s."""
    return 0.0 if body.kind == MOVES else scene.drift


@compiled
def passing_speed(scene: Scene, rollout: Rollout, body: Body) -> float:
    """Return the greatest closing speed of the circles round both, m/s."""
    speed = math.sqrt(body.v_x**2 + body.v_y**2)
    return float(rollout.speed + speed + growth_of(scene, body))


@compiled
def stays_away(
    scene: Scene, rollout: Rollout, i: int, end: float, level: float
) -> bool:
    """Return whether body i keeps a threshold, m, up to a time, s.

    By its present margin or its circle: two comparisons, for most bodies.
    """
    body = scene.bodies[i]
    if closing_speed(scene, rollout, body) * end < body.margin_now - level < math.inf:
        return True
    # Squares, without a root: most bodies are rejected here. With far < 0 the threshold
    # cannot be violated.
    far = limits_of(scene.robot).circumradius + body.spread + level
    far += passing_speed(scene, rollout, body) * end
    return bool(far < 0.0 or body.x * body.x + body.y * body.y > far * far)


@compiled
def closing_speed(scene: Scene, rollout: Rollout, body: Body) -> float:
    """Return the greatest closing speed of footprint and body, m/s."""
    turning = rollout.turning * limits_of(scene.robot).circumradius
    speed = body.speed + growth_of(scene, body)
    return float(rollout.speed + turning + speed)


BOUND_ROUNDING = 1e-10
"""m; tolerance of the bounds for rounding."""

NO_BEND = 1e-300
"""m/s²; divisor below which a quotient counts as infinite."""


@compiled_once
def time_to_lose(margin: float, rate: float, bend: float) -> float:
    """Return the least τ with margin + rate·τ − ½ bend·τ² = 0, s.

    Margin (m) and bend (m/s²) are not negative.
    """
    root = math.sqrt(rate * rate + 2.0 * bend * margin)
    # The form of the root without cancellation.
    if rate < 0.0:
        return 2.0 * margin / (root - rate)
    return (rate + root) / bend if bend > NO_BEND else math.inf


class ArcTwist(NamedTuple):
    """Twist on an arc at a time.

    Attributes:
        v: m/s.
        omega: rad/s.
        brakes: Whether it decreases.
    """

    v: float
    omega: float
    brakes: bool


@compiled_once
def arc_twist(arc: Arc, time: float, dt: float) -> ArcTwist:
    """Return the twist at a time on an arc."""
    share, brakes = 1.0, arc.steps < math.inf
    if brakes:
        steps = math.floor((time - arc.begin) / dt + RELATIVE_ROUNDING)
        share = max(1.0 - steps / arc.steps, 0.0)
    return ArcTwist(share * arc.v, share * arc.omega, brakes)


@compiled_once
def end_time(
    contact: Contact, end: End, driven: ArcTwist, line: tuple[float, float, float]
) -> float:
    """Return a lower bound of the time until an end crosses a line, s.

    ``line``: its position along the normal, m; its speed away, m/s; and σ² l, the
    rate of change of the end's velocity, m/s².
    """
    n_x, n_y, fast = contact.n_x, contact.n_y, abs(driven.omega)
    (x, y, v_x, v_y), (floor, growth, spin) = end, line
    spare = max(n_x * x + n_y * y - floor - BOUND_ROUNDING, 0.0)
    away = -n_x * (driven.v - driven.omega * y) - n_y * driven.omega * x
    # While braking, motion away from the line does not count.
    if driven.brakes:
        away = min(away, 0.0)
    bend = fast * fast * (n_x * x + n_y * y) - driven.omega * driven.v * n_y
    bend = max(bend, 0.0) + max(away, 0.0) * fast / 3.0
    bend += 2.0 * fast * math.sqrt(v_x * v_x + v_y * v_y) + spin
    time = time_to_lose(spare, away + n_x * v_x + n_y * v_y - growth, bend)
    # sin φ ≥ φ − φ³/6 was used for φ up to 1, and only where the end goes away.
    return min(time, 1.0 / fast) if away > 0.0 and fast > 0.0 else time


@compiled_once
def line_time(
    body: Body, contact: Contact, ends: Ends, driven: ArcTwist, distance: Pair
) -> float:
    """Return a lower bound of the time until a body's segment violates its distance, s.

    Args:
        body: The body.
        contact: Its contact now.
        ends: Of its segment.
        driven: Twist of the robot.
        distance: Required distance, m, and its rate of growth, m/s.
    """
    # Along n the footprint ends at P_r: an end may approach it by the margin.
    floor = contact.n_x * contact.x + contact.n_y * contact.y + distance[0]
    square = body.turn * body.turn
    spin = square * math.sqrt(body.x1**2 + body.y1**2)
    time = end_time(contact, ends.one, driven, (floor, distance[1], spin))
    if is_point(body):
        return time
    spin = square * math.sqrt(body.x2**2 + body.y2**2)
    return min(time, end_time(contact, ends.other, driven, (floor, distance[1], spin)))


@compiled_once
def clear_time(
    edges: Array,
    body: Body,
    ends: Ends,
    driven: ArcTwist,
    distance: Pair,
    limits: tuple[float, float, float],
) -> float:
    """Return a lower bound of the time until a body violates its distance, s.

    Negative if it does so now.

    Args:
        edges: Of the footprint.
        body: The body.
        ends: Of its segment.
        driven: Twist of the robot.
        distance: Required distance, and the part of it that may be missed later, m.
        limits: Growth of that distance and closing speed, m/s; end of the arc, s.
    """
    (required, slack), (growth, pace, until), wait, stop = distance, limits, math.inf, 0
    least = required - slack
    while stop < edges.shape[0]:
        part = part_at(edges, stop)
        contact, stop = part_contact(edges, part, body, ends), part.end
        if contact.distance < required:
            return -1.0
        time = min(line_time(body, contact, ends, driven, (least, growth)), until)
        if pace > 0.0:
            # The bound by the greatest speed [Mirtich1996] holds across arcs, and may
            # be the longer one.
            time = max(time, (contact.distance - least - BOUND_ROUNDING) / pace)
        wait = min(wait, time)
    return wait


LOOKS = 80
"""Samples of one body along a rollout, in addition to one per arc."""

AFAR = 0.1
"""m; excess of the margin above which the bound of the circles is used."""


@compiled_once
def too_near(
    scene: Scene, rollout: Rollout, i: int, span: Pair, level: float, slack: float
) -> tuple[bool, float]:
    """Return whether the margin of body i falls below a threshold, and when first.

    Args:
        scene: With the body.
        rollout: Of the robot.
        i: Number of the body.
        span: Begin and end of the check, s.
        level: Threshold, m.
        slack: False only if the margin is at least level − slack, m, at all times.
    """
    arcs, dt, (time, end) = rollout.arcs, scene.longest, span
    body, count, row = scene.bodies[i], arcs.shape[0], 0
    growth, passing = growth_of(scene, body), passing_speed(scene, rollout, body)
    pace = closing_speed(scene, rollout, body)
    for _ in range(LOOKS + count):
        row = arc_index(arcs, row, time)
        arc = arcs[row]
        at = frame_at(arc, time, dt)
        # A distance of two circles costs one root, a contact all edges.
        spare = circle_margin(scene, body, time, at) - growth * time - level
        if spare > AFAR:
            wait = spare / passing if passing > 0.0 else math.inf
        else:
            required = body.required + growth * time + level
            ends, until = ends_at(body, time, at), math.inf
            if row + 1 < count:
                # The bound holds for this arc's twist; the next one is sampled at its
                # start.
                until = arcs[row + 1].begin - time
            driven = arc_twist(arc, time, dt)
            speeds = (growth, pace, until)
            wait = clear_time(
                scene.edges, body, ends, driven, (required, slack), speeds
            )
            if wait < 0.0:
                return True, time
        time += wait
        if time >= end:
            return False, end
    # Undecided after all samples: too near, which is conservative.
    return True, time


STEP = 0.05
"""s; sampling period of the search for the least margin."""

MOST_SKIPPED = 1e6
"""Greatest number of skipped steps: compiled, a floor is an integer of 64 bits."""

REFINEMENTS = 6
"""Bisections about the time of the least margin."""

RESOLUTION, LEAST_STEP, DEEPEST = 1e-3, 1e-4, 1e6
"""m; resolution of the margin of a plan; least step of a search for a kept threshold;
greatest deficit of a margin."""

CHECKS = 10
"""Steps of that search, each twice the last one: 0.1 m in all."""

SPARE = 0.02
"""m; excess of a group's margin below which its points are checked one by one."""


class Violation(NamedTuple):
    """A violated body.

    Attributes:
        body: Its number, or −1.
        time: When it is violated first, s.
    """

    body: int
    time: float


class Watch(NamedTuple):
    """Time spans and thresholds of a check along a rollout.

    Attributes:
        moving: For moving bodies: end of the check, s (below 0: none), and threshold of
            the margin, m.
        still: For static bodies.
    """

    moving: Pair
    still: Pair


UNWATCHED = (-1.0, 0.0)
"""Entry of a :class:`Watch` without a check."""


@compiled_once
def next_body(scene: Scene, rollout: Rollout, i: int, watch: Watch) -> int:
    """Return the first body from i on that needs a check, or the number of bodies.

    Bodies are skipped by their circles and by their groups.
    """
    count: int = scene.bodies.shape[0]
    while i < count:
        row, wanted = scene.bodies[i].group, watch.still
        if moves(scene, i):
            wanted = watch.moving
        end, level = wanted
        # The owner of a group is the row after its last point.
        if row >= 0 and (end < 0.0 or is_far(scene, rollout, row, wanted)):
            i = scene.groups[row].owner
        elif end < 0.0 or stays_away(scene, rollout, i, end, level):
            i += 1
        else:
            return i
    return count


@compiled_once
def is_far(scene: Scene, rollout: Rollout, row: int, wanted: Pair) -> bool:
    """Return whether a group keeps a threshold up to a time; ``wanted``: both."""
    (end, level), near = wanted, False
    groups = with_bodies(scene, scene.groups, scene.drift)
    # SPARE at every sample, and a miss of SPARE in between, leave the threshold.
    if not stays_away(groups, rollout, row, end, level):
        near, _ = too_near(groups, rollout, row, (0.0, end), level + SPARE, SPARE)
    return not near


@compiled_once
def violation_of(
    scene: Scene, rollout: Rollout, i: int, watch: Watch, slack: float
) -> Violation:
    """Return the violation of body i along a rollout, if any.

    A static body that is too near now only has to get no nearer, or it could not be
    left. If it is nearer than the slack, its margin may not fall below −ε.
    """
    (end, level), now = watch.still, scene.bodies[i].margin_now
    if moves(scene, i):
        end, level = watch.moving
    if now < level:
        level = now
        if level < -slack:
            level, slack = threshold(scene), 0.0
    near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
    return Violation(i if near else -1, time)


@compiled_once
def violation(scene: Scene, rollout: Rollout, watch: Watch, slack: float) -> Violation:
    """Return the first body, in the order of rows, that violates, and when.

    ``slack``: see :func:`too_near`.
    """
    met = Violation(-1, 0.0)
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        # Points keep the order of the scan: their least row is sought.
        if met.body < 0 or precedes(scene.bodies, i, met.body):
            found = violation_of(scene, rollout, i, watch, slack)
            met = found if found.body >= 0 else met
        i = next_body(scene, rollout, i + 1, watch)
    return met


@compiled_once
def keeps_all(scene: Scene, rollout: Rollout, watch: Watch) -> bool:
    """Return whether no body violates its threshold."""
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        if violation_of(scene, rollout, i, watch, 0.0).body >= 0:
            return False
        i = next_body(scene, rollout, i + 1, watch)
    return True


@compiled_once
def keeps(scene: Scene, rollout: Rollout, moving: bool, level: float) -> bool:
    """Return whether the moving or the static bodies keep a threshold, m."""
    watch = Watch(UNWATCHED, (rollout.rest, level))
    if moving:
        watch = Watch((scene.settings[0].horizon, level), UNWATCHED)
    return keeps_all(scene, rollout, watch)


@compiled_once
def margin_at(scene: Scene, rollout: Rollout, i: int, time: float) -> float:
    """Return the margin of body i at a time, m."""
    body = scene.bodies[i]
    arc = rollout.arcs[arc_index(rollout.arcs, 0, time)]
    ends = ends_at(body, time, frame_at(arc, time, scene.longest))
    distance = line_contact(scene.edges, body, ends).distance
    return float(distance - body.required - growth_of(scene, body) * time)


@compiled_once
def sampled_margin(
    scene: Scene, rollout: Rollout, i: int, end: float, most: float
) -> float:
    """Return the least of the sampled margins of body i up to a time, m, ≤ ``most``.

    Sampled every :data:`STEP`, at most :data:`LOOKS` times; samples that cannot be less
    are skipped. Then refined about the least.
    """
    arcs, body, least, time, row = rollout.arcs, scene.bodies[i], most, 0.0, 0
    when = -1.0
    passing = passing_speed(scene, rollout, body)
    step = max(STEP, end / LOOKS)
    for _ in range(LOOKS + 1):
        row = arc_index(arcs, row, time)
        at = frame_at(arcs[row], time, scene.longest)
        margin, speed = circle_margin(scene, body, time, at), passing
        if margin < least + AFAR:
            contact = line_contact(scene.edges, body, ends_at(body, time, at))
            margin, speed = (
                contact.distance - body.required,
                closing_speed(scene, rollout, body),
            )
        margin -= growth_of(scene, body) * time
        if margin < least:
            least, when = margin, time
        if time >= end:
            break
        steps, way = 1.0, speed * step
        if way > 0.0:
            steps = max(math.floor(min((margin - least) / way, MOST_SKIPPED)), 1.0)
        time = min(time + steps * step, end)
    for _ in range(REFINEMENTS if when >= 0.0 else 0):
        step *= 0.5
        for side in range(2):
            time = min(max(when + (2 * side - 1) * step, 0.0), end)
            margin = margin_at(scene, rollout, i, time)
            if margin < least:
                least, when = margin, time
    return least


@compiled_once
def sampled_least(scene: Scene, rollout: Rollout, moving: bool, most: float) -> float:
    """Return the least sampled margin of the moving or the static bodies, m.

    Of the moving ones up to the horizon, of the static ones until rest; at most
    ``most``. Samples may miss the least.
    """
    least, end = most, scene.settings[0].horizon if moving else rollout.rest
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i) == moving:
            least = sampled_margin(scene, rollout, i, end, least)
    return least


@compiled_once
def least_margin(scene: Scene, rollout: Rollout, moving: bool, most: float) -> float:
    """Return a bound of the least margin of the moving or the static bodies, m.

    Samples may miss the least: see :func:`sampled_least`. The result is a margin that
    is kept at all times; without one after :data:`CHECKS` steps, the last one tried.
    """
    if keeps(scene, rollout, moving, most):
        return most
    level, step = sampled_least(scene, rollout, moving, most), LEAST_STEP
    for _ in range(CHECKS):
        if keeps(scene, rollout, moving, level):
            break
        level, step = level - step, 2.0 * step
    return level
