"""BARN's rule and metric, on published worlds where they are there."""

import csv
import sys

import pytest

barn = pytest.importorskip("barn", reason="needs qpavoid[study]")


@pytest.mark.parametrize(
    ("arrived", "expected"),
    [(None, 0.0), (4.0, 0.5), (20.0, 0.25), (100.0, 0.125)],
)
def test_the_metric_is_clipped_at_twice_and_eight_times_the_optimum(arrived, expected):
    row = {"success": arrived is not None, "arrived_s": arrived}
    assert barn.metric(row, 5.0) == expected


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
        "successes",
        "contacts",
        "contacts_standing",
        "timeouts",
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
        (["--data", "nowhere"], "world_0.world is in none of"),
    ],
)
def test_bad_arguments(arguments, said, monkeypatch, capsys, tmp_path):
    command = ["barn.py", "--out", str(tmp_path), *arguments]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit):
        barn.main()
    assert said in capsys.readouterr().err
