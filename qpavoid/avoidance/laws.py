"""The paper's closed-form laws: Eq. 5 (translation and rotation), Eq. 7 (rotation)."""

import math
from typing import Annotated

from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.cbf_rows import required_distance
from qpavoid.avoidance.decision import INVALID, REPELLED, SINGULAR, TRACKING
from qpavoid.avoidance.settings import activation
from qpavoid.avoidance.step import Outcome, no_outcome
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.contact import approach_row, edge_at
from qpavoid.model.contacts import (
    CONTACT_SIZE,
    ObstacleContact,
    contact_at,
    contact_table,
    most_contacts,
)
from qpavoid.model.robot import limit_twist, limits_of
from qpavoid.types import Sizes, VectorWritten

SINGULAR_LEVER = 1e-9
"""m; shorter undamped lever arms count as singular."""


@compiled
def inverse_lever(lever: float, damping: float) -> float:
    """Return 1/x, damped to x/(x² + λ²) [Nakamura1986]; 0 at the singular point."""
    if abs(lever) + damping < SINGULAR_LEVER:
        return 0.0
    return lever / (lever * lever + damping * damping)


@entry
@compiled
def eq5(
    p_x: float, p_y: float, n_x: float, n_y: float, speed: float, damping: float
) -> tuple[float, float]:
    """Return J_0⁻¹ ẋ_0 d̂_o, the repulsive twist of Eq. 5, with d̂_o = −n.

    In the robot frame J_0⁻¹ = [[1, p_y/p_x], [0, 1/p_x]]: singular abeam of the axle.

    Args:
        p_x: P_r in the robot frame, m.
        p_y: The same.
        n_x: Outward normal at P_r, towards the obstacle.
        n_y: The same.
        speed: ẋ_0 times its activation, m/s.
        damping: λ, m; see :class:`qpavoid.avoidance.settings.Repulsion`.
    """
    turn = -speed * n_y * inverse_lever(p_x, damping)
    return -speed * n_x + p_y * turn, turn


@entry
@compiled
def eq7(
    p_x: float, p_y: float, n_x: float, n_y: float, speed: float, damping: float
) -> tuple[float, float]:
    """Return the repulsive twist of Eq. 7: (0, ẋ_0/(p_y cos α − p_x sin α)).

    α is the angle of the outward normal (n_x, n_y) of the **segment** that holds P_r,
    so that one formula holds for all segments and both sides. The denominator is the
    speed of P_r along the inward normal for ω = 1; it vanishes on the sides at p_x = 0
    and in the middle of the rear. At a corner the obstacle lies off that normal, and
    the distance may shrink a little while P_r moves inwards.

    Args:
        p_x: P_r in the robot frame, m.
        p_y: The same.
        n_x: cos α.
        n_y: sin α.
        speed: ẋ_0 times its activation, m/s.
        damping: λ, m; see :class:`qpavoid.avoidance.settings.Repulsion`.
    """
    return 0.0, speed * inverse_lever(p_y * n_x - p_x * n_y, damping)


@entry
@compiled_once
def _repulsion_step_fits(
    law: int,
    setup: Setup,
    request: Request,
    state: Annotated[VectorWritten, Sizes(2)],
    contacts: VectorWritten,
) -> bool:
    """Return whether ``contacts`` has room for all contacts."""
    most = most_contacts(setup.edges, request.obstacles)
    all_fit: bool = contacts.shape[0] >= most * CONTACT_SIZE
    return all_fit


@entry_if(_repulsion_step_fits)
@compiled
def repulsion_step(
    law: int,
    setup: Setup,
    request: Request,
    state: Annotated[VectorWritten, Sizes(2)],
    contacts: VectorWritten,
) -> Outcome:
    """Return the outcome of Eq. 5 or Eq. 7; only the nearest obstacle repels.

    Args:
        law: 5 or 7.
        setup: Footprint, limits and settings.
        request: Obstacles and desired twist.
        state: Twist driven last; replaced by the next one, within the limits.
        contacts: Memory for all of them.
    """
    (v, omega), robot = request.desired, setup.robot
    if not (math.isfinite(v) and math.isfinite(omega)):
        return no_outcome(INVALID)
    radius = limits_of(robot).circumradius
    _, nearest = contact_table(setup.edges, radius, request.obstacles, 0.0, contacts)
    if nearest == -2:
        return no_outcome(INVALID)
    code, push_v, push_omega = TRACKING, 0.0, 0.0
    distance, obstacle = math.inf, -1
    if nearest >= 0:
        contact = contact_at(contacts, nearest)
        distance = contact.distance
        code, push_v, push_omega = repulsive_twist(law, setup, contact, request)
        obstacle = contact.obstacle if code != TRACKING else -1
    wanted, last = (v + push_v, omega + push_omega), (state[0], state[1])
    v, omega = limit_twist(robot, wanted, last, setup.settings[0].dt)
    state[0], state[1] = v, omega
    return Outcome(code, v, omega, distance, 0.0, 0.0, 0.0, obstacle, -1)


@compiled
def repulsive_twist(
    law: int, setup: Setup, contact: ObstacleContact, request: Request
) -> tuple[int, float, float]:
    """Return the status and the twist that Eq. 5 or 7 adds at a contact."""
    s, c, age, (v, omega) = setup.settings[0], contact, request.age, request.desired
    speed = math.sqrt(c.v_x * c.v_x + c.v_y * c.v_y)
    r_min, wanted = required_distance(setup.settings, speed, age)
    a_v, a_omega = approach_row(c.x, c.y, c.n_x, c.n_y)
    closing = -(a_v * v + a_omega * omega + c.n_x * c.v_x + c.n_y * c.v_y)
    wanted += s.closing_gain * max(closing, 0.0)
    r = wanted + (s.zone_ratio - 1.0) * r_min
    speed = s.speed * activation(s.activation, c.distance, wanted, r)
    if speed == 0.0:
        return TRACKING, 0.0, 0.0
    lever = c.x
    if law == 5:
        push_v, push_omega = eq5(c.x, c.y, c.n_x, c.n_y, speed, s.damping)
    else:
        edge = edge_at(setup.edges, c.segment)
        lever = c.y * edge.n_x - c.x * edge.n_y
        push_v, push_omega = eq7(c.x, c.y, edge.n_x, edge.n_y, speed, s.damping)
    if abs(lever) + s.damping < SINGULAR_LEVER:
        return SINGULAR, 0.0, 0.0
    return REPELLED, push_v, push_omega
