"""Poses by time: between two, after the last, and seen from one another."""

import math
from itertools import pairwise

import pytest

from qpavoid.model.kinematics import integrate
from qpavoid.model.trail import KEPT, Trail, compose, relative


def test_relative_and_placed_are_inverse():
    then, now = (1.0, -2.0, 3.0), (0.5, 4.0, -3.0)
    assert compose(then, relative(then, now))[:2] == pytest.approx(now[:2])
    assert relative(then, now)[2] == pytest.approx(2 * math.pi - 6.0)
    assert relative(then, then) == (0.0, 0.0, 0.0)


def test_between_two_and_after_the_last():
    trail = Trail()
    assert trail.at(3.0) == (0.0, 0.0, 0.0)
    trail.record(1.0, (0.0, 0.0, 3.1), (0.0, 0.0))
    trail.record(2.0, (1.0, 2.0, -3.1), (0.5, 0.3))
    x, y, heading = trail.at(1.5)
    assert (x, y) == pytest.approx((0.5, 1.0))
    assert math.cos(heading) == pytest.approx(-1.0, abs=1e-9)
    driven = integrate((1.0, 2.0, -3.1), (0.5, 0.3), 0.0, 0.4)
    assert trail.at(2.4) == pytest.approx(driven)
    assert trail.at(0.0) == (0.0, 0.0, 3.1)


def test_between_two_of_many_that_are_not_evenly_apart():
    trail, times = Trail(), (0.0, 1.0, 3.0, 3.5, 7.0)
    for time in times:
        trail.record(time, (time * time, -time, 0.1 * time), (9.0, 9.0))
    for a, b in pairwise(times):
        for share in (0.0, 0.3, 0.9):
            time = a + share * (b - a)
            x, y, heading = trail.at(time)
            assert x == pytest.approx(a * a + share * (b * b - a * a))
            assert (-y, 10 * heading) == pytest.approx((time, time))


def test_a_clock_that_goes_back_begins_a_new_trail():
    trail = Trail()
    for k in range(3 * KEPT):
        trail.record(float(k), (float(k), 0.0, 0.0), (0.0, 0.0))
    assert trail.at(0.0)[0] == 3 * KEPT - KEPT - 1
    trail.record(5.0, (7.0, 0.0, 0.0), (0.0, 0.0))
    assert trail.at(9.0) == (7.0, 0.0, 0.0) == trail.at(0.0)
