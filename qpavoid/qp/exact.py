"""The exact answer of the two-variable QP, and the least violation if there is none.

In the coordinates z = (√w_v v, √w_ω ω) the QP asks for the point of a polygon nearest
to z_f. Seidel's incremental method [Seidel1991] answers it: take half-planes one by
one; where the answer so far violates the next one, the new answer lies on its line,
and there it is an interval clamp. Taken in the order of greatest violation, few are
ever touched.

Cost: each round reads all n = m + 4 half-planes and adds one, so m rows take at most
n² + n(n − 1)/2 evaluations; two to five rounds are usual. A conflict is relaxed in at
most :data:`ROUNDS` further rounds of the same.

Nothing here allocates. The caller's table ``rows`` (m + 4, 9) holds the problem and
its half-planes: see :data:`WIDTH`.
"""

import math
from typing import Annotated, NamedTuple, TypeAlias

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.types import Array, Box, Matrix, MatrixWritten, Pair, Sizes

NULL_ROW = 1e-9
"""A row shorter than this, in scaled units, cannot be influenced by any twist."""

CONFLICT, VIOLATED = 1e-12, 4e-12
"""Relative to the numbers at hand: from where two half-planes are in conflict, and one
is violated. The first is less, so that rounding cannot send the search in a circle."""

PARALLEL, GRANTED = 1e-13, 1e-14
"""Sine of an angle below which two lines never meet; what an interval's end is granted
for rounding, relative, well below :data:`CONFLICT`."""

ON_BORDER = 1e-6
"""Relative; so near to its border a half-plane may hold an answer of any back end."""

LEAST_SLACK, ALLOWANCE, LEAST_MORE = 1e-12, 1e-13, 1e-9
"""m/s; the first slack that is tried, and what it is first granted for rounding; and by
how much rows are at least lowered beyond the slack that they need."""


class Terms(NamedTuple):
    """What a problem consists of beside its rows.

    Attributes:
        box: Limits of the twist.
        desired: v_f, ω_f.
        weights: w_v, w_ω, positive.
        n_hard: How many rows, the last ones, are limits and never lowered.
    """

    box: Box
    desired: Pair
    weights: Pair
    n_hard: int


class Projection(NamedTuple):
    """The point that all half-planes share nearest to another.

    Attributes:
        found: Whether there is one.
        z_1: √w_v v.
        z_2: √w_ω ω.
        first: Half-plane that holds it; −1: none.
        second: Another one.
        wanted: Where not found, the slack that the conflict needs, m/s.
    """

    found: bool
    z_1: float
    z_2: float
    first: int
    second: int
    wanted: float


class Optimum(NamedTuple):
    """The answer of a problem.

    Attributes:
        found: Whether there is one.
        v: m/s.
        omega: rad/s.
        slack: That was needed, m/s; 0: none.
        first: Half-plane that holds it (rows, then the four limits); −1: none.
        second: Another one.
    """

    found: bool
    v: float
    omega: float
    slack: float
    first: int
    second: int


ROUNDS = 64
"""Of relaxing a conflict: :data:`ALLOWANCE`, doubled so often, is beyond all speeds."""

A_V, A_OMEGA, B, OWNER, N_1, N_2, C, SOFTNESS, CHOSEN = range(9)
WIDTH = 9
"""Columns of ``rows``: a_v, a_ω and b of a row, the number of its obstacle; n_1, n_2, c
and softness of its half-plane; and the k-th half-plane that :func:`nearest_point` took.
The last four rows are the limits v_min, v_max, ω_min, ω_max."""

Rows: TypeAlias = Annotated[Matrix, Sizes(4, WIDTH)]
RowsWritten: TypeAlias = Annotated[MatrixWritten, Sizes(4, WIDTH)]


@entry
@compiled
def half_planes(rows: RowsWritten, terms: Terms) -> float:
    """Fill in n·z ≥ c − s·softness for rows and limits, and return a least s, m/s.

    Scaled and normalised. The last ``n_hard`` rows are never softened, nor are the
    limits. A null row with b > 0 holds for no twist: it only raises the least slack s.
    """
    m, least, box = rows.shape[0] - 4, 0.0, terms.box
    scale_v, scale_omega = math.sqrt(terms.weights[0]), math.sqrt(terms.weights[1])
    # a·u = (a_v/√w_v) z_1 + (a_ω/√w_ω) z_2: normals are divided where twists are
    # multiplied.
    per_v, per_omega = 1.0 / scale_v, 1.0 / scale_omega
    for i in range(m):
        n_1, n_2 = rows[i, A_V] * per_v, rows[i, A_OMEGA] * per_omega
        length = math.sqrt(n_1 * n_1 + n_2 * n_2)
        if length < NULL_ROW:
            # c = −∞ leaves the half-plane out: no twist can help it, and none hurts it.
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
    """Return the slack at which half-planes i, j and k just meet (k = −1: only two).

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
    """Return the point that all half-planes share nearest to (z_1, z_2)."""
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
        # Every half-plane holds: this is the answer.
        if worst < 0:
            break
        n_1, n_2 = rows[worst, N_1], rows[worst, N_2]
        c = rows[worst, C] - slack * rows[worst, SOFTNESS]
        beyond = c - n_1 * z_1 - n_2 * z_2
        # The new answer lies on the border of what was violated worst [Seidel1991]: the
        # foot of z_f there, or the end nearest to it of the interval that those taken
        # before leave.
        foot_1, foot_2 = z_1 + beyond * n_1, z_2 + beyond * n_2
        low, high, at_low, at_high = -math.inf, math.inf, -1, -1
        for k in range(count):
            j = int(rows[k, CHOSEN])
            c = rows[j, C] - slack * rows[j, SOFTNESS]
            rate = n_1 * rows[j, N_2] - n_2 * rows[j, N_1]
            need = c - rows[j, N_1] * foot_1 - rows[j, N_2] * foot_2
            need -= GRANTED * (scale + abs(c))
            # The line runs along this border: either all of it is allowed or nothing.
            if abs(rate) < PARALLEL:
                if need > CONFLICT * (scale + abs(c)):
                    wanted = slack_of_conflict(rows, worst, j, -1)
                    return Projection(False, p_1, p_2, worst, j, wanted)
            elif rate > 0.0 and need / rate > low:
                low, at_low = need / rate, j
            elif rate < 0.0 and need / rate < high:
                high, at_high = need / rate, j
        # An empty interval: these three have no common point.
        if low > high + CONFLICT * (scale + abs(low)):
            wanted = slack_of_conflict(rows, worst, at_low, at_high)
            return Projection(False, p_1, p_2, at_low, at_high, wanted)
        t, second = 0.0, -1
        if t < low:
            t, second = low, at_low
        elif t > high:
            t, second = high, at_high
        p_1, p_2 = foot_1 - t * n_2, foot_2 + t * n_1
        first = worst
        rows[count, CHOSEN] = worst
    return Projection(True, p_1, p_2, first, second, 0.0)


@compiled_once
def least_slack(rows: Array, wanted: float, z_1: float, z_2: float) -> float:
    """Return the least s ≥ ``wanted`` at which the half-planes have a common point.

    ``wanted`` is what null rows and the first conflict ask for; ``inf`` if no slack
    helps.

    Every conflict of three half-planes that is met names the slack that it needs, and
    the slack only grows, so no conflict is met twice. An allowance against rounding
    doubles, so that :data:`ROUNDS` always suffice; two to five are usual.
    """
    if not wanted < math.inf:
        return math.inf
    slack, allowance = max(wanted, LEAST_SLACK), ALLOWANCE
    for _ in range(ROUNDS):
        nearest = nearest_point(rows, z_1, z_2, slack + allowance)
        if nearest.found:
            return slack
        if not nearest.wanted < math.inf:
            break
        slack = max(nearest.wanted, slack + allowance)
        allowance *= 2.0
    return math.inf


@entry
@compiled
def relaxation(slack: float, tolerance: float) -> float:
    """Return by how much rows are lowered, m/s, if they need ``slack``: a little more.

    Twice the slack, but at most ``tolerance`` and at least :data:`LEAST_MORE` above it:
    the answer changes steadily where a problem becomes infeasible, and a row that
    hardly any twist can influence does not throw the robot about for less than that.
    """
    if slack == 0.0:
        return 0.0
    return slack + min(max(slack, LEAST_MORE), tolerance)


@entry
@compiled
def solve_exactly(rows: RowsWritten, terms: Terms, slack_tolerance: float) -> Optimum:
    """Return the twist nearest to the desired one that keeps every row and limit.

    Where no twist keeps the rows, they are all lowered by the least slack that allows
    one and a little more, see :func:`relaxation`: least violation first, then the
    nearest twist.

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
        slack = least_slack(rows, max(least, p.wanted), z_1, z_2)
        if not slack < math.inf:
            return Optimum(False, 0.0, 0.0, slack, -1, -1)
        p = nearest_point(rows, z_1, z_2, relaxation(slack, slack_tolerance))
    v = min(max(p.z_1 / scale_v, box.v_min), box.v_max)
    omega = min(max(p.z_2 / scale_omega, box.omega_min), box.omega_max)
    return Optimum(p.found, v, omega, slack, p.first, p.second)


@entry
@compiled
def certificate(rows: Rows, terms: Terms, relaxed: float, twist: Pair) -> Pair:
    """Return (violation, suboptimality) of a twist, judged from the problem alone.

    The violation is the greatest of b − A u (m/s) and of the limits' excess. At the
    optimum z − z_f = Σ λ n over half-planes that hold with equality, λ ≥ 0; the
    suboptimality is the distance of z − z_f from that cone, in scaled m/s. A twist
    that is not finite has both infinite. Rows but hard ones count as lowered by
    ``relaxed`` (m/s); the half-planes as :func:`half_planes` fills them in.
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
    # The cost's gradient, halved, must be a sum of active normals with λ ≥ 0: the twist
    # is held only by half-planes that it pushes against.
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
    # Two active normals less than half a turn apart, one on either side, span a cone
    # that holds the gradient.
    if left + right < math.pi:
        return violation, 0.0
    return violation, push * math.sin(min(left, right, 0.5 * math.pi))
