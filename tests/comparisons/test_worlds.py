"""Figures of published worlds beside the runs: BARN's metric, crowds' contacts."""

import math

import numpy as np
import pytest

import rows
from crowd_contacts import PERSON, Crowd, Task, own_clearance
from rows import metric, optimal_time
from scenario_files import walker


@pytest.mark.parametrize(
    ("arrived", "expected"),
    [(None, 0.0), (4.0, 0.5), (20.0, 0.25), (100.0, 0.125)],
)
def test_the_metric_is_clipped_at_twice_and_eight_times_the_optimum(arrived, expected):
    row = {"success": arrived is not None, "arrived_s": arrived}
    assert metric(row, 5.0) == expected


def test_the_optimal_time_is_that_of_the_published_path(data_folder):
    cells = np.load(data_folder / "barn/BARN/path_files" / "path_0.npy")
    ends = [[-2.25, 3.0], [-2.25, 13.0]]
    path = np.vstack([ends[:1], 0.15 * cells + (-4.575, 5.075), ends[1:]])
    expected = np.hypot(*np.diff(path, axis=0).T).sum() / 2.0
    assert optimal_time(0, data_folder) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("study", ["barn", "barn_wheels"])
def test_the_committed_metric_is_that_of_the_rows(data_folder, study):
    for method, runs in rows.read_runs(study).items():
        for setting in {place[0] for place in runs}:
            ends = {int(k[1]): run for k, run in runs.items() if k[0] == setting}
            values = [
                metric(
                    {"success": not run.end, "arrived_s": run.time},
                    optimal_time(world, data_folder),
                )
                for world, run in ends.items()
            ]
            kept = rows.read_costs()[study, setting, method][2]
            assert np.mean(values) == pytest.approx(kept, abs=2e-3), (setting, method)


def test_own_clearance_is_that_of_a_fine_look():
    human = walker(1, 100.0, (0.0, 0.0), (8.0, 0.0))
    crossing = walker(2, 100.0, (4.0, -4.0), (4.0, 4.0))
    gone = walker(3, 20.0, (1.0, 0.0), (1.0, 8.0))
    rng = np.random.default_rng(1)
    assert own_clearance(Task(human, (crossing, gone))) == pytest.approx(
        -2.0 * PERSON
    )  # they meet in (4, 0)
    assert own_clearance(Task(human, (gone,))) == math.inf
    for _ in range(20):
        begin, seconds = 100.0 + rng.uniform(-6.0, 6.0), rng.uniform(2.0, 9.0)
        other = walker(2, begin, *rng.uniform([0.0, -4.0], [8.0, 4.0], (2, 2)), seconds)
        other = other._replace(
            positions=other.positions + rng.normal(0.0, 0.2, other.positions.shape)
        )
        ends = [who.times[[0, -1]] for who in (human, other)]
        times = np.linspace(*np.clip(ends[0], *ends[1]), 2001)
        places = [
            [np.interp(times, who.times, axis) for axis in who.positions.T]
            for who in (human, other)
        ]
        least = np.hypot(*np.subtract(*places)).min() - 0.5
        assert own_clearance(Task(human, (other,))) == pytest.approx(least, abs=5e-3)


@pytest.mark.parametrize(
    ("scene", "count"),
    [("eth", 39), ("hotel", 26), ("zara01", 30), ("students03", 91)],
)
def test_humans_touch_each_other(data_folder, scene, count):
    tasks = Crowd(scene, str(data_folder)).tasks
    assert sum(own_clearance(task) < 0.0 for task in tasks) == count
