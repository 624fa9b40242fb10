"""Shared by all tests: hypothesis' profiles, published data, the paper's robot, and
short runs to draw."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from matplotlib.figure import Figure

from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.robot import Robot
from scenario_files import CROSSING, SLOW

CROWD = """
[[obstacles]]
kind = "random"
count = 300
low_m = [-3.0, -3.0]
high_m = [5.0, 5.0]
radius_high_m = 0.05
"""

settings.register_profile(
    "repeatable",
    deadline=None,
    max_examples=40,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("explore", deadline=None, max_examples=2000, database=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


@pytest.fixture(scope="session")
def data_folder():
    """The published data sets, where they are; they are no part of the repository."""
    named = os.environ.get("QPAVOID_DATA")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(named) if named else beside
    if not folder.is_dir():
        pytest.skip(f"no published data in {folder}; name its folder in QPAVOID_DATA")
    return folder


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made and named, and take no time to be drawn."""
    monkeypatch.setattr(Figure, "savefig", lambda _, file, **how: Path(file).touch())


@pytest.fixture(scope="session")
def robot():
    return Robot.mir100()


def simulate(folder, name, text, controllers=("eq5", "eq7", "qp")):
    file = folder / f"{name}.toml"
    file.write_text(text)
    scenario = load_scenario(file)
    return [run(scenario, controller) for controller in controllers]


@pytest.fixture(scope="session")
def worlds(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenarios")
    return {
        "slow": simulate(folder, "slow", CROSSING + SLOW),
        "crowd": simulate(folder, "crowd", CROSSING + CROWD, ("eq7",)),
        "empty": simulate(folder, "empty", CROSSING, ("qp",)),
    }


@pytest.fixture
def logs(worlds):
    return worlds["slow"]
