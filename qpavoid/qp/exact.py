"""The exact answer of the two-variable QP, and the least violation if there is none.

In the coordinates z = (√w_v v, √w_ω ω) the QP asks for the point of a polygon nearest
to z_f. Seidel's incremental method [Seidel1991] answers it: take half-planes one by
one; where the answer so far violates the next one, the new answer lies on its line,
and there it is an interval clamp. Taken in the order of greatest violation, few are
ever touched.

Cost: each round reads all n = m + 4 half-planes and adds one, so m rows take at most
n² + n(n − 1)/2 evaluations; two to five rounds are usual. A conflict is relaxed in at
most 64 further rounds of the same.

Nothing here allocates. The caller's table ``rows`` (m + 4, 9) holds the problem and
its half-planes: see :data:`WIDTH`.
"""

import math
from typing import TypeAlias

from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.footprint import Array

NULL_ROW = 1e-9
"""A row shorter than this, in scaled units, cannot be influenced by any twist."""

Answer: TypeAlias = tuple[bool, float, float, int, int, float]
"""Found, z_1, z_2, the two half-planes that hold it (−1: none), and, where not found,
the slack that the conflict needs."""

Box: TypeAlias = tuple[float, float, float, float]
"""v_min, v_max, ω_min, ω_max; m/s and rad/s, possibly infinite."""

Pair: TypeAlias = tuple[float, float]
"""Of v and of ω: a twist, or weights."""

A_V, A_OMEGA, B, OWNER, N_1, N_2, C, SOFTNESS, CHOSEN = range(9)
WIDTH = 9
"""Columns of ``rows``: a_v, a_ω and b of a row, the number of its obstacle; n_1, n_2, c
and softness of its half-plane; and the k-th half-plane that :func:`nearest_point` took.
The last four rows are the limits v_min, v_max, ω_min, ω_max."""


@compiled
def half_planes(rows: Array, box: Box, weights: Pair, hard: int) -> float:
    """Fill in n·z ≥ c − s·softness for rows and limits, and return a least s, m/s.

    Scaled and normalised. The last ``hard`` rows are never softened, nor are the
    limits. A null row with b > 0 holds for no twist: it only raises the least slack s.
    """
    m = rows.shape[0] - 4
    least = 0.0
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    per_v, per_omega = 1.0 / scale_v, 1.0 / scale_omega
    for i in range(m):
        n_1, n_2 = rows[i, A_V] * per_v, rows[i, A_OMEGA] * per_omega
        length = math.sqrt(n_1 * n_1 + n_2 * n_2)
        if length < NULL_ROW:
            least = max(least, rows[i, B])
            set_plane(rows, i, 0.0, 0.0, -math.inf, 0.0)
        else:
            per = 1.0 / length
            softness = per if i < m - hard else 0.0
            set_plane(rows, i, n_1 * per, n_2 * per, rows[i, B] * per, softness)
    set_plane(rows, m, 1.0, 0.0, box[0] * scale_v, 0.0)
    set_plane(rows, m + 1, -1.0, 0.0, -box[1] * scale_v, 0.0)
    set_plane(rows, m + 2, 0.0, 1.0, box[2] * scale_omega, 0.0)
    set_plane(rows, m + 3, 0.0, -1.0, -box[3] * scale_omega, 0.0)
    return least


@compiled
def set_plane(
    rows: Array, i: int, n_1: float, n_2: float, c: float, softness: float
) -> None:
    """Write half-plane i."""
    rows[i, N_1], rows[i, N_2], rows[i, C], rows[i, SOFTNESS] = n_1, n_2, c, softness


@compiled_once
def slack_of_conflict(rows: Array, i: int, j: int, k: int) -> float:
    """Return the slack at which half-planes i, j and k just meet (k = −1: only two).

    By Farkas' lemma λ ≥ 0 with Σ λ n = 0 proves them empty while
    Σ λ (c − s·softness) > 0.
    """
    if k < 0:
        l_i, l_j, l_k = 1.0, 1.0, 0.0
    else:
        l_i = max(rows[j, N_1] * rows[k, N_2] - rows[j, N_2] * rows[k, N_1], 0.0)
        l_j = max(rows[k, N_1] * rows[i, N_2] - rows[k, N_2] * rows[i, N_1], 0.0)
        l_k = max(rows[i, N_1] * rows[j, N_2] - rows[i, N_2] * rows[j, N_1], 0.0)
    offset = l_i * rows[i, C] + l_j * rows[j, C]
    softness = l_i * rows[i, SOFTNESS] + l_j * rows[j, SOFTNESS]
    if k >= 0:
        offset += l_k * rows[k, C]
        softness += l_k * rows[k, SOFTNESS]
    return offset / softness if softness > 0.0 else math.inf


@compiled_once
def nearest_point(rows: Array, z_1: float, z_2: float, slack: float) -> Answer:
    """Return the point that all half-planes share nearest to (z_1, z_2).

    Two half-planes count as in conflict from 1e-12, one as violated from 4e-12 on
    (relative to the numbers at hand), so that rounding cannot send it in a circle.
    """
    n = rows.shape[0]
    p_1, p_2 = z_1, z_2
    first = second = -1
    scale = 1.0 + abs(z_1) + abs(z_2)
    for count in range(n):
        worst, depth = -1, 0.0
        for i in range(n):
            c = rows[i, C] - slack * rows[i, SOFTNESS]
            gap = c - rows[i, N_1] * p_1 - rows[i, N_2] * p_2
            if gap > depth and gap > 4e-12 * (scale + abs(c)):
                worst, depth = i, gap
        if worst < 0:
            break
        n_1, n_2 = rows[worst, N_1], rows[worst, N_2]
        c = rows[worst, C] - slack * rows[worst, SOFTNESS]
        beyond = c - n_1 * z_1 - n_2 * z_2
        foot_1, foot_2 = z_1 + beyond * n_1, z_2 + beyond * n_2
        low, high, at_low, at_high = -math.inf, math.inf, -1, -1
        for k in range(count):
            j = int(rows[k, CHOSEN])
            c = rows[j, C] - slack * rows[j, SOFTNESS]
            rate = n_1 * rows[j, N_2] - n_2 * rows[j, N_1]
            need = c - rows[j, N_1] * foot_1 - rows[j, N_2] * foot_2
            need -= 1e-14 * (scale + abs(c))
            if abs(rate) < 1e-13:
                if need > 1e-12 * (scale + abs(c)):
                    wanted = slack_of_conflict(rows, worst, j, -1)
                    return False, p_1, p_2, worst, j, wanted
            elif rate > 0.0 and need / rate > low:
                low, at_low = need / rate, j
            elif rate < 0.0 and need / rate < high:
                high, at_high = need / rate, j
        if low > high + 1e-12 * (scale + abs(low)):
            wanted = slack_of_conflict(rows, worst, at_low, at_high)
            return False, p_1, p_2, at_low, at_high, wanted
        t, second = 0.0, -1
        if t < low:
            t, second = low, at_low
        elif t > high:
            t, second = high, at_high
        p_1, p_2 = foot_1 - t * n_2, foot_2 + t * n_1
        first = worst
        rows[count, CHOSEN] = worst
    return True, p_1, p_2, first, second, 0.0


@compiled_once
def least_slack(rows: Array, wanted: float, z_1: float, z_2: float) -> float:
    """Return the least s ≥ ``wanted`` at which the half-planes have a common point.

    ``wanted`` is what null rows and the first conflict ask for; ``inf`` if no slack
    helps.

    Every conflict of three half-planes that is met names the slack that it needs, and
    the slack only grows, so no conflict is met twice. An allowance against rounding
    starts at 1e-13 m/s and doubles, so that 64 rounds always suffice; two to five are
    usual.
    """
    if not wanted < math.inf:
        return math.inf
    slack, allowance = max(wanted, 1e-12), 1e-13
    for _ in range(64):
        found, _p_1, _p_2, _i, _j, wanted = nearest_point(
            rows, z_1, z_2, slack + allowance
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
    rows: Array,
    box: Box,
    desired: Pair,
    weights: Pair,
    hard: int,
    slack_tolerance: float,
) -> tuple[bool, float, float, float, int, int]:
    """Return the twist nearest to the desired one that keeps every row and limit.

    Where no twist keeps the rows, they are all lowered by the least slack that allows
    one and a little more, see :func:`relaxation`: least violation first, then the
    nearest twist.

    Args:
        rows: (m + 4, 9): a_v, a_ω and b (m/s) of m rows a_v v + a_ω ω ≥ b; the rest is
            filled in.
        box: v_min, v_max, ω_min, ω_max.
        desired: v_f, ω_f.
        weights: w_v, w_ω, positive.
        hard: How many rows, the last ones, are limits and never lowered.
        slack_tolerance: m/s; see :func:`relaxation`.

    Returns:
        Found, v, ω, the slack that was needed (0: none), and the numbers of the at
        most two half-planes that hold the answer (rows, then the four limits).
    """
    least = half_planes(rows, box, weights, hard)
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    z_1, z_2 = desired[0] * scale_v, desired[1] * scale_omega
    slack = 0.0
    found, p_1, p_2, first, second, wanted = nearest_point(rows, z_1, z_2, 0.0)
    if least > 0.0 or not found:
        slack = least_slack(rows, max(least, wanted), z_1, z_2)
        if not slack < math.inf:
            return False, 0.0, 0.0, slack, -1, -1
        found, p_1, p_2, first, second, _ = nearest_point(
            rows, z_1, z_2, relaxation(slack, slack_tolerance)
        )
    v = min(max(p_1 / scale_v, box[0]), box[1])
    omega = min(max(p_2 / scale_omega, box[2]), box[3])
    return found, v, omega, slack, first, second


@compiled
def certificate(
    rows: Array,
    box: Box,
    desired: Pair,
    weights: Pair,
    hard: int,
    relaxed: float,
    v: float,
    omega: float,
) -> tuple[float, float]:
    """Return (violation, suboptimality) of a twist, judged from the problem alone.

    The violation is the greatest of b − A u (m/s) and of the limits' excess. At the
    optimum z − z_f = Σ λ n over half-planes that hold with equality, λ ≥ 0; the
    suboptimality is the distance of z − z_f from that cone, in scaled m/s. A twist
    that is not finite has both infinite. Rows but hard ones count as lowered by
    ``relaxed`` (m/s); the half-planes as :func:`half_planes` fills them in.
    """
    if not (math.isfinite(v) and math.isfinite(omega)):
        return math.inf, math.inf
    violation = max(0.0, box[0] - v, v - box[1], box[2] - omega, omega - box[3])
    m = rows.shape[0] - 4
    for i in range(m):
        b = rows[i, B] - relaxed if i < m - hard else rows[i, B]
        violation = max(violation, b - rows[i, A_V] * v - rows[i, A_OMEGA] * omega)
    scale_v, scale_omega = math.sqrt(weights[0]), math.sqrt(weights[1])
    z_1, z_2 = v * scale_v, omega * scale_omega
    g_1, g_2 = z_1 - desired[0] * scale_v, z_2 - desired[1] * scale_omega
    push = math.sqrt(g_1 * g_1 + g_2 * g_2)
    if push < 1e-12:
        return violation, 0.0
    left, right = math.pi, math.pi
    for i in range(rows.shape[0]):
        n_1, n_2 = rows[i, N_1], rows[i, N_2]
        c = rows[i, C] - relaxed * rows[i, SOFTNESS]
        if c > -math.inf and n_1 * z_1 + n_2 * z_2 - c <= 1e-6 * (1.0 + abs(c)):
            angle = math.atan2(g_1 * n_2 - g_2 * n_1, g_1 * n_1 + g_2 * n_2)
            if angle >= 0.0:
                left = min(left, angle)
            if angle <= 0.0:
                right = min(right, -angle)
    if left + right < math.pi:
        return violation, 0.0
    return violation, push * math.sin(min(left, right, 0.5 * math.pi))
