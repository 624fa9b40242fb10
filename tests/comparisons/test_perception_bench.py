"""The bench of perception: its truth, its measures, and what it finds."""

import math

import numpy as np
import pytest

from perception_bench import EXACT, FAULTY, METHODS, SCENES, run, tracker
from perception_loops import KINDS, ROUND, drive
from perception_measures import measure
from perception_peer import circles
from perception_scenes import DRIFTS, large, record, walk_line
from qpavoid.lab.sensing.lidar import LidarSettings

LIDAR = LidarSettings(beams=180)


def test_a_mover_moves_as_its_truth_says():
    for mover in large("cart").movers:
        x, y, v_x, v_y, _ = mover.motion(mover.begins + 1.0)
        after = mover.motion(mover.begins + 1.1)
        assert np.hypot(after[0] - x - 0.1 * v_x, after[1] - y - 0.1 * v_y) < 1e-6


def test_a_walk_goes_to_and_fro_with_rests():
    path = walk_line((0.0, 0.0), (3.0, 4.0), 1.0)
    assert path(5.5)[:2] == path(6.5)[:2] == (3.0, 4.0)
    assert math.dist(path(8.0)[:2], (3.0, 4.0)) == pytest.approx(1.0)


def test_a_tracker_that_knows_the_truth_is_right_and_one_that_invents_is_not():
    made = record(SCENES["alone"](0), LIDAR)
    rows = iter(range(len(made.stamps)))

    def knows(time, odometry, ranges):
        known = made.truth[next(rows)][:, :4]
        return known[np.abs(known[:, 0]) < 100.0]

    right = measure(made, knows)
    assert right.known == right.to_know > 100
    assert right.false == 0 and max(right.speed_errors) < 1e-6
    wrong = measure(made, lambda *_: np.array([[1.0, -3.0, 0.5, 0.0]]))
    assert wrong.false > 0.8 * wrong.scans and wrong.known < 0.1 * wrong.to_know


def test_odometry_drifts_by_as_much_as_is_asked_for():
    made = record(SCENES["turning"](0), LIDAR, DRIFTS["4.3°/turn"])
    turned = made.poses[-1, 2] - made.poses[0, 2]
    off = made.odometry[-1, 2] - made.poses[-1, 2]
    assert math.degrees(off) == pytest.approx(4.3 * turned / (2 * math.pi), rel=0.3)


def test_a_walker_is_known_and_nothing_else_moves():
    found, peer = (run(("alone", EXACT, "none", 1, one)) for one in METHODS)
    assert found.known > 0.95 * found.to_know
    assert np.median(found.speed_errors) < 0.03
    assert 0.6 * peer.to_know < peer.known < found.known
    assert peer.false > 10 * found.false
    for lidar in (LIDAR, FAULTY):
        made = record(SCENES["turning"](0), lidar)
        assert measure(made, tracker(made)).false == 0


def test_the_faulty_sensor_loses_as_many_echoes_as_the_real_one():
    """A tenth to a sixth of all beams have an echo, and none in the next scan."""
    made = record(SCENES["furnished flat"](0), FAULTY)
    echo = np.isfinite(made.ranges)
    assert 0.1 < (echo[:-1] & ~echo[1:]).mean() < 0.17


def test_a_circle_is_about_the_triangle_on_its_segment():
    away = 3.0 + 1j * np.linspace(-0.15, 0.15, 9)
    (centre,) = circles(np.concatenate([[9.0 - 9j], away, [9.0 + 9j]]), 0.01)
    assert centre == pytest.approx(3.0 + 0.15 / math.sqrt(3.0))


@pytest.mark.long
def test_a_robot_among_walkers_arrives_by_perception():
    people = KINDS["walkers"](0)
    assert drive(people, "perception", ROUND, 0).success
