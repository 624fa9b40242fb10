"""Eq. 2 and 3 with the quintic time law, and the spline, against differences."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BPoly

from qpavoid.errors import InvalidInputError
from qpavoid.tracking.path import CubicPath, SplinePath

PAPER = CubicPath((0.0, 0.0, 0.0), (6.0, 3.0, 0.5), 5.0, 15.0)
poses = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))


def hermite(path):
    """Cubic by scipy's Bernstein polynomial, of ends and end derivatives."""
    ends = [
        [pose[:2], (path.k * math.cos(pose[2]), path.k * math.sin(pose[2]))]
        for pose in (path.start, path.goal)
    ]
    return BPoly.from_derivatives([0.0, 1.0], np.array(ends))


def quintic(tau):
    """Six boundary conditions determine the time law: oracle by a linear system."""
    powers = np.arange(6)
    rows = [
        np.where(powers == 0, 1.0, 0.0),
        np.where(powers == 1, 1.0, 0.0),
        np.where(powers == 2, 2.0, 0.0),
        np.ones(6),
        powers,
        powers * (powers - 1),
    ]
    coefficients = np.linalg.solve(np.array(rows, dtype=float), [0, 0, 0, 1, 0, 0])
    return np.polynomial.polynomial.polyval(tau, coefficients)


def test_curve_is_hermites_and_time_law_the_quintic():
    times = np.linspace(0, 15, 301)
    expected = hermite(PAPER)(quintic(times / 15))
    assert_allclose(PAPER.sample(times)[:, :2], expected, atol=1e-12)


def test_ends_are_the_poses_at_rest():
    for time, pose in ((0.0, PAPER.start), (15.0, PAPER.goal), (99.0, PAPER.goal)):
        assert_allclose(PAPER.sample(np.array([time]))[0], [*pose, 0, 0], atol=1e-12)
    assert_allclose(PAPER.sample(np.array([-1.0]))[0], [*PAPER.start, 0, 0], atol=0)


@given(poses, poses, st.floats(0.5, 6), st.floats(2, 20))
def test_speeds_are_the_derivatives(start, goal, k, duration):
    """v_r and ω_r against central differences of position and heading."""
    try:
        path = CubicPath(start, goal, k, duration)
    except InvalidInputError:
        assume(False)
    slopes = np.hypot(*hermite(path).derivative()(np.linspace(0, 1, 500)).T)
    assume(slopes.min() > 0.2 * k)
    h = 1e-5 * duration
    times = np.linspace(0, duration, 41)
    ahead, behind = path.sample(times + h), path.sample(times - h)
    rate = (ahead - behind) / (2 * h)
    reference = path.sample(times)
    turn = np.angle(np.exp(1j * (ahead[:, 2] - behind[:, 2]))) / (2 * h)
    scale = 1 + np.abs(reference[:, 3:]).max()
    speed = rate[:, 0] * np.cos(reference[:, 2]) + rate[:, 1] * np.sin(reference[:, 2])
    drift = rate[:, 1] * np.cos(reference[:, 2]) - rate[:, 0] * np.sin(reference[:, 2])
    assert_allclose(reference[:, 3], speed, atol=1e-5 * scale)
    assert_allclose(drift, 0.0, atol=1e-5 * scale)
    assert_allclose(reference[:, 4], turn, atol=1e-4 * scale)


def test_both_ends_where_the_speed_vanishes():
    """Speed and yaw rate go to zero like t², and the heading stays the tangent's."""
    for end, sign, heading in ((0.0, 1, 0.0), (15.0, -1, 0.5)):
        gaps = np.array([1e-2, 1e-3, 1e-4])
        near = PAPER.sample(end + sign * gaps)
        assert np.isfinite(near).all()
        assert_allclose(near[:, 2], heading, atol=1e-6)
        assert (near[:, 3] > 0).all()
        assert_allclose(near[1:, 3] / near[:-1, 3], 0.01, rtol=5e-3)
        assert_allclose(near[1:, 4] / near[:-1, 4], 0.01, rtol=5e-3)
        assert (near[:, 3] <= 30 * gaps**2 / 15**3 * PAPER.k * 1.01).all()


@pytest.mark.parametrize(
    ("start", "goal", "k"),
    [
        ((0, 0, 0), (0, 0, 0), 1.0),
        ((0, 0, 0), (1, 0, 0), 5.0),
        ((0, 0, math.pi / 4), (1, 1, math.pi / 4), 7.3),
        ((0, 0, 0), (1.5, 0, 0), 4.5),
    ],
    ids=["closed", "there and back", "there and back, turned", "just stops"],
)
def test_a_path_that_reverses_is_refused(start, goal, k):
    with pytest.raises(InvalidInputError, match="cusp"):
        CubicPath(start, goal, k, 10.0)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_cubic_wants_positive_numbers(bad):
    with pytest.raises(InvalidInputError):
        CubicPath((0, 0, 0), (1, 0, 0), bad, 1.0)
    with pytest.raises(InvalidInputError):
        CubicPath((0, 0, 0), (1, 0, 0), 1.0, bad)


WAY = np.array([[0, 0], [1, 0.2], [2, -0.3], [3, 0.5], [4, 0.4], [5, 1.5]], dtype=float)


def test_spline_keeps_its_limits_and_passes_near_the_points():
    path = SplinePath(WAY, 0.5, turn_rate=0.8, acceleration=0.4, smoothing=0.01)
    times = np.linspace(0, path.duration, 4001)
    reference = path.sample(times)
    x, y, heading, v, omega = reference.T
    assert_allclose(reference[[0, -1], 3], 0.0, atol=1e-12)
    assert v.min() >= 0 and v.max() <= 0.5 + 1e-12
    assert np.abs(omega).max() <= 0.8 + 1e-9
    assert np.abs(np.diff(v) / np.diff(times)).max() <= 0.4 * 1.01
    for point in WAY:
        assert np.hypot(x - point[0], y - point[1]).min() < 0.05
    assert np.hypot(*(reference[0, :2] - WAY[0])) < 0.05
    assert np.hypot(*(reference[-1, :2] - WAY[-1])) < 0.05
    assert np.abs(np.diff(heading)).max() < 0.01


def test_spline_speeds_are_the_derivatives():
    """Its table is linear between close points, hence the tolerances."""
    path = SplinePath(WAY, 0.5, acceleration=0.2)
    h = 0.02
    times = np.linspace(1.0, path.duration - 1.0, 500)
    rate = (path.sample(times + h) - path.sample(times - h)) / (2 * h)
    reference = path.sample(times)
    assert_allclose(reference[:, 3], np.hypot(rate[:, 0], rate[:, 1]), atol=0.015)
    assert_allclose(reference[:, 4], rate[:, 2], atol=0.05)
    times = np.linspace(0.0, path.duration, 5001)
    x, y, _, v, _ = path.sample(times).T
    driven = np.cumsum(v[1:] * np.diff(times))
    assert_allclose(driven, np.cumsum(np.hypot(np.diff(x), np.diff(y))), atol=0.015)


@pytest.mark.parametrize(
    "settings",
    [
        {"speed": 0.0},
        {"turn_rate": -1.0},
        {"acceleration": 0.0},
        {"smoothing": -0.1},
        {"points": WAY[:1]},
        {"points": np.zeros((9, 2))},
        {"speed": math.nan},
        {"points": np.full((5, 2), math.nan)},
        {"points": np.zeros((5, 3))},
    ],
)
def test_spline_refuses_what_makes_no_path(settings):
    with pytest.raises(InvalidInputError):
        SplinePath(**{"points": WAY, "speed": 0.5, **settings})


@pytest.mark.parametrize(
    "points, smoothing",
    [([(1e15, 0.0), (1e15 + 1.0, 0.0)], 0.02), ([(0, 0), (1, 0)], 1e200)],
)
def test_what_has_no_spline(points, smoothing):
    with pytest.raises(InvalidInputError, match="no spline"):
        SplinePath(np.array(points, float), 1.0, smoothing=smoothing)


def test_a_rough_polyline_of_many_points_is_followed_closely():
    """The search for the fewest knots took five seconds."""
    rng = np.random.default_rng(0)
    along = np.cumsum(rng.normal(0.0, 0.05, 10_000))
    steps = 0.15 * np.column_stack([np.cos(along), np.sin(along)])
    points = np.cumsum(steps, axis=0) + rng.normal(0.0, 0.02, steps.shape)
    path = SplinePath(points, 0.5)
    rows = path.sample(np.arange(0.0, path.duration, 1.0))
    off = shapely.LineString(points).distance(shapely.points(rows[:, :2]))
    assert off.max() < 0.1 and rows[:, 3].max() <= 0.5 and path.sample([1e9])[0, 3] == 0
