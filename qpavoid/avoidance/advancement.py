"""Conservative advancement: the least room of a body along a rollout, in continuous time.

The *room* of a body is its distance from the footprint less the distance to keep. After
a look at time t the next one may wait until a bound of the room comes down to the level
that matters [Mirtich1996]; what is found to stay above a level does so in between too.

**The bound.** Let n be the normal of the contact and P_r its point, in the robot frame.
No point of the footprint lies beyond the line across n at P_r. Hence, for an end e of
the body's line, room(t + τ) ≥ room_e + n·(e(t + τ) − e(t)), and the least over both ends
bounds that of the line. With the robot driving u = (v, ω), and the end moving at w over
ground (in the robot's axes) on an obstacle that spins at σ with lever l,

    n·(e(t + τ) − e(t)) ≥ s τ − ½ Q τ²     for |ω| τ ≤ 1,     s = n·w − n·J_e u,
    Q = max(ω² n·e − ω v n_y, 0) + ⅓ |ω| max(−n·J_e u, 0) + 2 |ω| |w| + σ² l.

As the robot sees it, what stands moves on a circle round the centre of rotation, where
1 − cos φ ≤ φ²/2 and sin φ ≥ φ − φ²/6 for φ in [0, 1]: the first two terms. The others
bound how w turns in the robot's axes, and how the spin turns w. While the robot brakes
along its arc it drives less of u, and only what brings the end nearer is counted of it.

Beyond an arc, and far away, the circles round footprint and body give the bound.

**Work.** No body is looked at more than :data:`LOOKS` times along a rollout, and once
more for every arc; one for which that is not enough counts as too near.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.prediction import (
    BEGIN,
    DRIVE_OMEGA,
    DRIVE_V,
    GROWTH,
    KEEP,
    LEVER_X1,
    LEVER_X2,
    LEVER_Y1,
    LEVER_Y2,
    SPEED,
    SPREAD,
    STEPS,
    TURN,
    V_X,
    V_Y,
    Rollout,
    Scene,
    X,
    Y,
    braking_share,
    frame_at,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import Touch, point_contact, wall_contact
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import Frame
from qpavoid.qp.exact import Pair

LOOKS = 80
"""At one body along a rollout, beside one for every arc."""

ROUNDING = 1e-10
"""m; no bound is trusted further."""

AFAR = 0.1
"""m; with so much more room than matters the circles are enough."""

STEP = 0.04
"""s; the least room is searched for at times so far apart at most: at its minimum it
changes by less than a millimetre meanwhile."""


class Ends(NamedTuple):
    """The ends of a body's line at a time, from the robot: places, and velocities.

    Attributes:
        x1: m, robot frame, as the next three.
        y1: m.
        x2: m.
        y2: m.
        v_x1: Over ground, m/s, in the robot's axes, as the next three.
        v_y1: m/s.
        v_x2: m/s.
        v_y2: m/s.
    """

    x1: float
    y1: float
    x2: float
    y2: float
    v_x1: float
    v_y1: float
    v_x2: float
    v_y2: float


@compiled_once
def ends_at(bodies: Array, i: int, time: float, at: Frame) -> Ends:
    """Return the ends of a body at a time, as seen from a frame."""
    spin = bodies[i, TURN]
    cos, sin = math.cos(spin * time), math.sin(spin * time)
    x1 = cos * bodies[i, LEVER_X1] - sin * bodies[i, LEVER_Y1]
    y1 = sin * bodies[i, LEVER_X1] + cos * bodies[i, LEVER_Y1]
    x2 = cos * bodies[i, LEVER_X2] - sin * bodies[i, LEVER_Y2]
    y2 = sin * bodies[i, LEVER_X2] + cos * bodies[i, LEVER_Y2]
    v_x, v_y = bodies[i, V_X], bodies[i, V_Y]
    p_x, p_y = bodies[i, X] + time * v_x - at.x, bodies[i, Y] + time * v_y - at.y
    c, s = at.cos, at.sin
    v_x1, v_y1 = v_x - spin * y1, v_y + spin * x1
    v_x2, v_y2 = v_x - spin * y2, v_y + spin * x2
    x1, y1, x2, y2 = p_x + x1, p_y + y1, p_x + x2, p_y + y2
    return Ends(
        c * x1 + s * y1,
        c * y1 - s * x1,
        c * x2 + s * y2,
        c * y2 - s * x2,
        c * v_x1 + s * v_y1,
        c * v_y1 - s * v_x1,
        c * v_x2 + s * v_y2,
        c * v_y2 - s * v_x2,
    )


@compiled
def time_to_lose(room: float, rate: float, bend: float) -> float:
    """Return the least τ with room + rate·τ − ½ bend·τ² = 0; room and bend ≥ 0."""
    root = math.sqrt(rate * rate + 2.0 * bend * room)
    if rate < 0.0:
        return 2.0 * room / (root - rate)
    return (rate + root) / bend if bend > 1e-300 else math.inf


class Drive(NamedTuple):
    """What an arc drives at a time.

    Attributes:
        v: m/s.
        omega: rad/s.
        brakes: Whether it becomes less.
    """

    v: float
    omega: float
    brakes: bool


@compiled
def drive_at(rollout: Rollout, row: int, time: float, dt: float) -> Drive:
    """Return what is driven at a time on an arc."""
    arcs = rollout.arcs
    steps = arcs[row, STEPS]
    share = braking_share(time - arcs[row, BEGIN], steps, dt)
    brakes = steps < math.inf
    return Drive(share * arcs[row, DRIVE_V], share * arcs[row, DRIVE_OMEGA], brakes)


@compiled_once
def end_time(
    touch: Touch, spare: float, place: Pair, velocity: Pair, drive: Drive, own: Pair
) -> float:
    """Return how long an end keeps the level that it is ``spare`` m above, s.

    ``own``: how fast the distance to keep grows, and σ² l, how fast the velocity turns.
    """
    n_x, n_y, fast = touch[2], touch[3], abs(drive.omega)
    (x, y), (v_x, v_y) = place, velocity
    away = -n_x * (drive.v - drive.omega * y) - n_y * drive.omega * x
    if drive.brakes:
        away = min(away, 0.0)
    bend = fast * fast * (n_x * x + n_y * y) - drive.omega * drive.v * n_y
    bend = max(bend, 0.0) + max(away, 0.0) * fast / 3.0
    bend += 2.0 * fast * math.sqrt(v_x * v_x + v_y * v_y) + own[1]
    time = time_to_lose(spare, away + n_x * v_x + n_y * v_y - own[0], bend)
    return min(time, 1.0 / fast) if away > 0.0 and fast > 0.0 else time


@compiled_once
def line_time(
    bodies: Array, i: int, touch: Touch, ends: Ends, drive: Drive, keep: float
) -> float:
    """Return how long the line of a body stays as far away as ``keep``, s."""
    floor = touch[2] * touch[0] + touch[3] * touch[1] + keep
    spin, growth = bodies[i, TURN] * bodies[i, TURN], bodies[i, GROWTH]
    spare = touch[2] * ends.x1 + touch[3] * ends.y1 - floor - ROUNDING
    place, velocity = (ends.x1, ends.y1), (ends.v_x1, ends.v_y1)
    lever = math.sqrt(bodies[i, LEVER_X1] ** 2 + bodies[i, LEVER_Y1] ** 2)
    own = (growth, spin * lever)
    time = end_time(touch, max(spare, 0.0), place, velocity, drive, own)
    if bodies[i, SPREAD] == bodies[i, KEEP]:
        return time
    spare = touch[2] * ends.x2 + touch[3] * ends.y2 - floor - ROUNDING
    place, velocity = (ends.x2, ends.y2), (ends.v_x2, ends.v_y2)
    lever = math.sqrt(bodies[i, LEVER_X2] ** 2 + bodies[i, LEVER_Y2] ** 2)
    own = (growth, spin * lever)
    return min(time, end_time(touch, max(spare, 0.0), place, velocity, drive, own))


@compiled
def line_contact(edges: Array, bodies: Array, i: int, ends: Ends) -> Touch:
    """Return the contact of the footprint with the line of a body."""
    if bodies[i, SPREAD] == bodies[i, KEEP]:
        return point_contact(edges, ends.x1, ends.y1)
    return wall_contact(edges, ends.x1, ends.y1, ends.x2, ends.y2)


@compiled
def circle_room(scene: Scene, i: int, time: float, at: Frame) -> float:
    """Return the room of the circles round footprint and body, m: never too much."""
    bodies = scene.bodies
    d_x = bodies[i, X] + time * bodies[i, V_X] - at.x
    d_y = bodies[i, Y] + time * bodies[i, V_Y] - at.y
    return math.sqrt(d_x * d_x + d_y * d_y) - scene.robot[8] - bodies[i, SPREAD]


@compiled_once
def least_room(
    scene: Scene, rollout: Rollout, i: int, span: Pair, enough: float, exact: bool
) -> tuple[float, float]:
    """Return the least room of body i within a span of times, m, and when it is.

    ``exact``: the least one, at times :data:`STEP` apart, or a value not below
    ``enough``. Otherwise the first that is found below ``enough``, or a value not
    below: then it is kept in between as well.
    """
    arcs, bodies, dt = rollout.arcs, scene.bodies, scene.settings[0].dt
    count, growth, (time, end) = arcs.shape[0], bodies[i, GROWTH], span
    passing = math.sqrt(bodies[i, V_X] ** 2 + bodies[i, V_Y] ** 2)
    passing += rollout.speed + growth
    pace = rollout.speed + rollout.turning * scene.robot[8]
    pace += bodies[i, SPEED] + growth
    least, when, row = math.inf, time, 0
    for _ in range(LOOKS + count):
        while row + 1 < count and arcs[row + 1, BEGIN] <= time:
            row += 1
        at = frame_at(arcs, row, time, dt)
        level = min(enough, least)
        room = circle_room(scene, i, time, at) - growth * time
        if room > level + AFAR:
            wait = (room - level) / passing if passing > 0.0 else math.inf
        else:
            ends = ends_at(bodies, i, time, at)
            touch = line_contact(scene.edges, bodies, i, ends)
            keep = bodies[i, KEEP] + growth * time
            room = touch[4] - keep
            if room < least:
                least, when = room, time
                if room < enough and not exact:
                    return least, when
            level = min(enough, least)
            drive = drive_at(rollout, row, time, dt)
            wait = line_time(bodies, i, touch, ends, drive, keep + level)
            if exact and time < end:
                wait = min(max(wait, STEP), end - time)
            if row + 1 < count:
                wait = min(wait, arcs[row + 1, BEGIN] - time)
            if pace > 0.0:
                wait = max(wait, (room - level - ROUNDING) / pace)
        if time + wait >= end and not (exact and time < end):
            return least, when
        time = min(time + wait, end)
    return (least, when) if exact else (min(least, enough - ROUNDING), when)
