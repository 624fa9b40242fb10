"""A call that machine code answers at once: the same decisions, and what it refuses."""

import copy
import gc
import pickle
import sys
import threading

import numpy as np
import pytest

from hostile_filters import FILTERS
from qpavoid import InvalidInputError, Robot, SafetyFilter
from qpavoid.avoidance import filter
from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.filter import GIVEN, nothing
from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import bound, native_code
from qpavoid.errors import ThreadError

pytestmark = pytest.mark.skipif(
    native_code(filter_step.py_func) is None,
    reason="no machine code beside the sources",
)

NEAR = np.array([[0.9, 0.1], [1.4, -0.3]])


def answered(safety, v, omega, points):
    """Answer of the quick path; None if it does not apply."""
    return safety._engine.quick(v, omega, points, *GIVEN[3:])


def used(**options):
    safety = SafetyFilter(Robot.mir100(), **options)
    safety.filter(0.5, 0.1, NEAR)
    return safety


def bits(decision):
    return *map(type, decision), *map(repr, decision._replace(solve_time_s=0.0))


def be_slow(safety):
    """Let a filter take the long way."""
    safety._engine.quick, safety._engine._be_quick = filter.nothing, lambda: None


@pytest.mark.parametrize("name", FILTERS)
def test_the_same_is_decided_to_the_last_bit(name):
    robot, settings, ahead, _ = FILTERS[name]
    quick, slow = (SafetyFilter(robot, settings, ahead=ahead) for _ in range(2))
    be_slow(slow)
    rng, statuses = np.random.default_rng(1), set()
    for i in range(600):
        if i % 20 == 0:
            twist, many = rng.normal(0.0, 1.0, 2), rng.choice([0, 1, 3, 30, 300])
            where = robot.footprint.circumradius * rng.choice([0.9, 1.5, 4.0])
            driven = rng.normal(0.0, 0.3, 2)
            quick.reset(*driven), slow.reset(*driven)
        v, omega = map(float, twist)
        points = rng.normal(0.0, where, (many, 2)) + [where, 0.0]
        one, other = (each.filter(v, omega, points) for each in (quick, slow))
        assert bits(one) == bits(other)
        assert quick._engine.state.tobytes() == slow._engine.state.tobytes()
        assert type(one) is Decision and one.solve_time_s > 0.0
        statuses.add(one.status)
    assert slow._engine.quick is nothing is not quick._engine.quick
    assert {Status.TRACKING, Status.FILTERED} <= statuses


def test_what_is_rare_is_answered_at_once_too():
    safety = used(ahead=False)
    assert answered(safety, 0.5, 0.1, NEAR).status is Status.FILTERED
    assert answered(safety, 0.5, 0.1, NEAR[:0]).clearance == np.inf
    assert answered(safety, 0.0, 0.0, NEAR * 0.1).status is not Status.TRACKING
    frozen = NEAR.copy()
    frozen.flags.writeable = False
    assert answered(safety, 0.5, 0.1, frozen) is not None
    for _ in range(2):  # memory is made by the long way, then it is there
        assert safety.filter(0.5, 0.1, np.tile(NEAR, (500, 1))).active
    assert answered(safety, 0.5, 0.1, np.tile(NEAR, (500, 1))) is not None


class Liar(np.ndarray):
    """Says that it has more rows than it has."""

    shape = property(lambda self: (10_000, 2))

    def __len__(self):
        return 10_000


MISALIGNED = np.zeros(33, np.uint8)[1:].view(np.float64).reshape(2, 2)
UNFIT = {
    "another type": NEAR.astype(np.float32),
    "integers": np.ones((2, 2), np.int64),
    "another order of bytes": NEAR.astype(">f8"),
    "columns apart": np.zeros((2, 4))[:, ::2],
    "rows apart": np.zeros((4, 2))[::2],
    "from behind": NEAR[::-1],
    "Fortran's order": np.asfortranarray(NEAR),
    "one row for many": np.broadcast_to(NEAR[0], (10**9, 2)),
    "no dimension": np.float64(1.0).reshape(()),
    "one dimension": np.zeros(4),
    "three dimensions": np.zeros((1, 2, 2)),
    "three columns": np.zeros((2, 3)),
    "no columns": np.zeros((2, 0)),
    "between the words": MISALIGNED,
    "masked": np.ma.masked_array(NEAR),
    "of a class that lies": NEAR.view(Liar),
    "objects": NEAR.astype(object),
    "a list": NEAR.tolist(),
    "a view of memory": memoryview(NEAR),
    "nothing": None,
}


@pytest.mark.parametrize("kind", UNFIT)
def test_an_array_that_is_not_as_expected_is_left_to_python(kind):
    safety = used()
    before = safety._engine.state.copy()
    assert answered(safety, 0.5, 0.1, UNFIT[kind]) is None
    assert (safety._engine.state == before).all()
    try:
        found = safety.filter(0.5, 0.1, UNFIT[kind])
    except InvalidInputError:
        return
    rows = np.asarray(UNFIT[kind], np.float64).view(np.ndarray).tolist()
    other = used()
    assert bits(found) == bits(other.filter(0.5, 0.1, rows))


@pytest.mark.parametrize("twist", [(1, 0.1), (np.float64(0.5), 0.1), ("1", 0.1)])
def test_a_number_that_is_no_float_is_left_to_python(twist):
    assert answered(used(), *twist, NEAR) is None


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_what_is_invalid_is_said_and_changes_nothing(bad):
    safety = used()
    before = safety._engine.state.copy()
    for points in (np.array([[bad, 0.0]]), np.tile([[bad, 0.0]], (600, 1))):
        assert answered(safety, 0.5, 0.1, points) is None
        with pytest.raises(InvalidInputError, match=r"points\[0\]"):
            safety.filter(0.5, 0.1, points)
    assert answered(safety, np.nan, 0.1, NEAR) is None
    assert (safety._engine.state == before).all()


def test_anything_beside_points_goes_the_long_way():
    safety, call = used(), used()._engine.quick
    assert call(0.5, 0.1, NEAR, *GIVEN[3:]) is not None
    for place in range(3, len(GIVEN)):
        others = list(GIVEN[3:])
        others[place - 3] = 0.25
        assert call(0.5, 0.1, NEAR, *others) is None
    for count in (0, 3, len(GIVEN) - 1, len(GIVEN) + 1):
        assert call(*[0.5] * count) is None
    age = float("0.0")  # another object
    assert safety._engine.quick(0.5, 0.1, NEAR, *GIVEN[3:-2], age, None) is not None


def test_another_thread_is_refused():
    safety, found = used(), []
    before = safety._engine.state.copy()

    def other():
        found.append(answered(safety, 0.5, 0.1, NEAR))
        try:
            safety.filter(0.5, 0.1, NEAR)
        except ThreadError as error:
            found.append(error)

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert found[0] is None and isinstance(found[1], ThreadError)
    assert (safety._engine.state == before).all()
    safety.reset()
    assert safety._engine.quick is nothing


def test_a_copy_has_a_call_of_its_own():
    safety = used()
    for other in (copy.copy(safety), pickle.loads(pickle.dumps(safety))):
        assert other._engine.quick is nothing
        one, two = safety._engine.state.copy(), other.filter(0.4, 0.1, NEAR)
        assert (safety._engine.state == one).all()
        assert two.status and other._engine.quick not in (nothing, safety._engine.quick)


def test_no_memory_is_kept():
    safety, points, twist = used(), NEAR.copy(), (0.123, 0.456)
    watched = points, *twist, Status.FILTERED, Decision
    before = [*map(sys.getrefcount, watched)]
    for _ in range(2_000):
        safety.filter(*twist, points)
        answered(safety, 0.5, None, points)
    after = [*map(sys.getrefcount, watched)]
    assert all(y - x <= 2 for x, y in zip(before, after, strict=True))
    points.resize(40, refcheck=False)  # no buffer is held
    state = safety._engine.state
    del safety
    gc.collect()
    assert sys.getrefcount(state) == 2


def test_memory_that_another_wants_back_meanwhile_is_held():
    """While machine code reads it without the lock of the interpreter."""
    safety, owner = used(ahead=False), bytearray(NEAR.tobytes() * 20_000)
    points, tried, done = np.frombuffer(owner).reshape(-1, 2), [], threading.Event()
    safety.filter(0.5, 0.0, points)

    def shrink():
        while not done.is_set():
            with pytest.raises(BufferError):
                owner.clear()
            tried.append(1)

    thread = threading.Thread(target=shrink)
    thread.start()
    for _ in range(20):
        assert answered(safety, 0.5, 0.0, points).active
    done.set()
    thread.join()
    assert tried


class Odd(Decision):
    """Whose hash is not that of its tuple, as if one were set up otherwise."""

    def __hash__(self):
        return 7


def test_where_memory_alone_makes_no_tuple_the_class_is_called(monkeypatch):
    """Python 3.14 keeps a tuple's hash within it, which only its own way sets up."""
    quick = answered(used(), 0.5, 0.1, NEAR)
    kinds = filter.MADE[0], Odd, *filter.MADE[2:]
    monkeypatch.setattr(filter, "MADE", kinds)
    for _ in range(100):
        called = answered(used(), 0.5, 0.1, NEAR)
        assert type(called) is Odd and bits(called) == bits(quick)
    gc.collect()
    before = sys.getrefcount(None)
    others = [answered(used(), 0.5, 0.1, NEAR) for _ in range(100)]
    del others
    gc.collect()
    assert abs(sys.getrefcount(None) - before) < 50


@pytest.mark.parametrize("made", [(), (np.ndarray, tuple, ()), (1, list, (), NEAR)])
def test_what_a_decision_is_made_of_is_checked(made):
    known = *used()._engine.setup, *(NEAR, np.zeros((0, 12)), 0.0, True, 0.0, 0.0)
    with pytest.raises(TypeError):
        bound(filter_step, (*known, np.zeros(99), np.zeros(9)), GIVEN, made)


def test_a_reset_is_not_undone_by_a_step_that_another_thread_is_at(monkeypatch):
    safety, elsewhere = SafetyFilter(Robot.mir100()), threading.Event()
    step, begun = safety._engine.step, threading.Event()

    def late(*given):
        begun.set()
        assert elsewhere.wait(10.0)
        return step(*given)

    monkeypatch.setattr(safety._engine, "step", late)
    given = (0.4, 0.1, [[3.0, 0.2]])
    thread = threading.Thread(
        target=safety.filter, args=given, kwargs={"driven": (0.3, 0.2)}
    )
    thread.start()
    assert begun.wait(10.0)
    safety.reset()
    elsewhere.set()
    thread.join()
    assert not safety._engine.state.any()
