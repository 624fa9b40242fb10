"""The simulator: determinism, logs, metrics, and the outcome of a run."""

import dataclasses
import json
import math

import numpy as np
import pytest

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import DataError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.clearance import (
    Motion,
    View,
    greatest_pace,
    room_on_the_way,
)
from qpavoid.lab.simulation.log import COLUMNS, Log
from qpavoid.lab.simulation.outcome import contacts_moving, mean_jerk, verdict
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.model.capsules import greatest_speed, like
from qpavoid.model.contacts import empty_contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from scenario_files import write

CONTROLLERS = ("eq5", "eq7", "qp", "qp-ahead")
CASES = ("paper/test_case_1", "paper/test_case_2")


@pytest.fixture(scope="module")
def logs():
    return {
        (case, name): run(load_scenario(case), name)
        for case in CASES
        for name in CONTROLLERS
    }


def short(scenario, seconds):
    return dataclasses.replace(scenario, duration=seconds)


def test_as_printed_the_laws_run_away():
    """The singularity, shown and not hidden; finite numbers all the same."""
    worst = 0.0
    for case in CASES:
        for law in ("eq5", "eq7"):
            log = run(load_scenario(f"{case}_as_printed"), law)
            assert all(
                np.isfinite(log[c]).all() for c in ("x_m", "v_mps", "omega_radps")
            )
            worst = max(worst, np.abs(log["omega_radps"]).max())
    assert worst > 100.0


def test_the_least_room_sees_what_happens_within_a_step():
    footprint = Footprint.rectangle(1.0, 0.5)
    obstacles = Obstacles(discs=[[0.0, 2.0, 0.1]], disc_velocities=[[0.0, -4.0]])
    robot = Robot("box", footprint, Limits.symmetric(1.0, 1.0))
    world, record = obstacles.arrays, AvoidanceSettings(dt=1.0, gamma=0.5).record()
    setup = Setup(footprint.edges, robot.limit_vector, record)

    def least(pace):
        motion = Motion((0.0, 0.0), 0.0, pace)
        view = View(world, like(world), empty_contacts(footprint.edges, world))
        return room_on_the_way(setup, motion, view)

    fastest = greatest_speed(obstacles.capsules)
    pace = greatest_pace(robot.limit_vector, 0.3, -0.2, fastest)
    assert pace == pytest.approx(4.3 + 0.2 * footprint.circumradius)
    assert fastest == 4.0
    assert least(0.0) == pytest.approx((1.65, 1.65 - 0.23))
    assert least(fastest) == pytest.approx((-0.35, -0.35 - 0.23))


def test_a_run_that_ends_before_its_path_has_not_arrived():
    result = metrics(run(short(load_scenario("paper/test_case_1"), 1.0), "qp"))
    assert result["outcome"] == "off goal"
    assert result["final_error_m"] > 5.0


def test_logs_are_saved_whole_and_without_pickle(tmp_path, logs):
    log = logs["paper/test_case_2", "qp"]
    path = tmp_path / "log.npz"
    log.save(path)
    assert len(repr(log)) < 200 and log.meta["controller"] in repr(log)
    again = Log.load(path)
    assert again.meta == dict(log.meta)
    assert metrics(again) == metrics(log)
    for column in COLUMNS:
        np.testing.assert_array_equal(again[column], log[column])
    assert again.discs.shape == (len(log), 1, 3)
    with np.load(path, allow_pickle=False) as data:
        assert "meta" in data
    for damaged in (path.read_bytes()[:-200], b"", b"not a log"):
        path.write_bytes(damaged)
        with pytest.raises(DataError, match="not readable arrays"):
            Log.load(path)
    with pytest.raises(DataError, match="not readable arrays"):
        Log.load(tmp_path / "none.npz")


SPOILT = {
    "meta is a list": {"meta": np.array("[]")},
    "meta is empty": {"meta": np.array("{}")},
    "no title": {"title": None},
    "a step without end": {"dt_s": 1e308},
    "a step that is true": {"dt_s": True},
    "no arrival": {"arrival": []},
    "frames that are text": {"frames_s": ["x"]},
    "no steps": dict.fromkeys(COLUMNS, np.zeros(0)),
    "one number": dict.fromkeys(COLUMNS, np.array(1.0)),
    "texts": dict.fromkeys(COLUMNS, np.array(["a", "b"])),
    "no corners": {"vertices": np.zeros((0, 2))},
    "corners that are text": {"vertices": np.full((4, 2), "a")},
    "discs of one step": {"discs": np.zeros(3)},
    "walls of three": {"walls": np.zeros((1, 3))},
    "no final pose": {"final": np.zeros(0)},
    "polygons without corners": {"polygons": np.array([1e18])},
    "half a polygon": {"polygons": np.array([-0.5])},
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_is_no_log_is_refused(tmp_path, logs, name):
    path, change = tmp_path / "log.npz", SPOILT[name]
    logs["paper/test_case_2", "qp"].save(path)
    with np.load(path) as file:
        arrays = dict(file)
    meta = json.loads(str(arrays["meta"]))
    meta |= {key: x for key, x in change.items() if key not in arrays}
    told = {key: x for key, x in change.items() if key in arrays}
    np.savez(path, **(arrays | {"meta": np.array(json.dumps(meta))} | told))
    with pytest.raises(DataError, match="not a readable log"):
        Log.load(path)


def test_metrics_of_a_log_made_by_hand():
    """Numbers that can be checked on paper."""
    n = 100
    columns = {name: np.zeros(n) for name in COLUMNS}
    columns["t_s"] = 0.1 * np.arange(n)
    columns["r_min_m"][:], columns["r_m"][:] = 0.15, 0.2
    columns["clearance_m"][:] = 0.3
    columns["clearance_m"][20:50] = 0.19
    columns["clearance_m"][30:35] = 0.14
    columns["least_clearance_m"] = columns["clearance_m"].copy()
    columns["least_clearance_m"][33] = 0.12
    columns["x_m"][50:] = 0.5
    columns["v_mps"][::2] = 0.2
    columns["v_mps"][10] = -0.4
    columns["solve_time_s"][:] = 1e-6 * np.arange(n)
    columns["status"][:40] = 1
    meta = {
        "scenario": "s",
        "controller": "qp",
        "solver": "exact",
        "dt_s": 0.1,
        "arrival": [0.1, 0.1],
    }
    log = Log(
        meta,
        columns,
        final=np.array([0.5, 0.0, math.pi - 0.09]),
        final_reference=np.array([0.5, 0.05, -math.pi, 0, 0]),
        discs=np.zeros((n, 0, 3)),
        points=np.zeros((0, 2)),
        walls=np.zeros((0, 4)),
        vertices=np.zeros((3, 2)),
        corners=np.zeros((1, 0, 2)),
        polygons=np.zeros(0),
        outlines=np.array([3.0]),
    )
    result = metrics(log)
    assert result["zone_entry_s"] == pytest.approx(2.0)
    assert result["zone_exit_s"] == pytest.approx(5.0)
    assert result["zone_duration_s"] == pytest.approx(3.0)
    assert result["min_clearance_m"] == 0.12
    assert result["time_below_r_s"] == pytest.approx(3.0)
    assert result["time_below_r_min_s"] == pytest.approx(0.5)
    assert result["rms_error_m"] == pytest.approx(0.5 / math.sqrt(2))
    assert result["max_error_m"] == 0.5
    assert result["final_error_m"] == pytest.approx(0.05)
    assert result["final_heading_error_rad"] == pytest.approx(0.09)
    assert result["length_m"] == pytest.approx(0.1 * (49 * 0.2 + 0.4))
    assert (result["v_min_mps"], result["v_max_mps"]) == (-0.4, 0.2)
    assert result["roughness_v_mps2"] == pytest.approx((97 * 0.2 + 2 * 0.4) / 99 / 0.1)
    assert result["solve_median_us"] == pytest.approx(49.5)
    assert result["solve_max_us"] == pytest.approx(99.0)
    assert result["statuses"] == "tracking:60 filtered:40"
    assert result["outcome"] == "arrived"
    columns["least_clearance_m"][33] = -1e-6
    assert metrics(log)["outcome"] == "touched"


@pytest.mark.parametrize(
    ("clearance", "arrived", "still", "word"),
    [
        (-0.01, 3.0, 0.0, "touched"),
        (0.0, 3.0, 9.0, "arrived"),
        (0.1, math.inf, 5.1, "stalled"),
        (0.1, math.inf, 4.9, "off goal"),
    ],
)
def test_the_word(clearance, arrived, still, word):
    noted = {"min_clearance_m": clearance, "arrived_s": arrived, "still_s": still}
    assert verdict(noted) == word


def test_compare_and_sweep_say_the_same():
    """Eq. 5 ends 15 cm beside its station: once `off goal` here and `stalled` there."""
    case = "paper/test_case_2"
    log = run(load_scenario(case), "eq5")
    job = Job("0", scenario_file(case), None, "{}", None, "eq5", "exact", "none")
    row, compared = run_job(job)[0], metrics(log)
    assert row["outcome"] == compared["outcome"] == "stalled"
    assert row["solver"] == compared["solver"] == "closed form"


def test_a_contact_is_whose_who_moved_when_it_began():
    """Touched at rest and driven off while touched: none; into something: one each."""
    least = np.array([0.1, -0.1, -0.2, 0.1, -0.1, -0.1, 0.2, -0.1])
    moving = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0])
    assert contacts_moving(least[:4], moving[:4]).tolist() == []
    assert contacts_moving(least, moving).tolist() == [4]
    assert contacts_moving(-np.ones(3), np.ones(3)).tolist() == [0]


def test_jerk_is_that_of_a_cubic():
    """x = t³: v = 3 t², a jerk of 6 m/s³; without a third speed there is none."""
    times = 0.1 * np.arange(20)
    assert mean_jerk(3.0 * times**2, 0.1) == pytest.approx(6.0)
    assert mean_jerk(np.array([0.0, 1.0]), 0.1) == 0.0


@pytest.mark.parametrize("name", ["eq5", "stop"])
def test_a_row_says_how_it_began_and_what_a_step_took(name):
    case = "paper/test_case_2"
    log = run(load_scenario(case), name)
    job = Job("0", scenario_file(case), None, "{}", None, name, "exact", "none")
    row = run_job(job)[0]
    assert row["start_clearance_m"] == pytest.approx(log["clearance_m"][0])
    assert row["jerk_mps3"] == pytest.approx(mean_jerk(log["v_mps"], log.meta["dt_s"]))
    assert row["contacts_moving"] == 0.0
    assert row["contact"] == (name == "stop")
    assert 0.0 < row["solve_us"] < 1e5


APPROACHED = """
title = "somebody walks up to a robot at its place"
duration_s = 4.0
dt_s = 0.05
[reference]
kind = "station"
pose = { x_m = 0.0, y_m = 0.0 }
[[obstacles]]
kind = "disc"
position_m = [4.0, 0.0]
velocity_mps = [-0.8, 0.0]
radius_m = 0.3
[guide]
"""


def test_among_people_who_give_way_a_guided_robot_does_not_retreat(tmp_path):
    """The premise is the scenario's: this person does not."""
    wary, bold = (
        run(load_scenario(write(tmp_path, APPROACHED + key)), "qp-ahead")
        for key in ("", "yielding = true")
    )
    assert wary["v_mps"].min() < -0.3 and bold["v_mps"][:50].min() > -0.01
