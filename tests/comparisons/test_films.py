"""`comparisons/films.py`: every scene is there, and a film is written."""

import sys

import pytest

import films
from qpavoid.lab.simulation.config import builtin_configs
from qpavoid.lab.simulation.methods import check_methods


def test_every_scene_and_method_exists():
    for config, methods in films.SCENES.values():
        assert config in builtin_configs()
        check_methods(methods.split(","))


def test_a_film_is_written(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(films, "animate", lambda logs, path, *how: drawn.append(path))
    monkeypatch.setattr(films, "run_fleet", lambda scenario, method: [method])
    options = ["--scenes", "trap,swap", "--kind", "mp4", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["films.py", *options])
    films.main()
    assert drawn == [tmp_path / "trap.mp4", tmp_path / "swap.mp4"]


def test_an_unknown_scene_is_a_usage_error(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["films.py", "--scenes", "x"])
    with pytest.raises(SystemExit) as ended:
        films.main()
    assert ended.value.code == 2 and "unknown scene 'x'" in capsys.readouterr().err
