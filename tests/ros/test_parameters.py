"""Parameters are the keys of scenario files; diagnostics and markers say what is."""

import json
import math

import numpy as np
import pytest
from ros_guards import AT_ONCE, guarded

import ros_messages as ros
from places import ROOT
from qpavoid.avoidance.inputs import Fault
from qpavoid.avoidance.settings import Actuation, AvoidanceSettings
from qpavoid.errors import InvalidInputError, UnknownNameError
from qpavoid.lab.scenario.schema import Preset, ScenarioModel
from qpavoid.lab.study.replay import read_parameters
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.ros.guard import Guard
from qpavoid.ros.parameters import PRESETS, TABLES, Wiring, defaults, preset, setup_of
from qpavoid.ros.report import ERROR, OK, WARN, diagnose, markers

SHIPPED = sorted((ROOT / "configs" / "ros").glob("[!s]*.yaml"))
SHAPE = "robot.footprint_m"


def test_defaults_are_those_of_the_package_but_for_a_jitter():
    for name in PRESETS:
        robot, actuation = preset(name), Actuation(jitter=0.25)
        setup = setup_of(defaults(robot), robot, 0.02)
        assert setup.settings == AvoidanceSettings(actuation=actuation)
        assert setup.robot.limits == robot.limits
        np.testing.assert_array_equal(
            setup.robot.footprint.vertices, robot.footprint.vertices
        )


def test_names_are_those_of_scenario_files():
    assert set(PRESETS) == set(Preset.__args__)
    own = {"freshness", "drive"}
    for table in set(TABLES) - own:
        assert table in ScenarioModel.model_fields


def test_values_are_set_and_refused_by_name():
    robot = preset("jackal")
    text = "[[-0.1, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.1, 0.1]]"
    given = {"filter.weight_omega_m2": 0.3, "robot.v_min_mps": 0.0, SHAPE: text}
    setup = setup_of(defaults(robot) | given, robot, 0.05)
    assert setup.settings.weights == (1.0, 0.3) and setup.settings.dt == 0.05
    assert setup.robot.limits.v_min == 0.0 and setup.robot.limits.v_max == 2.0
    assert setup.robot.footprint.circumradius == pytest.approx(math.hypot(0.2, 0.1))
    clockwise = "[[0.2, 0.1], [0.2, -0.1], [-0.1, -0.1]]"
    union = defaults(robot) | {SHAPE: f"[{text}, {clockwise}]"}
    first, second = setup_of(union, robot, 0.05).robot.footprint.outlines
    assert first.tolist() == json.loads(text)
    assert second.tolist() == json.loads(clockwise)[::-1]
    for wrong, said in (
        (
            {"radius.r_min_slow_m": -1.0},
            "radius: a safety radius needs r_min_slow >= 0",
        ),
        ({"filter.gamma_per_s": 100.0}, r"filter: settings need gamma \* dt <= 1"),
        ({"filter.bound": "none"}, "to be one of barrier, repulsion"),
        ({SHAPE: "[[1, 2], [3]]"}, "robot.footprint_m: "),
        ({SHAPE: "[[0, 0], [1, 0], [0, 1]"}, "robot.footprint_m: "),
        ({SHAPE: [0.0, 1.0]}, "robot.footprint_m: "),
        ({SHAPE: "[]"}, "robot.footprint_m: "),
        ({SHAPE: '["ab", "cd"]'}, "robot.footprint_m: "),
        ({SHAPE: f"[{text}, []]"}, "robot.footprint_m: "),
        ({SHAPE: "[[0, 0]]"}, "n >= 3"),
        ({SHAPE: "[[0, 0], [1, 0], [0, 1], [1, 1]]"}, "robot.footprint_m: "),
    ):
        with pytest.raises(InvalidInputError, match=said):
            setup_of(defaults(robot) | wrong, robot, 0.05)
    with pytest.raises(UnknownNameError, match="did you mean 'jackal'"):
        preset("jakal")


def test_a_scan_of_40_hz_is_due_when_it_arrives_and_before_the_timer():
    """Also 2.5 ms early or late."""
    dt, values = Wiring().dt_s, defaults(preset("mir100"))
    longest = dt * (1.0 + values["actuation.jitter"])
    assert dt <= 0.0225 and 0.0274 < longest < 0.03


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_shipped_files_are_valid(path):
    wiring, setup = read_parameters(path)
    assert Guard(setup, wiring).inputs.watches and setup.freshness.good > 0.0


@pytest.mark.parametrize(
    ("wiring", "said"),
    [({"scans": ()}, "must name a topic"),
     ({"scans": ("a", "a")}, "a topic is repeated"),
     ({"frame_poses": (0.0,) * 6}, "frame_poses needs 6 numbers"),
     ({"mask_boxes_m": (1.0, 0.0, 0.0, 1.0)}, "x_min, y_min < x_max"),
     ({"mask_boxes_m": (1.0,)}, "mask_boxes_m needs 4 numbers"),
     ({"last_beam_stamps": ("scam",)}, "last_beam_stamps names"),
     ({"empty_is_free": ("scan",)}, "empty_is_free names"),
     ({"frames": ("a",), "frame_poses": (0, 0, 0, 0, 0, 180)}, "180 degrees are 3.142"),
     ({"role": "planner"}, "role must be one of"),
     ({"role": "guide", "odometry": ""}, "a guide needs odometry"),
     ({"dock_frame": "dock"}, "a dock needs dock_frame and dock_m"),
     ({"dock_frame": "dock", "dock_m": (0.0, 0.0, 1.0)}, "dock_m needs 2 numbers")],
)  # fmt: skip
def test_wiring_that_is_wrong_is_named(wiring, said):
    with pytest.raises(InvalidInputError, match=said):
        guarded(**wiring)


@pytest.fixture
def guard():
    return guarded(AT_ONCE, odometry="")


def step(guard, distance, v=0.8):
    guard.see("scan", ros.wall(10.0, distance), 10.0, 10.0)
    guard.command(ros.twist(v), 10.0, 10.0)
    return guard.step(10.0, 10.0)


def test_diagnostics_say_what_is(guard):
    early = guard.step(9.0, 9.0)
    assert early.sentence.startswith("scan: never seen.")
    assert diagnose(guard, early)[0] == ERROR
    level, free = diagnose(guard, step(guard, 8.0), (0.001, 0.002, 0.003))
    assert level == OK and free["status"] == "tracking"
    assert free["latency_p50_s"] == "0.002"
    assert free["scan"] == "fresh, 0 s old; refused: none"
    guard.see("scan", ros.wall(9.0, 1.0), 10.0, 10.0)
    late = guard.step(10.4, 10.4)
    _, told = diagnose(guard, late)
    assert late.faults == {"scan": Fault.UNORDERED}
    assert told["scan"] == "unordered, 0.4 s old; refused: 1 unordered"
    guard.inputs.latch.steps = 5
    guard.see("scan", ros.wall(10.5, 8.0), 10.5, 10.5)
    assert diagnose(guard, guard.step(10.5, 10.5))[0] == WARN


def test_markers_show_what_holds_the_robot(guard):
    now = step(guard, 1.0)
    assert now.decision.active
    drawn = {one.name: one for one in markers(guard, now)}
    footprint = guard.setup.robot.footprint
    np.testing.assert_array_equal(drawn["footprint"].points[::2], footprint.vertices)
    rim = drawn["zone of slow obstacles"].points
    away = Contacts.of(footprint, Obstacles(rim)).distance
    np.testing.assert_allclose(away, 0.17, atol=1e-9)
    lines = drawn["active contacts"].points.reshape(-1, 2, 2)
    long = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    assert len(lines) == len(now.decision.active)
    assert long.min() >= now.decision.clearance - 1e-9
    way = drawn["plan"].points
    assert (way[0] == 0.0).all() and np.hypot(*way[-1]) > 0.0
    assert (
        Contacts.of(footprint, now.obstacles.seen_from((*way[-1], 0.0))).distance.min()
        > 0.0
    )
