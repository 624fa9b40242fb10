"""The study of crowds, on published tracks where they are there."""

import csv
import sys

import pytest

crowd = pytest.importorskip("crowd", reason="needs qpavoid[study]")


def study(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["crowd.py", "--workers", "1", *arguments])
    crowd.main()


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_two_tasks_and_the_humans(data_folder, tmp_path, monkeypatch, capsys):
    options = ["--scenes", "hotel", "--every", "100", "--methods", "qp-ahead"]
    study(monkeypatch, "--data", str(data_folder), *options, "--out", str(tmp_path))
    (line,) = read(tmp_path / "table.csv")
    runs = read(tmp_path / "runs.csv")
    assert [row["seed"] for row in runs] == ["0", "100"]
    assert (line["setting"], line["runs"], line["metric_arrived"]) == (
        "hotel",
        "2",
        "1.0",
    )
    tasks = crowd.read_tasks(crowd.find_scene("hotel", data_folder))
    for row in runs:
        time = tasks[int(row["seed"])].time
        assert float(row["metric_time"]) == pytest.approx(
            float(row["arrived_s"]) / time
        )
        assert 0.8 < float(row["metric_way"]) < 1.5
    (human,) = read(tmp_path / "human.csv")
    assert (human["runs"], human["contacts"]) == ("200", "26")
    assert "method=human runs=200" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--scenes", "eth,zara3"], "zara3"), (["--data", "nowhere"], "ETH/seq_eth")],
)
def test_what_is_wrong_is_said(arguments, said, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, *arguments)
    assert said in capsys.readouterr().err
