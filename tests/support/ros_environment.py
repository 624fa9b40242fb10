"""An environment of its own with ROS 2's wheels from PyPI, and a peer's DDS.

    python tests/support/ros_environment.py FOLDER

rclpy's wheels are of Linux on x86-64; the package is taken from this tree.
"""

import os
import subprocess
import sys
import venv
from pathlib import Path

NAMES = (
    *("rclpy", "rmw-fastrtps-cpp", "lifecycle-msgs", "std-msgs", "geometry-msgs"),
    *("nav-msgs", "sensor-msgs", "visualization-msgs", "diagnostic-msgs"),
)
OTHERS = "cyclonedds", "rosbags>=0.11.9", "numba>=0.60"
PACKAGES = *(f"ros-jazzy-{name}" for name in NAMES), *OTHERS
PROBE = "import rclpy, nav_msgs.msg, visualization_msgs.msg, cyclonedds, rosbags, numba"


def works(python):
    done = subprocess.run([python, "-c", PROBE], capture_output=True, check=False)
    return python.exists() and done.returncode == 0


def make(folder):
    """Return the environment's Python; what pip says where it cannot be made."""
    python = Path(folder) / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
    if not works(python):
        pip = [python, "-m", "pip", "install", "--quiet", *PACKAGES]
        done = subprocess.run(pip, capture_output=True, text=True, check=False)
        if done.returncode or not works(python):
            raise OSError((done.stderr.strip() or "rclpy cannot be imported")[-500:])
    return python


def default_folder():
    named = os.environ.get("QPAVOID_ROS_ENV")
    return Path(named) if named else Path.home() / ".cache" / "qpavoid" / "ros"


if __name__ == "__main__":
    print(make(sys.argv[1] if len(sys.argv) > 1 else default_folder()))
