"""A recorded drive, scan by scan: what is desired, what is touched, what is counted."""

import csv
import gzip
import math
import sys
from itertools import pairwise

import numpy as np
import pytest

scan_replay = pytest.importorskip("scan_replay", reason="needs qpavoid[study]")

from qpavoid.lab.worlds.carmen import read_scans


def driven(pose, v, omega, time, steps=20_000):
    """Integrate the unicycle by small steps, midpoint rule."""
    x, y, heading = pose
    dt = time / steps
    for _ in range(steps):
        middle = heading + 0.5 * omega * dt
        x, y = x + v * dt * math.cos(middle), y + v * dt * math.sin(middle)
        heading += omega * dt
    return x, y, heading


@pytest.mark.parametrize("twist", [(0.5, 0.0), (0.7, 1.1), (-0.3, -2.0), (0.0, 0.4)])
def test_the_twist_is_that_of_the_arc(twist):
    start = (1.0, -2.0, 3.0)  # the heading passes π
    x, y, heading = driven(start, *twist, 0.25)
    end = x, y, heading - 2 * math.pi
    assert scan_replay.twist_between(start, end, 0.25) == pytest.approx(twist, abs=1e-7)


def line(time, x, ranges, heading=0):
    words = ["FLASER", len(ranges), *ranges]
    words += [x, 0, heading, x, 0, heading, time, "host", time]
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


def test_what_is_changed_and_touched_is_counted(log, tmp_path, monkeypatch, capsys):
    command = ["scan_replay.py", "--data", str(log), "--methods", "qp,eq5"]
    monkeypatch.setattr(sys, "argv", [*command, "--out", str(tmp_path / "out")])
    scan_replay.main()
    assert "5 scans, 1 twists cut" in capsys.readouterr().out
    with open(tmp_path / "out" / "table.csv", newline="") as file:
        table = list(csv.DictReader(file))
    names = (
        "method,runs,successes,contacts,contacts_standing,timeouts,failed,mean_time_s"
    )
    assert ",".join(table[0]).startswith(f"{names},metric,setting,")
    assert [row["method"] for row in table] == ["qp"] * 3 + ["eq5"] * 3
    for row in table:
        assert (row["runs"], row["contacts"], row["stopped"]) == ("5", "1", "0")
        assert int(row["nearer"]) == (1 if row["setting"] == "r_min 0.05 m" else 2)
    narrow = table[3]  # Eq. 5 acts nearer than r = 4/3 · 0.05 m
    assert narrow["method"] == "eq5" and narrow["metric"] == "1.0"
    with open(tmp_path / "out" / "runs.csv", newline="") as file:
        runs = list(csv.DictReader(file))
    qp = [row for row in runs if (row["method"], row["r_min_m"]) == ("qp", "0.1")]
    assert [row["changed"] for row in qp[:2]] == ["False", "True"]
    assert [row["touched"] for row in qp] == ["False"] * 2 + ["True"] + ["False"] * 2
    assert float(qp[1]["clearance_m"]) == pytest.approx(0.35 - 0.04 - 0.235)
    assert float(qp[3]["v_mps"]) == 1.6 and qp[3]["cut"] == "True"
    for name in ("map.png", "report.html"):
        assert (tmp_path / "out" / name).stat().st_size > 1000


def replay(monkeypatch, out, *arguments):
    command = ["scan_replay.py", "--methods", "eq5", "--out", str(out), *arguments]
    monkeypatch.setattr(sys, "argv", command)
    scan_replay.main()
    with open(out / "table.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_any_log_robot_and_laser(tmp_path, monkeypatch, capsys):
    """No gzip, a wide robot, its laser far ahead; one scan is not in order."""
    far = [6.0] * 180
    beside = [0.5, *far[1:]]  # to the right
    file = tmp_path / "my.log"
    file.write_text(
        line(0.0, 0.0, beside)
        + line(3.0, 0.3, far)
        + line(2.0, 9.0, far)
        + line(6.0, 0.6, beside)
        + line(9.0, 0.9, far)
    )
    with pytest.raises(SystemExit):
        replay(monkeypatch, tmp_path / "out", "--log", str(file))
    assert (
        "my.log: without --dt, 3 s apart: no step is so long" in capsys.readouterr().err
    )
    options = ["--log", str(file), "--dt", "0.3", "--robot", "0.8,1.2"]
    table = replay(monkeypatch, tmp_path / "out", *options, "--laser", "0.3")
    assert [row["runs"] for row in table] == ["3"] * 3
    assert [row["contacts"] for row in table] == ["2"] * 3
    table = replay(monkeypatch, tmp_path / "out", *options, "--laser", "0.5")
    assert [row["contacts"] for row in table] == ["0"] * 3
    assert "my.log replayed" in (tmp_path / "out" / "report.html").read_text()


def test_beams_of_any_number_with_what_they_span(tmp_path, monkeypatch, capsys):
    """A scanner of 682 beams over 240°: the last of them is 30° behind the left."""
    file = tmp_path / "my.log"
    text = ""
    for k in range(4):
        ranges = [6.0] * 681 + [0.2 + 0.1 * k]
        text += line(0.25 * k, 0.1 * k, ranges)
    file.write_text(text)
    with pytest.raises(SystemExit):
        replay(monkeypatch, tmp_path / "out", "--log", str(file))
    assert "682 beams, where (180, 181, 360, 361) are known" in capsys.readouterr().err
    log = "--log", str(file), "--view", "240"
    table = replay(monkeypatch, tmp_path / "out", *log)
    assert [row["contacts"] for row in table] == ["1"] * 3
    x, y = next(read_scans(file, view=math.radians(240.0))).points()[-1]
    assert (x, y) == pytest.approx((-0.1, 0.2 * math.sqrt(0.75)))


@pytest.mark.parametrize(
    ("poses", "far", "said"),
    [
        (
            [(0.1 * k, 0.0) for k in range(5)],
            6000.0,
            "no scan has a return within 10 m",
        ),
        ([(0.1 * k, 0.0) for k in range(5)], 0.0, "no scan has a return within 10 m"),
        ([(1.0, 0.0)] * 5, 6.0, "it never moves: are its poses in m?"),
        (
            [(100.0 * k, 0.0) for k in range(5)],
            6.0,
            "4 of 4 twists are faster than the robot",
        ),
        (
            [(0.1 * k, 45.0) for k in range(5)],
            6.0,
            "a heading is 7 turns: is it in rad?",
        ),
        (
            [*[(0.0, 0.0)] * 5, (90.0, 0.0), (180.0, 0.0)],
            6.0,
            "2 of 2 twists are faster than the robot",
        ),
    ],
)
def test_a_log_in_other_units_is_refused(
    poses, far, said, tmp_path, monkeypatch, capsys
):
    file = tmp_path / "my.log"
    lines = [line(0.25 * k, x, [far] * 180, at) for k, (x, at) in enumerate(poses)]
    file.write_text("".join(lines))
    with pytest.raises(SystemExit):
        replay(monkeypatch, tmp_path / "out", "--log", str(file))
    assert f"my.log: {said}" in capsys.readouterr().err


def test_a_method_named_twice_is_one_and_a_picture_is_of_this_run(
    log, tmp_path, monkeypatch
):
    out = tmp_path / "out"
    out.mkdir()
    (out / "map.png").write_bytes(b"of before")
    file = str(log / scan_replay.LOG)
    table = replay(monkeypatch, out, "--log", file, "--methods", "qp,qp")
    assert len(table) == len(scan_replay.RADII)
    assert (out / "map.png").read_bytes() != b"of before"


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--robot", "jeep", "neither LENGTH,WIDTH nor mir100"),
        ("--laser", "nan", "--laser wants -20 to 20 m"),
        ("--dt", "0", "--dt wants 0.001 to 0.5 s"),
        ("--view", "400", "--view wants 0 to 360°"),
        ("--view", "180 --message RAWLASER1", "--view is of FLASER"),
        ("--message", "SONAR", "invalid choice"),
        ("--log", "nowhere.log", "nowhere.log: not readable"),
    ],
)
def test_what_is_wrong_is_said(option, value, said, monkeypatch, capsys, tmp_path):
    with pytest.raises(SystemExit):
        replay(monkeypatch, tmp_path, option, *value.split())
    assert said in capsys.readouterr().err


def test_a_published_drive_is_reproduced_but_for_sideways_motion(data_folder):
    scans = list(read_scans(data_folder / "carmen" / scan_replay.LOG))[:400]
    moments = scan_replay.make_moments(scans)
    for k, (here, there) in enumerate(pairwise(moments)):
        time = scans[k + 1].time - scans[k].time
        x, y, heading = driven(here.pose, here.v, here.omega, time, steps=20)
        turned = math.remainder(heading - there.pose[2], 2 * math.pi)
        off = np.hypot(x - there.pose[0], y - there.pose[1])
        assert here.cut or (abs(turned) < 1e-6 and off < 0.08)


@pytest.mark.parametrize("data", [True, False])
def test_an_absent_log_is_said(tmp_path, monkeypatch, capsys, data):
    monkeypatch.delenv("QPAVOID_DATA", raising=False)
    option = ["--data", str(tmp_path)] if data else []
    monkeypatch.setattr(sys, "argv", ["scan_replay.py", *option])
    with pytest.raises(SystemExit):
        scan_replay.main()
    said = capsys.readouterr().err
    assert scan_replay.LOG in said if data else "--data" in said
