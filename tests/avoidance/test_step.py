"""A step always has an answer: what is wrong brakes, says so, and stays for a while."""

import math
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qpavoid import Limits, Robot, SafetyFilter
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.inputs import (
    PROBLEM,
    WAITING,
    Fault,
    Freshness,
    InputWatch,
    Stamps,
)
from qpavoid.model.obstacles import Obstacles

AHEAD = [[1.2, 0.0]]
LIMITS = Limits(-0.5, 1.0, -1.5, 1.5, 2.0, 2.5, wheel_speed=1.1, track=0.5)
ROBOT = replace(Robot.mir100(), limits=LIMITS)
AT_ONCE = Freshness(good=0.0)


class Leaves:
    """No number, and no way to ask whether it is one."""

    def __float__(self):
        raise SystemExit("good bye")

    __array__ = __len__ = __iter__ = __str__ = __float__


class Interrupts(Leaves):
    def __float__(self):
        raise KeyboardInterrupt

    __array__ = __float__


WRONG = {
    "nothing": {},
    "a name that there is not": {"v": 0.5, "omega": 0.0, "scan": AHEAD},
    "infinite": {"v": 0.5, "omega": math.inf},
    "too great a number": {"v": 10**400, "omega": 0.0},
    "no data": {"v": 0.5, "omega": 0.0, "points": None},
    "NaN in a point": {"v": 0.5, "omega": 0.0, "points": [[1.0, math.nan]]},
    "an age below 0": {"v": 0.5, "omega": 0.0, "age": -1.0},
    "old": {"v": 0.5, "omega": 0.0, "points": AHEAD, "age": 0.21},
    "driven is NaN": {"v": 0.5, "omega": 0.0, "driven": (math.nan, 0.0)},
    "leaves": {"v": Leaves(), "omega": 0.0},
    "points that leave": {"v": 0.5, "omega": 0.0, "points": Leaves()},
    "driven leaves": {"v": 0.5, "omega": 0.0, "driven": (0.0, Leaves())},
    "an age that leaves": {"v": 0.5, "omega": 0.0, "age": Leaves()},
    "stamps of text": {"v": 0.5, "omega": 0.0, "stamps": "now"},
    "stamps that leave": {"v": 0.5, "omega": 0.0, "stamps": Stamps(Leaves(), 0.0)},
}
wrong = pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)


def moving(**options):
    """Return a filter whose robot drives (0.8, 0.4)."""
    safety = SafetyFilter(ROBOT, ahead=False, **options)
    safety.reset(0.8, 0.4)
    return safety


@wrong
def test_what_is_wrong_brakes_along_the_arc(call):
    """2.0 m/s² and 2.5 rad/s² in 0.02 s: 20 steps, both parts alike."""
    safety = moving()
    for left in range(19, -1, -1):
        decision = safety.step(**call)
        assert decision.status is Status.INVALID and decision.problem
        assert decision[:2] == pytest.approx((0.04 * left, 0.02 * left), abs=1e-12)
        assert math.isnan(decision.clearance) and "stops" in decision.status.sentence
    assert sum(safety.faults.values()) == 20


def test_a_good_step_is_that_of_filter():
    asked, told = moving(), moving()
    for _ in range(50):
        one, other = asked.filter(0.9, 0.1, AHEAD), told.step(0.9, 0.1, AHEAD)
        assert one._replace(solve_time_s=0.0) == other._replace(solve_time_s=0.0)
        assert other.problem == ""
    assert told.faults == {}


def test_an_interrupt_is_passed_on():
    with pytest.raises(KeyboardInterrupt):
        moving().step(Interrupts(), 0.0)


def test_it_brakes_from_what_is_driven_if_that_is_valid():
    safety = moving()
    decision = safety.step(math.nan, 0.0, AHEAD, driven=(0.4, 0.2))
    assert decision[:2] == pytest.approx((0.36, 0.18), abs=1e-12)
    decision = safety.brake("the sensor burns", driven=(math.nan, 0.0))
    assert decision[:2] == pytest.approx((0.32, 0.16), abs=1e-12)
    assert decision.problem == "the sensor burns"
    assert safety.brake().problem == PROBLEM


@pytest.mark.parametrize("good, steps", [(0.0, 1), (0.02, 1), (0.1, 5), (0.5, 25)])
def test_it_drives_again_after_so_many_good_steps(good, steps):
    safety = moving(freshness=Freshness(good=good))
    for fault in (safety.brake, safety.step):
        assert fault().status is Status.INVALID
        for _ in range(steps - 1):
            waiting = safety.step(0.5, 0.0, AHEAD)
            assert (waiting.status, waiting.problem) == (Status.INVALID, WAITING)
        assert safety.step(0.5, 0.0, AHEAD).status is not Status.INVALID


def test_only_a_hand_lets_it_drive_again_if_so_set():
    safety = moving(freshness=Freshness(good=math.inf))
    assert safety.step(0.5, 0.0, AHEAD).status is not Status.INVALID
    safety.brake()
    safety.acknowledge()
    assert safety.step(0.5, 0.0, AHEAD).problem == WAITING, "the fault was not over"
    for _ in range(200):
        assert safety.step(0.5, 0.0, AHEAD).problem == WAITING
    safety.acknowledge()
    assert safety.step(0.5, 0.0, AHEAD).status is not Status.INVALID


def stamped(safety, now, **stamps):
    named = {"steady": now, **stamps}
    return safety.step(0.5, 0.0, AHEAD, stamps=Stamps(now, **named))


FAULTY = {
    "nothing is stamped": ({}, "never seen"),
    "only odometry is": ({"odometry": 10.0}, "never seen"),
    "stale": ({"points": 9.79}, "stale"),
    "stale discs": ({"points": 10.0, "discs": 9.49}, "discs: stale"),
    "stale odometry": ({"points": 10.0, "odometry": 9.89}, "odometry: stale"),
    "future": ({"points": 10.06}, "future"),
    "blind": ({"points": 10.0, "valid": 0.49}, "blind"),
    "blind, NaN": ({"points": 10.0, "valid": math.nan}, "blind"),
    "a percentage": ({"points": 10.0, "valid": 3}, "invalid"),
    "less than none": ({"points": 10.0, "valid": -0.1}, "invalid"),
    "NaN": ({"points": math.nan}, "invalid"),
}


@pytest.mark.parametrize("stamps, why", FAULTY.values(), ids=FAULTY)
def test_what_is_not_fresh_is_not_driven_by(stamps, why):
    safety = moving(freshness=AT_ONCE)
    decision = stamped(safety, 10.0, **stamps)
    assert decision.status is Status.INVALID
    assert why in decision.problem or why == "invalid"
    assert all(why.split(": ")[-1] in name for name in safety.faults)


@pytest.mark.parametrize(
    "stamps",
    [
        {"points": 9.81},
        {"points": 10.04},
        {"discs": 9.51},
        {"points": 10.0, "odometry": 9.91, "valid": 0.5},
    ],
)
def test_what_is_fresh_is(stamps):
    decision = stamped(moving(), 10.0, **stamps)
    assert decision.status is not Status.INVALID, decision.problem


def test_the_same_scan_again_is_an_older_one():
    """A loop of 50 Hz, one scan: 10 steps of 0.2 s are driven, and not one more."""
    safety = moving(freshness=AT_ONCE)
    for k in range(15):
        decision = stamped(safety, 10.0 + 0.02 * k, points=10.0)
        assert (decision.status is Status.INVALID) == (k > 10), k


REFUSED = [(100.0, Fault.UNORDERED), (99.9, Fault.UNORDERED), (100.2, Fault.FUTURE)]
REFUSED += [(math.nan, Fault.INVALID), (math.inf, Fault.INVALID)]


@pytest.mark.parametrize(("stamp", "why"), REFUSED)
def test_a_stamp_that_is_refused_makes_nothing_younger(stamp, why):
    watch = InputWatch(oldest=0.2, future=0.05)
    assert watch.receive(100.0, 100.0, 7.0) is None
    assert watch.receive(stamp, 100.1, 7.1) is why and watch.refused[why] == 1
    assert watch.fault(100.1, 7.1) is None, "the last valid one is fresh"
    assert watch.fault(100.3, 7.3) is why
    assert watch.receive(100.35, 100.35, 7.35) is None
    assert watch.fault(100.35, 7.35) is None


def test_a_clock_that_stands_still_ages_it_alike():
    safety = moving(freshness=AT_ONCE)
    for k in range(15):
        stamps = Stamps(10.0, points=10.0, steady=0.02 * k)
        decision = safety.step(0.5, 0.0, AHEAD, stamps=stamps)
        assert (decision.status is Status.INVALID) == (k > 10), k


def test_what_was_stamped_once_is_awaited():
    safety = moving(freshness=AT_ONCE)
    assert stamped(safety, 10.0, points=10.0, discs=10.0).status is not Status.INVALID
    assert stamped(safety, 10.4, points=10.4).status is not Status.INVALID
    assert "discs: stale" in stamped(safety, 10.6, points=10.6).problem


def test_a_step_without_stamps_is_a_fault_once_there_were_some():
    """Else whoever loses them drives on by whatever he has, however old."""
    safety = moving(freshness=AT_ONCE)
    assert safety.step(0.5, 0.0, AHEAD).status is not Status.INVALID
    assert stamped(safety, 10.0, points=10.0).status is not Status.INVALID
    assert "points: unstamped" in safety.step(0.5, 0.0, AHEAD).problem
    assert stamped(safety, 10.1, points=10.1).status is not Status.INVALID


def test_a_steady_clock_that_goes_back_leaves_nothing_known():
    """The machine's after one of the caller's: no age by it would count for hours."""
    safety = moving(freshness=AT_ONCE)
    assert stamped(safety, 10.0, points=10.0).status is not Status.INVALID
    stands = Stamps(10.0, points=10.0, steady=5.0)
    assert "went back" in safety.step(0.5, 0.0, AHEAD, stamps=stands).problem
    for k in range(15):
        stands = Stamps(10.0, points=10.0, steady=5.0 + 0.0195 * k)
        decision = safety.step(0.5, 0.0, AHEAD, stamps=stands)
        assert (decision.status is Status.INVALID) == (k > 10), k


def test_a_clock_that_is_set_back_brakes_until_stamps_follow_it():
    safety = moving(freshness=AT_ONCE)
    assert stamped(safety, 10.0, points=10.0).status is not Status.INVALID
    known = Stamps(5.0, points=10.0, steady=10.02)
    assert "future" in safety.step(0.5, 0.0, AHEAD, stamps=known).problem
    known = Stamps(5.02, points=5.02, steady=10.04)
    assert safety.step(0.5, 0.0, AHEAD, stamps=known).status is not Status.INVALID


def test_odometry_that_is_stale_is_not_braked_from():
    safety = moving()
    known = Stamps(10.0, points=10.0, odometry=9.0, steady=10.0)
    decision = safety.step(0.5, 0.0, AHEAD, stamps=known, driven=(0.0, 0.0))
    assert decision[:2] == pytest.approx((0.76, 0.38), abs=1e-12)


def test_the_filter_is_told_the_age():
    """An obstacle that may accelerate, measured 0.1 s ago: as ``age`` tells it."""
    disc = {"discs": [[1.0, 0.0, 0.2]], "disc_velocities": [[-0.4, 0.0]]}
    told = moving().filter(0.8, 0.0, Obstacles(**disc), age=0.1)
    known = Stamps(10.0, discs=9.9, steady=10.0)
    found = moving().step(0.8, 0.0, Obstacles(**disc), stamps=known)
    assert found[:2] == pytest.approx(told[:2], abs=1e-9)
    assert told[:2] != moving().filter(0.8, 0.0, Obstacles(**disc))[:2]


def test_another_thread_gets_braking_and_changes_nothing():
    safety, found = moving(), []
    safety.filter(0.8, 0.4, [])
    thread = threading.Thread(
        target=lambda: found.extend([safety.step(0.5, 0.0, AHEAD), safety.brake()])
    )
    thread.start()
    thread.join()
    assert [decision.status for decision in found] == [Status.INVALID] * 2
    assert "thread" in found[0].problem
    assert found[0][:2] == found[1][:2] == pytest.approx((0.76, 0.38), abs=1e-12)
    assert safety._engine.state[0] == 0.8
    assert safety.faults == {} and safety.step(0.8, 0.4, []).status == "tracking"


def test_the_stamps_of_another_thread_are_not_those_of_the_filter():
    safety = moving(freshness=AT_ONCE)
    assert stamped(safety, 10.0, points=10.0).status is not Status.INVALID
    later = threading.Thread(target=lambda: stamped(safety, 11.0, points=11.0))
    later.start()
    later.join()
    assert stamped(safety, 10.1, points=10.1).status is not Status.INVALID


anything = st.one_of(
    st.none(),
    st.text(max_size=3),
    st.floats(),
    st.integers(),
    st.binary(max_size=3),
    st.lists(st.floats(), max_size=4),
    st.lists(st.lists(st.floats(-2, 2), min_size=2, max_size=2), max_size=3),
    st.builds(object),
)
ARGUMENTS = "obstacles", "points", "age", "driven", "stamps", "v", "omega"


@settings(max_examples=300, deadline=None)
@given(
    st.dictionaries(st.sampled_from(ARGUMENTS), anything),
    st.floats(-0.4, 0.9),
    st.floats(-0.3, 0.3),
)
def test_it_answers_whatever_it_is_given(call, v, omega):
    """Within the limits and the accelerations, from what it drove."""
    safety = SafetyFilter(ROBOT, ahead=False, freshness=AT_ONCE)
    safety.reset(v, omega)
    before = safety._engine.state[:2].copy()
    decision = safety.step(**{"v": 0.5, "omega": 0.0, **call})
    twist = np.array(decision[:2])
    assert np.isfinite(twist).all()
    assert abs(twist[0]) + 0.25 * abs(twist[1]) <= 1.1 + 1e-9
    if call.get("driven") is None or decision.status is Status.INVALID:
        given_driven = call.get("driven") is not None
        off = np.abs(twist - before)
        assert given_driven or (off <= np.array([0.04, 0.05]) + 1e-9).all()
    assert (decision.problem != "") == (decision.status is Status.INVALID)


@pytest.mark.parametrize(
    "spoilt",
    [
        Stamps(10.0, points=9.9, discs=9.9, valid=2.0),
        Stamps(10.0, points="9.9", discs=9.9),
        Stamps(math.nan, points=9.9),
    ],
    ids=["a share of 2", "a text", "no time"],
)
def test_an_input_is_awaited_whose_first_stamps_were_wrong(spoilt):
    safety = SafetyFilter(ROBOT, freshness=Freshness(good=0.0))
    assert safety.step(0.5, 0.0, AHEAD, stamps=spoilt).status is Status.INVALID
    assert safety.step(0.5, 0.0, AHEAD).status is Status.INVALID


@pytest.mark.parametrize("again", [Stamps(10.05, points=10.0), Stamps(10.05)])
def test_a_blind_scan_stays_blind(again):
    safety = SafetyFilter(ROBOT, freshness=Freshness(good=0.0))
    blind = Stamps(10.0, points=10.0, valid=0.1)
    assert safety.step(0.5, 0.0, AHEAD, stamps=blind).status is Status.INVALID
    assert "blind" in safety.step(0.5, 0.0, AHEAD, stamps=again).problem
    sees = Stamps(10.1, points=10.1)
    assert safety.step(0.5, 0.0, AHEAD, stamps=sees).status is not Status.INVALID
