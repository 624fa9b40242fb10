"""The reference of all keys: complete, true to the models, and one file of them."""

import json
import re
import tomllib

import pytest

from places import ROOT
from qpavoid.errors import UnknownNameError
from qpavoid.lab.simulation.config import builtin_configs
from qpavoid.lab.simulation.schema import ScenarioModel
from qpavoid.lab.study.keys import json_schema, key_tables, literal, model_of

KEYS = json.loads((ROOT / "tests/lab/simulation/keys.json").read_text())
"""Keys and defaults of scenario files, kept by hand."""


def test_every_key_has_an_effect():
    for file in ("scenario", "study"):
        for table in key_tables(file):
            assert table.what and table.keys
            for key in table.keys:
                assert key.effect and key.kind, (table.head, key.name)


def test_the_reference_has_all_keys_of_the_models():
    (top,) = (table for table in key_tables("scenario") if not table.name)
    assert {key.name for key in top.keys} == set(ScenarioModel.model_fields)
    found = {(t.name, k.name) for t in key_tables("scenario") for k in t.keys}
    names = {name for name, _ in found}
    for path in KEYS:
        table, _, key = re.sub(r"\[.*?\]", "", path).rpartition(".")
        if table in names:
            assert (table, key) in found, path


def test_defaults_are_those_of_the_models():
    for table in key_tables("scenario"):
        for key in table.keys:
            kept = KEYS.get(f"{table.name}.{key.name}" if table.name else key.name)
            if isinstance(kept, float | int | str) and kept not in (
                "absent",
                "absent-default",
            ):
                wanted = "required" if kept == "REQUIRED" else literal(kept)
                assert key.default in (wanted, "inf"), (table.head, key.name)


def test_units_are_said_by_the_ending():
    units = {k.name: k.unit for t in key_tables("scenario") for k in t.keys}
    assert units["gamma_per_s"] == "1/s" and units["acceleration_mps2"] == "m/s²"
    assert units["angular_acceleration_radps2"] == "rad/s²" and units["seed"] == ""
    assert units["k_y_rad_per_m2"] == "rad/m²" and units["rate_hz"] == "Hz"


@pytest.mark.parametrize("file", ["scenario", "study"])
def test_the_json_schema_is_json_and_strict(file):
    text = json.dumps(json_schema(file), allow_nan=False)
    found = json.loads(text)
    assert found["title"] == f"qpavoid {file}" and not found["additionalProperties"]
    assert set(found["properties"]) == set(model_of(file).model_fields)


def test_shipped_scenarios_are_valid_by_the_json_schema():
    jsonschema = pytest.importorskip("jsonschema")
    check = jsonschema.Draft202012Validator(json_schema("scenario"))
    for name, path in builtin_configs().items():
        document = tomllib.loads(path.read_text())
        assert not [*check.iter_errors(document)], name
    wrong = {"title": "x", "duration_s": -1.0, "filter": {"gamma": 2.0}}
    said = "".join(error.message for error in check.iter_errors(wrong))
    assert "gamma" in said and "-1" in said


def test_another_file_is_unknown():
    with pytest.raises(UnknownNameError, match="did you mean 'scenario'"):
        model_of("scenarios")
