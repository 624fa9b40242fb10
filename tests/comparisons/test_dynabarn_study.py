"""DynaBARN's episodes, and what can be crossed when the motion is known."""

import csv
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

dynabarn = pytest.importorskip("dynabarn", reason="needs qpavoid[study]")

import crossing
from qpavoid.errors import DataError
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.study.sweep.study import read_study
from qpavoid.lab.worlds.dynabarn import Cylinder, DynaBarn, DynaBarnWorld, find_worlds
from qpavoid.model.robot import Limits, Robot

SMALL = {
    "timeout_s": 20.0,
    "robot_start": [4, 0, 3.14],
    "robot_goal": [-1, 0],
    "goal_radius": 1.0,
    "obstacle_radius": 0.5,
    "walls": [{"center": [0, 4], "size": [6, 0.5]}],
    "worlds": {
        "0": [{"t": [0, 12], "x": [1, 1], "y": [3, -3], "period": 12}],
        "1": [{"t": [0, 9], "x": [1, 1], "y": [3, -6], "period": 9}],
        "2": [{"t": [0, 3], "x": [1, 2], "y": [3, -3], "period": 3}],
    },
}


@pytest.fixture
def data(tmp_path):
    (tmp_path / "dynabarn.json").write_text(json.dumps(SMALL))
    return str(tmp_path)


def test_a_phase_shifts_the_clock_by_thirds_to_the_first_jump(data):
    sixths = DynaBarn("reverse", 1.0, data, phases=6)
    for phase, y in ((0, 3.0), (1, 1.0), (2, -1.0)):
        source = DynaBarn("reverse", 1.0, data)
        assert source.sample(phase) == sixths.sample(2 * phase)
        assert source.identity(None) != sixths.identity(None)
        scene = make_scenario(source.sample(phase), source.name, Path("x"), data)
        seen = scene.world.at(0.0)
        np.testing.assert_allclose(seen.discs, [[1.0, y, 0.5]], atol=1e-12)
        np.testing.assert_allclose(seen.disc_velocities, [[0.0, -0.5]])
        assert scene.duration == 20.0 - 4.0 * phase and len(scene.world.walls) == 4
        later = scene.world.at(
            16.0 - 4.0 * phase
        )  # 4 s after the jump, on the way back
        np.testing.assert_allclose(later.discs[0, :2], [1.0, -1.0], atol=1e-12)
        assert scene.path.sample(np.array([99.0]))[0, :2] == pytest.approx((-1.0, 0.0))


def test_an_episode_may_end_at_the_jump(data):
    source = DynaBarn("end", 1.0, data)
    assert source.sample(2)["duration_s"] == pytest.approx(4.0)
    assert source.identity(None) != DynaBarn("reverse", 1.0, data).identity(None)


def test_a_study_file_takes_its_worlds(data, tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(
        'title = "t"\ncontrollers = ["qp"]\nseeds = "0:2"\n'
        '[[generators]]\nkind = "dynabarn"\njumps = "end"\n'
    )
    study = read_study(file, data)
    assert len(study) == 2
    assert study.sources[0][0] == DynaBarn("end", 1.0, data)


def gate(width, opens=None, radius=0.5):
    """A row of cylinders across the way with a gap; one may leave it at a time."""
    ys = 0.5 * width + radius + 0.7 * np.arange(20)
    still = np.array([0.0, 1000.0])
    row = [Cylinder(still, np.array([[1.0, y]] * 2), math.inf) for y in (*ys, *(-ys))]
    if opens is not None:
        times = np.array([0.0, opens, opens + 3.5, 1000.0])
        places = np.array([[1.0, 0.0], [1.0, 0.0], [-6.0, 0.0], [-6.0, 0.0]])
        row.append(Cylinder(times, places, math.inf))
    walls = np.empty((0, 4))
    return DynaBarnWorld(
        tuple(row), radius, walls, (4.0, 0.0, 3.14), (-2.0, 0.0), 1.0, 40.0
    )


JACKAL = Robot("Jackal", Robot.jackal().footprint, Limits.symmetric(1.0, 1.57))


@pytest.mark.parametrize(
    ("width", "kind"),
    [(0.2, "impossible"), (0.42, "undecided"), (0.66, "undecided"), (0.9, "possible")],
)
def test_a_gap_is_judged_by_both_circles(width, kind):
    """The Jackal is 0.43 m wide, its circumscribed circle 0.666 m."""
    found, time, safe = crossing.judge(gate(width), 0.0, JACKAL)
    assert (found, safe) == (kind, True)
    assert time == (pytest.approx(5.0) if kind == "possible" else None)


def test_a_gate_that_opens_is_passed_after_that():
    """Closed until 8 s: nobody is nearer than 0.7 m until then, and 2 m remain."""
    _, time, _ = crossing.judge(gate(1.2, opens=8.0), 0.0, JACKAL)
    assert 8.0 + 2.0 < time < 8.0 + 4.0
    assert crossing.judge(gate(1.2, opens=39.5), 0.0, JACKAL)[0] == "impossible"


def test_who_waits_in_the_way_is_touched():
    times = np.array([0.0, 10.0])
    head_on = Cylinder(times, np.array([[-6.0, 0.0], [14.0, 0.0]]), 10.0)
    alone = DynaBarnWorld(
        (head_on,), 0.5, np.empty((0, 4)), (4.0, 0.0, 3.14), (-2.0, 0.0), 1.0, 10.0
    )
    kind, time, safe = crossing.judge(alone, 0.0, JACKAL)
    assert (kind, safe) == ("possible", False) and time > 5.0


def test_terciles_are_the_published_difficulties(data_folder):
    groups = list(dynabarn.terciles(range(60), str(data_folder)).values())
    assert groups == [[*range(20)], [*range(20, 40)], [*range(40, 60)]]


def test_the_study(data, tmp_path, monkeypatch, capsys):
    command = ["dynabarn.py", "--data", data, "--worlds", "0:3", "--workers", "1"]
    command += ["--methods", "alone,qp-ahead", "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", command)
    dynabarn.main()
    with open(tmp_path / "out" / "table.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert list(table[0])[-1] == "setting"
    assert "metric_possible" not in table[0]  # all of them are
    assert [row["runs"] for row in table] == ["3"] * 6
    ours = [row for row in table if row["method"] == "qp-ahead"]
    assert [row["successes"] for row in ours[:2]] == ["3", "3"]
    with open(tmp_path / "out" / "runs.csv", newline="") as file:
        runs = list(csv.DictReader(file))
    # tracking alone is at x = 1 after about 3 s: then so is the cylinder in phase 1
    alone = [r for r in runs if r["method"] == "alone" and int(r["seed"]) < 3]
    assert [row["contact"] for row in alone] == ["False", "True", "False"]
    assert {row["crossing"] for row in runs} == {"possible"}
    assert "3 possible, 0 impossible, 0 undecided; waiting safe in 3" in (
        capsys.readouterr().out
    )


def test_a_wrong_method_is_said_before_the_search(data, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(dynabarn, "terciles", lambda *_: pytest.fail("it searches"))
    command = [
        "dynabarn.py",
        "--data",
        data,
        "--methods",
        "eq6",
        "--out",
        str(tmp_path),
    ]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit):
        dynabarn.main()
    assert "eq6" in capsys.readouterr().err


def test_absent_data_is_said(tmp_path, monkeypatch):
    with pytest.raises(DataError, match=r"dynabarn\.json is in none of"):
        find_worlds(tmp_path)
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    with pytest.raises(DataError, match="--data"):
        find_worlds(None)
