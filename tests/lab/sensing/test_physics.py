"""Wheels in MuJoCo: beside the kinematic plant, Coulomb's law, energy, ground."""

import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")

from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.config import changed, find_config, read_document
from qpavoid.lab.scenario.scenario import load_scenario, make_scenario
from qpavoid.lab.sensing.physics import Patch, Physics, PhysicsRun
from qpavoid.lab.simulation.run import run, run_fleet
from qpavoid.lab.study.metrics import metrics
from qpavoid.model.kinematics import arc, integrate, wrap_angle
from scenario_files import MINIMAL, problems, write

DT, GRAVITY = 0.02, 9.81
AT_ONCE = {"delay": 0.0, "lag": 0.0}
START = (1.0, -2.0, 0.4)


def drive(settings, commands, start=START, dt=DT):
    """Return the run, and the pose and drive after every command."""
    run, pose, found = PhysicsRun(settings, start), start, []
    for v, omega in commands:
        drive = run.step(v, omega, dt)
        pose = integrate(pose, drive.ground, drive.lateral, dt)
        found.append((pose, drive))
    return run, found


def held(v, omega, seconds):
    return [(v, omega)] * round(seconds / DT)


@pytest.mark.parametrize(
    ("base", "twist", "far", "turned"),
    [
        ("differential", (0.2, 0.0), 0.002, 0.001),
        ("differential", (0.2, 0.2), 0.004, 0.003),
        ("differential", (0.0, 0.3), 0.002, 0.004),
        ("differential", (-0.2, 0.1), 0.003, 0.002),
        ("skid-steer", (0.2, 0.0), 0.002, 0.001),
        ("skid-steer", (0.2, 0.1), 0.030, 0.020),
        ("skid-steer", (0.0, 0.3), 0.070, 0.030),
    ],
    ids=str,
)
def test_slowly_on_a_flat_floor_it_drives_as_the_kinematic_plant(
    base, twist, far, turned
):
    """Within far (m) and turned (rad) at the end of 5 s, after it has got going."""
    settings = Physics(base, **AT_ONCE)
    commands = [*held(*twist, 1.0), *held(*twist, 5.0)]
    _, found = drive(settings, commands)
    begin, end = found[49][0], found[-1][0]
    x, y, heading = arc(*begin, *twist, 5.0)
    assert math.hypot(end[0] - x, end[1] - y) < far
    assert abs(wrap_angle(end[2] - heading)) < turned


def test_a_skid_steered_base_turns_as_coulomb_s_law_says():
    """In place, on four equal loads, all wheels slide: ω t/2 (1 + (b/t)²) is wanted."""
    x, y = 0.131, 0.187795  # m, of a wheel
    needed = 1.0 + (x / y) ** 2
    plant = Physics("skid-steer", separation_multiplier=needed, **AT_ONCE)
    _, found = drive(plant, held(0.0, 1.0, 4.0))
    turned = found[-1][0][2] - found[49][0][2]
    assert wrap_angle(turned - 3.0) == pytest.approx(0.0, abs=0.12)
    plain = dataclasses.replace(plant, separation_multiplier=1.0)
    _, found = drive(plain, held(0.0, 1.0, 4.0))
    rate = (found[-1][0][2] - found[49][0][2]) / 3.0
    assert rate == pytest.approx(1.0 / needed, rel=0.06)


@pytest.mark.parametrize("friction", [0.05, 0.2, 0.5])
def test_it_stops_as_coulomb_s_law_says(friction):
    """From v in v²/(2 μ g), with wheels that stand long before."""
    settings = Physics("skid-steer", friction=friction, **AT_ONCE)
    seconds = 1.0 / (friction * GRAVITY) + 0.5
    commands = [*held(1.0, 0.0, 5.0), *held(0.0, 0.0, seconds)]
    _, found = drive(settings, commands)
    assert found[249][1].ground[0] == pytest.approx(1.0, abs=0.01)
    assert abs(found[-1][1].ground[0]) < 0.02
    way = math.dist(found[249][0][:2], found[-1][0][:2])
    assert way == pytest.approx(0.5 / (friction * GRAVITY), rel=0.1)


def test_a_base_that_lies_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    run = PhysicsRun(Physics(), START)
    run.data.qpos[2:7] = 0.5, 0.5**0.5, 0.5**0.5, 0.0, 0.0
    with pytest.raises(InvalidInputError, match="tipped over"):
        run.step(0.0, 0.0, DT)
    run = PhysicsRun(Physics(), START)
    run.data.qvel[:] = np.nan
    with pytest.raises(InvalidInputError, match="tipped over"):
        run.step(0.0, 0.0, DT)


def test_the_driver_waits_and_keeps_to_its_limits():
    settings = Physics(delay=0.1, lag=0.0, acceleration=(0.5, 1.0))
    _, found = drive(settings, held(0.4, 0.0, 1.5))
    speed = np.array([d.ground[0] for _, d in found])
    begins = np.argmax(speed > 0.004) * DT
    assert begins == pytest.approx(0.1, abs=1.5 * DT)
    rises = (
        np.interp(0.3, speed, np.arange(75)) - np.interp(0.1, speed, np.arange(75))
    ) * DT
    assert rises == pytest.approx(0.2 / 0.5, rel=0.05)
    fast = PhysicsRun(Physics(acceleration=(9.0, 9.0)), START)
    assert fast.acceleration == [2.0, 2.5]
    slow = dataclasses.replace(settings, lag=0.3, delay=0.0, acceleration=(2.0, 2.5))
    _, found = drive(slow, held(0.2, 0.0, 0.4))
    assert found[-1][1].ground[0] == pytest.approx(0.2 * (1 - math.exp(-1.0)), abs=0.03)


GROUND = """
[plant]
kind = "mujoco"
base = "skid-steer"
friction = 0.4
delay_s = 0.05
acceleration_mps2 = 3.0
[[plant.patches]]
x_m = 1.0
y_m = 2.0
length_m = 3.0
width_m = 4.0
friction = 0.2
"""


def test_the_file_says_it_all(tmp_path):
    found = load_scenario(write(tmp_path, MINIMAL + GROUND)).plant
    assert found == Physics(
        "skid-steer",
        friction=0.4,
        delay=0.05,
        acceleration=(3.0, math.inf),
        patches=(Patch((1.0, 2.0), (3.0, 4.0), friction=0.2),),
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"mujoco"', '"mujco"', "plant: unknown kind 'mujco'; did you mean 'mujoco'?"),
        ("x_m = 1.0", "x = 1.0", "plant.patches[0].x"),
        ("delay_s = 0.05", "delay_s = 2.0", "plant.delay_s: input should be less"),
    ],
)
def test_bad_settings_are_said(tmp_path, old, new, said):
    first, *_ = problems(tmp_path, MINIMAL + GROUND.replace(old, new, 1))
    assert said in first


@pytest.mark.parametrize("name", ["demo/jackal_mujoco", "demo/mir_mujoco"])
def test_the_shipped_scenes_are_driven(name):
    result = metrics(run(load_scenario(name), "qp-ahead"))
    assert result["min_clearance_m"] > 0.05 and result["final_error_m"] < 0.3


def test_every_robot_of_several_has_wheels_of_its_own():
    _, path = find_config("fleet/swap")
    document, _ = read_document(path)
    changes = {"plant.kind": "mujoco", "duration_s": 3.0}
    scenario = make_scenario(changed(document, changes), "swap", path)
    for one, log in zip(scenario.robots, run_fleet(scenario, "alone"), strict=True):
        assert (log["x_m"][0], log["y_m"][0]) == one.start[:2]
        moved = math.dist(log.final[:2], one.start[:2])
        assert 0.5 < moved < 2.1 and log.final[0] * one.start[0] > 0.0
