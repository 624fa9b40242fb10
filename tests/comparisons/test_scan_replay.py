"""A recorded drive, scan by scan: desired twists, contacts, counts."""

import csv
import gzip
import math
import sys

import numpy as np
import pytest

scan_replay = pytest.importorskip("scan_replay", reason="needs qpavoid[study]")

from qpavoid.lab.worlds.carmen import read_scans
from qpavoid.model.kinematics import arc


@pytest.mark.parametrize("twist", [(0.5, 0.0), (0.7, 1.1), (-0.3, -2.0), (0.0, 0.4)])
def test_the_twist_is_that_of_the_arc(twist):
    start = (1.0, -2.0, 3.0)  # the heading passes π
    x, y, heading = arc(*start, *twist, 0.25)
    end = x, y, heading - 2 * math.pi
    found = scan_replay.twist_between(start, end, 0.25)
    assert found == pytest.approx((*twist, 0.0), abs=1e-7)


def line(time, x, ranges):
    words = ["FLASER", len(ranges), *ranges, x, 0, 0, x, 0, 0, time, "host", time]
    return " ".join(map(str, words)) + "\n"


@pytest.fixture
def log(tmp_path):
    """A robot at 0.4 m/s, once at 3 m/s: far walls, a near thing, one in the body."""
    far = [6.0] * 180
    near, inside = list(far), list(far)
    near[90] = 0.35  # straight ahead of the laser, 7.5 cm ahead of the bumper
    inside[0] = 0.15  # to the right, in the body
    xs = np.cumsum([0.0, 0.1, 0.1, 0.1, 0.75, 0.1])
    scans = (far, near, inside, far, far, far)
    lines = [
        line(0.25 * k, x, r) for k, (x, r) in enumerate(zip(xs, scans, strict=True))
    ]
    with gzip.open(tmp_path / scan_replay.LOG, "wt") as file:
        file.writelines(lines)
    return tmp_path


def test_changed_and_touched_scans_are_counted(log, tmp_path, monkeypatch, capsys):
    command = ["scan_replay.py", "--data", str(log), "--methods", "qp,eq5"]
    monkeypatch.setattr(sys, "argv", [*command, "--out", str(tmp_path / "out")])
    scan_replay.main()
    assert "5 scans, 1 twists limited" in capsys.readouterr().out
    with open(tmp_path / "out" / "scan_replay.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["method"] for row in table] == ["qp"] * 3 + ["eq5"] * 3
    for row in table:
        assert (row["runs"], row["contacts"], row["stopped"]) == ("5", "1", "0")
        assert int(row["nearer"]) == (1 if row["setting"] == "r_min 0.05 m" else 2)
    narrow = table[3]  # Eq. 5 acts nearer than r = 4/3 · 0.05 m
    assert narrow["method"] == "eq5" and narrow["metric"] == "1.0"
    moments = scan_replay.make_moments(list(read_scans(log / scan_replay.LOG)))
    assert [one.touched for one in moments] == [False, False, True, False, False]
    assert (moments[3].v, moments[3].cut) == (1.6, True)
    for radius, nearer in ((0.07, 0), (0.08, 1)):  # 0.35 - 0.04 - 0.235 m away
        row = scan_replay.replay("qp", radius, moments[:2], 0.25)
        assert row["nearer"] == nearer and row["successes"] == 1


def test_the_drive_is_that_of_the_rows(data_folder):
    scans = list(read_scans(data_folder / "carmen" / scan_replay.LOG))
    moments = scan_replay.make_moments(scans)
    assert len(moments) == 4790
    assert sum(moment.touched for moment in moments) == 100
