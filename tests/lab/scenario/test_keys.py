"""The reference of all keys: complete, and true to the models."""

import json
import re
import sys
import tomllib

import pytest

from places import ROOT
from qpavoid.cli import main
from qpavoid.lab.scenario.config import builtin_configs
from qpavoid.lab.scenario.schema import ScenarioModel
from qpavoid.lab.study.sweep.study import StudyModel

sys.path.append(str(ROOT / "docs"))
from keys import key_tables

MODELS = (ScenarioModel, StudyModel)
KEYS = json.loads((ROOT / "tests/lab/scenario/keys.json").read_text())
"""Keys and defaults of scenario files, kept by hand."""


def test_every_key_has_an_effect():
    for model in MODELS:
        for table in key_tables(model):
            assert table.what and table.keys
            for key in table.keys:
                assert key.effect and key.kind, (table.head, key.name)


def test_the_reference_has_all_keys_of_the_models():
    (top,) = (table for table in key_tables(ScenarioModel) if not table.name)
    assert {key.name for key in top.keys} == set(ScenarioModel.model_fields)
    found = {(t.name, k.name) for t in key_tables(ScenarioModel) for k in t.keys}
    names = {name for name, _ in found}
    for path in KEYS:
        table, _, key = re.sub(r"\[.*?\]", "", path).rpartition(".")
        if table in names:
            assert (table, key) in found, path


def test_units_are_said_by_the_ending():
    units = {k.name: k.unit for t in key_tables(ScenarioModel) for k in t.keys}
    assert units["gamma_per_s"] == "1/s" and units["acceleration_mps2"] == "m/s²"
    assert units["angular_acceleration_radps2"] == "rad/s²" and units["seed"] == ""
    assert units["k_y_rad_per_m2"] == "rad/m²" and units["rate_hz"] == "Hz"


def printed(file, capsys):
    assert main(["schema", file]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_json_schema_is_strict(capsys):
    for model, file in zip(MODELS, ("scenario", "study"), strict=True):
        found = printed(file, capsys)
        assert found["title"] == f"qpavoid {file}"
        assert not found["additionalProperties"]
        assert set(found["properties"]) == set(model.model_fields)


def test_shipped_scenarios_are_valid_by_the_json_schema(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    check = jsonschema.Draft202012Validator(printed("scenario", capsys))
    for name, path in builtin_configs().items():
        document = tomllib.loads(path.read_text())
        assert not [*check.iter_errors(document)], name
    wrong = {"title": "x", "duration_s": -1.0, "filter": {"gamma": 2.0}}
    said = "".join(error.message for error in check.iter_errors(wrong))
    assert "gamma" in said and "-1" in said
