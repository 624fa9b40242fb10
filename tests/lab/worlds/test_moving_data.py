"""Pedestrians and DynaBARN: published files, damage, and a robot in a human's place."""

import json

# Pedestrians
from pathlib import Path

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.worlds import crowd, dynabarn
from qpavoid.lab.worlds.crowd import (
    Crowd,
    Task,
    find_scene,
    read_tasks,
    read_tracks,
    task_document,
)
from scenario_files import walker


@pytest.mark.parametrize(
    "name, tracks, tasks",
    [
        ("ETH/seq_eth", 360, 318),
        ("ETH/seq_hotel", 390, 200),
        ("UCY/zara01", 148, 142),
    ],
)
def test_published_pedestrians(data_folder, name, tracks, tasks):
    fps = crowd.SET_FPS[name.split("/")[1]]
    read = crowd.read_tracks(data_folder / "opentraj" / name / "obsmat.txt", fps)
    assert len(read) == tracks
    assert [x.number for x in read] == sorted({x.number for x in read})
    steps = np.concatenate([np.diff(x.times) for x in read])
    assert steps == pytest.approx(0.4)
    paces = [np.hypot(*np.diff(x.positions, axis=0).T) / 0.4 for x in read]
    assert 1.0 < np.median(np.concatenate(paces)) < 1.6  # people walk
    far = [np.hypot(*(x.positions[-1] - x.positions[0])) >= 6 for x in read]
    long = [len(x.times) >= 10 for x in read]
    assert np.logical_and(far, long).sum() == tasks


def test_tracks_are_sorted_and_the_height_is_passed_over(tmp_path):
    file = tmp_path / "obsmat.txt"
    file.write_text("6 2 3 9 4 0 0 0\n\n0 2 1 9 2 0 0 0\n3 1 5 9 6 0 0 0\n")
    first, second = crowd.read_tracks(file, 15.0)
    assert first.number == 1 and first.positions.tolist() == [[5, 6]]
    assert second.times.tolist() == [0.0, 0.4]
    assert second.positions.tolist() == [[1, 2], [3, 4]]


def test_four_columns_are_frame_id_and_place(tmp_path):
    file = tmp_path / "trajnet.txt"
    file.write_text("0\t2.0\t1\t2\n10\t2.0\t3\t-4.5\n")
    (walker,) = crowd.read_tracks(file, 25.0)
    assert walker.number == 2 and walker.times.tolist() == [0.0, 0.4]
    assert walker.positions.tolist() == [[1, 2], [3, -4.5]]


# DynaBARN


@pytest.mark.long
def test_published_dynabarn(data_folder):
    file = data_folder / "dynabarn" / "dynabarn.json"
    worlds = [dynabarn.read_world(file, n) for n in range(60)]
    assert {len(x.cylinders) for x in worlds} == {*range(5, 12), *range(13, 25)}
    published = json.loads(file.read_text())["worlds"].values()
    distinct = {json.dumps(frame) for frames in published for frame in frames}
    open_ = [json.loads(x) for x in distinct]
    open_ = [x for x in open_ if (x["x"][0], x["y"][0]) != (x["x"][-1], x["y"][-1])]
    assert (len(distinct), len(open_)) == (469, 438)
    jumps = sum(np.isfinite(c.jump) for x in worlds for c in x.cylinders)
    assert jumps == sum(frame in open_ for frames in published for frame in frames)
    for world in worlds:
        assert world.duration == min([100.0, *(c.jump for c in world.cylinders)])
        assert world.start == (11.0, 0.0, 3.14) and world.goal == (-9.0, 0.0)
    for world in [
        *worlds,
        *(dynabarn.read_world(file, n, "reverse") for n in range(60)),
    ]:
        for times, positions, _ in world.cylinders:
            assert times[0] == 0.0 and times[-1] >= world.duration
            paces = np.hypot(*np.diff(positions, axis=0).T) / np.diff(times)
            assert paces.max() < 1.96, "no cylinder jumps while an episode lasts"


TO_AND_FRO = {
    "timeout_s": 7.0,
    "robot_start": [0, 0, 0],
    "robot_goal": [1, 0],
    "goal_radius": 1.0,
    "obstacle_radius": 0.5,
    "walls": [{"center": [1, 2], "size": [4, 2]}],
    "worlds": {
        "3": [
            {"t": [0, 1, 3], "x": [0, 1, 2], "y": [0, 0, 0], "period": 3},
            {"t": [0, 0.5, 2], "x": [0, 1, 0], "y": [0, 0, 0], "period": 2},
        ]
    },
}


def test_an_episode_ends_at_the_first_jump_or_goes_back(tmp_path):
    file = tmp_path / "dynabarn.json"
    file.write_text(json.dumps(TO_AND_FRO))
    world = dynabarn.read_world(file, 3)
    assert world.duration == 3.0
    assert world.cylinders[1].times.tolist() == [0, 0.5, 2, 2.5, 4]
    assert world.walls.tolist() == [
        [-1, 1, 3, 1],
        [3, 1, 3, 3],
        [3, 3, -1, 3],
        [-1, 3, -1, 1],
    ]
    world = dynabarn.read_world(file, 3, "reverse")
    assert world.duration == 7.0
    times, positions, jump = world.cylinders[0]
    assert times.tolist() == [0, 1, 3, 5, 6, 7, 9] and jump == 3.0
    assert positions[:, 0].tolist() == [0, 1, 2, 1, 0, 1, 2]


def test_a_phase_shifts_the_clock_by_thirds_to_the_first_jump(tmp_path):
    frame = {"t": [0, 12], "x": [1, 1], "y": [3, -3], "period": 12}
    document = TO_AND_FRO | {"timeout_s": 20.0, "worlds": {"0": [frame]}}
    (tmp_path / "dynabarn.json").write_text(json.dumps(document))
    data = str(tmp_path)
    source, sixths = (
        dynabarn.DynaBarn("reverse", 1.0, data, **more) for more in ({}, {"phases": 6})
    )
    assert source.identity(None) != sixths.identity(None)
    for phase, y in ((0, 3.0), (1, 1.0), (2, -1.0)):
        assert source.sample(phase) == sixths.sample(2 * phase)
        scene = make_scenario(source.sample(phase), source.name, Path("x"), data)
        seen = scene.world.at(0.0)
        np.testing.assert_allclose(seen.discs, [[1.0, y, 0.5]], atol=1e-12)
        np.testing.assert_allclose(seen.disc_velocities, [[0.0, -0.5]])
        assert scene.duration == 20.0 - 4.0 * phase and len(scene.world.walls) == 4
        back = scene.world.at(16.0 - 4.0 * phase)  # 4 s after the jump
        np.testing.assert_allclose(back.discs[0, :2], [1.0, -1.0], atol=1e-12)
        assert scene.path.sample(np.array([99.0]))[0, :2] == pytest.approx((1.0, 0.0))


@pytest.mark.parametrize(
    "change, error",
    [
        ({"t": [0, 2, 1]}, "worlds.3.0: Value error, times must increase"),
        ({"x": [0, 1]}, "worlds.3.0: .*t, x and y need the same"),
        ({"x": [0, 1, float("nan")]}, "worlds.3.0.x.2: Input should be a finite"),
        ({"period": 4}, "worlds.3.0: .*the last key frame is not at the period"),
        ({"t": [0], "x": [0], "y": [0]}, "worlds.3.0.t: List should have at least 2"),
        ({"t": [0, 0.5, 1e-300], "period": 1e-300}, "times must increase"),
        ({"t": [0, 1e-301, 1e-300], "period": 1e-300}, "key frames"),
        ({"timeout_s": 1e12}, "e.12 key frames"),
        ({"timeout_s": float("inf")}, "timeout_s: Input should be a finite"),
    ],
)
def test_damaged_key_frames(tmp_path, change, error):
    """Of a frame or of the file; some worlds would have frames without end."""
    file, frame = tmp_path / "dynabarn.json", TO_AND_FRO["worlds"]["3"][0] | change
    document = TO_AND_FRO | change | {"worlds": {"3": [frame]}}
    file.write_text(json.dumps(document))
    with pytest.raises(DataError, match=error):
        dynabarn.read_world(file, 3, "reverse")


@pytest.fixture
def task():
    human = walker(1, 100.0, (0.0, 0.0), (8.0, 0.0))
    crossing = walker(2, 100.0, (4.0, -4.0), (4.0, 4.0))
    gone = walker(3, 20.0, (1.0, 0.0), (1.0, 8.0))
    return Task(human, (crossing, gone))


def test_a_task_starts_and_ends_as_the_human_did(task):
    document = task_document(task)
    assert task.time == pytest.approx(8.0) and task.length == pytest.approx(8.0)
    assert document["start"] == {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0}
    assert document["reference"]["points_m"][1] == pytest.approx([8.0, 0.0])
    assert document["duration_s"] == pytest.approx(24.0)
    (other,) = document["obstacles"]  # the one who has gone is not there
    assert other["times_s"][0] == pytest.approx(0.0) and other["fleeting"]
    scenario = make_scenario(document, "task", Path("task"))
    assert scenario.settings.passive and scenario.settled == 0.0


def test_a_robot_takes_a_place(data_folder):
    folder = str(data_folder)
    job = Job("", Crowd("zara01", folder), 3, "{}", folder, "qp-ahead", "exact", "none")
    row, _ = run_job(job)
    assert row["error"] == "" and row["success"]
    assert row["start_clearance_m"] >= row["min_clearance_m"] > 0.0
    assert row["contacts_moving"] == 0.0
    assert row["arrived_s"] < row["time_s"] + 0.05 < row["arrived_s"] + 0.11
    way = np.diff(read_tasks(find_scene("zara01", folder))[3].human.positions, axis=0)
    assert 0.8 < row["length_m"] / np.hypot(*way.T).sum() < 1.2


@pytest.mark.parametrize(
    ("find", "said"),
    [
        (lambda data: find_scene("eth", data), "obsmat.*ETH.seq_eth"),
        (dynabarn.find_worlds, r"dynabarn\.json is in none of"),
    ],
)
def test_absent_data_is_said(tmp_path, monkeypatch, find, said):
    with pytest.raises(DataError, match=said):
        find(tmp_path)
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    with pytest.raises(DataError, match="--data"):
        find(None)


def test_an_id_that_is_used_again_is_somebody_else(tmp_path):
    """Regression: two people with one id were read as one track of 400 s."""
    lines = [f"{k} 1 {0.4 * k} 0" for k in (*range(20), *range(1000, 1020))]
    file = tmp_path / "a.txt"
    file.write_text("\n".join(lines))
    people = read_tracks(file, 2.5)
    assert [len(person.times) for person in people] == [20, 20]
    assert {person.number for person in people} == {1}
    assert len(read_tracks(file, 100.0)) == 1


def walk(step, places):
    """Return who walks along x, and from 0 to 1 and back along y or z."""
    rows = [f"{k} 1 {step * k} {places.format(y=k % 2)} 0 0 0\n" for k in range(20)]
    return "".join(rows)


def straight(lost):
    """Return who walks along x at 1 m/s, but for one sample."""
    places = {k: 0.4 * k for k in range(21)} | dict([lost])
    return "".join(f"{10 * k} 1 {x} 0 0 0 0 0\n" for k, x in places.items())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "not a readable track file"),
        ("0 1 0 0 0 0 0 0\n0 1 1 0 0 0 0 0", "row 2: an id is at one frame twice"),
        ("0 1 nan 0 0 0 0 0", "row 1: a number is not finite"),
        ("0 1 0 0 0 0 0", "holds no rows of 4 or 8 columns"),
        ("0 1 0 0 0 0 0 0\n9 1 0 0", "the number of columns changed from 8 to 4"),
        ("0 1 0 0 0 0 0 x", "could not convert"),
        ("0 1.5 0 0 0 0 0 0", "row 1: the id is not a whole number"),
        ("\n", "holds no rows"),
        ("0 1 0 0 0 0 0 0\n", "no track has 10 samples and 6 m between its ends"),
        (walk(0.4, "{y} 0"), "only heights change: are y and z exchanged?"),
        (walk(4.0, "0 {y}"), "people walk at 103 m/s: are their places in m"),
        (straight(lost=(15, 0.0)), "id 1 jumps at 5.6 s at 14 m/s"),
        (straight(lost=(15, 1e300)), "row 16: the place is nowhere"),
    ],
)
def test_a_file_without_tracks_is_refused(text, said, tmp_path):
    file = tmp_path / "seq_hotel" / "obsmat.txt"
    file.parent.mkdir()
    if text:
        file.write_text(text)
    with pytest.raises(DataError) as error:
        read_tasks(file)
    assert said in str(error.value) and str(file) in str(error.value)
