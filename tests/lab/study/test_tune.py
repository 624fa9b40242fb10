"""Tuning: better on what it was trained on, and honest about what it was not."""

import json

import pytest

from places import COMPARISONS
from qpavoid.cli import main
from qpavoid.errors import ConfigError
from sweep_sources import DOCUMENT, toml

pytest.importorskip("optuna", reason="needs qpavoid[tune]")

from qpavoid.lab.study.sweep.store import read_rows
from qpavoid.lab.study.tune import _metrics, read_tuning, tune

TUNING = """
title = "Small"
controller = "qp"
train = "0:3"
test = "10:14"
trials = 6
[loss]
failure = 1.0
contact = 10.0
[search]
"radius.r_min_slow_m" = { low = 0.05, high = 0.2 }
"filter.bound" = { choices = ["barrier", "repulsion"] }
[[scenarios]]
config = "past.toml"
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "past.toml").write_text(toml(DOCUMENT))

    def write(*change):
        path = tmp_path / "tuning.toml"
        path.write_text(TUNING.replace(*change) if change else TUNING)
        return path

    return write


def test_what_is_found_is_judged_on_scenes_not_seen(file, tmp_path):
    said, out = [], tmp_path / "out"
    found = tune(read_tuning(file()), out, 1, said.append)
    assert len(said) == 6 and said[0].startswith("trial 0: loss")
    assert 0.05 <= found.best["radius.r_min_slow_m"] <= 0.2
    names = [(row["settings"], row["scenes"]) for row in found.table]
    assert names == [
        ("as they stand", "training"),
        ("as they stand", "held out"),
        ("best", "training"),
        ("best", "held out"),
    ]
    losses = [float(line.split()[3]) for line in said]
    assert found.table[2]["loss"] == pytest.approx(min(losses), rel=1e-3)
    seeds = {row["seed"] for row in read_rows(out / "held_out")}
    assert seeds == set(range(10, 14))
    assert json.loads((out / "tuning.json").read_text())["best"] == found.best
    count = len(read_rows(out / "training"))
    assert count == 3 * 7  # six trials and the settings as they stand
    assert tune(read_tuning(file()), out, 1).table == found.table
    assert len(read_rows(out / "training")) == count


def test_the_command_prints_the_table(file, tmp_path, capsys):
    path = file("trials = 6", "trials = 1")
    command = ["tune", str(path), "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "| settings | scenes | failure | contact | loss |" in printed
    assert "| best | held out |" in printed


SEVERAL = """
[[generators]]
kind = "own"
source = "sweep_sources:Harmless"
options = { name = "mine" }
train = "20:22"
test = [30]
weight = 3.0
"""


def test_every_case_has_seeds_and_a_weight_of_its_own(file, tmp_path):
    path = file("trials = 6", "trials = 1")
    path.write_text(path.read_text() + SEVERAL)
    tuning = read_tuning(path)
    found = tune(tuning, tmp_path / "out", 1)
    assert [*tuning.weights.values()] == [1.0, 3.0]
    scenes = {
        (row["scenario"].rpartition("/")[2], row["seed"])
        for row in read_rows(tmp_path / "out" / "training")
    }
    assert scenes == {("past", 0), ("past", 1), ("past", 2), ("mine", 20), ("mine", 21)}
    rows = read_rows(tmp_path / "out" / "held_out")
    assert {(row["scenario"] == "mine", row["seed"]) for row in rows} == {
        *((False, seed) for seed in range(10, 14)),
        (True, 30),
    }
    assert {row["scenes"] for row in found.table} == {"training", "held out"}


def test_a_run_counts_as_its_weight():
    rows = [
        {"success": success, "contact": contact, "min_room_m": room, "duration_s": 10.0}
        | {"arrived_s": 5.0 if success else None}
        for success, contact, room in (
            (True, False, 0.0),
            (False, True, -1.0),
            (False, False, None),
        )
    ]
    assert _metrics(rows, [5.0, 2.0, 1.0]) == pytest.approx(
        {"failure": 0.375, "contact": 0.25, "below_r_min": 0.25, "time": 0.6875}
    )


@pytest.mark.slow
def test_the_tuning_of_the_guide_is_valid(data_folder):
    pytest.importorskip("pyrvo", reason="needs qpavoid[baselines]")
    tuning = read_tuning(COMPARISONS / "crowdnav" / "tune_guide.toml", data_folder)
    counts = [sum(len(s) for _, s in some) for some in tuning.scenes.values()]
    assert counts == [40, 142]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (('train = "20:22"', 'seeds = "20:22"'), "mine: no place for seeds"),
        (('train = "20:22"', 'train = "30:31"'), "seeds of mine are trained on"),
        (('train = "20:22"', 'train = "3:3"'), "train: there are none of mine"),
        (("{ name", "{ title"), "sweep_sources:Harmless: .*'title'"),
        ((":Harmless", ":Harmles"), "did you mean 'Harmless'"),
        (("weight = 3.0", "weight = 0.0"), "weight: .*greater than 0"),
    ],
)
def test_mistakes_in_a_case_are_named(file, change, match):
    path = file()
    path.write_text(path.read_text() + SEVERAL.replace(*change))
    with pytest.raises(ConfigError, match=match):
        read_tuning(path)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (('"10:14"', '"2:5"'), "test: seeds of .*past are trained on"),
        (("contact = 10.0", "contacts = 10.0"), "loss"),
        (("low = 0.05, high = 0.2", "low = 0.3, high = 0.2"), "low < high"),
        (("high = 0.2 }", "high = 0.9 }"), "r_min_slow_m.: 0.9"),
        (("radius.r_min_slow_m", "radius.r_min_slowm"), "r_min_slowm: unknown key"),
        (("trials = 6", "trials = 0"), "trials"),
    ],
)
def test_mistakes_are_named(file, change, match):
    with pytest.raises(ConfigError, match=match):
        read_tuning(file(*change))
