"""Keys of scenario files come from the settings: none lost, none out of reach."""

import json
import re
import sys
import tomllib
from pathlib import Path

import pytest

from places import ROOT
from qpavoid.cli import main
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.scenario.config import builtin_configs
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.scenario.schema import ScenarioModel
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.study.sweep.study import StudyModel
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.tracking.kanayama import Gains
from scenario_files import MINIMAL, write

sys.path.append(str(ROOT / "docs"))
from keys import key_tables

MODELS = (ScenarioModel, StudyModel)
KEYS = json.loads((Path(__file__).parent / "keys.json").read_text())
"""Every key with its default, kept by hand."""


def keys(schema, table=None, path=""):
    """Yield every key of a JSON schema with its default."""

    def tables(part):
        if "$ref" in part:
            part = schema["$defs"][part["$ref"].rpartition("/")[2]]
        if "properties" in part:
            yield part
        inner = [part["items"]] if isinstance(part.get("items"), dict) else []
        for one in [*inner, *part.get("anyOf", ()), *part.get("oneOf", ())]:
            yield from tables(one)

    table = schema if table is None else table
    for name, part in table["properties"].items():
        key = f"{path}{name}"
        found = list(tables(part))
        for below in found:
            kind = below["properties"].get("kind", {}).get("const")
            yield from keys(schema, below, f"{key}({kind})." if kind else f"{key}.")
        if found and part.get("default", 0) is None:
            yield key, "absent"
        elif not found and name != "kind":
            required = name in table.get("required", ())
            default = "REQUIRED" if required else part.get("default", "absent-default")
            yield key, "inf" if default == float("inf") else default


def test_every_key_is_there_with_its_default():
    assert dict(keys(ScenarioModel.model_json_schema())) == KEYS


ALL_TABLES = """
[plant]
[lidar]
[guide]
[localisation]
kind = "%s"
"""


@pytest.mark.parametrize("kind", [MotionCapture, Uwb])
def test_empty_tables_are_the_defaults_of_python(tmp_path, kind):
    name = "uwb" if kind is Uwb else "motion_capture"
    scenario = load_scenario(write(tmp_path, MINIMAL + ALL_TABLES % name))
    assert scenario.plant == Plant() and scenario.lidar == LidarSettings()
    assert scenario.guide == GuideSettings()
    assert scenario.perception == PerceptionSettings()
    assert scenario.localisation == kind()
    assert scenario.tracker.gains == Gains()


def test_the_track_of_the_robot_reaches_its_wheels_and_its_odometry(tmp_path):
    text = MINIMAL + '[plant]\nslip = 0.1\n[localisation]\nkind = "uwb"\n'
    without = load_scenario(write(tmp_path, text))
    assert without.plant.track == without.localisation.track == 0.445
    told = load_scenario(write(tmp_path, text + "[robot]\ntrack_m = 0.6\n"))
    assert told.plant.track == told.localisation.track == 0.6
    assert told.plant.start()(0.0, 1.0, 0.05) != without.plant.start()(0.0, 1.0, 0.05)


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
