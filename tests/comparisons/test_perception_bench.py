"""The bench of perception and the recorded scans: truth, measures, results."""

import math

import numpy as np
import pytest

import perception_real
from perception_bench import EXACT, FAULTY, METHODS, SCENES, run, tracker
from perception_loops import KINDS, ROUND, drive
from perception_measures import measure
from perception_real import AT_REST, Seen, cars, frozen, lone, seen_at_rest
from perception_scenes import DRIFTS, record
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.study.calibrate import Recording

LIDAR = LidarSettings(beams=180)


def test_a_tracker_that_knows_the_truth_is_right_and_one_that_invents_is_not():
    made = record(SCENES["alone"](0), LIDAR)
    rows = iter(range(len(made.stamps)))

    def knows(time, odometry, ranges):
        known = made.truth[next(rows)]
        return known[np.isfinite(known[:, 0])]

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


def test_a_pose_that_stops_while_the_walls_come_nearer_is_faulty():
    times = np.arange(0.0, 5.0, 0.02)
    x = np.minimum(times, 3.0)
    poses = np.column_stack([times, x, 0.0 * x, 0.0 * x])
    stamps = times[::5]
    ranges = np.repeat((8.0 - 0.5 * stamps)[:, None], 30, axis=1)
    made = Recording(stamps, ranges, -1.0, 0.07, (0.1, 20.0), poses)
    assert frozen(made) == (
        "pose repeats for 2.0 s from 3.0 s on, echoes move by 0.80 m (median)"
    )
    poses[:, 1] = times
    assert frozen(made) == ""


def test_a_track_without_moving_echoes_is_lone():
    body, wall = np.array([2.0, 0.0, 1.0, 0.0]), np.array([7.0, 1.0, 0.5, 0.0])
    pose = np.zeros(3)
    seen = [Seen(0.1 * k, np.array([2.0 + 0.2j]), {1: body}, pose) for k in range(10)]
    assert lone(seen) == {"lone_tracks": 0, "false_near_percent": 0, "false_percent": 0}
    seen[3].tracks[2] = wall
    assert lone(seen)["false_percent"] == 10.0 and lone(seen)["false_near_percent"] == 0


def test_the_cars_of_the_recordings_are_right_and_their_walls_at_rest(
    data_folder, monkeypatch
):
    pytest.importorskip("rosbags", reason="needs qpavoid[bags]")
    if not (data_folder / "scans").is_dir():
        pytest.skip("no scans")
    monkeypatch.setattr(
        perception_real, "DRIFTS", {"none": perception_real.DRIFTS["none"]}
    )
    rows = list(cars(data_folder))
    (row,) = [one for one in rows if one.get("setting") == "cars"]
    assert row["false_near_percent"] <= 1.0 and row["false_percent"] <= 5.0
    assert row["right"] >= 0.9 and row["right_of"] > 500
    assert row["speed_errors_median"] <= 0.1 and row["speed_errors_p90"] <= 0.3
    notes = {one["recording"]: one.get("note", "") for one in rows}
    assert "pose repeats" in notes["overtake_ego"]
    assert "needs turns" in notes["intersection"]


def test_one_walker_is_one_track_of_two_scanners(data_folder):
    pytest.importorskip("rosbags", reason="needs qpavoid[bags]")
    path = data_folder / "scans" / "obstacle_detector" / "scans_demo.bag"
    if not path.is_file():
        pytest.skip("no scans")
    seen = seen_at_rest(path, AT_REST["obstacle_detector", "scans_demo"])
    tracks = perception_real.followed(seen)
    assert sum(np.ptp(one[:, 0]) > 2.0 for one in tracks.values()) == 1
    longest = max(tracks.values(), key=len)
    way = np.hypot(*np.diff(longest[:, 1:3], axis=0).T).sum()
    assert way > 8.0 and math.hypot(*longest[-1, 1:3]) < 2.0
    assert lone(seen)["lone_tracks"] == 0


@pytest.mark.long
def test_a_robot_among_walkers_arrives_by_perception():
    people = KINDS["walkers"](0)
    assert drive(people, "perception", ROUND, 0)["success"]
