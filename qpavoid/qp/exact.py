"""Exact solution of the two-variable QP, and the least violation if it is infeasible.

In the coordinates z = (√w_v v, √w_ω ω) the QP is the projection of z_f onto a
polygon. Seidel's incremental method [Seidel1991]: add half-planes one by one; if the
point so far violates the next one, the new point lies on its line, where it is clamped
to an interval. In the order of greatest violation, few are ever added.

Cost: each round reads all n = m + 4 half-planes and adds one, so m rows take at most
n² + n(n − 1)/2 evaluations; two to five rounds are usual. A conflict is relaxed in at
most :data:`ROUNDS` further rounds.

No function allocates. The caller's table ``rows`` (m + 4, 9) holds the problem and
its half-planes: see :data:`ROW_WIDTH`.
"""

import math
from typing import Annotated, NamedTuple, TypeAlias

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.types import Array, Box, Matrix, MatrixWritten, Pair, Sizes

NULL_ROW = 1e-9
"""Norm in scaled units, below which no twist can influence a row."""

CONFLICT, VIOLATED = 1e-12, 4e-12
"""Relative tolerances: of a conflict of two half-planes, and of a violated one. The
first is smaller, so that rounding cannot make the search cycle."""

PARALLEL, GRANTED = 1e-13, 1e-14
"""Sine of the angle below which two lines count as parallel; relative tolerance of an
interval's end for rounding, well below :data:`CONFLICT`."""

ON_BORDER = 1e-6
"""Relative distance from its border below which a half-plane counts as active."""

LEAST_SLACK, ALLOWANCE, LEAST_MORE = 1e-12, 1e-13, 1e-9
"""m/s; least slack tried, its first allowance for rounding, and least additional
relaxation of the rows."""


class Terms(NamedTuple):
    """A problem without its rows.

    Attributes:
        box: Limits of the twist.
        desired: v_f, ω_f.
        weights: w_v, w_ω, positive.
        n_hard: Number of rows, the last ones, that are limits and never relaxed.
    """

    box: Box
    desired: Pair
    weights: Pair
    n_hard: int


class Projection(NamedTuple):
    """Point of an intersection of half-planes nearest to a given one.

    Attributes:
        found: Whether the intersection is not empty.
        z_1: √w_v v.
        z_2: √w_ω ω.
        first: Active half-plane, or −1.
        second: Another one, or −1.
        required: If not found, the slack that resolves the conflict, m/s.
    """

    found: bool
    z_1: float
    z_2: float
    first: int
    second: int
    required: float


class Optimum(NamedTuple):
    """Solution of a problem.

    Attributes:
        found: Whether there is one.
        v: m/s.
        omega: rad/s.
        slack: Required relaxation, m/s; 0 if feasible.
        first: Active half-plane (rows, then the four limits), or −1.
        second: Another one, or −1.
    """

    found: bool
    v: float
    omega: float
    slack: float
    first: int
    second: int


ROUNDS = 64
"""Greatest number of doublings of :data:`ALLOWANCE`, which then exceeds all speeds."""

A_V, A_OMEGA, B, ROW_OWNER, N_1, N_2, C, SOFTNESS, TAKEN = range(9)
ROW_WIDTH = 9
"""Columns of ``rows``: a_v, a_ω and b of a row, the number of its obstacle; n_1, n_2, c
and softness of its half-plane; and the k-th half-plane that :func:`nearest_point` took.
The last four rows are the limits v_min, v_max, ω_min, ω_max."""

Rows: TypeAlias = Annotated[Matrix, Sizes(4, ROW_WIDTH)]
RowsWritten: TypeAlias = Annotated[MatrixWritten, Sizes(4, ROW_WIDTH)]


@entry
@compiled
def half_planes(rows: RowsWritten, terms: Terms) -> float:
    """Fill in n·z ≥ c − s·softness for rows and limits; return a least slack s, m/s.

    Scaled and normalised. The last ``n_hard`` rows and the limits have softness 0. A
    null row with b > 0 holds for no twist: it only raises the least slack.
    """
    m, least, box = rows.shape[0] - 4, 0.0, terms.box
    scale_v, scale_omega = math.sqrt(terms.weights[0]), math.sqrt(terms.weights[1])
    # a·u = (a_v/√w_v) z_1 + (a_ω/√w_ω) z_2.
    per_v, per_omega = 1.0 / scale_v, 1.0 / scale_omega
    for i in range(m):
        n_1, n_2 = rows[i, A_V] * per_v, rows[i, A_OMEGA] * per_omega
        length = math.sqrt(n_1 * n_1 + n_2 * n_2)
        if length < NULL_ROW:
            # c = −∞ disables the half-plane: no twist influences it.
            least = max(least, rows[i, B])
            set_plane(rows, i, (0.0, 0.0), (-math.inf, 0.0))
        else:
            per = 1.0 / length
            softness = per if i < m - terms.n_hard else 0.0
            set_plane(rows, i, (n_1 * per, n_2 * per), (rows[i, B] * per, softness))
    set_plane(rows, m, (1.0, 0.0), (box.v_min * scale_v, 0.0))
    set_plane(rows, m + 1, (-1.0, 0.0), (-box.v_max * scale_v, 0.0))
    set_plane(rows, m + 2, (0.0, 1.0), (box.omega_min * scale_omega, 0.0))
    set_plane(rows, m + 3, (0.0, -1.0), (-box.omega_max * scale_omega, 0.0))
    return least


@compiled
def set_plane(rows: Array, i: int, normal: Pair, offset: Pair) -> None:
    """Write half-plane i: n_1 and n_2, c and softness."""
    rows[i, N_1], rows[i, N_2] = normal
    rows[i, C], rows[i, SOFTNESS] = offset


@compiled_once
def slack_of_conflict(rows: Array, i: int, j: int, k: int) -> float:
    """Return the slack at which half-planes i, j, k just intersect (k = −1: i, j only).

    By Farkas' lemma λ ≥ 0 with Σ λ n = 0 proves them empty while
    Σ λ (c − s·softness) > 0.
    """
    if k < 0:
        l_i, l_j, l_k = 1.0, 1.0, 0.0
    else:
        # Three normals in the plane are dependent; by Cramer's rule each one's λ is the
        # cross product of the other two.
        l_i = max(rows[j, N_1] * rows[k, N_2] - rows[j, N_2] * rows[k, N_1], 0.0)
        l_j = max(rows[k, N_1] * rows[i, N_2] - rows[k, N_2] * rows[i, N_1], 0.0)
        l_k = max(rows[i, N_1] * rows[j, N_2] - rows[i, N_2] * rows[j, N_1], 0.0)
    offset = l_i * rows[i, C] + l_j * rows[j, C]
    softness = l_i * rows[i, SOFTNESS] + l_j * rows[j, SOFTNESS]
    if k >= 0:
        offset += l_k * rows[k, C]
        softness += l_k * rows[k, SOFTNESS]
    return offset / softness if softness > 0.0 else math.inf


@entry
@compiled_once
def nearest_point(rows: Rows, z_1: float, z_2: float, slack: float) -> Projection:
    """Return the point in all half-planes nearest to (z_1, z_2)."""
    n = rows.shape[0]
    p_1, p_2 = z_1, z_2
    first = second = -1
    scale = 1.0 + abs(z_1) + abs(z_2)
    for count in range(n):
        worst, depth = -1, 0.0
        for i in range(n):
            c = rows[i, C] - slack * rows[i, SOFTNESS]
            gap = c - rows[i, N_1] * p_1 - rows[i, N_2] * p_2
            if gap > depth and gap > VIOLATED * (scale + abs(c)):
                worst, depth = i, gap
        # Every half-plane holds: optimal.
        if worst < 0:
            break
        n_1, n_2 = rows[worst, N_1], rows[worst, N_2]
        c = rows[worst, C] - slack * rows[worst, SOFTNESS]
        beyond = c - n_1 * z_1 - n_2 * z_2
        # The new point lies on the border of the most violated one [Seidel1991]: the
        # projection of z_f, clamped to the interval that the earlier ones leave.
        foot_1, foot_2 = z_1 + beyond * n_1, z_2 + beyond * n_2
        low, high, at_low, at_high = -math.inf, math.inf, -1, -1
        for k in range(count):
            j = int(rows[k, TAKEN])
            c = rows[j, C] - slack * rows[j, SOFTNESS]
            rate = n_1 * rows[j, N_2] - n_2 * rows[j, N_1]
            need = c - rows[j, N_1] * foot_1 - rows[j, N_2] * foot_2
            need -= GRANTED * (scale + abs(c))
            # Parallel to this border: all of the line is allowed or nothing.
            if abs(rate) < PARALLEL:
                if need > CONFLICT * (scale + abs(c)):
                    required = slack_of_conflict(rows, worst, j, -1)
                    return Projection(False, p_1, p_2, worst, j, required)
            elif rate > 0.0 and need / rate > low:
                low, at_low = need / rate, j
            elif rate < 0.0 and need / rate < high:
                high, at_high = need / rate, j
        # An empty interval: these three have no common point.
        if low > high + CONFLICT * (scale + abs(low)):
            required = slack_of_conflict(rows, worst, at_low, at_high)
            return Projection(False, p_1, p_2, at_low, at_high, required)
        t, second = 0.0, -1
        if t < low:
            t, second = low, at_low
        elif t > high:
            t, second = high, at_high
        p_1, p_2 = foot_1 - t * n_2, foot_2 + t * n_1
        first = worst
        rows[count, TAKEN] = worst
    return Projection(True, p_1, p_2, first, second, 0.0)


@compiled_once
def least_slack(rows: Array, required: float, z_1: float, z_2: float) -> float:
    """Return the least s ≥ ``required`` for which the half-planes intersect, m/s.

    ``required``: slack of null rows and the first conflict; ``inf`` if no slack helps.

    Each conflict of three half-planes gives the slack that it requires, and the slack
    only grows, so no conflict recurs. The allowance for rounding doubles, so that
    :data:`ROUNDS` always suffice; two to five are usual.
    """
    if not required < math.inf:
        return math.inf
    slack, allowance = max(required, LEAST_SLACK), ALLOWANCE
    for _ in range(ROUNDS):
        nearest = nearest_point(rows, z_1, z_2, slack + allowance)
        if nearest.found:
            return slack
        if not nearest.required < math.inf:
            break
        slack = max(nearest.required, slack + allowance)
        allowance *= 2.0
    return math.inf


@entry
@compiled
def relaxation(slack: float, tolerance: float) -> float:
    """Return the relaxation of the rows, m/s, for a required ``slack``.

    Twice the slack, but at most ``tolerance`` and at least :data:`LEAST_MORE` above it:
    the solution is then continuous where a problem becomes infeasible, and a row with
    hardly any influence cannot cause a large twist for less than the tolerance.
    """
    if slack == 0.0:
        return 0.0
    return slack + min(max(slack, LEAST_MORE), tolerance)


@entry
@compiled
def solve_exactly(rows: RowsWritten, terms: Terms, slack_tolerance: float) -> Optimum:
    """Return the twist nearest to the desired one within all rows and limits.

    If infeasible, all rows are relaxed as :func:`relaxation` says: least violation
    first, then the nearest twist.

    Args:
        rows: (m + 4, 9): a_v, a_ω and b (m/s) of m rows a_v v + a_ω ω ≥ b; the rest is
            filled in.
        terms: The rest of the problem.
        slack_tolerance: m/s; see :func:`relaxation`.
    """
    least, box, slack = half_planes(rows, terms), terms.box, 0.0
    scale_v, scale_omega = math.sqrt(terms.weights[0]), math.sqrt(terms.weights[1])
    z_1, z_2 = terms.desired[0] * scale_v, terms.desired[1] * scale_omega
    p = nearest_point(rows, z_1, z_2, 0.0)
    if least > 0.0 or not p.found:
        slack = least_slack(rows, max(least, p.required), z_1, z_2)
        if not slack < math.inf:
            return Optimum(False, 0.0, 0.0, slack, -1, -1)
        p = nearest_point(rows, z_1, z_2, relaxation(slack, slack_tolerance))
    v = min(max(p.z_1 / scale_v, box.v_min), box.v_max)
    omega = min(max(p.z_2 / scale_omega, box.omega_min), box.omega_max)
    return Optimum(p.found, v, omega, slack, p.first, p.second)


@entry
@compiled
def certificate(rows: Rows, terms: Terms, relaxed: float, twist: Pair) -> Pair:
    """Return (violation, suboptimality) of a twist, computed from the problem alone.

    The violation is the greatest of b − A u (m/s) and of the limits' excess. At the
    optimum z − z_f = Σ λ n over active half-planes, λ ≥ 0; the suboptimality is the
    distance of z − z_f from that cone, in scaled m/s. Both are infinite for a twist
    that is not finite. Rows but hard ones count as relaxed by ``relaxed`` (m/s); the
    half-planes are those of :func:`half_planes`.
    """
    (v, omega), box, m = twist, terms.box, rows.shape[0] - 4
    if not (math.isfinite(v) and math.isfinite(omega)):
        return math.inf, math.inf
    violation = max(0.0, box.v_min - v, v - box.v_max)
    violation = max(violation, box.omega_min - omega, omega - box.omega_max)
    for i in range(m):
        b = rows[i, B] - relaxed if i < m - terms.n_hard else rows[i, B]
        violation = max(violation, b - rows[i, A_V] * v - rows[i, A_OMEGA] * omega)
    scale_v, scale_omega = math.sqrt(terms.weights[0]), math.sqrt(terms.weights[1])
    z_1, z_2, desired = v * scale_v, omega * scale_omega, terms.desired
    # KKT: half the cost's gradient is a sum of active normals with λ ≥ 0.
    g_1, g_2 = z_1 - desired[0] * scale_v, z_2 - desired[1] * scale_omega
    push = math.sqrt(g_1 * g_1 + g_2 * g_2)
    if push < CONFLICT:
        return violation, 0.0
    left, right = math.pi, math.pi
    for i in range(rows.shape[0]):
        n_1, n_2 = rows[i, N_1], rows[i, N_2]
        c = rows[i, C] - relaxed * rows[i, SOFTNESS]
        if c > -math.inf and n_1 * z_1 + n_2 * z_2 - c <= ON_BORDER * (1.0 + abs(c)):
            angle = math.atan2(g_1 * n_2 - g_2 * n_1, g_1 * n_1 + g_2 * n_2)
            if angle >= 0.0:
                left = min(left, angle)
            if angle <= 0.0:
                right = min(right, -angle)
    # The gradient lies in the cone of two active normals less than half a turn apart.
    if left + right < math.pi:
        return violation, 0.0
    return violation, push * math.sin(min(left, right, 0.5 * math.pi))
