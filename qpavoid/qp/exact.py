"""The exact answer of the two-variable QP, and the least violation if there is none.

In the coordinates z = (√w_v v, √w_ω ω) the QP asks for the point of a polygon nearest
to z_f. Seidel's incremental method [Seidel1991] answers it: take half-planes one by
one; where the answer so far violates the next one, the new answer lies on its line,
and there it is an interval clamp. Taken in the order of greatest violation, few are
ever touched.

Cost: each round reads all m + 4 half-planes and adds one, so m rows take at most
(m + 4)² + (m + 4)(m + 3)/2 evaluations; two to five rounds are usual.
"""

import math
from typing import TypeAlias

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.model.footprint import Array

NULL_ROW = 1e-9
"""A row shorter than this, in scaled units, cannot be influenced by any twist."""

Answer: TypeAlias = tuple[bool, float, float, int, int, float]
"""Found, z_1, z_2, the two half-planes that hold it (−1: none), and, where not found,
the slack that the conflict needs."""


@compiled
def half_planes(
    A: Array, b: Array, lower: Array, upper: Array, weights: Array, hard: int
) -> tuple[Array, float]:
    """Return the scaled, normalised half-planes n·z ≥ c − s·softness, and a least s.

    The rows come first, the last ``hard`` of them never softened, then the limits
    v_min, v_max, ω_min, ω_max, which never are.
    A null row with b > 0 holds for no twist: it only raises the least slack s, in m/s.

    Returns:
        (4, m + 4): n_1, n_2, c, softness; and the slack that the null rows need.
    """
    m = A.shape[0]
    planes = np.zeros((4, m + 4))
    planes[2, :] = -math.inf
    least = 0.0
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    for i in range(m):
        n_1, n_2 = A[i, 0] / scale_v, A[i, 1] / scale_omega
        length = math.sqrt(n_1 * n_1 + n_2 * n_2)
        if length < NULL_ROW:
            least = max(least, b[i])
        else:
            planes[0, i], planes[1, i] = n_1 / length, n_2 / length
            planes[2, i] = b[i] / length
            planes[3, i] = 1.0 / length if i < m - hard else 0.0
    planes[0, m], planes[2, m] = 1.0, lower[0] * scale_v
    planes[0, m + 1], planes[2, m + 1] = -1.0, -upper[0] * scale_v
    planes[1, m + 2], planes[2, m + 2] = 1.0, lower[1] * scale_omega
    planes[1, m + 3], planes[2, m + 3] = -1.0, -upper[1] * scale_omega
    return planes, least


@compiled
def slack_of_conflict(planes: Array, i: int, j: int, k: int) -> float:
    """Return the slack at which half-planes i, j and k just meet (k = −1: only two).

    By Farkas' lemma λ ≥ 0 with Σ λ n = 0 proves them empty while
    Σ λ (c − s·softness) > 0.
    """
    if k < 0:
        l_i, l_j, l_k = 1.0, 1.0, 0.0
    else:
        l_i = max(planes[0, j] * planes[1, k] - planes[1, j] * planes[0, k], 0.0)
        l_j = max(planes[0, k] * planes[1, i] - planes[1, k] * planes[0, i], 0.0)
        l_k = max(planes[0, i] * planes[1, j] - planes[1, i] * planes[0, j], 0.0)
    offset = l_i * planes[2, i] + l_j * planes[2, j]
    softness = l_i * planes[3, i] + l_j * planes[3, j]
    if k >= 0:
        offset += l_k * planes[2, k]
        softness += l_k * planes[3, k]
    return offset / softness if softness > 0.0 else math.inf


@compiled
def nearest_point(planes: Array, z_1: float, z_2: float, slack: float) -> Answer:
    """Return the point that all half-planes share nearest to (z_1, z_2).

    Two half-planes count as in conflict from 1e-12, one as violated from 4e-12 on
    (relative to the numbers at hand), so that rounding cannot send it in a circle.
    """
    n = planes.shape[1]
    chosen = np.empty(n, dtype=np.int64)
    p_1, p_2 = z_1, z_2
    first = second = -1
    scale = 1.0 + abs(z_1) + abs(z_2)
    for count in range(n):
        worst, depth = -1, 0.0
        for i in range(n):
            c = planes[2, i] - slack * planes[3, i]
            gap = c - planes[0, i] * p_1 - planes[1, i] * p_2
            if gap > depth and gap > 4e-12 * (scale + abs(c)):
                worst, depth = i, gap
        if worst < 0:
            break
        n_1, n_2 = planes[0, worst], planes[1, worst]
        c = planes[2, worst] - slack * planes[3, worst]
        beyond = c - n_1 * z_1 - n_2 * z_2
        foot_1, foot_2 = z_1 + beyond * n_1, z_2 + beyond * n_2
        low, high, at_low, at_high = -math.inf, math.inf, -1, -1
        for k in range(count):
            j = chosen[k]
            c = planes[2, j] - slack * planes[3, j]
            rate = n_1 * planes[1, j] - n_2 * planes[0, j]
            need = c - planes[0, j] * foot_1 - planes[1, j] * foot_2
            need -= 1e-14 * (scale + abs(c))
            if abs(rate) < 1e-13:
                if need > 1e-12 * (scale + abs(c)):
                    wanted = slack_of_conflict(planes, worst, j, -1)
                    return False, p_1, p_2, worst, j, wanted
            elif rate > 0.0 and need / rate > low:
                low, at_low = need / rate, j
            elif rate < 0.0 and need / rate < high:
                high, at_high = need / rate, j
        if low > high + 1e-12 * (scale + abs(low)):
            wanted = slack_of_conflict(planes, worst, at_low, at_high)
            return False, p_1, p_2, at_low, at_high, wanted
        t, second = 0.0, -1
        if t < low:
            t, second = low, at_low
        elif t > high:
            t, second = high, at_high
        p_1, p_2 = foot_1 - t * n_2, foot_2 + t * n_1
        first = worst
        chosen[count] = worst
    return True, p_1, p_2, first, second, 0.0


@compiled
def least_slack(planes: Array, least: float, z_1: float, z_2: float) -> float:
    """Return the least s ≥ ``least`` at which the half-planes have a common point.

    0 if the point nearest to (z_1, z_2) is found without slack, ``inf`` if no slack
    helps.

    Every conflict of three half-planes that is met names the slack that it needs, and
    the slack only grows, so no conflict is met twice. An allowance against rounding
    starts at 1e-13 m/s and doubles, so that 64 rounds always suffice; two to five are
    usual.
    """
    found, _p_1, _p_2, _i, _j, wanted = nearest_point(planes, z_1, z_2, 0.0)
    if found and least <= 0.0:
        return 0.0
    slack, allowance = max(least, wanted, 1e-12), 1e-13
    for _ in range(64):
        found, _p_1, _p_2, _i, _j, wanted = nearest_point(
            planes, z_1, z_2, slack + allowance
        )
        if found:
            return slack
        if not wanted < math.inf:
            break
        slack = max(wanted, slack + allowance)
        allowance *= 2.0
    return math.inf


@compiled
def relaxation(slack: float, tolerance: float) -> float:
    """Return by how much rows are lowered, m/s, if they need ``slack``: a little more.

    Twice the slack, but at most ``tolerance`` and at least 1e-9 m/s above it: the
    answer changes steadily where a problem becomes infeasible, and a row that hardly
    any twist can influence does not throw the robot about for less than the tolerance.
    """
    if slack == 0.0:
        return 0.0
    return slack + min(max(slack, 1e-9), tolerance)


@compiled
def solve_exactly(
    A: Array,
    b: Array,
    lower: Array,
    upper: Array,
    desired: Array,
    weights: Array,
    hard: int,
    slack_tolerance: float,
) -> tuple[bool, float, float, float, int, int]:
    """Return the twist nearest to the desired one that keeps every row and limit.

    Where no twist keeps the rows, they are all lowered by the least slack that allows
    one and a little more, see :func:`relaxation`: least violation first, then the
    nearest twist.

    Args:
        A: (m, 2) rows over (v, ω).
        b: (m,) m/s.
        lower: (2,) v_min, ω_min.
        upper: (2,) v_max, ω_max.
        desired: (2,) v_f, ω_f.
        weights: (2,) w_v, w_ω, positive.
        hard: How many rows, the last ones, are limits and never lowered.
        slack_tolerance: m/s; see :func:`relaxation`.

    Returns:
        Found, v, ω, the slack that was needed (0: none), and the numbers of the at
        most two half-planes that hold the answer (rows, then the four limits).
    """
    planes, least = half_planes(A, b, lower, upper, weights, hard)
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    z_1, z_2 = desired[0] * scale_v, desired[1] * scale_omega
    slack = 0.0
    found, p_1, p_2, first, second, _ = nearest_point(planes, z_1, z_2, 0.0)
    if least > 0.0 or not found:
        slack = least_slack(planes, least, z_1, z_2)
        if not slack < math.inf:
            return False, 0.0, 0.0, slack, -1, -1
        found, p_1, p_2, first, second, _ = nearest_point(
            planes, z_1, z_2, relaxation(slack, slack_tolerance)
        )
    v = min(max(p_1 / scale_v, lower[0]), upper[0])
    omega = min(max(p_2 / scale_omega, lower[1]), upper[1])
    return found, v, omega, slack, first, second


@compiled
def certificate(
    A: Array,
    b: Array,
    lower: Array,
    upper: Array,
    desired: Array,
    weights: Array,
    hard: int,
    v: float,
    omega: float,
) -> tuple[float, float]:
    """Return (violation, suboptimality) of a twist, judged from the problem alone.

    The violation is the greatest of b − A u (m/s) and of the limits' excess. At the
    optimum z − z_f = Σ λ n over half-planes that hold with equality, λ ≥ 0; the
    suboptimality is the distance of z − z_f from that cone, in scaled m/s. A twist
    that is not finite has both infinite.
    """
    if not (math.isfinite(v) and math.isfinite(omega)):
        return math.inf, math.inf
    violation = max(0.0, lower[0] - v, v - upper[0], lower[1] - omega, omega - upper[1])
    for i in range(A.shape[0]):
        violation = max(violation, b[i] - A[i, 0] * v - A[i, 1] * omega)
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    z_1, z_2 = v * scale_v, omega * scale_omega
    g_1, g_2 = z_1 - desired[0] * scale_v, z_2 - desired[1] * scale_omega
    push = math.sqrt(g_1 * g_1 + g_2 * g_2)
    if push < 1e-12:
        return violation, 0.0
    planes, _ = half_planes(A, b, lower, upper, weights, hard)
    left, right = math.pi, math.pi
    for i in range(planes.shape[1]):
        n_1, n_2 = planes[0, i], planes[1, i]
        c = planes[2, i]
        if c > -math.inf and n_1 * z_1 + n_2 * z_2 - c <= 1e-6 * (1.0 + abs(c)):
            angle = math.atan2(g_1 * n_2 - g_2 * n_1, g_1 * n_1 + g_2 * n_2)
            if angle >= 0.0:
                left = min(left, angle)
            if angle <= 0.0:
                right = min(right, -angle)
    if left + right < math.pi:
        return violation, 0.0
    return violation, push * math.sin(min(left, right, 0.5 * math.pi))
