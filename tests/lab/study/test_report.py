"""The report: what is packed, read and written."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from packed import HOSTILE, row, unpacked
from qpavoid.avoidance.decision import SENTENCES
from qpavoid.errors import DataError
from qpavoid.lab.study.report import payload
from qpavoid.lab.study.report.page import as_json, part
from qpavoid.lab.study.report.payload import pack, pack_groups, pack_run
from qpavoid.lab.study.report.ranking import name_methods, read_results

# ---- payload ----------------------------------------------------------------------


def test_what_is_packed_comes_out_again():
    arrays = {
        "few": np.array([1, -2, 3], dtype=np.int8),
        "many": np.linspace(0.0, 1.0, 12).reshape(3, 4),
        "none": np.empty((5, 0, 4)),
    }
    found = unpacked(pack(arrays))
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array.astype(found[name].dtype))


def test_a_long_log_is_thinned(logs, monkeypatch):
    log = logs[0]
    columns = {name: np.tile(x, 110) for name, x in log.columns.items()}
    long = replace(
        log,
        columns=columns,
        discs=np.tile(log.discs, (110, 1, 1)),
    )
    packed = pack_run(long)
    assert packed["every"] == -(-len(long) // payload.MOST_LOG_STEPS) > 1
    assert len(unpacked(packed)["t"]) <= payload.MOST_LOG_STEPS
    monkeypatch.setattr(payload, "MOST_LOG_NUMBERS", 30_000)
    found = unpacked(pack_run(long))
    assert sum(x.size for x in found.values()) < 31_500


def test_whole_scenarios_are_kept_first_those_that_tell_methods_apart(
    logs, tmp_path, monkeypatch
):
    logs[0].save(tmp_path / "log.npz")
    rows = [
        row(name, scenario=scenario, outcome=outcome, run=f"{scenario}{name}")
        for scenario, other in (("alike", "arrived"), ("apart", "stalled"))
        for name, outcome in (("a", "arrived"), ("b", other))
    ]
    paths = {x["run"]: tmp_path / "log.npz" for x in rows}
    groups, left_out = pack_groups(name_methods(rows), paths)
    assert [len(group["runs"]) for group in groups] == [2, 2] and left_out == 0
    assert groups[0]["runs"][1]["run"] == "apartb"
    monkeypatch.setattr(payload, "BUDGET", payload.size(groups[0]))
    groups, left_out = pack_groups(name_methods(rows), paths)
    assert len(groups) == 1 and left_out == 2
    monkeypatch.setattr(payload, "BUDGET", payload.size(groups[0]) - 1)
    groups, left_out = pack_groups(name_methods(rows), paths)
    assert [len(group["runs"]) for group in groups] == [1] and left_out == 3


# ---- reading and writing ----------------------------------------------------------


def test_a_folder_without_runs_is_an_error(tmp_path):
    with pytest.raises(DataError, match="no results of qpavoid sweep"):
        read_results(tmp_path)
    for empty in ("[]", "{}"):
        (tmp_path / "summary.json").write_text(empty)
        with pytest.raises(DataError, match="no runs yet"):
            read_results(tmp_path)
    for wrong in ("{", "[1]", "[{}]"):
        (tmp_path / "summary.json").write_text(wrong)
        with pytest.raises(DataError, match=r"summary\.json"):
            read_results(tmp_path)


def test_data_cannot_leave_its_place_in_the_page():
    text = as_json({"a": HOSTILE, "b": [math.nan, math.inf, 1.5], "c": "\u2028"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": HOSTILE, "b": [None, None, 1.5], "c": "\u2028"}


def test_the_page_says_of_a_status_what_python_says():
    told = dict(re.findall(r'^    (\w+): "(.+)",$', part("panels.js"), re.MULTILINE))
    assert told == {str(status): text for status, text in SENTENCES.items()}
