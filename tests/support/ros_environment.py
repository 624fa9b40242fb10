"""An environment of its own with ROS 2's wheels from PyPI, and a peer's DDS.

    python tests/support/ros_environment.py FOLDER

rclpy's wheels are of Linux on x86-64; the package is taken from this tree.
"""

import os
import shutil
import subprocess
import sys
import venv
from functools import partial
from hashlib import sha256
from pathlib import Path

NAMES = (
    *("rclpy", "rmw-fastrtps-cpp", "lifecycle-msgs", "std-msgs", "geometry-msgs"),
    *("nav-msgs", "sensor-msgs", "visualization-msgs", "diagnostic-msgs"),
)
OTHERS = "cyclonedds", "rosbags>=0.11.9", "numba>=0.60", "scipy"
PACKAGES = *(f"ros-jazzy-{name}" for name in NAMES), *OTHERS
PROBE = "import rclpy, nav_msgs.msg, visualization_msgs.msg, cyclonedds, rosbags, scipy"


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


BUILDERS = (
    *("ament-cmake", "ament-cmake-gmock", "ament-cmake-gtest", "ament-cmake-pytest"),
    *("ament-cmake-include-directories", "ament-cmake-ros", "ament-package"),
    *("python-cmake-module", "rosidl-core-generators", "rosidl-default-generators"),
)
FOLLOW_PATH = """nav_msgs/Path path
string controller_id
string goal_checker_id
---
uint16 UNKNOWN=100
uint16 INVALID_PATH=103
uint16 FAILED_TO_MAKE_PROGRESS=105
std_msgs/Empty result
uint16 error_code
---
float32 distance_to_goal
float32 speed
"""
BOND = """std_msgs/Header header
string id
string instance_id
bool active
float32 heartbeat_timeout
float32 heartbeat_period
"""
INTERFACES = {
    "bond/msg/Status.msg": BOND,
    "tf2_msgs/msg/TFMessage.msg": "geometry_msgs/TransformStamped[] transforms\n",
    "nav2_msgs/action/FollowPath.action": FOLLOW_PATH,
}
"""Definitions of what has no wheels, as in Jazzy."""

NEEDED = "action_msgs", "geometry_msgs", "nav_msgs", "std_msgs"
CMAKE = """cmake_minimum_required(VERSION 3.16)
project({name})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces({name} "{file}" DEPENDENCIES {needed})
ament_package()
"""
MANIFEST = """<package format="3"><name>{name}</name><version>1.0.0</version>
<description>Interfaces</description><license>BSD</license>
<maintainer email="test@example.org">test</maintainer>
<buildtool_depend>ament_cmake</buildtool_depend>{depends}
<member_of_group>rosidl_interface_packages</member_of_group></package>
"""


def interfaces(python):
    """Return the environment of a process that has :data:`INTERFACES`, built once.

    Others are built anew. An OSError has the end of what the builder says.
    """
    root, asked = Path(python).parents[1], repr((INTERFACES, NEEDED, CMAKE, MANIFEST))
    made = root / "interfaces" / sha256(asked.encode()).hexdigest()[:12]
    libraries = f"{made}/lib:{root}/lib"
    place = f"lib/python3.{sys.version_info[1]}/site-packages"
    environment = os.environ | {"LD_LIBRARY_PATH": libraries}
    environment |= {"PYTHONPATH": str(made / place), "AMENT_PREFIX_PATH": str(root)}
    environment |= {"CMAKE_PREFIX_PATH": str(root), "PATH": f"{root}/bin:/usr/bin:/bin"}
    for path, text in INTERFACES.items():
        name, _, file = path.partition("/")
        if (made / "share" / name).exists():
            continue
        source = made / "source" / name
        shutil.rmtree(source, ignore_errors=True)
        (source / file).parent.mkdir(parents=True)
        (source / file).write_text(text)
        finds = "\n".join(f"find_package({one} REQUIRED)" for one in NEEDED)
        told = {"name": name, "file": file, "finds": finds, "needed": " ".join(NEEDED)}
        depends = "".join(f"<depend>{one}</depend>" for one in NEEDED)
        (source / "CMakeLists.txt").write_text(CMAKE.format(**told))
        (source / "package.xml").write_text(MANIFEST.format(**told, depends=depends))
        packages = [f"ros-jazzy-{one}" for one in BUILDERS]
        install = [python, "-m", "pip", "install", "--quiet", *packages]
        cmake = ["cmake", "-S", source, "-B", source / "build", "-DBUILD_TESTING=OFF"]
        cmake += [f"-DPython3_EXECUTABLE={python}", f"-DCMAKE_INSTALL_PREFIX={made}"]
        build = ["cmake", "--build", source / "build", "--target", "install"]
        run = partial(subprocess.run, capture_output=True, text=True, check=False)
        # The wheels name an include folder of their builder: cmake fails at the end.
        tried = run([*install, "catkin_pkg", "empy<4"]), run(cmake, env=environment)
        done = run(build, env=environment)
        if done.returncode:
            said = "".join(one.stderr for one in (*tried, done))
            raise OSError(f"{name} is not built: {said[-500:]}")
    return environment


def default_folder():
    named = os.environ.get("QPAVOID_ROS_ENV")
    return Path(named) if named else Path.home() / ".cache" / "qpavoid" / "ros"


if __name__ == "__main__":
    print(make(sys.argv[1] if len(sys.argv) > 1 else default_folder()))
