"""The study of fleets: a row a run, which has the worst of all its robots."""

import csv
import sys

import numpy as np
import pytest

from outlines import least_apart
from qpavoid.lab.simulation.outcome import mean_jerk
from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.simulation.scenario import load_scenario

fleet = pytest.importorskip("fleet", reason="needs qpavoid[study]")


def read_csv(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def drive(monkeypatch, *options):
    monkeypatch.setattr(sys, "argv", ["fleet.py", "--workers", "1", *options])
    fleet.main()


def test_two_robots_swap_their_places(tmp_path, monkeypatch):
    options = "--scenes", "swap", "--methods", "qp-ahead", "--seeds", "0:1"
    drive(monkeypatch, *options, "--out", str(tmp_path))
    (row,) = read_csv(tmp_path / "runs.csv")
    assert (row["success"], row["contact"], row["seed"]) == ("True", "False", "0")
    logs = run_fleet(load_scenario("fleet/swap"), "qp-ahead")
    assert len(logs) == 2
    near = least_apart(logs)
    assert near > 0.17 and float(row["min_clearance_m"]) == pytest.approx(
        near, abs=0.01
    )
    jerks = [mean_jerk(np.asarray(log["v_mps"]), log.meta["dt_s"]) for log in logs]
    assert float(row["jerk_mps3"]) == pytest.approx(max(jerks))
    room = min(log["room_m"].min() for log in logs)
    assert float(row["min_room_m"]) == pytest.approx(room)
    assert float(row["solve_us"]) > 0.0


def test_who_drives_on_touches_and_it_began_in_motion(tmp_path, monkeypatch):
    options = "--scenes", "swap", "--methods", "alone", "--seeds", "0:1"
    drive(monkeypatch, *options, "--out", str(tmp_path))
    (row,) = read_csv(tmp_path / "runs.csv")
    assert (row["success"], row["contact"]) == ("False", "True")
    assert float(row["contacts_moving"]) >= 1.0


def test_an_unknown_scene_is_said(monkeypatch, capsys):
    with pytest.raises(SystemExit) as ended:
        drive(monkeypatch, "--scenes", "swap,swop")
    assert ended.value.code == 2 and "unknown scenes: swop" in capsys.readouterr().err
