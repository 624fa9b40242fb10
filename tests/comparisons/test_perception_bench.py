"""The bench of perception and the recorded scans: truth, measures, results."""

import math

import numpy as np
import pytest

import perception_real
from perception_bench import EXACT, FAULTY, measure, run, tracker
from perception_loops import KINDS, ROUND, drive
from perception_real import cars
from perception_scenes import DRIFTS, SCENES, record
from qpavoid.lab.sensing.lidar import LidarSettings

LIDAR = LidarSettings(beams=180)


def test_a_tracker_that_knows_the_truth_is_right_and_one_that_invents_is_not():
    made = record(SCENES["alone"](0), LIDAR)
    rows = iter(range(len(made.stamps)))

    def knows(time, odometry, ranges):
        known = made.truth[next(rows)]
        return known[np.isfinite(known[:, 0])]

    right = measure(made, knows)
    assert all(right["right"]) and len(right["right"]) > 100
    assert not any(right["false"]) and max(right["speed_errors"]) < 1e-6
    wrong = measure(made, lambda *_: np.array([[1.0, -3.0, 0.5, 0.0]]))
    assert np.mean(wrong["false"]) > 0.8 and np.mean(wrong["right"]) < 0.1


def test_odometry_drifts_by_as_much_as_is_asked_for():
    made = record(SCENES["turning"](0), LIDAR, DRIFTS["4.3°/turn"])
    turned = made.poses[-1, 2] - made.poses[0, 2]
    off = made.odometry[-1, 2] - made.poses[-1, 2]
    assert math.degrees(off) == pytest.approx(4.3 * turned / (2 * math.pi), rel=0.3)


def test_a_walker_is_known_and_nothing_else_moves():
    found = run(("alone", EXACT, "none", 1))
    assert np.mean(found["right"]) > 0.95
    assert np.median(found["speed_errors"]) < 0.03
    for lidar in (LIDAR, FAULTY):
        made = record(SCENES["turning"](0), lidar)
        assert not any(measure(made, tracker(made))["false"])


def test_the_faulty_sensor_loses_as_many_echoes_as_the_real_one():
    """A tenth to a sixth of all beams have an echo, and none in the next scan."""
    made = record(SCENES["furnished flat"](0), FAULTY)
    echo = np.isfinite(made.ranges)
    assert 0.1 < (echo[:-1] & ~echo[1:]).mean() < 0.17


def test_the_cars_of_the_recordings_are_right_and_their_walls_at_rest(
    data_folder, monkeypatch
):
    pytest.importorskip("rosbags", reason="needs qpavoid[bags]")
    if not (data_folder / "scans").is_dir():
        pytest.skip("no scans")
    monkeypatch.setattr(
        perception_real, "DRIFTS", {"none": perception_real.DRIFTS["none"]}
    )
    rows = [one for one in cars(data_folder) if "setting" in one]
    assert [one["setting"] for one in rows] == ["default", "cars"]
    for row in rows:
        assert row["false_near_percent"] <= 1.0 and row["false_percent"] <= 5.0
        assert row["right"] >= 0.9 and row["right_of"] > 500
        assert row["speed_errors_median"] <= 0.11 and row["speed_errors_p90"] <= 0.3


@pytest.mark.long
def test_a_robot_among_walkers_arrives_by_perception():
    people = KINDS["walkers"](0)
    assert drive(people, "perception", ROUND, 0)["success"]
