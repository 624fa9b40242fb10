"""A pedestrian taken out of a crowd, and a robot in its place."""

from pathlib import Path

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.worlds.crowd import (
    Crowd,
    Task,
    find_scene,
    read_tasks,
    read_tracks,
    task_document,
)
from scenario_files import walker


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


def test_absent_data_is_said(tmp_path, monkeypatch):
    with pytest.raises(DataError, match="obsmat.*ETH.seq_eth"):
        find_scene("eth", tmp_path)
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    with pytest.raises(DataError, match="--data"):
        find_scene("eth", None)


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
        ("0 1 0 0 0 0 0\n", "holds no rows of 4 or 8 columns"),
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
