"""Intervals, against the textbook and what was printed."""

import pytest

from qpavoid.lab.study.statistics import wilson

WILSON_59 = (0.9833333333333333, 0.9114487018291041, 0.9970518402378096)
WILSON_994 = (0.994, 0.9869718316826028, 0.9972473308742513)


def test_wilson_is_the_textbook_interval():
    assert wilson(8, 10) == pytest.approx((0.8, 0.4902, 0.9433), abs=1e-4)
    assert wilson(0, 20) == pytest.approx((0.0, 0.0, 0.1611), abs=1e-4)
    assert wilson(5, 5)[2] == 1.0


def test_the_digits_of_the_committed_page():
    """Shares are those of the formulas written out, to more digits than are shown."""
    assert wilson(59, 60) == pytest.approx(WILSON_59, abs=1e-8)
    assert wilson(994, 1000) == pytest.approx(WILSON_994, abs=1e-8)
