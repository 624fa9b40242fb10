"""The ablation: parts by settings are run, parts by edits are still in the sources."""

import sys

import pytest

ablation = pytest.importorskip("ablation", reason="needs qpavoid[study]")

from qpavoid.lab.simulation.methods import find_method
from qpavoid.lab.study.sweep.sources import check_scene, scenario_file


def study(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["ablation.py", "--workers", "1", *arguments])
    ablation.main()


def test_a_part_runs_with_the_package_that_it_is_given(tmp_path, monkeypatch):
    inside = ["--inside", str(ablation.PACKAGE.parent), "--parts", "guide"]
    some = ["--studies", "strangers", "--every", "75", "--out", str(tmp_path)]
    study(monkeypatch, *inside, *some)
    rows = ablation.read_csv(tmp_path / "guide" / "runs.csv")
    assert [(row["method"], row["error"]) for row in rows] == 2 * [("qp-ahead", "")]


@pytest.mark.slow
def test_two_parts_on_two_cases(tmp_path, monkeypatch, capsys):
    parts = ["--parts", "guide,hysteresis", "--studies", "strangers", "--every", "75"]
    study(monkeypatch, *parts, "--out", str(tmp_path))
    names = "qp-ahead", "qp-ahead+guide no hysteresis"
    rows = ablation.read_csv(tmp_path / "runs.csv")
    assert [(row["method"], row["seed"], row["setting"]) for row in rows] == [
        (name, seed, "strangers") for name in names for seed in ("0", "75")
    ]
    assert {row["error"] for row in rows} == {""}
    table = ablation.read_csv(tmp_path / "table.csv")
    assert [(row["method"], row["runs"]) for row in table] == [(n, "2") for n in names]
    assert "| method | strangers |" in capsys.readouterr().out
    settings = [row["guide.hysteresis"] for row in rows]
    assert settings == ["", "", "0.0", "0.0"]


@pytest.mark.parametrize("name", [n for n, p in ablation.PARTS.items() if p.edits])
def test_the_sources_are_those_of_the_edits(name, tmp_path):
    copy = ablation.cut(ablation.PARTS[name], tmp_path)
    for file in {edit.file for edit in ablation.PARTS[name].edits}:
        before, after = (
            (root / "qpavoid" / "guide" / file).read_text("utf-8")
            for root in (ablation.ROOT, copy)
        )
        assert before != after
        compile(after, file, "exec")


def test_an_edit_that_fits_nowhere_is_said(tmp_path):
    part = ablation.Part(edits=[ablation.constant("NO_SUCH", "1")])
    with pytest.raises(ablation.ConfigError, match=r"NO_SUCH = .* is there 0 times"):
        ablation.cut(part, tmp_path)


def test_parts_are_methods_and_settings_that_there_are(tmp_path):
    source = scenario_file("demo/strangers")
    for part in ablation.PARTS.values():
        assert find_method(part.method)
        check_scene(source, part.changes, tmp_path, None)
    labels = [ablation.label(name) for name in ablation.PARTS]
    assert len(set(labels)) == len(labels)
    assert all(find_method(label.partition(" ")[0]) for label in labels)


def test_the_cases_are_those_that_are_reported(data_folder):
    scenes = {
        study: ablation.scenes_of(study, 1, {}, str(data_folder))
        for study in ablation.STUDIES
    }
    counts = {k: sum(len(one.seeds) for one in some) for k, some in scenes.items()}
    assert counts == {
        "strangers": 150,
        "barn": 50,
        "barn-fast": 50,
        "barn-lidar": 50,
        "crowd": 166,
        "dense": 53,
        "dynabarn": 36,
        "forest": 50,
        "wheels": 60,
        "barn-lidar-slow": 50,
        "dynabarn-fast": 36,
        "dynabarn-end": 36,
        "points": 120,
        "tracks": 60,
        "crowdnav": 100,
        "parked": 40,
        "maps": 24,
        "paper": 2,
        "several": 40,
        "barn-wheels": 50,
        "crowdnav-5": 100,
        "points-together": 120,
        "tracks-together": 60,
    }


def test_a_planner_is_before_the_method_on_maps(tmp_path, monkeypatch, data_folder):
    inside = ["--inside", str(ablation.PACKAGE.parent), "--parts", "guide"]
    some = ["--studies", "paper,maps", "--every", "8", "--data", str(data_folder)]
    asked = []

    def run_study(title, scenes, options, add):
        asked.append((options.methods, {scene.setting for scene in scenes}))
        return []

    monkeypatch.setattr(ablation, "run_study", run_study)
    study(monkeypatch, *inside, *some, "--out", str(tmp_path))
    assert asked == [("qp-ahead", {"paper"}), ("astar+qp-ahead", {"maps"})]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["--parts", "wheels"], "wheels"), (["--studies", "moon"], "moon")],
)
def test_what_is_wrong_is_said(arguments, said, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, *arguments)
    assert said in capsys.readouterr().err


def test_a_process_that_has_another_package_refuses(tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, "--parts", "parking", "--inside", str(tmp_path))
    assert "is not in" in capsys.readouterr().err
