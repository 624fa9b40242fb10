"""What was searched and found for the baselines, as data."""

import json
import tomllib
from itertools import groupby, product

import numpy as np
import pytest

import tune_baselines as tuning
from places import ROOT
from qpavoid.lab.study.sweep.sources import scenario_file


def test_a_search_is_recorded_beside_the_others(tmp_path):
    path, better = tmp_path / "tuned.toml", {"time": 2.0}
    path.write_text("[dwa]\ntried = 3\n[rpp]\ntried = 12\n")
    tried = [({}, {"loss": 2.0}), (better, {"loss": 1.5}), (better, {"loss": 1.5})]
    tuning.record("rpp", 40, tried, path)
    known = tomllib.loads(path.read_text())
    assert known["dwa"] == {"tried": 3} and known["rpp"]["tried"] == 12
    found = known["rpp"]["all_kinds"]
    assert found["best"] == better and (found["tried"], found["runs"]) == (2, 80)
    assert (found["before"], found["after"]) == ({"loss": 2.0}, {"loss": 1.5})
    assert found["cases"] == "tune_guide.toml"
    assert set(found["space"]) == set(tuning.SEARCH["rpp"])
    tuning.record("new", 40, [({}, {"loss": 2.0})] * 2, path)
    last = tomllib.loads(path.read_text())["new"]["all_kinds"]
    assert last["best"] == {}


def test_ours_is_recorded_beside_the_others(tmp_path):
    path, found = tmp_path / "tuned.toml", tmp_path / "tuning.json"
    path.write_text("[rpp]\ntried = 12\n")
    table = [
        {"settings": name, "scenes": scenes, "loss": loss}
        for name, scenes, loss in (
            ("as they stand", "training", 0.5),
            ("as they stand", "held out", 0.7),
            ("best", "training", 0.4),
            ("best", "held out", 0.8),
        )
    ]
    text = "trials = 3\n[search]\nx = {low = 0.0, high = 1.0}\n"
    told = {"best": {"x": 0.2}, "table": table, "tuning": text}
    found.write_text(json.dumps(told))
    tuning.record_ours(found, 40, path)
    known = tomllib.loads(path.read_text())
    assert known["rpp"] == {"tried": 12}
    assert known["guide"]["all_kinds"] == {
        "cases": "tune_guide.toml",
        "tried": 3,
        "runs": 120,
        "seed": 0,
        "driven": "start",
        "space": {"x": {"low": 0.0, "high": 1.0}},
        "before": {"loss": 0.5},
        "after": {"loss": 0.4},
        "held_out": {"before": {"loss": 0.7}, "after": {"loss": 0.8}},
        "best": {"x": 0.2},
    }


@pytest.mark.slow
def test_the_cases_are_those_that_ours_was_trained_on(data_folder):
    """Sources and numbers of ``train`` in the file, read by hand."""
    told = tomllib.loads(tuning.CASES.read_text())
    cases = tuning.cases_of(data_folder)
    found = [(x, [*some]) for x, some in groupby(cases, key=lambda case: case.source)]
    parts = [*told["scenarios"], *told["generators"]]
    for part, (source, some) in zip(parts, found, strict=True):
        seeds = range(*map(int, part["train"].split(":")))
        assert [case.seed for case in some] == [*seeds]
        asked = part | part.get("options", {})
        keys = "config", "family", "speed_mps", "scene", "phase", "people"
        for value in (asked[key] for key in keys if key in asked):
            assert f"={value!r}" in repr(source)
    assert len(cases) == 40
    held = tuning.cases_of(data_folder, "held out")
    assert len(held) == 142 and not {*map(str, held)} & {*map(str, cases)}


def test_a_setting_is_judged_by_what_its_runs_come_to(monkeypatch):
    ends = iter([(True, True, 1.0), (False, False, 0.5)])
    monkeypatch.setattr(tuning, "met", lambda *_: next(ends))
    found = tuning.judged("stop", {}, ["a", "b"], workers=1)
    assert found == {"loss": 0.5 + 5.0 + 0.75, "failure": 0.5} | {
        "contact": 0.5,
        "time": 0.75,
    }


def test_a_case_is_driven_with_the_settings_that_are_tried():
    case = tuning.Case(scenario_file("demo/strangers"), 1, "")
    failed, _, share = tuning.met("stop", {"margin": 50.0}, case)
    assert failed and share == 1.0
    assert tuning.met("stop", {"margin": 0.05}, case) != (failed, False, share)


def losses(method, seed):
    """A loss of every setting of a method's space, drawn at random."""
    space = tuning.SEARCH[method]
    rng = np.random.default_rng(seed)
    keys = [tuple(x) for x in product(*space.values())]
    table = dict(zip(keys, rng.permutation(len(keys)), strict=True))
    return lambda _, settings, count: {"loss": float(table[tuple(settings.values())])}


@pytest.mark.parametrize("method", ["dwa", "rpp", "eq5-tuned", "teb"])
@pytest.mark.parametrize("tries", [1, 5, 12, 10_000])
def test_a_budget_is_spent_and_not_more(method, tries, monkeypatch):
    loss = losses(method, tries)
    monkeypatch.setattr(tuning, "judged", loss)
    *tried, (best, least) = tuning.search(method, 3, tries)
    kinds = {tuple(settings.values()) for settings, _ in tried}
    assert len(kinds) == len(tried) <= tries
    assert least["loss"] == min(result["loss"] for _, result in tried)
    assert least == loss(method, best, 3) and tried[0][0] == tuning.standing(method)
    left = tuning.SEARCH[method].items() if len(tried) < tries else ()
    for key, values in left:
        for value in values:
            assert loss(method, {**best, key: value}, 3)["loss"] >= least["loss"]
    assert left or len(tried) == tries


@pytest.mark.parametrize("method", ["rpp", "nmpc", "c3bf"])
def test_what_a_search_left_is_drawn(method, tmp_path, monkeypatch):
    path, loss = tmp_path / "tuned.toml", losses(method, 3)
    monkeypatch.setattr(tuning, "judged", loss)
    found = [*tuning.search(method, 40, 10_000)]
    tuning.record(method, 40, found, path)
    known = tuning.recorded(method, path)
    assert [*tuning.rest(method, 40, known, known["tried"])] == []
    drawn = [*tuning.rest(method, 40, known, known["tried"] + 9)]
    kinds = {tuple(settings.values()) for settings, _ in drawn}
    assert len(kinds) == len(drawn) == 9
    for settings, result in drawn:
        assert sum(settings[key] != x for key, x in known["best"].items()) > 1
        assert result == loss(method, settings, 40)
    tuning.record_rest(method, drawn, path)
    after = tuning.recorded(method, path)
    assert (after["tried"], after["drawn"]) == (known["tried"] + 9, 9)
    assert after["runs"] == 40 * after["tried"] and after["seed"] == tuning.SEED
    assert all(after[key] == known[key] for key in ("best", "before", "after"))
    told = after["best_drawn"]
    assert told["loss"] == min(x["loss"] for _, x in drawn)
    assert (told["settings"], {"loss": told["loss"]}) in drawn


@pytest.mark.parametrize("better", [True, False])
def test_what_is_drawn_has_to_be_better_on_cases_held_out(
    better, tmp_path, monkeypatch
):
    path, start = tmp_path / "tuned.toml", tuning.standing("rpp")
    tuning.record("rpp", 40, 2 * [(start, {"loss": 2.0})], path)
    assert not tuning.gains(tuning.recorded("rpp", path))
    for loss, gains in (1.99, False), (1.9, True):
        tuning.record_rest("rpp", [({**start, "time": 0.6}, {"loss": loss})], path)
        assert tuning.gains(tuning.recorded("rpp", path)) == gains
    ends = {start["time"]: {"loss": 3.0}, 0.6: {"loss": 2.9 if better else 3.0}}
    monkeypatch.setattr(tuning, "judged", lambda _, some, __: ends[some["time"]])
    held = tuning.record_held_out("rpp", ["a", "b"], path)
    known = tuning.recorded("rpp", path)
    assert known["held_out"] == held and known["before"] == {"loss": 2.0}
    assert known["best"]["time"] == (0.6 if better else start["time"])
    assert known["after"] == {"loss": 1.9 if better else 2.0}


def test_a_check_is_recorded_and_changes_nothing_else(tmp_path, monkeypatch):
    path, start = tmp_path / "tuned.toml", tuning.standing("rpp")
    found = {**start, "time": 0.6}
    tried = [(start, {"loss": 2.0}), (found, {"loss": 1.0}), (found, {"loss": 1.0})]
    tuning.record("rpp", 40, tried, path)
    before = tuning.recorded("rpp", path)
    ends = {start["time"]: {"loss": 3.0}, 0.6: {"loss": 3.5}}
    monkeypatch.setattr(tuning, "judged", lambda _, some, __: ends[some["time"]])
    check = tuning.record_check("rpp", ["a", "b"], path)
    assert check == {"before": {"loss": 3.0}, "after": {"loss": 3.5}}
    assert tuning.recorded("rpp", path) == before | {"check": check}


def test_what_searches_found_was_asked_of_cases_held_out():
    known = tomllib.loads(tuning.RECORD.read_text())
    searched = {x: known[x]["all_kinds"] for x in tuning.SEARCH}
    changed = {x for x, of in searched.items() if of["start"] != of["best"]}
    assert changed == {x for x, of in searched.items() if "check" in of}
    for name in changed & {x for x, of in searched.items() if "held_out" in of}:
        held = searched[name]["held_out"]
        taken = "after" if held["after"]["loss"] < held["before"]["loss"] else "before"
        assert searched[name]["check"]["after"] == held[taken]


def test_the_defaults_are_what_was_found():
    known = tomllib.loads(tuning.RECORD.read_text())
    ours = known.pop("guide")["all_kinds"]
    held_out = ours["held_out"]
    assert ours["driven"] == "start"
    assert held_out["after"]["failure"] >= held_out["before"]["failure"]
    assert held_out["after"]["contact"] >= held_out["before"]["contact"]
    for method, entry in known.items():
        last = entry.get("all_kinds", entry)
        module, name = tuning.found(method)
        fields = getattr(module, name).__dataclass_fields__
        for key, value in last["best"].items():
            assert fields[key].default == value and value in last["space"][key]


def test_every_setting_that_is_searched_exists():
    for method, space in tuning.SEARCH.items():
        module, name = tuning.found(method)
        assert set(space) <= set(getattr(module, name).__dataclass_fields__)


def test_all_had_one_budget():
    """On the same cases; only the first search left some where no neighbour gained."""
    known = tomllib.loads(tuning.RECORD.read_text())
    assert {*tuning.SEARCH} <= {*known}
    first = [entry for entry in known.values() if "forests" in entry]
    assert len({str([e["forests"], e["strangers"]]) for e in first}) == 1
    for entry in first:
        assert entry["tried"] == 12 or len(entry["start"]) < 5
        assert entry["runs"] == 16 * entry["tried"]
        assert entry["loss"]["best"] <= entry["loss"]["before"]
    for entry in (x["all_kinds"] for x in known.values() if "all_kinds" in x):
        assert entry["cases"] == tuning.CASES.name
        assert (entry["tried"], entry["runs"]) == (16, 40 * 16)
        assert entry["after"]["loss"] <= entry["before"]["loss"]
        assert "held_out" in entry or not tuning.gains(entry)


def test_the_readme_says_how_many_were_searched():
    known = tomllib.loads(tuning.RECORD.read_text())
    searched = [x for x in known if "all_kinds" in known[x] and x != "guide"]
    ((tried, runs),) = {
        tuple(known[x]["all_kinds"][key] for key in ("tried", "runs")) for x in searched
    }
    said = (
        f"searched on {runs // tried} training cases; {len(searched) - 1} others and "
        f"A* were searched on the same, in {tried} settings each"
    )
    assert "astar" in searched and said in (ROOT / "README.md").read_text()
