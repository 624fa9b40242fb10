"""Independent answers to compare with: brute force, exact fractions, scipy.

Nothing here shares a formula with the package.
"""

import math
from fractions import Fraction
from itertools import combinations

import numpy as np
import shapely
import shapely.ops
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection


def point_distance(vertices, p):
    """Signed distance of a point to a polygon, by shapely: negative inside."""
    polygon, point = shapely.Polygon(vertices), shapely.Point(p)
    return polygon.distance(point) or -polygon.exterior.distance(point)


def wall_distance(vertices, wall):
    """Distance of a segment to a polygon, by shapely; −1 in any contact or overlap."""
    ends = shapely.LineString([wall[:2], wall[2:]])
    return shapely.Polygon(vertices).distance(ends) or -1.0


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def exact_planes(problem):
    """All half-planes as (a_1, a_2, bound, softness), limits with softness 0."""
    planes = [
        (Fraction(a[0]), Fraction(a[1]), Fraction(bound), Fraction(1))
        for a, bound in zip(problem.A.tolist(), problem.b.tolist(), strict=True)
    ]
    for k, (one, other) in enumerate(((1, 0), (0, 1))):
        low, high = float(problem.lower[k]), float(problem.upper[k])
        if math.isfinite(low):
            planes.append((Fraction(one), Fraction(other), Fraction(low), Fraction(0)))
        if math.isfinite(high):
            planes.append(
                (Fraction(-one), Fraction(-other), -Fraction(high), Fraction(0))
            )
    return planes


def exact_slack(problem):
    """Least common slack of the rows: the worst of all conflicts of 1, 2, 3 planes."""
    planes, slack = exact_planes(problem), Fraction(0)
    for a_1, a_2, bound, soft in planes:
        if a_1 == 0 == a_2 and soft:
            slack = max(slack, bound / soft)
    planes = [p for p in planes if p[0] != 0 or p[1] != 0]

    def conflict(multipliers, members):
        soft = sum(f * p[3] for f, p in zip(multipliers, members, strict=True))
        need = sum(f * p[2] for f, p in zip(multipliers, members, strict=True))
        return need / soft if soft > 0 else Fraction(0)

    for p, q in combinations(planes, 2):
        if cross(p, q) == 0 and p[0] * q[0] + p[1] * q[1] < 0:
            ratio = -p[0] / q[0] if p[0] != 0 else -p[1] / q[1]
            slack = max(slack, conflict((Fraction(1), ratio), (p, q)))
    for p, q, r in combinations(planes, 3):
        factors = [cross(q, r), cross(r, p), cross(p, q)]
        if all(f <= 0 for f in factors):
            factors = [-f for f in factors]
        if any(factors) and all(f >= 0 for f in factors):
            slack = max(slack, conflict(factors, (p, q, r)))
    return slack


def exact_nearest(problem, slack):
    """Nearest point, by trying u_f, every foot on a line and every corner."""
    planes = [
        (a_1, a_2, bound - slack * soft)
        for a_1, a_2, bound, soft in exact_planes(problem)
        if a_1 != 0 or a_2 != 0
    ]
    desired = [Fraction(x) for x in problem.desired.tolist()]
    w_1, w_2 = (Fraction(x) for x in problem.weights.tolist())
    candidates = [tuple(desired)]
    for a_1, a_2, bound in planes:
        step = (bound - a_1 * desired[0] - a_2 * desired[1]) / (
            a_1 * a_1 / w_1 + a_2 * a_2 / w_2
        )
        candidates.append(
            (desired[0] + step * a_1 / w_1, desired[1] + step * a_2 / w_2)
        )
    for p, q in combinations(planes, 2):
        if cross(p, q):
            candidates.append(
                (
                    (p[2] * q[1] - p[1] * q[2]) / cross(p, q),
                    (p[0] * q[2] - p[2] * q[0]) / cross(p, q),
                )
            )
    allowed = [
        u for u in candidates if all(a * u[0] + c * u[1] >= d for a, c, d in planes)
    ]
    best = min(
        allowed,
        key=lambda u: w_1 * (u[0] - desired[0]) ** 2 + w_2 * (u[1] - desired[1]) ** 2,
    )
    return np.array([float(best[0]), float(best[1])])


def exact_answer(problem, slack_tolerance=1e-3):
    """Return (u, slack): least violation first, then the nearest twist."""
    slack = exact_slack(problem)
    allowance = lowered(slack, Fraction(slack_tolerance))
    return exact_nearest(problem, allowance), float(slack)


def lowered(slack, tolerance=1e-3):
    """Return by how much the rows are lowered: twice the slack, within bounds."""
    if not slack > 0:
        return 0 * slack
    return slack + min(max(slack, Fraction(1, 10**9)), tolerance)


def large_answer(problem, slack_tolerance=1e-3):
    """Return (u, slack) by linprog and the corners of the polygon that qhull finds."""
    rows = len(problem.b)
    limits = list(zip(problem.lower, problem.upper, strict=True))
    lengths = np.hypot(*problem.A.T)
    slack = linprog(
        [0, 0, 1],
        A_ub=np.column_stack([-problem.A, -np.ones(rows)]),
        b_ub=-problem.b,
        bounds=[*limits, (0, None)],
    ).x[2]
    slack = slack if slack > 1e-9 else 0.0
    b = problem.b - float(lowered(slack, slack_tolerance))
    A = np.vstack([problem.A, np.eye(2), -np.eye(2)])
    b = np.concatenate([b, problem.lower, -problem.upper])
    lengths = np.hypot(*A.T)
    inner = linprog(
        [0, 0, -1],
        A_ub=np.column_stack([-A, lengths]),
        b_ub=-b,
        bounds=[(None, None), (None, None), (0, None)],
    ).x[:2]
    corners = HalfspaceIntersection(np.column_stack([-A, b]), inner).intersections
    scale = np.sqrt(problem.weights)
    allowed = shapely.MultiPoint(corners * scale).convex_hull
    target = shapely.Point(problem.desired * scale)
    if (A @ problem.desired >= b).all():
        return problem.desired.copy(), slack
    foot = shapely.ops.nearest_points(allowed, target)[0]
    return np.array([foot.x, foot.y]) / scale, slack
