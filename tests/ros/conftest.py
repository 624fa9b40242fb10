"""An environment with rclpy, made once."""

import platform
import sys

import pytest

import ros_environment


@pytest.fixture(scope="session")
def python():
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("rclpy's wheels are of Linux on x86-64")
    try:
        return ros_environment.make(ros_environment.default_folder())
    except OSError as error:
        pytest.skip(f"no environment with rclpy: {error}")
