"""The study of crowds, on published tracks where they are there."""

import csv
import math
import sys

import numpy as np
import pytest

from qpavoid.lab.worlds.crowd import read_tracks
from walkers import walker

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
    tasks = crowd.Crowd("hotel", str(data_folder)).tasks
    for row in runs:
        time = tasks[int(row["seed"])].time
        assert float(row["metric_time"]) == pytest.approx(
            float(row["arrived_s"]) / time
        )
        assert 0.8 < float(row["metric_way"]) < 1.5
    (human,) = read(tmp_path / "human.csv")
    assert human["runs"] == "2"
    whole = crowd.human("hotel", tasks)
    assert (whole["runs"], whole["contacts"]) == (200, 26)
    assert "method=human runs=2" in capsys.readouterr().out


def test_own_clearance_is_that_of_a_fine_look():
    human = walker(1, 100.0, (0.0, 0.0), (8.0, 0.0))
    crossing = walker(2, 100.0, (4.0, -4.0), (4.0, 4.0))
    gone = walker(3, 20.0, (1.0, 0.0), (1.0, 8.0))
    rng = np.random.default_rng(1)
    assert crowd.own_clearance(crowd.Task(human, (crossing, gone))) == pytest.approx(
        -2.0 * crowd.PERSON
    )  # they meet in (4, 0)
    assert crowd.own_clearance(crowd.Task(human, (gone,))) == math.inf
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
        assert crowd.own_clearance(crowd.Task(human, (other,))) == pytest.approx(
            least, abs=5e-3
        )


@pytest.mark.parametrize(
    ("scene", "count"),
    [("eth", 39), ("hotel", 26), ("zara01", 30), ("students03", 91)],
)
def test_humans_touch_each_other(data_folder, scene, count):
    tasks = crowd.Crowd(scene, str(data_folder)).tasks
    assert sum(crowd.own_clearance(task) < 0.0 for task in tasks) == count


def tracks(file, fps, paths):
    """Write people who walk straight, 0.4 s between samples, all from time 0 on."""
    lines = []
    for who, (start, end) in enumerate(paths):
        for k, (x, y) in enumerate(np.linspace(start, end, 21)):
            lines.append(f"{0.4 * fps * k} {who} {x} 0 {y} 0 0 0")
    file.write_text("\n".join(lines) + "\n")
    return file


def test_an_id_that_is_used_again_is_somebody_else(tmp_path):
    """It was one person, who walked for 400 s."""
    lines = [f"{k} 1 {0.4 * k} 0" for k in (*range(20), *range(1000, 1020))]
    file = tmp_path / "a.txt"
    file.write_text("\n".join(lines))
    people = read_tracks(file, 2.5)
    assert [len(person.times) for person in people] == [20, 20]
    assert {person.number for person in people} == {1}
    assert len(read_tracks(file, 100.0)) == 1


def test_who_touched_stays_open_where_a_method_fails_the_second_time(
    tmp_path, monkeypatch
):
    """All tables were lost with the repeat of a run."""
    (tmp_path / "once_c.py").write_text(
        "import builtins\n"
        "def drives(v, omega, obstacles, context):\n"
        "    builtins.asked_c += 1\n"
        "    if builtins.asked_c > 170:\n        raise RuntimeError('again')\n"
        "    return v, omega\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("builtins.asked_c", 0, raising=False)
    towards = (9.0, 0.0), (1.0, 0.0)
    one = tracks(tmp_path / "a.txt", 30.0, [((0.0, 0.0), (8.0, 0.0)), towards])
    options = ["--methods", "once_c:drives", "--every", "2", "--workers", "1"]
    out = ["--out", str(tmp_path / "out")]
    study(monkeypatch, "--tracks", str(one), "--fps", "30", *options, *out)
    (row,) = read(tmp_path / "out" / "table.csv")
    assert (row["contacts"], row["metric_surprised"]) == ("1", "")


def test_any_tracks(tmp_path, monkeypatch):
    """Other recordings were a KeyError in every worker and a table of zeros."""
    far = (0.0, 20.0), (1.0, 20.0)
    one = tracks(tmp_path / "a.txt", 30.0, [((0.0, 0.0), (8.0, 0.0)), far])
    two = tracks(tmp_path / "b.txt", 10.0, [((0.0, 0.0), (0.0, 9.0)), far])
    files = ["--tracks", str(one), str(two), "--fps", "30", "10"]
    study(monkeypatch, *files, "--methods", "qp-ahead", "--out", str(tmp_path / "out"))
    table = read(tmp_path / "out" / "table.csv")
    assert [row["setting"] for row in table] == [str(one), str(two)]
    assert all(row["metric_arrived"] == "1.0" for row in table)
    humans = read(tmp_path / "out" / "human.csv")
    assert [row["mean_time_s"] for row in humans] == ["8.0", "8.0"]


def test_who_was_touched_is_found_whatever_the_method(tmp_path, monkeypatch):
    """Runs of methods without a QP could not be repeated to see whom they touched."""
    towards = (9.0, 0.0), (1.0, 0.0)
    one = tracks(tmp_path / "a.txt", 30.0, [((0.0, 0.0), (8.0, 0.0)), towards])
    out = tmp_path / "out"
    methods = ["--methods", "alone,eq7", "--out", str(out), "--every", "2"]
    study(monkeypatch, "--tracks", str(one), "--fps", "30", *methods)
    table = read(out / "table.csv")
    assert table[0]["contacts"] == "1" and table[0]["metric_surprised"] == "0.0"


def walk(step, places):
    """Return who walks along x, and from 0 to 1 and back along y or z."""
    rows = [f"{k} 1 {step * k} {places.format(y=k % 2)} 0 0 0\n" for k in range(20)]
    return "".join(rows)


def straight(lost):
    """Return who walks along x at 1 m/s, but for one sample."""
    places = {k: 0.4 * k for k in range(21)} | dict([lost])
    return "".join(f"{10 * k} 1 {x} 0 0 0 0 0\n" for k, x in places.items())


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "not a readable track file"),
        ("0 1 0 0 0 0 0\n", "8 or 4 columns are wanted, not 7"),
        ("0 1 0 0 0 0 0 0\n", "no track has 10 samples and 6 m between its ends"),
        (walk(0.4, "{y} 0"), "only heights change: are y and z exchanged?"),
        (walk(4.0, "0 {y}"), "people walk at 103 m/s: are their places in m"),
        (straight(lost=(15, 0.0)), "id 1 jumps at 5.6 s at 14 m/s"),
        (straight(lost=(15, 1e300)), ":16: (1e+300, 0) m is nowhere"),
    ],
)
def test_a_file_without_tracks_is_said_before_anything_runs(
    text, said, tmp_path, monkeypatch, capsys
):
    file, out = tmp_path / "tracks.txt", tmp_path / "out"
    if text:
        file.write_text(text)
    with pytest.raises(SystemExit) as ended:
        study(monkeypatch, "--tracks", str(file), "--fps", "25", "--out", str(out))
    assert ended.value.code == 2 and not out.exists()
    told = capsys.readouterr().err
    assert said in told and str(file) in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--scenes", "eth,zara3"], "zara3"),
        (["--data", "nowhere"], "ETH/seq_eth"),
        (["--tracks", "a.txt"], "--tracks wants --fps"),
        (["--tracks", "a.txt", "--fps", "0"], "frames a second must be positive"),
    ],
)
def test_what_is_wrong_is_said(arguments, said, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, *arguments)
    assert said in capsys.readouterr().err
