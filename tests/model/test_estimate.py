"""Velocities from positions. Oracles: a Kalman filter in matrices, Riccati's equation,
the motions that were simulated, and the worst acceleration history by superposition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import solve_discrete_are

from followed import DEFAULT, follow
from qpavoid.model.estimate import EstimatorSettings, Motion, VelocityEstimator

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


def steady_gains(settings, dt):
    """Return α and β/T by moving one of two settled obstacles by 1 m for one step."""
    estimator = VelocityEstimator(settings)
    steps = 30 + int(20 * math.sqrt(settings.noise / settings.acceleration) / dt)
    for step in range(steps):
        estimator.update(step * dt, [0], [[0.0, 0.0]])
    motion = estimator.update(steps * dt, [0], [[1.0, 0.0]])
    return motion.positions[0, 0], motion.velocities[0, 0]


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
@pytest.mark.parametrize("acceleration", [0.3, 1.0, 5.0])
def test_gains_become_those_of_riccati_and_of_the_tracking_index(dt, acceleration):
    settings = EstimatorSettings(acceleration=acceleration)
    alpha, gain = steady_gains(settings, dt)
    H, R = np.eye(2, 4), settings.noise**2 * np.eye(2)
    P = solve_discrete_are(transition(dt).T, H.T, disturbance(acceleration, dt), R)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    assert_allclose([alpha, gain], K[[0, 2], 0], rtol=1e-6)
    index, beta = acceleration * dt**2 / settings.noise, gain * dt
    assert beta == pytest.approx(index * math.sqrt(1 - alpha), rel=1e-6)
    assert alpha == pytest.approx(math.sqrt(2 * beta + beta**2 / 12) - beta / 2)


def test_first_sight_is_at_rest_and_says_so():
    motion = VelocityEstimator().update(5.0, ["a", "b"], [[1, 2], [3, 4]])
    assert isinstance(motion, Motion)
    assert_array_equal(motion.positions, [[1, 2], [3, 4]])
    assert_array_equal(motion.velocities, np.zeros((2, 2)))
    assert_allclose(motion.uncertainty, DEFAULT.speed)


@RATES
@pytest.mark.parametrize("acceleration", [0.5, 1.0, 2.0])
def test_lag_behind_a_constant_acceleration(dt, acceleration):
    settings = EstimatorSettings(acceleration=acceleration)
    alpha, gain = steady_gains(settings, dt)
    rate = math.sqrt(settings.noise / acceleration)
    times = np.arange(30 + int(20 * rate / dt)) * dt
    positions = np.zeros((len(times), 1, 2))
    positions[:, 0, 1] = acceleration * times**2 / 2
    places, velocities, off = follow(settings, times, positions)
    lag = acceleration * times[-1] - velocities[-1, 0, 1]
    exact = acceleration * dt * (alpha / (gain * dt) - 0.5)
    assert lag == pytest.approx(exact, rel=1e-5)
    assert lag < off[-1, 0]
    assert dt > rate or lag < math.sqrt(2 * acceleration * settings.noise)
    behind = positions[-1, 0, 1] - places[-1, 0, 1]
    assert behind == pytest.approx(settings.noise * math.sqrt(1 - alpha), rel=1e-5)


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


def wandering(rng, times, count, rate):
    """Positions and velocities under accelerations of size a that turn at random."""
    moments = np.diff(times, prepend=times[0])
    direction = rng.uniform(-math.pi, math.pi, count)
    speed = rng.uniform(0.0, DEFAULT.speed, count)
    v = np.stack([speed * np.cos(direction), speed * np.sin(direction)], axis=1)
    p = np.zeros((count, 2))
    for dt in moments:
        for _ in range(4):
            turn = rng.uniform(size=count) < rate * dt
            new = rng.uniform(-math.pi, math.pi, count)
            direction = np.where(turn, new, direction)
            push = np.stack([np.cos(direction), np.sin(direction)], axis=1)
            h = dt / 4
            p = p + h * v + DEFAULT.acceleration * push * h**2 / 2
            v = v + DEFAULT.acceleration * push * h
        yield p, v


@pytest.mark.parametrize("scale", [0.01, 0.05, 0.2, 0.5])
@pytest.mark.parametrize("factors", [(1.0,), (0.02, 0.5, 1.0, 3.0)])
def test_uncertainty_holds_for_turning_obstacles_and_noise(scale, factors):
    rng = np.random.default_rng(7)
    times = np.cumsum(scale * rng.choice(factors, 100))
    p, v = map(np.array, zip(*wandering(rng, times, 400, rate=2.0), strict=True))
    noisy = p + rng.normal(scale=DEFAULT.noise, size=p.shape)
    _, found, off = follow(EstimatorSettings(forget=100.0), times, noisy)
    held = np.abs(found - v) <= off[:, :, None]
    assert held.mean() > 0.995
    assert held.mean(axis=(1, 2)).min() > 0.97
