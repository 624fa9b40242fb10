"""The paper's closed-form laws: Eq. 5 (translation and rotation), Eq. 7 (rotation)."""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import wanted_distance
from qpavoid.avoidance.decision import INVALID, REPELLED, SINGULAR, TRACKING
from qpavoid.avoidance.settings import activation
from qpavoid.compiled import compiled
from qpavoid.model.contact import approach_row
from qpavoid.model.contacts import contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays
from qpavoid.model.robot import limit_twist

SINGULAR_LEVER = 1e-9
"""m; a shorter lever arm, undamped, has no inverse worth the name."""


@compiled
def inverse_lever(lever: float, damping: float) -> float:
    """Return 1/x, damped to x/(x² + λ²) [Nakamura1986]; 0 at the singular point."""
    if abs(lever) + damping < SINGULAR_LEVER:
        return 0.0
    return lever / (lever * lever + damping * damping)


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


@compiled
def eq7(
    p_x: float, p_y: float, n_x: float, n_y: float, speed: float, damping: float
) -> tuple[float, float]:
    """Return the repulsive twist of Eq. 7, corrected: (0, ẋ_0/(p_y cos α − p_x sin α)).

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


@compiled
def repulsion_step(
    law: int,
    edges: Array,
    robot: Array,
    settings: npt.NDArray[np.void],
    obstacles: Arrays,
    age: float,
    v: float,
    omega: float,
    state: Array,
    contacts: Array,
) -> tuple[int, float, float, float, int]:
    """Return code, v, ω, clearance and obstacle of Eq. 5 (law 5) or Eq. 7 (law 7).

    The nearest obstacle alone repels, as in the paper. The twist is cut to what the
    robot can drive after the one in ``state``, which it replaces. ``contacts`` has
    room for all of them.
    """
    if not (math.isfinite(v) and math.isfinite(omega)):
        return INVALID, 0.0, 0.0, math.inf, -1
    _, nearest = contact_table(edges, robot[8], obstacles, 0.0, contacts)
    if nearest == -2:
        return INVALID, 0.0, 0.0, math.inf, -1
    code, push_v, push_omega = TRACKING, 0.0, 0.0
    distance, obstacle = math.inf, -1
    if nearest >= 0:
        distance = contacts[nearest, 4]
        code, push_v, push_omega = repulsive_twist(
            law, edges, settings, contacts[nearest], age, v, omega
        )
        obstacle = int(contacts[nearest, 7]) if code != TRACKING else -1
    v, omega = limit_twist(
        robot, v + push_v, omega + push_omega, state[0], state[1], settings[0].dt
    )
    state[0], state[1] = v, omega
    return code, v, omega, distance, obstacle


@compiled
def repulsive_twist(
    law: int,
    edges: Array,
    settings: npt.NDArray[np.void],
    contact: Array,
    age: float,
    v: float,
    omega: float,
) -> tuple[int, float, float]:
    """Return code and what Eq. 5 or 7 adds to the desired twist at a contact."""
    p_x, p_y, n_x, n_y = contact[0], contact[1], contact[2], contact[3]
    distance, v_x, v_y, segment = contact[4], contact[5], contact[6], int(contact[8])
    s = settings[0]
    r_min, wanted = wanted_distance(settings, math.sqrt(v_x * v_x + v_y * v_y), age)
    a_v, a_omega = approach_row(p_x, p_y, n_x, n_y)
    closing = -(a_v * v + a_omega * omega + n_x * v_x + n_y * v_y)
    wanted += s.closing * max(closing, 0.0)
    r = wanted + (s.ratio - 1.0) * r_min
    speed = s.speed * activation(s.activation, distance, wanted, r)
    if speed == 0.0:
        return TRACKING, 0.0, 0.0
    lever = p_x
    if law == 5:
        push_v, push_omega = eq5(p_x, p_y, n_x, n_y, speed, s.damping)
    else:
        a_x, a_y = edges[segment, 2], edges[segment, 3]
        lever = p_y * a_x - p_x * a_y
        push_v, push_omega = eq7(p_x, p_y, a_x, a_y, speed, s.damping)
    if abs(lever) + s.damping < SINGULAR_LEVER:
        return SINGULAR, 0.0, 0.0
    return REPELLED, push_v, push_omega
