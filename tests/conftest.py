"""Shared by all tests: hypothesis' profiles, published data, the paper's robot."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from qpavoid.model.robot import Robot

settings.register_profile(
    "repeatable",
    deadline=None,
    max_examples=60,
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


@pytest.fixture(scope="session")
def robot():
    return Robot.mir100()
