"""Discs found again in the points of a scan, and followed."""

import itertools
import math

import numpy as np
import pytest

from qpavoid.errors import InvalidInputError
from qpavoid.lab.sensing.clusters import (
    ClusterSettings,
    ClusterTracker,
    cluster,
    enclosing_disc,
)
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.worlds.crowd import read_tracks
from qpavoid.lab.worlds.map_server import to_world
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles


@pytest.mark.parametrize("seed", range(20))
def test_the_smallest_enclosing_disc(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(1, 12), 2))
    if seed % 4 == 0:
        points = np.round(points)  # on lines, and twice
    x, y, radius = enclosing_disc(points)
    assert np.hypot(*(points - (x, y)).T).max() <= radius * (1 + 1e-8) + 1e-11
    least = min(
        reach
        for size in (1, 2, 3)
        for some in itertools.combinations(points, size)
        if (reach := reach_from(points, centre_of(some))) is not None
    )
    assert radius == pytest.approx(least, abs=1e-9)


def centre_of(some):
    """Return the point as far from each of up to three points, on their plane."""
    first, rest = some[0], np.array(some[1:]).reshape(-1, 2) - some[0]
    gram = rest @ rest.T
    if len(rest) == 2 and abs(np.linalg.det(gram)) < 1e-12:
        return None
    if len(rest) and not gram.any():
        return first
    share = np.linalg.lstsq(2 * gram, np.diag(gram), rcond=None)[0]
    return first + share @ rest


def reach_from(points, centre):
    return None if centre is None else np.hypot(*(points - centre).T).max()


def test_clusters_are_what_hangs_together():
    rng = np.random.default_rng(5)
    points = rng.uniform(0, 6, (120, 2))
    labels = cluster(points, 0.4)
    near = np.hypot(*(points[:, None] - points).transpose(2, 0, 1)) <= 0.4
    assert (labels[:, None] == labels)[near].all()
    reached = near
    while (further := reached @ reached).sum() > reached.sum():
        reached = further
    assert ((labels[:, None] == labels) == reached).all()
    assert not len(cluster(np.empty((0, 2)), 0.4))


def test_a_walker_is_found_and_followed():
    lidar = Lidar(LidarSettings(beams=720, noise=0.01, seed=4))
    tracker = ClusterTracker()
    pose = (0.0, 0.0, 0.0)
    walls = [(-5.0, 4.0, 6.0, 4.0)]
    speeds = []
    for k in range(61):
        time = 0.05 * k
        walkers = [(3.0 - 0.8 * time, 1.0, 0.25), (2.0, -3.0 + 1.0 * time, 0.25)]
        world = Obstacles(discs=walkers, walls=walls)
        points = lidar.scan(pose, time, world)
        found = tracker.update(lidar.taken, to_world(points, pose))
        if time > 1.0 and lidar.taken == pytest.approx(time):
            for walker, velocity in zip(walkers, ([-0.8, 0], [0, 1.0]), strict=True):
                apart = np.hypot(*(found.discs[:, :2] - walker[:2]).T)
                nearest = int(np.argmin(apart))
                assert apart[nearest] < 0.15
                assert found.discs[nearest, 2] == pytest.approx(0.25, abs=0.06)
                speeds.append(np.hypot(*(found.disc_velocities[nearest] - velocity)))
        pose = arc(*pose, 0.3, 0.2, 0.05)
    assert found.points[:, 1] == pytest.approx(4.0, abs=0.06)  # the wall
    assert len(found.discs) == 2
    assert np.median(speeds) < 0.15 and np.max(speeds) < 0.5


def test_pedestrians_of_zara_are_seen_to_walk(data_folder):
    tracks = read_tracks(data_folder / "opentraj/UCY/zara01/obsmat.txt", 25.0)
    lidar = Lidar(LidarSettings(beams=720, range=8.0, noise=0.01))
    tracker, pose, seen, errors = ClusterTracker(), (-2.0, 12.0, 0.0), 0, []
    for time in np.arange(1.0, 60.0, 0.1):
        here = [x for x in tracks if x.times[0] < time < x.times[-1] - 0.1]
        places = np.array([place(x, time) for x in here])
        steps = (np.array([place(x, time + 0.1) for x in here]) - places) / 0.1
        world = Obstacles(discs=np.column_stack([places, np.full(len(here), 0.25)]))
        points = lidar.scan(pose, time, world)
        found = tracker.update(lidar.taken, to_world(points, pose))
        for where, velocity in zip(places, steps, strict=True):
            if time < 3.0 or np.hypot(*(where - pose[:2])) > 6.0:
                continue
            seen += 1
            apart = np.hypot(*(found.discs[:, :2] - where).T)
            if apart.min(initial=9.0) < 0.3:  # else hidden, or one of a group
                off = found.disc_velocities[np.argmin(apart)] - velocity
                errors.append(np.hypot(*off))
    assert seen > 500 and len(errors) > 0.8 * seen
    assert np.median(errors) < 0.2


def place(track, time):
    return [np.interp(time, track.times, track.positions[:, i]) for i in (0, 1)]


def square(x, y):
    return np.array([(x, y), (x + 0.1, y), (x, y + 0.1), (x + 0.1, y + 0.1)])


def test_what_is_large_stays_points():
    side = np.linspace(0.0, 1.1, 12)
    bars = [np.column_stack([side, 0 * side]), np.column_stack([0 * side, side])]
    corner = np.vstack(bars)  # fits a square of 1.2 m, but no disc of that width
    found = ClusterTracker().update(0.0, np.vstack([corner, square(5, 5)]))
    assert len(found.discs) == 1 and len(found.points) == 24


def test_who_is_out_of_reach_or_forgotten_is_new():
    tracker = ClusterTracker(ClusterSettings(reach=0.5))
    tracker.update(0.0, square(0, 0))
    moved = tracker.update(0.1, square(0.05, 0))
    assert moved.disc_velocities[0, 0] > 0.01
    again = tracker.update(0.1, square(0.05, 0))
    assert (again.disc_velocities == moved.disc_velocities).all()
    far = tracker.update(0.2, square(3, 0))
    assert not far.disc_velocities.any()
    assert not len(tracker.update(0.3, np.empty((0, 2))))
    late = tracker.update(9.0, square(3, 0))
    assert not late.disc_velocities.any()


def test_two_that_pass_each_other_keep_their_velocities():
    tracker = ClusterTracker()
    for k in range(40):
        time = 0.05 * k
        points = np.vstack([square(time - 1, 0), square(1 - time, 0.45)])
        order = np.random.default_rng(k).permutation(len(points))
        found = tracker.update(time, points[order])
    by_height = found.disc_velocities[np.argsort(found.discs[:, 1])]
    assert by_height == pytest.approx(np.array([(1, 0), (-1, 0)]), abs=0.1)


def test_what_is_wrong_with_a_scan():
    with pytest.raises(InvalidInputError, match="not finite"):
        ClusterTracker().update(0.0, np.array([(math.nan, 0.0)]))
    with pytest.raises(InvalidInputError, match="clusters needs gap > 0"):
        ClusterSettings(gap=0.0)
