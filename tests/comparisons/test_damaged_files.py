"""Damaged files of every kind: our own errors alone, in a second, in 500 MB."""

import random

import pytest

for name, extra in (("pyarrow", "study"), ("optuna", "tune"), ("rosbags", "bags")):
    pytest.importorskip(name, reason=f"needs qpavoid[{extra}]")

from reliability.damage import damaged, fuzz_apart
from reliability.kinds import KINDS

FEW = {"scenario": 25, "map": 25, "study": 50}
"""Of readers that take their time, or hardly ever let pass; 30 of all others."""


@pytest.mark.parametrize(
    "count", [None, pytest.param(10_000, marks=pytest.mark.slow)], ids=str
)
@pytest.mark.parametrize("name", KINDS)
def test_readers_let_nothing_out_but_our_own_errors(name, count):
    wanted = count or FEW.get(name, 30)
    found = fuzz_apart(name, wanted, seed=1)
    assert found["foreign"] == 0, found["what"]
    assert found["read"] + found["refused"] == wanted
    assert found["refused"] > 0.3 * wanted
    assert found["worst_s"] <= 1.0 and found["most_mb"] <= 500
    assert name == "parquet" or found["read"] > 0


def test_a_reader_that_lets_something_out_is_found(monkeypatch):
    from reliability import damage, kinds

    def careless(path):
        int(path.read_text())

    made = kinds.Kind(kinds.text("number.txt", "42\n"), careless)
    monkeypatch.setitem(kinds.KINDS, "careless", made)
    monkeypatch.setattr(damage.resource, "setrlimit", lambda *_: None)
    found = damage.fuzz("careless", 50)
    assert found["foreign"] > 20 and "ValueError" in "".join(found["what"])


def test_damages_are_repeatable_and_real():
    whole = b"x = 1.0\ny = [2, 3]\n"
    made = [damaged(whole, True, random.Random(k)) for k in range(100)]
    assert made == [damaged(whole, True, random.Random(k)) for k in range(100)]
    assert sum(one != whole for one in made) > 90
