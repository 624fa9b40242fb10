"""Keys of scenario files come from the settings: none lost, none out of reach."""

import json
from pathlib import Path

import pytest

from minimal import MINIMAL, write
from qpavoid.errors import ConfigError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.planning.planner import PlannerSettings
from qpavoid.lab.scenario.config import validated
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.scenario.schema import ScenarioModel
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.study.sweep.study import StudyModel
from qpavoid.model.estimate import EstimatorSettings
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.tracking.kanayama import Gains

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
[estimation]
[guide]
[localisation]
kind = "%s"
"""


@pytest.mark.parametrize("kind", [MotionCapture, Uwb])
def test_empty_tables_are_the_defaults_of_python(tmp_path, kind):
    name = "uwb" if kind is Uwb else "motion_capture"
    scenario = load_scenario(write(tmp_path, MINIMAL + ALL_TABLES % name))
    assert scenario.plant == Plant() and scenario.lidar == LidarSettings()
    assert scenario.estimation == EstimatorSettings()
    assert scenario.guide == GuideSettings()
    assert scenario.planner == PlannerSettings()
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


STUDY = {"title": "t", "controllers": ["qp"]}


def lines(model, document):
    with pytest.raises(ConfigError) as caught:
        validated(model, document, Path("s.toml"))
    return [line.removeprefix("s.toml: ") for line in caught.value.problems]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"seeds": "abc"}, ["seeds: string should match pattern"]),
        (
            {"seeds": [-1, "x"]},
            [
                "seeds[0]: input should be greater than or equal to 0 (got -1)",
                "seeds[1]: input should be a valid integer (got 'x')",
            ],
        ),
        (
            {"generators": [{"kind": "forest", "seeds": ["x"]}]},
            ["generators[0].seeds[0]: input should be a valid integer (got 'x')"],
        ),
    ],
)
def test_names_of_types_are_no_part_of_a_key(more, said):
    found = lines(StudyModel, STUDY | more)
    assert len(found) == len(said)
    assert all(line.startswith(text) for line, text in zip(found, said, strict=True))
