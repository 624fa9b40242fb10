"""Velocities from positions. Oracles: a Kalman filter in matrices, and the worst
acceleration history by superposition; ids that come and go, bad input."""

import copy
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid.errors import InvalidInputError
from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator

DEFAULT = EstimatorSettings()


def follow(settings, times, positions):
    estimator = VelocityEstimator(settings)
    ids = range(positions.shape[1])
    motions = [
        estimator.update(t, ids, p) for t, p in zip(times, positions, strict=True)
    ]
    return (np.array(part) for part in zip(*motions, strict=True))


RATES = pytest.mark.parametrize("dt", [0.01, 0.05, 0.1, 0.2, 0.5])


def transition(dt):
    return np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2))


def disturbance(a, dt):
    return (a * dt) ** 2 * np.kron([[dt**2 / 3, dt / 2], [dt / 2, 1.0]], np.eye(2))


def matrix_filter(settings, times, positions):
    """Yield state (x, y, v_x, v_y) and its covariance after every position."""
    H, R = np.eye(2, 4), settings.noise**2 * np.eye(2)
    state = np.array([*positions[0], 0.0, 0.0])
    prior = (settings.speed / 2) ** 2
    P = np.diag([settings.noise**2] * 2 + [prior] * 2)
    yield state, P
    for dt, position in zip(np.diff(times), positions[1:], strict=True):
        F = transition(dt)
        state, P = F @ state, F @ P @ F.T + disturbance(settings.acceleration, dt)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        state = state + K @ (position - H @ state)
        left = np.eye(4) - K @ H
        P = left @ P @ left.T + K @ R @ K.T
        yield state, P


def uncertainty(settings, P):
    """Its definition in Motion, with α of a position that was just taken in."""
    rho = math.sqrt(max(0.0, 1.0 - P[0, 0] / settings.noise**2))
    lag = math.sqrt(2 * settings.acceleration * settings.noise * rho)
    return 2 * math.sqrt(P[2, 2]) + lag


settings_drawn = st.builds(
    EstimatorSettings,
    acceleration=st.floats(0.1, 10.0),
    noise=st.floats(0.001, 0.2),
    speed=st.floats(0.1, 5.0),
    forget=st.just(10.0),
)
steps_drawn = st.lists(st.floats(0.001, 1.0), min_size=1, max_size=40)


@given(settings_drawn, steps_drawn, st.integers(0, 2**32 - 1))
def test_equals_a_kalman_filter_in_matrices_at_irregular_times(settings, steps, seed):
    times = np.cumsum([3.0, *steps])
    positions = np.random.default_rng(seed).normal(size=(len(times), 1, 2))
    found = follow(settings, times, positions)
    expected = matrix_filter(settings, times, positions[:, 0])
    for place, velocity, off, (state, P) in zip(*found, expected, strict=True):
        assert_allclose(place[0], state[:2], rtol=1e-7, atol=1e-7)
        assert_allclose(velocity[0], state[2:], rtol=1e-6, atol=1e-6)
        assert_allclose(off[0], uncertainty(settings, P), rtol=1e-4)


@RATES
def test_uncertainty_holds_the_worst_acceleration_history(dt):
    """The errors after a pulse in each eighth of an interval add up to the worst."""
    parts, steps = 8, 30 + int(3.0 / dt)
    pulse = dt / parts
    estimator = VelocityEstimator()
    for step in range(steps):
        motion = estimator.update(step * dt, range(parts), np.zeros((parts, 2)))
    left = dt - pulse * np.arange(1, parts + 1)
    true = np.full(parts, pulse * DEFAULT.acceleration)
    worst = 0.0
    for step in range(steps):
        places = np.zeros((parts, 2))
        places[:, 0] = true * (pulse / 2 + left + step * dt)
        motion = estimator.update((steps + step) * dt, range(parts), places)
        worst += np.abs(motion.velocities[:, 0] - true).sum()
    assert 0.4 * DEFAULT.acceleration * dt < worst < motion.uncertainty.min()


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
    "twice": (1.1, ["a", "c", "a"], np.zeros((3, 2)), "'a' is repeated"),
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
