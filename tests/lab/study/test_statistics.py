"""Intervals, against the textbook and what was printed."""

import numpy as np
import pytest

from qpavoid.lab.study.statistics import bootstrap, wilson

WILSON_59 = (0.9833333333333333, 0.9114487018291041, 0.9970518402378096)
WILSON_994 = (0.994, 0.9869718316826028, 0.9972473308742513)
MEDIAN = (55.238976803973216, 29.311388300841898, 86.13089951363219)
MEAN = (63.010066485239705, 46.22656916320578, 80.4228627696053)


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
    """Shares are those of the formulas written out, to more digits than are shown."""
    assert wilson(59, 60) == pytest.approx(WILSON_59, abs=1e-8)
    assert wilson(994, 1000) == pytest.approx(WILSON_994, abs=1e-8)
    values = np.arange(30.0) ** 1.5
    assert bootstrap(values) == pytest.approx(MEDIAN, rel=1e-14)
    assert bootstrap(values, np.mean) == pytest.approx(MEAN, rel=1e-14)
