"""What was searched and found for the baselines, as data."""

import tomllib
from itertools import product

import numpy as np
import pytest

import tune_baselines as tuning


def test_a_search_is_recorded_beside_the_others(tmp_path):
    path, better = tmp_path / "tuned.toml", {"time": 2.0}
    path.write_text("[dwa]\ntried = 3\nbest.look = 0.3\n")
    tried = [({}, {"loss": 2.0}), (better, {"loss": 1.5}), (better, {"loss": 1.5})]
    tuning.record("rpp", 8, tried, path)
    known = tomllib.loads(path.read_text())
    assert known["dwa"] == {"tried": 3, "best": {"look": 0.3}}
    assert known["rpp"]["best"] == better and known["rpp"]["tried"] == 2
    assert known["rpp"]["loss"] == {"before": 2.0, "best": 1.5}
    assert known["rpp"]["strangers"] == {"seed": 100000, "count": 8}
    assert set(known["rpp"]["space"]) == set(tuning.SEARCH["rpp"])
    tuning.record("rpp", 8, [({}, {"loss": 2.0})] * 2, path)
    assert tomllib.loads(path.read_text())["rpp"]["best"] == {}


def losses(method, seed):
    """A loss of every setting of a method's space, drawn at random."""
    space = tuning.SEARCH[method]
    rng = np.random.default_rng(seed)
    keys = [tuple(x) for x in product(*space.values())]
    table = dict(zip(keys, rng.permutation(len(keys)), strict=True))
    return lambda _, settings, count: {"loss": table[tuple(settings.values())]}


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


def test_the_defaults_are_what_was_found():
    known = tomllib.loads(tuning.RECORD.read_text())
    assert known
    for method, entry in known.items():
        module, name = tuning.found(method)
        fields = getattr(module, name).__dataclass_fields__
        for key, value in entry["best"].items():
            assert fields[key].default == value and value in entry["space"][key]


def test_every_setting_that_is_searched_exists():
    for method, space in tuning.SEARCH.items():
        module, name = tuning.found(method)
        assert set(space) <= set(getattr(module, name).__dataclass_fields__)


def test_all_had_one_budget():
    """On the same scenes; fewer settings only where none is left to try."""
    known = tomllib.loads(tuning.RECORD.read_text())
    assert {*tuning.SEARCH} - {*known} == {"astar"}
    assert len({str([e["forests"], e["strangers"]]) for e in known.values()}) == 1
    for entry in known.values():
        assert entry["tried"] == 12 or len(entry["start"]) < 5
        assert entry["runs"] == 16 * entry["tried"]
        assert entry["loss"]["best"] <= entry["loss"]["before"]
