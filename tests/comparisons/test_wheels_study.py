"""The study of the plant of rigid bodies."""

import csv
import sys
import tomllib

import pytest

pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")

wheels = pytest.importorskip("wheels", reason="needs qpavoid[study]")

from barn_files import challenge
from places import COMPARISONS
from qpavoid.lab.study.identify import identify


def test_the_study_of_wheels_has_the_identified_settings():
    text = (COMPARISONS / "studies" / "barn_wheels.toml").read_text()
    settings = tomllib.loads(text)["settings"]
    found = identify(wheels.driven_at_random("skid-steer", (2.0, 1.57), 60.0))
    for one, key in (
        (found.acceleration, "robot.acceleration_mps2"),
        (found.angular_acceleration, "robot.angular_acceleration_radps2"),
    ):
        assert 0.95 * one.low < value(settings[key]) <= 1.03 * one.low
    oldest = found.delay.high + 1.0 / 30.0
    assert oldest <= value(settings["actuation.delay_s"]) < oldest + 0.02
    assert found.factor.low < 1.0 < found.factor.high


def value(setting):
    return setting[0] if isinstance(setting, list) else setting


def test_a_table_has_speed_cross_check_and_identified(tmp_path, monkeypatch):
    challenge(tmp_path / "BARN", 7)
    options = "--data", tmp_path, "--world", 7, "--methods", "alone", "--seconds", 10
    monkeypatch.setattr(wheels, "SECONDS", 1.0)
    out = tmp_path / "out"
    monkeypatch.setattr(sys, "argv", [*map(str, ("study", *options, "--out", out))])
    wheels.main()
    with open(out / "wheels.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["part"] for row in rows} == {"speed", "cross-check", "identified"}
    assert all(float(row["value"]) > 0.0 for row in rows if row["part"] == "speed")
