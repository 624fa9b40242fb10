"""Keys of scenario files come from the settings: none lost, none out of reach."""

import json
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

from minimal import MINIMAL, write
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import ConfigError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.planning.planner import PlannerSettings
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Patch, Physics
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation.config import validated
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.simulation.schema import ScenarioModel
from qpavoid.lab.study.sweep.study import StudyModel
from qpavoid.model.estimate import EstimatorSettings
from qpavoid.model.robot import Limits
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.settings import declared
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.path import CubicPath, SplinePath
from qpavoid.tracking.station import StationKeeping

BEFORE = json.loads((Path(__file__).parent / "keys.json").read_text())
"""Every key with its default, as they stood in models written by hand."""

NEW = {
    "obstacles(polygon).times_s": "absent-default",
    "obstacles(polygon).shifts_m": "absent-default",
    "planner.detour_m": 1.0,
    "tracking.rest_m": 0.003,
    "tracking.wake_m": 0.008,
    "tracking.blend_speed_mps": 0.05,
    "reference(spline).begin_mps": 0.0,
    "reference(barn).begin_mps": 0.0,
    "lidar.mount_x_m": 0.0,
    "lidar.mount_y_m": 0.0,
    "lidar.mount_heading_rad": 0.0,
    "lidar.point_radius_m": 0.02,
    "lidar.fade": 0.0,
    "lidar.sweep_s": 0.0,
    "lidar.delay_s": 0.0,
    "lidar.perception": True,
    "perception.radius_m": 0.25,
    "perception.acceleration_mps2": 1.5,
    "perception.memory_s": 20.0,
    "perception.memory_way_m": 8.0,
    "localisation(uwb).start_sigma_m": 0.05,
    "localisation(uwb).start_sigma_rad": 0.05,
    "robot.v_dead_mps": None,
    "robot.omega_dead_radps": None,
}
"""What no file could set."""

GUIDE = {
    "guide.horizon_s": 3.0,
    "guide.soft_m": 0.15,
    "guide.near": 20.0,
    "guide.deep_m": 100.0,
    "guide.enter_m2": 2.0,
    "guide.heading_m2": 0.1,
    "guide.hysteresis": 0.1,
    "guide.preference": 0.05,
    "guide.clear_m": 0.03,
    **{key: value for key, value in BEFORE.items() if key.startswith("guide")},
}
"""Those of the guide."""

PLACED = {
    **dict.fromkeys(("x_m", "y_m", "length_m", "width_m"), "REQUIRED"),
    "heading_rad": 0.0,
}
MUJOCO = {
    "plant(mujoco).base": "differential",
    "plant(mujoco).friction": 0.5,
    "plant(mujoco).delay_s": 0.02,
    "plant(mujoco).lag_s": 0.05,
    "plant(mujoco).acceleration_mps2": "inf",
    "plant(mujoco).angular_acceleration_radps2": "inf",
    "plant(mujoco).torque_nm": "inf",
    "plant(mujoco).separation_multiplier": 0.0,
    **{
        f"plant(mujoco).{things}.{key}": default
        for things, last in (("patches", {"friction": 0.1}),)
        for key, default in (PLACED | last).items()
    },
}
"""Those of the plant of rigid bodies."""

PACE = {
    "speed_mps": "REQUIRED",
    "turn_rate_radps": 1.0,
    "acceleration_mps2": 0.5,
    "smoothing_m": 0.02,
    "begin_mps": 0.0,
}
EACH = {"robot": "absent", "controller": None, "jitter_m": 0.0, "jitter_rad": 0.0}
ROBOTS = {
    "one": EACH,
    "circle": {**EACH, **PACE, "count": "REQUIRED", "radius_m": "REQUIRED"},
    "random": {
        **{**EACH, **PACE, "count": "REQUIRED", "apart_m": 1.5},
        **{"low_m": "REQUIRED", "high_m": "REQUIRED"},
    },
}
"""Those of several robots that a single one has not."""


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
    alone, of_robots = BEFORE | NEW | GUIDE | MUJOCO, {kind: {} for kind in ROBOTS}
    found = dict(keys(ScenarioModel.model_json_schema()))
    for key in [key for key in found if key.startswith("robots(")]:
        kind, _, name = key.removeprefix("robots(").partition(").")
        of_robots[kind][name] = found.pop(key)
    assert found == alone
    for kind, own in ROBOTS.items():
        assert own.items() <= of_robots[kind].items()
        others = of_robots[kind].keys() - own.keys()
        assert {name: of_robots[kind][name] for name in others}.items() <= alone.items()


SETTINGS = (
    AvoidanceSettings,
    *(
        type(getattr(AvoidanceSettings(), part.name))
        for part in (
            item for item in fields(AvoidanceSettings) if is_dataclass(item.type)
        )
    ),
    *(
        GuideSettings,
        PlannerSettings,
        PerceptionSettings,
        LidarSettings,
        MotionCapture,
    ),
    *(
        Uwb,
        Plant,
        Physics,
        Patch,
        EstimatorSettings,
        Limits,
        Waiting,
        Gains,
        CubicPath,
        SplinePath,
    ),
    StationKeeping,
)
GIVEN = {"seed", "track", "dt", "points", "start", "goal", "patches"}
"""Of the scenario, the robot, or written in a way of their own."""


@pytest.mark.parametrize("kind", SETTINGS, ids=lambda kind: kind.__name__)
def test_every_field_has_a_key(kind):
    known = {key.rpartition(".")[2] for key in BEFORE | NEW | GUIDE | MUJOCO}
    prefix = "wait_" if kind is Waiting else ""
    said = {
        setting.name
        for setting in declared(kind)
        if setting.keys and all(prefix + key in known for key in setting.keys)
    }
    nested = {item.name for item in fields(kind) if is_dataclass(item.type)}
    assert {item.name for item in fields(kind)} - nested - GIVEN <= said | {
        "estimation"
    }


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
