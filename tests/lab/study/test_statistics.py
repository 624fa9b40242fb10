"""Intervals and paired differences, against the textbook and what was printed."""

import numpy as np
import pytest

from qpavoid.lab.study.statistics import Paired, bootstrap, paired, wilson

WILSON_59 = (0.9833333333333333, 0.9114487018291041, 0.9970518402378096)
WILSON_994 = (0.994, 0.9869718316826028, 0.9972473308742513)
MEDIAN = (55.238976803973216, 27.0, 86.13089951363219)
MEAN = (63.010066485239705, 46.163037308102695, 80.29991134074056)


def test_wilson_is_the_textbook_interval():
    assert wilson(8, 10) == pytest.approx((0.8, 0.4902, 0.9433), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.0, 0.1611), abs=1e-4)
    assert wilson(5, 5)[2] == 1.0


def test_bootstrap_is_repeatable_and_about_right():
    values = np.random.default_rng(3).normal(2.0, 1.0, 400)
    found = bootstrap(values, np.mean)
    assert found == bootstrap(values, np.mean)
    half = 1.96 * values.std() / 20
    assert found == pytest.approx(
        (values.mean(), values.mean() - half, values.mean() + half), abs=0.02
    )
    assert bootstrap(np.array([])) is None
    assert bootstrap(np.array([3.0])) == (3.0, 3.0, 3.0)


def test_the_digits_of_the_committed_page():
    """Values of the formulas written out, before SciPy: far more digits than shown."""
    assert wilson(59, 60) == pytest.approx(WILSON_59, abs=1e-8)
    assert wilson(994, 1000) == pytest.approx(WILSON_994, abs=1e-8)
    values = np.arange(30.0) ** 1.5
    assert bootstrap(values) == pytest.approx(MEDIAN, rel=1e-14)
    assert bootstrap(values, np.mean) == pytest.approx(MEAN, rel=1e-14)


def test_mcnemar_is_the_binomial_test_of_the_split():
    def p(first, second):
        return Paired(20, first, second, (0.0, 0.0, 0.0), 9, None).p

    assert p(0, 0) == p(4, 4) == 1.0
    assert p(1, 5) == p(5, 1) == pytest.approx(2 * (1 + 6) / 2**6)
    assert p(0, 10) == pytest.approx(2 / 2**10)


def test_pairs_are_the_scenes_that_both_ran():
    first = {1: 4.0, 2: None, 3: 5.0, 4: 6.0}
    second = {1: 3.0, 2: 7.0, 3: None, 5: 1.0}
    pair = paired(first, second)
    assert (pair.scenes, pair.only_first, pair.only_second, pair.both) == (3, 1, 1, 1)
    assert pair.time == (1.0, 1.0, 1.0)
    assert paired(first, {9: 1.0}) is None
