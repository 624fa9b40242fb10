"""Perception on recorded scans: truth, faults of recordings, tracks without a body."""

import math

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="needs qpavoid[bags]")

import perception_real
from perception_real import AT_REST, Seen, cars, frozen, lone, seen_at_rest
from qpavoid.lab.study.calibrate import Recording


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
