"""Rays against oracles, and the sensor's clock, noise and errors."""

import math

import numpy as np
import pytest

from qpavoid.errors import InvalidInputError
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles

EMPTY = Obstacles()


def directions(settings, pose):
    n, view = settings.beams, settings.field_of_view
    angles = pose[2] + settings.mount[2] + view * ((np.arange(n) + 0.5) / n - 0.5)
    return np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("seed", range(12))
def test_ranges_solve_the_equations_of_rays_with_walls_and_discs(seed):
    """Linear equations of open walls, quadratic ones of discs; 0 within a disc."""
    rng = np.random.default_rng(seed)
    walls, place = rng.uniform(-5, 5, (20, 4)), np.array([0.1, 0.2])
    discs = np.column_stack([rng.uniform(-6, 6, (8, 2)), rng.uniform(0.05, 0.8, 8)])
    settings, pose = LidarSettings(beams=60, range=8.0), (*place, 0.3)
    ranges = Lidar(settings).ranges(pose, Obstacles(discs=discs, walls=walls))
    expected = np.full(60, 8.0)
    for k, direction in enumerate(directions(settings, pose)):
        for wall in walls:
            system = np.column_stack([direction, wall[:2] - wall[2:]])
            length, share = np.linalg.solve(system, wall[:2] - place)
            if length >= 0 and 0 <= share <= 1:
                expected[k] = min(expected[k], length)
        for x, y, radius in discs:
            to = np.array([x, y]) - place
            near, far = np.sort_complex(
                np.roots([1.0, -2.0 * direction @ to, to @ to - radius**2])
            )
            if near.imag == 0.0 and far.real > 0.0:
                expected[k] = min(expected[k], max(near.real, 0.0))
    assert ranges == pytest.approx(expected, abs=1e-9)


def test_special_cases_of_rays():
    one = Lidar(LidarSettings(beams=1, field_of_view=0.1))
    pose = (0.0, 0.0, 0.0)

    def seen(**obstacles):
        return one.ranges(pose, Obstacles(**obstacles))[0]

    assert seen() == 10.0
    assert seen(discs=[(3, 0, 1)]) == pytest.approx(2)
    assert seen(discs=[(-3, 0, 1)]) == 10.0  # behind
    assert seen(discs=[(0.5, 0, 1)]) == 0.0  # within
    assert seen(discs=[(0, 0, 0)]) == 0.0
    assert seen(walls=[(2, 0, 5, 0)]) == 2.0  # along the beam
    assert seen(walls=[(5, 0, 2, 0)]) == 2.0
    assert seen(walls=[(-2, 0, 5, 0)]) == 0.0
    assert seen(walls=[(-2, 0, -5, 0)]) == 10.0
    assert seen(walls=[(2, 0, 2, 5)]) == 2.0  # its end
    assert seen(walls=[(2, -1, 2, -5)]) == 10.0
    assert seen(walls=[(-2, -1, -2, 1)]) == 10.0
    assert seen(points=[(2, 0.01)]) == pytest.approx(2 - math.sqrt(0.02**2 - 0.01**2))
    assert seen(discs=[(20, 0, 1)]) == 10.0


def test_points_are_in_the_robot_frame_wherever_the_sensor_is():
    settings = LidarSettings(math.pi, 91, noise=0.0, mount=(0.3, -0.1, 1.0))
    pose = (1.0, 2.0, 2.5)
    points = Lidar(settings).scan(pose, 0.0, Obstacles(discs=[(-1.0, 4.0, 0.5)]))
    assert len(points) > 10
    disc = Obstacles(discs=[(-1.0, 4.0, 0.5)]).seen_from(pose).discs[0]
    assert np.hypot(*(points - disc[:2]).T) == pytest.approx(0.5)
    assert np.arctan2(*(points - (0.3, -0.1)).T[::-1]).min() > 1.0 - math.pi / 2


def test_rate_and_latency():
    lidar = Lidar(LidarSettings(rate=10.0, latency=0.15, noise=0.0))
    taken = []
    pose = (0.0, 0.0, 0.0)
    for k in range(41):
        time = 0.02 * k
        wall = Obstacles(walls=[(3.0 + time, -9.0, 3.0 + time, 9.0)])
        points = lidar.scan(pose, time, wall)
        assert points[:, 0] == pytest.approx(3.0 + lidar.taken)
        taken.append(lidar.taken)
        pose = arc(*pose, 0.0, 1.0, 0.0)
    for k, time in enumerate(taken):
        due = math.floor((0.02 * k - 0.15) * 10 + 1e-6) / 10
        assert time == pytest.approx(max(due, 0.0))


def test_an_old_scan_moves_with_the_robot():
    lidar = Lidar(LidarSettings(rate=1.0, noise=0.0))
    post = Obstacles(discs=[(2.0, 1.0, 0.1)])
    lidar.scan((0.0, 0.0, 0.0), 0.0, post)
    pose = arc(0.0, 0.0, 0.0, 0.5, 1.0, 0.9)
    late = lidar.scan(pose, 0.9, EMPTY)
    centre = post.seen_from(pose).discs[0, :2]
    assert np.hypot(*(late - centre).T) == pytest.approx(0.1)
    assert not len(lidar.scan(pose, 1.0, EMPTY))


def test_noise_and_dropouts_are_seeded():
    def scan(noise=0.0, **changes):
        lidar = Lidar(LidarSettings(beams=20_000, noise=noise, **changes))
        return lidar.scan((0.0, 0.0, 0.0), 0.0, Obstacles(discs=[(5, 0, 1)]))

    clean = scan()
    noisy = scan(noise=0.05, seed=1)
    assert (scan(noise=0.05, seed=1) == noisy).all()
    assert (scan(noise=0.05, seed=2) != noisy).any()
    errors = np.hypot(*noisy.T) - np.hypot(*clean.T)
    assert np.std(errors) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(errors)) < 0.005
    assert len(scan(dropout=0.3)) == pytest.approx(0.7 * len(clean), rel=0.05)
    assert not len(scan(dropout=1.0))


def test_echoes_fade_with_range_and_incidence():
    wall = Obstacles(walls=[(1.0, -99.0, 1.0, 99.0)])
    settings = LidarSettings(beams=4000, range=10.0, noise=0.0, fade=0.5)
    many = Lidar(settings)
    scans = np.array([many.measure(lambda _: ((0, 0, 0), wall)) for _ in range(100)])
    exact = many.ranges((0.0, 0.0, 0.0), wall)
    lost = 1.0 - np.isfinite(scans).mean(axis=0)[exact < 9.0]
    # r = 1 m / cos ι: the exponent is fade · r² / range, r in m.
    expected = 1.0 - np.exp(-0.5 * exact[exact < 9.0] ** 2 / 10.0)
    assert np.abs(lost - expected).max() < 0.25
    assert np.abs(lost - expected).mean() < 0.05


@pytest.mark.parametrize("sweep", [0.1, -0.1])
def test_beams_of_a_sweep_see_where_robot_and_walls_were(sweep):
    """A wall that comes nearer, before a robot that turns; 8 slices of the sweep."""
    settings = LidarSettings(2.0, 160, rate=5.0, noise=0.0, sweep=sweep, delay=0.03)
    lidar = Lidar(settings)
    for k in range(3):
        time = 0.2 * k
        place = 4.0 - 0.5 * time
        wall = Obstacles(
            walls=[(place, -90.0, place, 90.0)], wall_velocities=[(-0.5, 0.0)]
        )
        lidar.scan((0.0, 0.0, 1.0 * time), time, wall)
    assert lidar.taken == pytest.approx(0.4 - 0.1 + 0.03)
    assert lidar.pose[2] == pytest.approx(lidar.taken)
    share = (np.arange(160) + 0.5) / 160
    times = 0.4 - 0.1 + 0.1 * (share if sweep > 0 else 1.0 - share)
    angles = 2.0 * (share - 0.5) + times
    expected = (4.0 - 0.5 * times) / np.cos(angles)
    seen = lidar.last < 8.0
    assert seen.sum() > 50
    assert lidar.last[seen] == pytest.approx(expected[seen], rel=0.03)


def test_time_does_not_run_backwards():
    lidar = Lidar()
    lidar.scan((0.0, 0.0, 0.0), 1.0, EMPTY)
    for time in (0.9, math.nan):
        with pytest.raises(InvalidInputError, match="time runs backwards"):
            lidar.scan((0.0, 0.0, 0.0), time, EMPTY)
