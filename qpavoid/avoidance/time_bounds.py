"""Time bound of conservative advancement: how long a body keeps its margin.

The *margin* m of a body is its distance from the footprint minus the required distance.
Let n be the normal of the contact and P_r its point, in the robot frame.
No point of the footprint lies beyond the line across n at P_r. Hence, for an end e of
the body's segment, m(t + τ) ≥ m_e + n·(e(t + τ) − e(t)), and the least over both ends
bounds that of the segment. With the robot driving u = (v, ω), and the end moving at w
over ground (in the robot's axes) on an obstacle that spins at σ with lever l,

    n·(e(t + τ) − e(t)) ≥ s τ − ½ Q τ²     for |ω| τ ≤ 1,     s = n·w − n·J_e u,
    Q = max(ω² n·e − ω v n_y, 0) + ⅓ |ω| max(−n·J_e u, 0) + 2 |ω| |w| + σ² l.

In the robot frame a static point moves on a circle round the centre of rotation, where
1 − cos φ ≤ φ²/2 and sin φ ≥ φ − φ²/6 for φ in [0, 1]: the first two terms. The others
bound the rotation of w in the robot's axes, and by the spin. While the robot brakes
along its arc it drives a part of u, and only components that approach are counted.
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
"""m; tolerance of the bounds for rounding."""

NO_BEND = 1e-300
"""m/s²; divisor below which a quotient counts as infinite."""


@compiled_once
def time_to_lose(room: float, rate: float, bend: float) -> float:
    """Return the least τ with room + rate·τ − ½ bend·τ² = 0, s; room and bend ≥ 0."""
    root = math.sqrt(rate * rate + 2.0 * bend * room)
    # The form of the root without cancellation.
    if rate < 0.0:
        return 2.0 * room / (root - rate)
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
    share = braking_share(time - arc.begin, arc.steps, dt)
    return ArcTwist(share * arc.v, share * arc.omega, arc.steps < math.inf)


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
    body: Body, contact: Contact, ends: Ends, driven: ArcTwist, keep: Pair
) -> float:
    """Return a lower bound of the time until a body's segment violates its distance, s.

    Args:
        body: The body.
        contact: Its contact now.
        ends: Of its segment.
        driven: Twist of the robot.
        keep: Required distance, m, and its rate of growth, m/s.
    """
    # Along n the footprint ends at P_r: an end may approach it by the margin.
    floor = contact.n_x * contact.x + contact.n_y * contact.y + keep[0]
    square = body.turn * body.turn
    spin = square * math.sqrt(body.x1**2 + body.y1**2)
    time = end_time(contact, ends.one, driven, (floor, keep[1], spin))
    if is_point(body):
        return time
    spin = square * math.sqrt(body.x2**2 + body.y2**2)
    return min(time, end_time(contact, ends.other, driven, (floor, keep[1], spin)))
