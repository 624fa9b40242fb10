"""A pedestrian taken out of a crowd, and a robot in its place."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.simulation.batch import as_loop
from qpavoid.lab.simulation.scenario import load_scenario, make_scenario
from qpavoid.lab.simulation.world import AWAY, Track, World
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.worlds.crowd import (
    PERSON,
    Crowd,
    Pedestrian,
    Task,
    find_scene,
    own_clearance,
    read_tasks,
    task_document,
)


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
    scenario = make_scenario(document, "task", Path("task"))
    assert scenario.settings.passive and scenario.settled == 0.0


def test_others_may_come_in_before_the_record_shows_them(task):
    """The one who crosses at 1 m/s is there 2 s earlier, and 2 m farther away."""
    (other,) = task_document(task, seen_before=2.0)["obstacles"]
    assert other["times_s"][:2] == pytest.approx([-2.0, 0.0])
    assert other["positions_m"][0] == pytest.approx([4.0, -6.0])
    assert len(other["times_s"]) == len(other["positions_m"]) == 22


def test_own_clearance_is_that_of_a_fine_look(task):
    rng = np.random.default_rng(1)
    assert own_clearance(task) == pytest.approx(-2.0 * PERSON)  # they meet in (4, 0)
    assert own_clearance(Task(task.human, task.others[1:])) == math.inf
    for _ in range(20):
        begin, seconds = 100.0 + rng.uniform(-6.0, 6.0), rng.uniform(2.0, 9.0)
        other = walker(2, begin, *rng.uniform([0.0, -4.0], [8.0, 4.0], (2, 2)), seconds)
        other = other._replace(
            positions=other.positions + rng.normal(0.0, 0.2, other.positions.shape)
        )
        ends = [human.times[[0, -1]] for human in (task.human, other)]
        times = np.linspace(*np.clip(ends[0], *ends[1]), 2001)
        places = [
            [np.interp(times, who.times, axis) for axis in who.positions.T]
            for who in (task.human, other)
        ]
        least = np.hypot(*np.subtract(*places)).min() - 0.5
        assert own_clearance(Task(task.human, (other,))) == pytest.approx(
            least, abs=5e-3
        )


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
    ("scene", "count", "own"),
    [
        ("eth", 318, 39),
        ("hotel", 200, 26),
        ("zara01", 142, 30),
        ("students03", 105, 91),
    ],
)
def test_published_scenes_have_their_tasks(data_folder, scene, count, own):
    tasks = read_tasks(find_scene(scene, data_folder))
    assert len(tasks) == count
    assert sum(own_clearance(task) < 0.0 for task in tasks) == own
    ends = [np.hypot(*(t.human.positions[-1] - t.human.positions[0])) for t in tasks]
    assert min(ends) >= 6.0


def test_a_robot_takes_a_place(data_folder):
    folder = str(data_folder)
    job = Job("", Crowd("zara01", folder), 3, "{}", folder, "qp-ahead", "exact", "none")
    row, _ = run_job(job)
    assert row["error"] == "" and row["success"]
    assert row["min_moving_clearance_m"] >= row["min_clearance_m"] > 0.0
    assert row["arrived_s"] < row["time_s"] + 0.05 < row["arrived_s"] + 0.11
    way = np.diff(read_tasks(find_scene("zara01", folder))[3].human.positions, axis=0)
    assert 0.8 < row["length_m"] / np.hypot(*way.T).sum() < 1.2


def test_a_run_that_ends_at_once_is_no_batch():
    scenario = load_scenario("paper/test_case_1")
    assert as_loop(scenario) is not None
    assert as_loop(replace(scenario, settled=0.0)) is None


def test_absent_data_is_said(tmp_path, monkeypatch):
    with pytest.raises(DataError, match="obsmat.*ETH.seq_eth"):
        find_scene("eth", tmp_path)
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    with pytest.raises(DataError, match="--data"):
        find_scene("eth", None)
