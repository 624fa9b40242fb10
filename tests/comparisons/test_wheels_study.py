"""The study of the plant of rigid bodies."""

import csv
import sys

import pytest

pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")

wheels = pytest.importorskip("wheels", reason="needs qpavoid[study]")

from barn_files import challenge
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.simulation.config import changed
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.study.identify import identify
from qpavoid.lab.study.sweep.sources import scenario_file
from wheels import MUJOCO, PLANTS, TOLD, changes_of


@pytest.mark.parametrize("base", MUJOCO)
def test_plants_are_settings_of_a_scenario(base, tmp_path):
    document = scenario_file("demo/strangers").sample()
    found = [
        make_scenario(changed(document, changes_of(plant, base)), "s", tmp_path)
        for plant in PLANTS
    ]
    assert [one.plant for one in found] == [None, Physics(base), Physics(base)]
    plain, untold, told = (one.settings.actuation.delay for one in found)
    assert plain == untold == 0.0 < told
    assert told == TOLD[base]["actuation.delay_s"]


def test_what_the_filter_is_told_is_what_is_identified():
    for base, most in (("differential", (1.0, 1.5)), ("skid-steer", (2.0, 1.57))):
        told = TOLD[base]
        found = identify(wheels.driven_at_random(base, most, 60.0))
        for one, key in (
            (found.acceleration, "robot.acceleration_mps2"),
            (found.angular_acceleration, "robot.angular_acceleration_radps2"),
        ):
            assert 0.95 * one.low < told[key] <= 1.03 * one.low
        oldest = found.delay.high + (1.0 / 30.0 if base == "skid-steer" else 0.0)
        assert oldest <= told["actuation.delay_s"] < oldest + 0.02
        assert found.factor.low < 1.0 < found.factor.high


def start(monkeypatch, main, *arguments):
    monkeypatch.setattr(sys, "argv", ["study", *map(str, arguments)])
    main()


def test_one_table_has_speed_cross_check_paper_and_identified(tmp_path, monkeypatch):
    challenge(tmp_path / "BARN", 7)
    options = "--data", tmp_path, "--world", 7, "--methods", "alone"
    monkeypatch.setattr(wheels, "paper", lambda methods: iter(()))
    monkeypatch.setattr(wheels, "SECONDS", 1.0)
    out = tmp_path / "out"
    start(monkeypatch, wheels.main, *options, "--seconds", 10, "--out", out)
    with open(out / "wheels.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["part"] for row in rows} == {"speed", "cross-check", "identified"}
    assert all(float(row["value"]) > 0.0 for row in rows if row["part"] == "speed")


def test_the_paper_s_cases_on_every_plant():
    rows = list(wheels.paper(["alone"]))
    assert len(rows) == 2 * len(PLANTS) * 2
    touched = [row["value"] for row in rows if "test_case_1" in row["what"]][::2]
    assert max(touched) - min(touched) < 10.0 and max(touched) < -390.0
