"""Two-variable QPs by name: ordinary, degenerate, infeasible, badly scaled, large."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from oracles import exact_answer, large_answer
from qpavoid.qp.problem import FilterProblem

FREE = (math.inf, math.inf)


def qp(
    A=(),
    b=(),
    desired=(0.6, 0.0),
    weights=(1.0, 0.1),
    lower=(-1.0, -1.5),
    upper=(1.0, 1.5),
    n_hard=0,
):
    A = np.reshape(np.array(A, dtype=float), (-1, 2))
    return FilterProblem(
        np.array(desired, dtype=float),
        np.array(weights, dtype=float),
        A,
        np.array(b, dtype=float),
        np.array(lower, dtype=float),
        np.array(upper, dtype=float),
        np.arange(len(A)),
        n_hard,
    )


@dataclass(frozen=True, eq=False)
class Case:
    """A problem by name, and its answer by an oracle."""

    name: str
    problem: FilterProblem

    def __str__(self):
        return self.name

    @property
    def expected(self):
        return _expected(self)


@cache
def _expected(case):
    oracle = exact_answer if len(case.problem.b) <= 9 else large_answer
    return oracle(case.problem)


def unit_rows(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def ring(rows, gap, seed=0, centre=(0.1, -0.2)):
    """Rows round a point that keeps each of them by ``gap`` (negative: none does)."""
    rng = np.random.default_rng(seed)
    A = unit_rows(rng.uniform(0, 2 * math.pi, rows))
    return A, A @ np.array(centre) - gap * rng.uniform(1.0, 2.0, rows)


def arc_of_points(rows):
    """Rows of a scanned disc: nearly parallel, as a LiDAR gives them."""
    bearing = np.linspace(-0.2, 0.2, rows)
    n = unit_rows(bearing)
    p = np.column_stack([np.full(rows, 0.4), 0.3 * bearing])
    A = np.column_stack([-n[:, 0], n[:, 0] * p[:, 1] - n[:, 1] * p[:, 0]])
    return A, -0.05 - 0.3 * (1 - np.cos(bearing))


def _cases():
    yield Case("no rows", qp())
    yield Case("no rows, desired outside the limits", qp(desired=(3.0, -7.0)))
    yield Case("a row that holds", qp([[-1, 0.2]], [-0.9]))
    yield Case("one row active", qp([[-1, 0.3]], [-0.2]))
    yield Case("two rows meet", qp([[-1, 0.3], [-1, -0.4]], [-0.2, -0.1]))
    yield Case("a row and a limit", qp([[-1, 0.3]], [0.1], desired=(1.0, 0.0)))
    yield Case("desired on the boundary", qp([[-1, 0]], [-0.6]))
    yield Case("desired at a corner", qp([[-1, 0], [0, 1]], [-0.6, 0]))
    yield Case("desired far away", qp([[-1, 0.3]], [-0.2], desired=(500.0, 300.0)))
    yield Case("the same row five times", qp([[-1, 0.3]] * 5, [-0.2] * 5))
    yield Case("the same row, scaled", qp([[-1, 0.5], [-8, 4]], [-0.25, -2.0]))
    yield Case("parallel rows", qp([[-1, 0.3]] * 4, [-0.2, -0.3, -0.25, -5]))
    yield Case("a slab", qp([[-1, 0.3], [1, -0.3]], [-0.2, 0.1]))
    yield Case("a slab of no width", qp([[-1, 0], [1, 0]], [-0.25, 0.25]))
    yield Case("a single point", qp([[-1, 0], [1, 1], [0, -1]], [-0.5, 0.75, -0.25]))
    yield Case(
        "three rows through one point", qp([[-1, 0], [-1, 1], [-1, -1]], [0] * 3)
    )
    yield Case("a null row that holds", qp([[0, 0], [-1, 0.3]], [-0.1, -0.2]))
    yield Case("a null row that cannot hold", qp([[0, 0], [-1, 0.3]], [0.1, -0.2]))
    yield Case("only a null row that cannot hold", qp([[0, 0]], [0.25]))
    yield Case(
        "no limits", qp([[-1, 0.3]], [-0.2], lower=(-np.inf, -np.inf), upper=FREE)
    )
    yield Case(
        "no limits, two rows",
        qp([[-1, 1], [-1, -1]], [0, 0], lower=(-np.inf, -np.inf), upper=FREE),
    )
    yield Case(
        "half limits", qp([[-1, 0.3]], [0.2], lower=(-np.inf, 0), upper=(1, np.inf))
    )
    yield Case("no turning", qp([[-1, 0.3]], [-0.2], lower=(-1, 0), upper=(1, 0)))
    yield Case("forwards only", qp([[-1, 0.3]], [0.2], lower=(0, -1.5)))
    yield Case("rows that disagree", qp([[-1, 0], [1, 0]], [0.1, 0.2]))
    yield Case("three rows disagree", qp([[-1, 1], [-1, -1], [1, 0]], [0.1, 0.2, 0.3]))
    yield Case("a row against the limits", qp([[-1, 0.1]], [1.5]))
    yield Case(
        "weak row against the limits", qp([[0.001, 0.002], [-1, 0]], [0.1, -0.3])
    )
    yield Case("disagreement of scales", qp([[-100, 0], [0.1, 0.01]], [10, 0.5]))
    for scale in (1e-8, 1e-6, 1e-3, 1e3):
        name = f"a row scaled by {scale:g}"
        yield Case(name, qp([[-scale, 0.3 * scale], [-1, 0]], [-0.2 * scale, -0.5]))
    yield Case("turning is dear", qp([[-1, 0.3]], [-0.2], weights=(1.0, 100.0)))
    yield Case("turning is cheap", qp([[-1, 0.3]], [-0.2], weights=(1.0, 1e-3)))
    yield Case("heavy weights", qp([[-1, 0.3]], [-0.2], weights=(300.0, 30.0)))
    yield Case("light weights", qp([[-1, 0.3]], [-0.2], weights=(0.01, 0.001)))
    for rows in (20, 100, 1000):
        yield Case(f"{rows} rows of a scan", qp(*arc_of_points(rows)))
        yield Case(f"{rows} rows round a point", qp(*ring(rows, 0.05)))
        yield Case(f"{rows} rows, none feasible", qp(*ring(rows, -0.05)))


CASES = list(_cases())


def random_problem(rng):
    """A small problem of a closed loop's kind, feasible or not, scaled at random."""
    rows = int(rng.integers(0, 8))
    A = rng.normal(size=(rows, 2)) * 10.0 ** rng.uniform(-3, 1, (rows, 1))
    b = (rng.normal(size=rows) - 0.3) * np.hypot(*A.T)
    return qp(A, b, rng.normal(size=2), 10.0 ** rng.uniform(-2, 1, 2))


def small_integer_problem(rng):
    """Rows from a few small integers: duplicates, opposites, nulls, exact contacts."""
    rows = int(rng.integers(0, 8))
    A, b = rng.integers(-2, 3, (rows, 2)), rng.integers(-3, 3, rows) / 2
    weights = rng.choice([1.0, 0.25, 4.0, 100.0], 2)
    return qp(A, b, rng.integers(-4, 5, 2) / 2, weights)
