"""Conservative advancement: the room of a body along a rollout, in continuous time.

The *room* of a body is its distance from the footprint less the distance to keep. After
a look at time t the next one may wait until a bound of the room comes down to the level
that matters [Mirtich1996]; what is found to stay above a level does so in between too.

**The bound.** Let n be the normal of the contact and P_r its point, in the robot frame.
No point of the footprint lies beyond the line across n at P_r. Hence, for an end e of
the body's line, room(t + τ) ≥ room_e + n·(e(t + τ) − e(t)), and the least over both
ends bounds that of the line. With the robot driving u = (v, ω), and the end moving at
w over ground (in the robot's axes) on an obstacle that spins at σ with lever l,

    n·(e(t + τ) − e(t)) ≥ s τ − ½ Q τ²     for |ω| τ ≤ 1,     s = n·w − n·J_e u,
    Q = max(ω² n·e − ω v n_y, 0) + ⅓ |ω| max(−n·J_e u, 0) + 2 |ω| |w| + σ² l.

As the robot sees it, what stands moves on a circle round the centre of rotation, where
1 − cos φ ≤ φ²/2 and sin φ ≥ φ − φ²/6 for φ in [0, 1]: the first two terms. The others
bound how w turns in the robot's axes, and how the spin turns w. While the robot brakes
along its arc it drives less of u, and only what brings the end nearer is counted of it.

Beyond an arc, and far away, the circles round footprint and body give the bound.

Along a way that just keeps the level the looks would stand still. Where more is wanted
than is needed, ``slack`` is what may be missed of it in between.

**Groups.** Points that follow one another, as those of a scan do, share a wall that has
no more room than any of them (:func:`qpavoid.avoidance.bodies.group_of`): where that is
found to keep the level, and :data:`SPARE` at every look, none of them is looked at.

**Work.** No body, and no group, is looked at more than :data:`LOOKS` times along a
rollout, and once more for every arc; one for which that is not enough counts as too
near. A call of the
filter rolls out fewer than 1,400 plans, whatever it is given: mostly fewer than twenty.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import (
    GROUP,
    OWNER,
    Body,
    Scene,
    altered,
    body_at,
    comes_first,
    is_point,
    moves,
)
from qpavoid.avoidance.motion import (
    End,
    Ends,
    circle_room,
    closing_speed,
    ends_at,
    growth_of,
    line_contact,
    passing_speed,
    stays_away,
)
from qpavoid.avoidance.prediction import (
    Arc,
    Rollout,
    arc_at,
    arc_index,
    braking_share,
    frame_at,
)
from qpavoid.compiled import compiled_once
from qpavoid.model.contact import Contact
from qpavoid.types import Pair

LOOKS = 80
"""At one body along a rollout, beside one for every arc."""

BOUND_ROUNDING = 1e-10
"""m; no bound is trusted further."""

NO_BEND = 1e-300
"""m/s²; a quotient by less is infinite."""

AFAR = 0.1
"""m; with so much more room than matters the circles are enough."""

STEP = 0.05
"""s; the least room is searched for at times so far apart."""

SPARE = 0.02
"""m; with so little more room than matters a group counts as near."""

REFINEMENTS = 6
"""How often the time of the least room is bisected."""


@compiled_once
def time_to_lose(room: float, rate: float, bend: float) -> float:
    """Return the least τ with room + rate·τ − ½ bend·τ² = 0; room and bend ≥ 0."""
    root = math.sqrt(rate * rate + 2.0 * bend * room)
    if rate < 0.0:
        return 2.0 * room / (root - rate)
    return (rate + root) / bend if bend > NO_BEND else math.inf


class Meeting(NamedTuple):
    """First violation along a rollout.

    Attributes:
        body: Its number; −1: nothing does.
        time: When it does first, s.
    """

    body: int
    time: float


class Watch(NamedTuple):
    """What is looked at along a rollout.

    Attributes:
        moving: Up to when what moves is, s (below 0: it is not), and the room that it
            has to leave, m.
        still: The same for what stands.
    """

    moving: Pair
    still: Pair


UNWATCHED = (-1.0, 0.0)
"""Of a :class:`Watch`: not looked at."""


class ArcTwist(NamedTuple):
    """What an arc drives at a time.

    Attributes:
        v: m/s.
        omega: rad/s.
        brakes: Whether it becomes less.
    """

    v: float
    omega: float
    brakes: bool


@compiled_once
def arc_twist(arc: Arc, time: float, dt: float) -> ArcTwist:
    """Return what is driven at a time on an arc."""
    share = braking_share(time - arc.begin, arc.steps, dt)
    return ArcTwist(share * arc.v, share * arc.omega, arc.steps < math.inf)


@compiled_once
def end_time(
    contact: Contact, end: End, driven: ArcTwist, line: tuple[float, float, float]
) -> float:
    """Return a lower bound of the time until an end crosses a line, s.

    ``line``: where that is along the normal, m; how fast it moves away, m/s; and
    σ² l, how fast the velocity of the end turns, m/s².
    """
    n_x, n_y, fast = contact.n_x, contact.n_y, abs(driven.omega)
    (x, y, v_x, v_y), (floor, growth, spin) = end, line
    spare = max(n_x * x + n_y * y - floor - BOUND_ROUNDING, 0.0)
    away = -n_x * (driven.v - driven.omega * y) - n_y * driven.omega * x
    if driven.brakes:
        away = min(away, 0.0)
    bend = fast * fast * (n_x * x + n_y * y) - driven.omega * driven.v * n_y
    bend = max(bend, 0.0) + max(away, 0.0) * fast / 3.0
    bend += 2.0 * fast * math.sqrt(v_x * v_x + v_y * v_y) + spin
    time = time_to_lose(spare, away + n_x * v_x + n_y * v_y - growth, bend)
    return min(time, 1.0 / fast) if away > 0.0 and fast > 0.0 else time


@compiled_once
def line_time(
    body: Body, contact: Contact, ends: Ends, driven: ArcTwist, keep: Pair
) -> float:
    """Return a lower bound of the time until the line of a body is too near, s.

    Args:
        body: Whose line it is.
        contact: Its contact now.
        ends: Of it.
        driven: What the robot drives.
        keep: m now, and how fast that grows, m/s.
    """
    floor = contact.n_x * contact.x + contact.n_y * contact.y + keep[0]
    square = body.turn * body.turn
    spin = square * math.sqrt(body.x1**2 + body.y1**2)
    time = end_time(contact, ends.one, driven, (floor, keep[1], spin))
    if is_point(body):
        return time
    spin = square * math.sqrt(body.x2**2 + body.y2**2)
    return min(time, end_time(contact, ends.other, driven, (floor, keep[1], spin)))


@compiled_once
def room_at(scene: Scene, rollout: Rollout, i: int, time: float) -> float:
    """Return the room of body i at a time, m."""
    body = body_at(scene, i)
    arc = arc_at(rollout.arcs, arc_index(rollout.arcs, 0, time))
    ends = ends_at(body, time, frame_at(arc, time, scene.longest))
    distance = line_contact(scene.edges, body, ends).distance
    return float(distance - body.keep - growth_of(scene, body) * time)


@compiled_once
def too_near(
    scene: Scene, rollout: Rollout, i: int, span: Pair, level: float, slack: float
) -> tuple[bool, float]:
    """Return whether body i has less room than a level within a span, and when first.

    Args:
        scene: With the body.
        rollout: The way of the robot.
        i: Number of the body.
        span: From when until when, s.
        level: Room, m.
        slack: It is never false if there is less than level − slack, m, at any time.
    """
    arcs, dt, (time, end) = rollout.arcs, scene.longest, span
    body, count, row = body_at(scene, i), arcs.shape[0], 0
    growth, passing = growth_of(scene, body), passing_speed(scene, rollout, body)
    pace = closing_speed(scene, rollout, body)
    for _ in range(LOOKS + count):
        row = arc_index(arcs, row, time)
        arc = arc_at(arcs, row)
        at = frame_at(arc, time, dt)
        spare = circle_room(scene, body, time, at) - growth * time - level
        if spare > AFAR:
            wait = spare / passing if passing > 0.0 else math.inf
        else:
            ends = ends_at(body, time, at)
            contact = line_contact(scene.edges, body, ends)
            keep = body.keep + growth * time + level
            if contact.distance < keep:
                return True, time
            driven, least = arc_twist(arc, time, dt), keep - slack
            wait = line_time(body, contact, ends, driven, (least, growth))
            if row + 1 < count:
                wait = min(wait, arc_at(arcs, row + 1).begin - time)
            if pace > 0.0:
                wait = max(wait, (contact.distance - least - BOUND_ROUNDING) / pace)
        time += wait
        if time >= end:
            return False, end
    return True, time


@compiled_once
def next_body(scene: Scene, rollout: Rollout, i: int, watch: Watch) -> int:
    """Return the first body from i on that may come too near; their number: none.

    Left out is what keeps away by its circle, and together with its group.
    """
    count: int = scene.bodies.shape[0]
    while i < count:
        row, wanted = int(scene.bodies[i, GROUP]), watch.still
        if moves(scene, i):
            wanted = watch.moving
        end, level = wanted
        if row >= 0 and (end < 0.0 or is_far(scene, rollout, row, wanted)):
            i = int(scene.groups[row, OWNER])
        elif end < 0.0 or stays_away(scene, rollout, i, end, level):
            i += 1
        else:
            return i
    return count


@compiled_once
def is_far(scene: Scene, rollout: Rollout, row: int, wanted: Pair) -> bool:
    """Return whether a group keeps a level of room up to a time, and more at a look."""
    (end, level), near = wanted, False
    groups = altered(scene, scene.groups, scene.drift, scene.closest)
    if not stays_away(groups, rollout, row, end, level):
        near, _ = too_near(groups, rollout, row, (0.0, end), level + SPARE, SPARE)
    return not near


@compiled_once
def keeps_all(scene: Scene, rollout: Rollout, watch: Watch) -> bool:
    """Return whether no body comes too near."""
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        end, level = watch.moving if moves(scene, i) else watch.still
        near, _ = too_near(scene, rollout, i, (0.0, end), level, 0.0)
        if near:
            return False
        i = next_body(scene, rollout, i + 1, watch)
    return True


@compiled_once
def first_met(scene: Scene, rollout: Rollout, watch: Watch, slack: float) -> Meeting:
    """Return when the first body that comes too near does, in the order of their rows.

    ``slack``: see :func:`too_near`.
    """
    met = Meeting(-1, 0.0)
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        if met.body < 0 or comes_first(scene.bodies, i, met.body):
            end, level = watch.moving if moves(scene, i) else watch.still
            near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
            if near:
                met = Meeting(i, time)
        i = next_body(scene, rollout, i + 1, watch)
    return met


@compiled_once
def least_room(
    scene: Scene, rollout: Rollout, i: int, span: Pair, enough: float
) -> tuple[float, float]:
    """Return the least room of body i as far as it is found, m, and when it is.

    Looked for at times :data:`STEP` apart, at most :data:`LOOKS` of them, and then
    about the least.

    Args:
        scene: With the body.
        rollout: The way of the robot.
        i: Number of the body.
        span: From when until when, s.
        enough: m; returned where it is not less.
    """
    arcs, dt, (time, end) = rollout.arcs, scene.longest, span
    body, least, when, row = body_at(scene, i), enough, -1.0, 0
    passing = passing_speed(scene, rollout, body)
    pace = closing_speed(scene, rollout, body)
    step = max(STEP, (end - time) / LOOKS)
    for _ in range(LOOKS + 1):
        row = arc_index(arcs, row, time)
        at = frame_at(arc_at(arcs, row), time, dt)
        growth = growth_of(scene, body) * time
        room, speed = circle_room(scene, body, time, at) - growth, passing
        if room < least + AFAR:
            contact = line_contact(scene.edges, body, ends_at(body, time, at))
            room, speed = contact.distance - body.keep - growth, pace
            if room < least:
                least, when = room, time
        if time >= end:
            break
        steps, way = 1.0, speed * step
        if way > 0.0:
            steps = max(math.floor(min((room - least) / way, 1e6)), 1.0)
        time = min(time + steps * step, end)
    for _ in range(REFINEMENTS if when >= 0.0 else 0):
        step *= 0.5
        for side in range(2):
            time = min(max(when + (2 * side - 1) * step, span[0]), end)
            room = room_at(scene, rollout, i, time)
            if room < least:
                least, when = room, time
    return least, when
