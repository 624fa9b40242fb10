"""Localisation, wheels, and runs on what is sensed."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2

from qpavoid.avoidance.decision import STATUSES, Status
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb, arc_jacobians
from qpavoid.lab.sensing.plant import Plant, wheel_speeds
from qpavoid.lab.simulation.log import COLUMNS
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles

DT = 0.05


def asked(k):
    return 0.6 + 0.3 * math.sin(0.03 * k), 0.7 * math.cos(0.05 * k)


def drive(localiser, plant, steps, start=(1.0, -2.0, 0.4)):
    """Return true poses and those that are believed."""
    locate, step = localiser.start(start), plant.start()
    pose, true, believed = start, [], []
    for k in range(steps):
        wheels, ground, _ = step(*asked(k), DT)
        pose = arc(*pose, *ground, DT)
        true.append(pose)
        believed.append(locate(pose, DT * (k + 1), wheels, DT))
    return np.array(true), np.array(believed)


@pytest.mark.parametrize("omega", [0.0, 1e-6, 1e-3, 0.01, -0.8, 3.0])
@pytest.mark.parametrize("v", [0.0, 0.7, -0.4])
@pytest.mark.parametrize("dt", [0.05, 0.7])
def test_jacobians_by_finite_differences(v, omega, dt):
    heading = 0.8
    by_pose, by_twist = arc_jacobians(heading, v, omega, dt)
    at = np.array([0.3, -0.2, heading, v, omega])
    for i in range(5):
        h = 1e-5 * np.eye(5)[i]
        slope = (np.array(arc(*(at + h), dt)) - arc(*(at - h), dt)) / 2e-5
        assert np.hstack([by_pose, by_twist])[:, i] == pytest.approx(slope, abs=2e-9)


@pytest.mark.parametrize("rate", [20.0, 5.0])
def test_the_covariance_is_true(rate):
    """The normalised error squared is χ² with 3 degrees of freedom."""
    runs, plain = 60, []
    for seed in range(runs):
        localiser = Uwb(slip=0.1, rate=rate)
        random = np.random.default_rng(seed)
        pose = start = (1.0, -2.0, 0.4)
        ekf = localiser.filter(start, random)
        step = Plant(slip=0.1, seed=1000 + seed).start()
        for k in range(200):
            wheels, ground, _ = step(*asked(k), DT)
            pose = arc(*pose, *ground, DT)
            ekf.predict(*wheels, DT)
            if k % round(1 / (rate * DT)) == 0:
                ekf.correct(pose[:2] + 0.1 * random.standard_normal(2), 0.1)
            if k in (20, 100, 199):
                error = ekf.mean - pose
                plain.append(error @ np.linalg.solve(ekf.covariance, error))
    low, high = chi2.ppf([0.001, 0.999], 3 * runs) / runs
    for nees in np.reshape(plain, (runs, 3)).mean(axis=0):
        assert low < nees < high


def test_motion_capture_is_below_a_millimetre():
    true, believed = drive(MotionCapture(), Plant(), 2000)
    error = (believed - true)[:, :2]
    assert np.std(error) == pytest.approx(0.0005, rel=0.05)
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.001


def test_lag_is_that_of_a_system_of_first_order_at_any_time_step():
    lag, end = (0.3, 0.1), 0.6
    for n in (1, 6, 60):
        step = Plant(lag=lag).start()
        driven = [step(1.0, -2.0, end / n).wheels for _ in range(n)]
        way = np.sum(driven, axis=0) * end / n
        for i, asked_for in enumerate((1.0, -2.0)):
            exact = asked_for * (end - lag[i] * (1 - math.exp(-end / lag[i])))
            assert way[i] == pytest.approx(exact)
    assert driven[-1][0] == pytest.approx(1 - math.exp(-end / 0.3), abs=0.01)


def test_slip_is_of_each_wheel_and_seeded():
    def grounds(seed):
        step = Plant(slip=0.1, track=0.5, seed=seed).start()
        return np.array([step(0.5, 1.0, DT).ground for _ in range(20_000)])

    driven = grounds(1)
    assert (driven == grounds(1)).all() and (driven != grounds(2)).any()
    left, right = wheel_speeds(*driven.T, 0.5)
    assert left.mean() == pytest.approx(0.25, rel=0.01)
    assert left.std() == pytest.approx(0.025, rel=0.03)
    assert right.std() == pytest.approx(0.075, rel=0.03)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.03
    assert Plant(slip=0.1).start()(0.5, 1.0, DT).wheels == (0.5, 1.0)


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
