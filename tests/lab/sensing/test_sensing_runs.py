"""Runs on what is sensed: scans instead of obstacles, a believed pose, real wheels."""

import dataclasses

import numpy as np
import pytest

from qpavoid.avoidance.decision import STATUSES, Status
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation.log import COLUMNS
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.obstacles import Obstacles


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("paper/test_case_1")


@pytest.mark.parametrize(("perceived", "latency"), [(False, 0.1), (True, 0.0)])
def test_a_laser_is_enough_to_go_round_a_disc(scenario, perceived, latency):
    lidar = LidarSettings(latency=latency, dropout=0.05, perception=perceived)
    sensed = dataclasses.replace(scenario, lidar=lidar)
    log = run(sensed, "qp-ahead")
    assert metrics(log)["min_clearance_m"] > 0.1
    off = np.hypot(
        log["x_m"][-1] - log["x_ref_m"][-1], log["y_m"][-1] - log["y_ref_m"][-1]
    )
    assert off < 0.3  # Eq. 6 cannot correct what is lateral at rest
    assert log["v_mps"][-1] == pytest.approx(0.0, abs=0.01)


def test_an_exact_plant_and_a_perfect_place_change_nothing(scenario):
    scenario = dataclasses.replace(scenario, duration=8.0)
    known = run(scenario, "qp")
    assert known["changed"].any()
    perfect = dataclasses.replace(
        scenario, plant=Plant(), localisation=MotionCapture(0.0, 0.0)
    )
    again = run(perfect, "qp")
    for name in set(COLUMNS) - {"solve_time_s"}:
        np.testing.assert_array_equal(known[name], again[name])


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"localisation": MotionCapture()}, 0.03),
        ({"localisation": Uwb()}, 0.3),
        ({"plant": Plant(slip=0.05, lag=(0.1, 0.1))}, 0.1),
    ],
    ids=["motion capture", "UWB", "slip and lag"],
)
def test_what_is_not_exact_costs_a_little(scenario, change, error):
    log = run(dataclasses.replace(scenario, **change), "qp-ahead")
    result = metrics(log)
    assert 0.0 < result["final_error_m"] < error
    assert result["min_clearance_m"] > 0.1
    moved = np.hypot(*(log.final[:2] - [log["x_m"][0], log["y_m"][0]]))
    assert moved > 1.0


def test_a_sensor_from_python_sees_in_place_of_all_others():
    class Nothing:
        def start(self):
            return lambda time, obstacles, pose: Obstacles()

    scenario = load_scenario("paper/test_case_2")
    blind = dataclasses.replace(scenario, sensor=Nothing(), duration=3.0)
    log = run(blind, "qp")
    assert {STATUSES[int(number)] for number in log["status"]} == {Status.TRACKING}
