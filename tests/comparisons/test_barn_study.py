"""BARN's rule and metric, on published worlds where they are there."""

import csv
import sys

import numpy as np
import pytest

from barn_files import WORLD, challenge
from qpavoid.lab.worlds.barn import BarnWorlds

barn = pytest.importorskip("barn", reason="needs qpavoid[study]")


@pytest.mark.parametrize(
    ("arrived", "expected"),
    [(None, 0.0), (4.0, 0.5), (20.0, 0.25), (100.0, 0.125)],
)
def test_the_metric_is_clipped_at_twice_and_eight_times_the_optimum(arrived, expected):
    row = {"success": arrived is not None, "arrived_s": arrived}
    assert barn.metric(row, 5.0) == expected


def start(monkeypatch, folder, out, *arguments):
    command = ["barn.py", "--data", str(folder), "--out", str(out), "--workers", "1"]
    monkeypatch.setattr(sys, "argv", [*command, "--methods", "alone", *arguments])
    barn.main()


def test_any_worlds_do_without_the_first(tmp_path, monkeypatch):
    """World 0 was wanted whatever was asked for."""
    folder = challenge(tmp_path / "worlds" / "BARN", 7, 9)
    start(monkeypatch, tmp_path, tmp_path / "out", "--worlds", "7:10:2", "--speed", "2")
    with open(tmp_path / "out" / "table.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["runs"], row["successes"], row["failed"]) == ("2", "2", "0")
    source = BarnWorlds(2.0)
    before = source.identity(str(tmp_path))
    (folder / "world_9.world").write_text(WORLD.format(x=0.0))
    assert source.identity(str(tmp_path)) != before
    assert source.identity(str(folder)) == source.identity(str(tmp_path))


def test_more_runs_of_a_world_have_other_noise(tmp_path, monkeypatch):
    challenge(tmp_path / "worlds" / "BARN", 7)
    more = "--worlds", "7:8", "--lidar", "--runs", "3", "--speed", "0.5,2"
    start(monkeypatch, tmp_path, tmp_path / "out", *more)
    with open(tmp_path / "out" / "runs.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    noises = "", ", noise 1", ", noise 2"
    named = [f"BARN, v <= {v} m/s{noise}" for v in (0.5, 2) for noise in noises]
    assert [row["scenario"] for row in rows] == named
    assert {row["seed"] for row in rows} == {"7"}
    assert len({row["run"] for row in rows}) == 6
    assert {row["setting"] for row in rows} == {
        "v <= 0.5 m/s, LiDAR",
        "v <= 2 m/s, LiDAR",
    }
    seeds = [BarnWorlds(2.0, noise).sample(7)["seed"] for noise in range(3)]
    assert seeds == [7, 1007, 2007]


def test_damaged_files_are_named_before_anything_runs(tmp_path, monkeypatch, capsys):
    folder = challenge(tmp_path / "data", 7, 8, 9)
    cut = folder / "world_8.world"
    cut.write_text(cut.read_text()[:60])
    whole = (folder / "path_files" / "path_9.npy").read_bytes()
    (folder / "path_files" / "path_9.npy").write_bytes(whole[:200])
    with pytest.raises(SystemExit) as ended:
        start(monkeypatch, folder, tmp_path / "out", "--worlds", "7:30")
    said = capsys.readouterr().err
    assert ended.value.code == 2 and not (tmp_path / "out").exists()
    assert "world_8.world: not a readable SDF" in said
    assert "path_9.npy: not a readable" in said
    assert "and 17 more" in said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda cells: cells[::-1], "does not lead from"),
        (lambda cells: 0.15 * cells, "does not lead from"),
        (lambda cells: 3 * cells, "does not lead from"),
        (lambda cells: cells + [8, 0], "leads through a cylinder"),
    ],
)
def test_a_path_of_another_world_or_unit_is_said(
    change, said, tmp_path, monkeypatch, capsys
):
    folder = challenge(tmp_path / "data", 3)
    path = folder / "path_files" / "path_3.npy"
    np.save(path, change(np.load(path)))
    with pytest.raises(SystemExit):
        start(monkeypatch, folder, tmp_path / "out", "--worlds", "3:4")
    assert f"path_3.npy: it {said}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("barn_dwa_runs.txt", "7 a\n"),
        ("barn_dwa_runs.txt", ""),
        ("barn_mppi_per_world.csv", "world,runs\n7,1\n"),
    ],
)
def test_damaged_published_runs_are_said_before_anything_runs(
    name, text, tmp_path, monkeypatch, capsys
):
    folder = challenge(tmp_path / "data", 7)
    (folder / "published").mkdir()
    (folder / "published" / name).write_text(text)
    with pytest.raises(SystemExit) as ended:
        start(monkeypatch, folder, tmp_path / "out", "--worlds", "7:8")
    assert ended.value.code == 2 and not (tmp_path / "out").exists()
    assert f"{name}: not readable" in capsys.readouterr().err


def test_two_worlds_by_the_official_rule(data_folder, tmp_path, monkeypatch, capsys):
    command = ["barn.py", "--data", str(data_folder), "--worlds", "0:13:12"]
    command += ["--methods", "qp-ahead,eq7", "--out", str(tmp_path), "--workers", "1"]
    monkeypatch.setattr(sys, "argv", command)
    barn.main()
    with open(tmp_path / "table.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "method",
        "runs",
        "began",
        "successes",
        "contacts",
        "contacts_standing",
        "timeouts",
        "failed",
        "mean_time_s",
        "metric",
        "setting",
    ]
    ours = rows[0]
    assert (ours["method"], ours["successes"], ours["contacts"]) == (
        "qp-ahead",
        "2",
        "0",
    )
    assert 0.26 < float(ours["metric"]) < 0.35
    assert "organisers' DWA, 20 runs in Gazebo: success 0.9" in capsys.readouterr().out
    with open(tmp_path / "runs.csv", newline="") as file:
        assert [row["seed"] for row in csv.DictReader(file)] == ["0", "12"] * 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--worlds", "0:0"], "FIRST:AFTER"),
        (["--methods", "eq9"], "eq9"),
        (["--speed", "2,0"], "invalid speeds value: '2,0'"),
        (["--speed", "nan"], "invalid speeds value: 'nan'"),
        (["--speed", "inf"], "invalid speeds value: 'inf'"),
        (["--data", "nowhere"], "world_0.world is in none of"),
    ],
)
def test_bad_arguments(arguments, said, monkeypatch, capsys, tmp_path):
    challenge(tmp_path / "data", 0)
    with pytest.raises(SystemExit):
        start(
            monkeypatch,
            tmp_path / "data",
            tmp_path / "out",
            *("--worlds", "0:1", *arguments),
        )
    assert said in capsys.readouterr().err
