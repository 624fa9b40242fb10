"""From contacts to the rows of the QP: d̂_oᵀ J_0 u ≥ b."""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import activation, safety_radius
from qpavoid.compiled import compiled
from qpavoid.model.contact import Names, approach_row
from qpavoid.model.footprint import Array

BARRIER = 0


@compiled
def row_reach(
    circumradius: float,
    settings: npt.NDArray[np.void],
    disc_velocities: Array,
    lower: Array,
    upper: Array,
) -> float:
    """Return the distance, m, beyond which no admissible twist can violate a row.

    The distance shrinks at most at V = |v| + |ω|·circumradius + |v_o|, hence a barrier
    row can only be violated where γ(d − r_min) < V; a repulsion row exists below r.
    """
    s = settings[0]
    fastest = 0.0
    for i in range(disc_velocities.shape[0]):
        v_x, v_y = disc_velocities[i, 0], disc_velocities[i, 1]
        fastest = max(fastest, math.sqrt(v_x * v_x + v_y * v_y))
    r_min = safety_radius(fastest, s.low, s.high, s.speed_low, s.speed_high)
    if s.bound != BARRIER:
        return float(min(s.ratio * r_min, s.reach))
    speed = max(-lower[0], upper[0]) + max(-lower[1], upper[1]) * circumradius
    return float(min(r_min + (speed + fastest) / s.gamma, s.reach))


@compiled
def least_value(coefficient: float, low: float, high: float) -> float:
    """Return the least value of coefficient · x for x in [low, high]."""
    if coefficient > 0.0:
        return coefficient * low
    return coefficient * high if coefficient < 0.0 else 0.0


@compiled
def constraint_rows(
    numbers: Array,
    names: Names,
    settings: npt.NDArray[np.void],
    lower: Array,
    upper: Array,
) -> tuple[Array, Array, Names]:
    """Return A (m, 2), b (m,) and the obstacle (m,) of every row that can matter.

    The row of a contact is d̂_oᵀ J_0 (1, m/rad). With the bound ``barrier`` the distance
    obeys ḋ = d̂_oᵀ(J_0 u − v_o) ≥ −γ(d − r_min), hence b = −γ(d − r_min) + d̂_oᵀ v_o;
    with ``repulsion`` b is ẋ_0 times its activation. In m/s. Rows that hold for every
    admissible twist are left out: they cannot change the answer.

    Args:
        numbers: Contacts, as :func:`qpavoid.model.contact.contact_table` gives them.
        names: Their obstacles and segments.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        lower: (2,) v_min, ω_min.
        upper: (2,) v_max, ω_max.
    """
    s = settings[0]
    capacity = numbers.shape[0]
    A, b = np.empty((capacity, 2)), np.empty(capacity)
    owner = np.empty(capacity, dtype=np.int64)
    count = 0
    for k in range(capacity):
        p_x, p_y = numbers[k, 0], numbers[k, 1]
        n_x, n_y, distance = numbers[k, 2], numbers[k, 3], numbers[k, 4]
        v_x, v_y = numbers[k, 5], numbers[k, 6]
        if distance > s.reach:
            continue
        speed = math.sqrt(v_x * v_x + v_y * v_y)
        r_min = safety_radius(speed, s.low, s.high, s.speed_low, s.speed_high)
        if s.bound == BARRIER:
            bound = -s.gamma * (distance - r_min) - n_x * v_x - n_y * v_y
        else:
            r = s.ratio * r_min
            if distance >= r:
                continue
            bound = s.speed * activation(s.activation, distance, r_min, r)
        a_v, a_omega = approach_row(p_x, p_y, n_x, n_y)
        least = least_value(a_v, lower[0], upper[0])
        least += least_value(a_omega, lower[1], upper[1])
        if least < bound:
            A[count, 0], A[count, 1], b[count] = a_v, a_omega, bound
            owner[count] = names[k, 0]
            count += 1
    return A[:count], b[:count], owner[:count]
