"""The certificate accepts the answer and nothing else; problems as values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oracles import lowered
from problem_bank import qp, random_problem
from qpavoid.errors import InvalidInputError
from qpavoid.qp.problem import FIELDS
from qpavoid.qp.solve import RESIDUAL_TOLERANCE, solve

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.floats(0, 2 * math.pi), st.floats(1e-3, 1.0))
def test_certificate_rejects_every_other_twist(seed, bearing, size):
    problem = random_problem(np.random.default_rng(seed))
    solution = solve(problem)
    slack = solution.slack
    relaxed = problem.relaxed(float(lowered(slack)))
    assert max(relaxed.certify(*solution.u)) <= 1e-9
    step = size * np.array([math.cos(bearing), math.sin(bearing)])
    wrong = solution.u + step / np.sqrt(problem.weights)
    assert max(relaxed.certify(*wrong)) > RESIDUAL_TOLERANCE


def test_violation_is_in_the_rows_units():
    problem = qp([[-1, 0], [0, 1e-3]], [-0.2, 0.5e-3])
    assert problem.certify(0.5, 0.0)[0] == pytest.approx(0.3)
    assert problem.certify(0.1, 0.0)[0] == pytest.approx(0.5e-3)
    assert problem.certify(0.1, 2.5)[0] == pytest.approx(1.0)


@pytest.mark.parametrize("rows", [0, 1])
def test_every_limit_counts_as_a_violation(rows):
    problem = qp([[-1, 0]] * rows, [-9.0] * rows)
    for excess, twist in (
        (0.3, (1.3, 0.0)),
        (0.2, (-1.2, 0.0)),
        (0.4, (0.0, 1.9)),
        (0.1, (0.0, -1.6)),
    ):
        assert problem.certify(*twist)[0] == pytest.approx(excess)


@pytest.mark.parametrize(
    "wrong",
    [
        {"desired": (math.nan, 0)},
        {"desired": (math.inf, 0)},
        {"desired": (0, 0, 0)},
        {"A": [[math.nan, 0]], "b": [0]},
        {"A": [[1, 0]], "b": [math.inf]},
        {"A": [[1, 0]], "b": [0, 1]},
        {"b": [1]},
        {"weights": (1.0, 0.0)},
        {"weights": (1.0, -1.0)},
        {"weights": (math.nan, 1.0)},
        {"lower": (math.nan, 0)},
        {"lower": (2.0, 0)},
        {"upper": (1.0,)},
        {"n_hard": 1},
        {"n_hard": -1},
        {"A": [[1, 0]], "b": [0], "n_hard": 2},
    ],
    ids=str,
)
def test_problems_that_make_no_sense(wrong):
    with pytest.raises(InvalidInputError):
        qp(**wrong)


def test_a_problem_is_read_only_and_a_copy():
    A, b = np.array([[-1.0, 0.3]]), np.array([-0.2])
    problem = qp(A, b)
    arrays = [getattr(problem, name) for name in FIELDS]
    assert problem.n_hard == 0
    assert not any(array.flags.writeable for array in arrays)
    b[0] = 7.0
    assert problem.b[0] == -0.2
