"""A pedestrian taken out of a crowd, and a robot in its place."""

import numpy as np
import pytest

from qpavoid.datasets.obsmat import Pedestrian
from qpavoid.errors import DataError
from qpavoid.simulation.world import AWAY, Track, World
from qpavoid.study.sweep.crowd import Task, find_scene, read_tasks, task_document
from qpavoid.study.sweep.job import Job, run_job
from qpavoid.study.sweep.sources import Crowd


def walker(number, begin, start, end, seconds=8.0):
    times = begin + np.arange(0.0, seconds + 0.2, 0.4)
    part = ((times - begin) / seconds)[:, None]
    return Pedestrian(
        number, times, np.array(start) * (1 - part) + np.array(end) * part
    )


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


def test_who_is_not_there_yet_is_away():
    track = Track(
        np.array([1.0, 3.0]), np.array([[0.0, 0.0], [2.0, 0.0]]), 0.2, fleeting=True
    )
    world = World(tracks=(track,))
    assert not world.is_steady
    for time, x in ((0.9, AWAY), (1.0, 0.0), (2.0, 1.0), (3.0, 2.0), (3.1, AWAY)):
        assert world.at(time).discs[0, 0] == pytest.approx(x)
    np.testing.assert_array_equal(world.at(3.1).disc_velocities, np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("scene", "count"), [("eth", 318), ("hotel", 200), ("zara01", 142)]
)
def test_published_scenes_have_their_tasks(data_folder, scene, count):
    tasks = read_tasks(find_scene(scene, data_folder))
    assert len(tasks) == count
    ends = [np.hypot(*(t.human.positions[-1] - t.human.positions[0])) for t in tasks]
    assert min(ends) >= 6.0


def test_a_robot_takes_a_place(data_folder):
    folder = str(data_folder)
    job = Job("", Crowd("zara01", folder), 3, "{}", folder, "qp-ahead", "exact", "none")
    row, _ = run_job(job)
    assert row["error"] == "" and row["success"]
    assert row["min_moving_clearance_m"] >= row["min_clearance_m"] > 0.0


def test_absent_data_is_said(tmp_path, monkeypatch):
    with pytest.raises(DataError, match="eth: none of .*obsmat"):
        find_scene("eth", tmp_path)
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    with pytest.raises(DataError, match="--data"):
        find_scene("eth", None)
