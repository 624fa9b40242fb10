"""How long a body stays away: the bound of conservative advancement.

The *room* of a body is its distance from the footprint less the distance to keep. Let n
be the normal of the contact and P_r its point, in the robot frame.
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
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.body_table import Body, is_point
from qpavoid.avoidance.motion import End, Ends
from qpavoid.avoidance.prediction import Arc, braking_share
from qpavoid.compiled import compiled_once
from qpavoid.model.contact import Contact
from qpavoid.types import Pair

BOUND_ROUNDING = 1e-10
"""m; no bound is trusted further."""

NO_BEND = 1e-300
"""m/s²; a quotient by less is infinite."""


@compiled_once
def time_to_lose(room: float, rate: float, bend: float) -> float:
    """Return the least τ with room + rate·τ − ½ bend·τ² = 0; room and bend ≥ 0."""
    root = math.sqrt(rate * rate + 2.0 * bend * room)
    # Of the root's two forms the one in which nothing cancels.
    if rate < 0.0:
        return 2.0 * room / (root - rate)
    return (rate + root) / bend if bend > NO_BEND else math.inf


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
    # A motion that dies away may not be counted on to lead away.
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
    # Along n the footprint ends at P_r: an end of the line may come down to there and
    # what is to be kept.
    floor = contact.n_x * contact.x + contact.n_y * contact.y + keep[0]
    square = body.turn * body.turn
    spin = square * math.sqrt(body.x1**2 + body.y1**2)
    time = end_time(contact, ends.one, driven, (floor, keep[1], spin))
    if is_point(body):
        return time
    spin = square * math.sqrt(body.x2**2 + body.y2**2)
    return min(time, end_time(contact, ends.other, driven, (floor, keep[1], spin)))
