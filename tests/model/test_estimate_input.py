"""Velocities from positions: ids that come and go, bad input, extreme numbers."""

import copy
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from followed import DEFAULT, follow
from qpavoid.errors import InvalidInputError
from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator


@given(st.integers(0, 2**32 - 1))
def test_ids_do_not_know_of_each_other(seed):
    """Each in its own estimator, in any order, present or not: the same answers."""
    rng = np.random.default_rng(seed)
    together = VelocityEstimator()
    alone = {name: VelocityEstimator() for name in ("a", 7, (1, 2), None)}
    time = 0.0
    for _ in range(12):
        time += rng.choice([0.0, 0.02, 0.3, 1.5])
        seen = [name for name in alone if rng.uniform() < 0.6]
        seen = [seen[i] for i in rng.permutation(len(seen))]
        positions = rng.normal(size=(len(seen), 2))
        motion = together.update(time, seen, positions)
        for row, name in enumerate(seen):
            own = alone[name].update(time, [name], positions[[row]])
            for part, of_one in zip(motion, own, strict=True):
                assert_array_equal(part[row], of_one[0])


def test_an_id_that_comes_back_in_time_is_known_and_later_is_new():
    estimator = VelocityEstimator(EstimatorSettings(forget=0.5))
    for step in range(40):
        t = step * 0.05
        estimator.update(t, ["a", "b"], [[t, 0], [0, t]])
    estimator.update(2.0, ["b"], [[0, 2.0]])
    sooner = estimator.update(2.4, ["a"], [[2.4, 0]])
    assert_allclose(sooner.velocities, [[1.0, 0.0]], atol=0.01)
    assert sooner.uncertainty[0] < DEFAULT.speed / 2
    later = estimator.update(2.6, ["b", "a"], [[0, 2.6], [2.6, 0]])
    assert_array_equal(later.velocities[0], [0.0, 0.0])
    assert later.uncertainty[0] == pytest.approx(DEFAULT.speed)
    assert later.velocities[1, 0] == pytest.approx(1.0, abs=0.01)


def test_what_is_forgotten_takes_no_memory():
    estimator = VelocityEstimator()
    for step in range(500):
        estimator.update(0.1 * step, [step], [[0.0, 0.0]])
    assert len(estimator._tracks) <= 12


def test_nothing_seen_is_an_answer_and_time_goes_on():
    estimator = VelocityEstimator()
    for nothing in ([], np.empty((0, 2)), ()):
        motion = estimator.update(3.0, [], nothing)
        assert motion.positions.shape == motion.velocities.shape == (0, 2)
        assert motion.uncertainty.shape == (0,)
    with pytest.raises(InvalidInputError, match="backwards"):
        estimator.update(2.9, [], [])


def test_a_message_that_comes_twice_changes_nothing():
    once, twice = VelocityEstimator(), VelocityEstimator()
    for step in range(10):
        t, here = 0.1 * step, [[0.05 * step, -1.0]]
        first = once.update(t, ["a"], here)
        twice.update(t, ["a"], here)
        again = twice.update(t, ["a", f"new {step}"], [*here, [9.0, 9.0]])
        for part, other in zip(first, again, strict=True):
            assert_array_equal(part[0], other[0])
        assert again.uncertainty[1] == pytest.approx(DEFAULT.speed)


def test_answers_are_copies():
    estimator, undisturbed = VelocityEstimator(), VelocityEstimator()
    positions = np.zeros((1, 2))
    for part in estimator.update(0.0, ["a"], positions):
        part[:] = 99.0
    undisturbed.update(0.0, ["a"], np.zeros((1, 2)))
    assert_array_equal(positions, [[0.0, 0.0]])
    found = estimator.update(0.1, ["a"], [[0.1, 0.0]])
    expected = undisturbed.update(0.1, ["a"], [[0.1, 0.0]])
    assert_array_equal(found.velocities, expected.velocities)


class Unhashed:
    def __hash__(self):
        raise ValueError("no hash")


BAD = {
    "nan": (1.1, ["a", "b"], [[0.0, 0.0], [math.nan, 0.0]], r"positions\[1\].*'b'"),
    "inf": (1.1, ["a", "b"], [[0.0, -math.inf], [0.0, 0.0]], r"positions\[0\].*'a'"),
    "width": (1.1, ["a"], [[0.0, 0.0, 0.0]], r"positions.*\(n, 2\)"),
    "flat": (1.1, ["a"], [0.0, 0.0], r"positions.*\(n, 2\)"),
    "text": (1.1, ["a"], [["x", "y"]], "positions must be numbers"),
    "none": (1.1, ["a"], None, "positions"),
    "too many": (1.1, ["a", "b"], [[0.0, 0.0]], "2 or more ids for 1 positions"),
    "too few": (1.1, [], [[0.0, 0.0]], "0 ids for 1 positions"),
    "twice": (1.1, ["a", "c", "a"], np.zeros((3, 2)), "'a' comes twice"),
    "unhashable": (1.1, [["a"]], [[0.0, 0.0]], "hashable"),
    "no list": (1.1, 5, [[0.0, 0.0]], "hashable"),
    "backwards": (0.9, ["a"], [[0.0, 0.0]], "backwards"),
    "no time": (math.nan, ["a"], [[0.0, 0.0]], "time must be a finite"),
    "endless": (math.inf, ["a"], [[0.0, 0.0]], "time must be a finite"),
    "no number": ("1.1", ["a"], [[0.0, 0.0]], "time must be numbers"),
    "huge time": (10**400, ["a"], [[0.0, 0.0]], "time must be numbers"),
    "far time": (1e101, ["a"], [[0.0, 0.0]], "time must be finite"),
    "masked time": (np.ma.masked, ["a"], [[0.0, 0.0]], "time must not be masked"),
    "huge": (1.1, ["a"], [[1e308, 1e308]], r"positions\[0\].*'a'"),
    "endless ids": (1.1, itertools.count(), [[0.0, 0.0]], "2 or more ids for 1"),
    "bad hash": (1.1, [Unhashed()], [[0.0, 0.0]], "hashables: no hash"),
}


@pytest.mark.parametrize(("time", "ids", "positions", "message"), BAD.values(), ids=BAD)
def test_bad_input_is_refused_and_nothing_is_lost(time, ids, positions, message):
    estimator = VelocityEstimator()
    estimator.update(0.9, ["a", "b"], [[0.0, 0.0], [1.0, 1.0]])
    estimator.update(1.0, ["a", "b"], [[0.1, 0.0], [1.0, 0.9]])
    untouched = copy.deepcopy(estimator)
    with pytest.raises(InvalidInputError, match=message):
        estimator.update(time, ids, positions)
    for part, other in zip(
        estimator.update(1.05, ["b", "c", "a"], np.ones((3, 2))),
        untouched.update(1.05, ["b", "c", "a"], np.ones((3, 2))),
        strict=True,
    ):
        assert_array_equal(part, other)


@pytest.mark.parametrize("wrong", [{"noise": 1e-7}, {"speed": 1e7}])
def test_bad_settings_are_refused_by_name(wrong):
    with pytest.raises(InvalidInputError, match=next(iter(wrong))):
        EstimatorSettings(**wrong)
    with pytest.raises(InvalidInputError, match="must be EstimatorSettings, not"):
        VelocityEstimator(wrong)


@given(
    st.tuples(*[st.sampled_from([1e-6, 1e-3, 1.0, 1e3, 1e6])] * 3),
    st.lists(st.floats(-9.0, 5.9), min_size=1, max_size=30),
)
def test_extreme_settings_and_times_give_numbers(values, powers):
    settings = EstimatorSettings(*values, forget=1e6)
    times = np.cumsum([-1e3, *(10.0 ** np.array(powers))])
    positions = np.random.default_rng(0).normal(size=(len(times), 2, 2))
    for part in follow(settings, times, positions):
        assert np.isfinite(part).all()


@pytest.mark.parametrize("dt", np.geomspace(1e2, 1e5, 20))
def test_rounding_makes_no_variance_negative(dt):
    settings = EstimatorSettings(1e-6, 1e-6, 1e6, 1e6)
    *_, off = follow(settings, [0.0, dt], np.zeros((2, 1, 2)))
    assert 0.0 <= off[-1, 0] < settings.speed
