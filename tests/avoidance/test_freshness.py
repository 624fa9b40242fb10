"""Ages, order, clocks that jump, and the latch."""

import math

import pytest

from qpavoid.avoidance.inputs import Fault, InputWatch


@pytest.fixture
def watch():
    made = InputWatch(oldest=0.2, future=0.05)
    assert made.fault(100.0, 7.0) is Fault.NEVER and made.age(100.0, 7.0) == math.inf
    assert made.receive(100.0, 100.0, 7.0) is None
    return made


def test_what_arrives_late_was_old_already(watch):
    assert watch.receive(100.1, 100.25, 7.25) is None
    assert watch.age(100.25, 7.25) == pytest.approx(0.15)
    assert watch.fault(100.31, 7.31) is Fault.STALE


@pytest.mark.parametrize(
    ("stamp", "why"),
    [
        (100.0, Fault.UNORDERED),
        (99.9, Fault.UNORDERED),
        (100.2, Fault.FUTURE),
        (math.nan, Fault.INVALID),
        (math.inf, Fault.INVALID),
    ],
)
def test_what_is_refused_does_not_make_it_younger(watch, stamp, why):
    assert watch.receive(stamp, 100.1, 7.1) is why
    assert watch.refused[why] == 1
    assert watch.fault(100.1, 7.1) is None, "the last valid one is fresh"
    assert watch.fault(100.3, 7.3) is why
    assert watch.receive(100.35, 100.35, 7.35) is None
    assert watch.fault(100.35, 7.35) is None


def test_what_is_blind_is_so_at_once_and_until_the_next(watch):
    watch.judge(Fault.BLIND)
    assert watch.fault(100.0, 7.0) is Fault.BLIND and watch.refused[Fault.BLIND] == 1
    assert watch.receive(100.1, 100.1, 7.1) is None
    assert watch.fault(100.1, 7.1) is None


def test_a_clock_that_goes_back(watch):
    """The last stamp is then from another time; what is seen now counts again."""
    assert watch.fault(50.0, 7.1) is Fault.FUTURE
    assert watch.receive(50.0, 50.0, 7.1) is None
    assert watch.fault(50.1, 7.2) is None
