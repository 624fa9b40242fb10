"""The studies of reliability, in small; their page and its tables."""

import shutil
import warnings

import numpy as np
import pytest

for module, extra in (("pyarrow", "study"), ("rosbags", "bags")):
    pytest.importorskip(module, reason=f"needs qpavoid[{extra}]")

from qpavoid.errors import InvalidInputError
from qpavoid.model.validation import MOST_ROWS, as_polygons, as_rows
from reliability import damage, exported, loops, page
from reliability.calls import study

GCC = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
WRONG = ("raised", "not finite", "beyond limits")


def test_the_page_is_made_of_the_tables():
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.filled(text, page.TABLES) == text
    assert f"{sum(int(x['calls']) for x in page.rows_of('calls')):,} calls" in text
    within = [x for x in page.rows_of("loops") if x["within the premises"] == "yes"]
    assert f"no contact in {sum(int(x['loops']) for x in within):,} loops" in text
    assert (
        f"{sum(int(x['loops']) for x in page.rows_of('loops')):,} closed loops" in text
    )


def test_the_tables_keep_what_the_page_promises():
    for row in page.rows_of("calls"):
        assert [row[name] for name in WRONG] == ["0"] * 3, row
    for row in page.rows_of("exported"):
        assert [row[name] for name in WRONG[1:]] == ["0"] * 2, row
    for row in page.rows_of("loops"):
        assert row["within the premises"] == "no" or row["contacts"] == "0", row
    assert all(row["foreign"] == "0" for row in page.rows_of("files"))
    assert {row["reader"] for row in page.rows_of("files")} == {*damage.KINDS}


@pytest.mark.parametrize("solver", ["exact", "osqp", "casadi", "qpsolvers:daqp"])
def test_hostile_calls_have_answers(solver):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        row = study(solver, 600)
    assert [row[name] for name in WRONG] == [0, 0, 0] and 300 < row["invalid"] < 500


@pytest.mark.parametrize("fault", loops.WITHIN)
def test_nothing_is_touched_within_the_premises(fault):
    row = loops.study(fault, 2)
    assert row["contacts"] == 0 and row["least clearance m"] > 0.0


def test_a_fault_outside_them_is_one():
    """Blind without a word, and the robot drives on: some loop is spoilt by that."""
    assert loops.study("blind, not said", 12)["below r_min"] > 0


@GCC
@pytest.mark.slow
@pytest.mark.parametrize("sanitizer", exported.SANITIZERS)
def test_the_exported_filter_answers_hostile_calls(sanitizer):
    row = exported.fuzz("careful", sanitizer, 600, threads=2)
    assert row["calls"] == 600 and 50 < row["invalid"] < 300
    assert row["not finite"] == row["beyond limits"] == 0


@GCC
@pytest.mark.long
def test_its_stack_is_bounded_and_no_compiler_warns():
    pytest.importorskip("ziglang")
    row = exported.describe("late")
    assert 1000 < row["stack bytes"] < 16_384
    assert row["warnings of gcc"] == row["warnings of clang"] == 0


@pytest.mark.long
@pytest.mark.parametrize("name", damage.KINDS)
def test_damaged_files_raise_our_own_errors_alone(name):
    found = damage.fuzz_apart(name, 50, seed=1)
    assert found["foreign"] == 0, found["what"]
    assert found["read"] + found["refused"] == 50 and found["refused"] > 10
    assert found["worst_s"] <= 1.0 and found["most_mb"] <= 500


def test_an_error_of_a_reader_is_found(monkeypatch):
    careless = "obsmat.txt", lambda path: float(path.read_text()[:1])
    monkeypatch.setitem(damage.KINDS, "careless", careless)
    monkeypatch.setattr(damage.resource, "setrlimit", lambda *_: None)
    found = damage.fuzz("careless", 30)
    assert found["foreign"] > 0 and found["read"] + found["foreign"] == 30
    assert any("Error" in error for error in found["what"])


def test_more_rows_than_can_be_answered_in_time_are_refused_uncopied():
    for wide in [(10**12, 2), (3, 10**12)]:
        with pytest.raises(InvalidInputError, match="more than 1000000"):
            as_rows(np.broadcast_to(0.5, wide), 2, "points")
    with pytest.raises(InvalidInputError, match="rows"):
        as_rows(range(MOST_ROWS + 1), 2, "points")
    with pytest.raises(InvalidInputError, match="sequence"):
        as_polygons(iter([]))
