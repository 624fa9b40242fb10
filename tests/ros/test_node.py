"""The node on the wire: a peer of another implementation breaks what can break.

Slow, and on Linux with x86-64 alone: an environment of its own is made of wheels.
"""

import json
import os
import platform
import random
import subprocess
import sys

import pytest

import ros_environment
from places import ROOT

pytestmark = pytest.mark.slow

PEER = ROOT / "tests" / "support" / "ros_peer.py"


@pytest.fixture(scope="session")
def python():
    """An environment with rclpy, made once."""
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("rclpy's wheels are of Linux on x86-64")
    try:
        return ros_environment.make(ros_environment.default_folder())
    except OSError as error:
        pytest.skip(f"no environment with rclpy: {error}")


def lines(python, *given, **environment):
    """Lines that a process prints, whose package is that of this tree."""
    known = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    pipes = {"capture_output": True, "text": True, "check": False}
    done = subprocess.run([python, *given], env=known, timeout=1800, **pipes)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.splitlines()


def told(python, script, **environment):
    """Output of a peer of the node after all its scenes."""
    domain = str(random.SystemRandom().randrange(60, 100))
    found = json.loads(lines(python, script, domain, **environment)[-1])
    print(json.dumps(found, indent=1))
    return found


@pytest.fixture(scope="session")
def happened(python):
    return told(python, PEER)


@pytest.fixture(scope="session")
def driven(python):
    """Results of all roles and modes."""
    try:
        known = ros_environment.interfaces(python)
    except OSError as error:
        pytest.skip(f"no interfaces of tf2_msgs, nav2_msgs and bond: {error}")
    paths = os.pathsep.join([str(ROOT), str(PEER.parent), known["PYTHONPATH"]])
    script = ROOT / "tests" / "ros" / "ros_roles.py"
    return told(python, script, **(known | {"PYTHONPATH": paths}))


def test_a_goal_sent_at_1_hz_is_reached_after_an_emergency_stop(driven):
    """Round a box; the robot starts from rest when the stop is released."""
    found = driven["guide"]
    assert found["stays"] == 0.0 and found["before"] > 0.3
    assert found["released"] < 0.35 and found["least"] > 0.07
    away, turn = found["off"]
    assert away < 0.05 and turn < 0.06 and found["blocked"] == [False]
    sentence, values = found["feedback"]
    assert sentence and values["arrived"] == "True" and float(values["left_m"]) < 0.05
    assert found["bounds"] > 0


def test_it_serves_the_action_of_nav2(driven):
    """Refused, replaced by the same path sent again, followed, canceled, replaced by a
    goal on a topic, and deactivated; with heartbeats, until it is deactivated."""
    found, rests = driven["guide"]["action"], driven["guide"]["rests"]
    ends = [[6, 103], [6, 100], [4, 0], [5, 0], [6, 100], [6, 100]]
    assert found["ends"] == ends
    names, alive, instances = zip(*found["beats"], strict=True)
    assert {*names} == {"qpavoid"} and len({*instances}) == 1 and instances[0]
    assert len(alive) > 20 and all(alive[:-1]) and not alive[-1]
    (first,), (last,) = found["left"]
    assert first > 3.5 and last < 0.1 and rests < 0.01


def test_an_operator_is_helped(driven):
    """Full speed at r_min and 5 cm along a wall; round a box; slower for a person."""
    found = driven["teleop"]
    assert found["set"] == [[True, ""]]
    assert found["wall"] > 0.79 and found["wall_least"] > 0.14
    box, person = found["box"], found["person"]
    assert box["x"] > 0.6 and abs(box["heading"]) < 0.1 and box["least"] > 0.07
    assert person["slow"] < 0.7 and person["then"] > 0.7 and person["least"] > 0.2


def test_a_dock_is_approached_to_2_cm_and_nothing_else(driven):
    found = driven["dock"]
    assert abs(found["gap"] - 0.02) < 0.01 and found["others"] > 0.09
    assert "points in the dock are exempt" in found["said"]


def test_a_person_is_followed_at_1_m(driven):
    found = driven["follow"]
    assert abs(found["gap"] - 1.0) < 0.15 and abs(found["v"] - 0.5) < 0.15
    ((done, why),) = found["refused"]
    assert not done and "mode to be one of command, teleop, dock, follow" in why


def test_a_person_in_scans_has_a_velocity_in_the_markers(driven):
    """0.8 m/s towards the robot, which steps aside without a command."""
    found = driven["person"]
    assert len(found["speeds"]) > 3 and found["moves"] > 0.1
    assert all(abs(speed - 0.8) < 0.15 for speed in found["speeds"])
    assert found["occupied"] > 100


def test_every_scan_is_answered_at_once(driven):
    """1,080 beams at 40 Hz with perception and the default control step.

    On a machine that others use, too: docs/ros2.md has the times on a quiet one.
    """
    found = driven["bench"]
    assert found["n"] > 500 and found["p50"] < 0.01
    assert found["twists_per_scan"] < 1.3, "the timer comes first"


OUTAGES = {
    "kill": (0.25, "scan: stale."),
    "odometry": (0.2, "odom: stale."),
    "blind": (0.1, "scan: blind."),
}
"""Seconds from the last good message to standing, on a machine that others use too."""


@pytest.mark.parametrize("scene", OUTAGES)
def test_it_brakes_says_why_and_drives_again(happened, scene):
    """Nav2's monitor promises 0.6 s, 90 % held, and 0.6 s to drive again.

    Here that is 0.3 s of good inputs, and more on a machine that others use as well.
    """
    (longest, why), found = OUTAGES[scene], happened[scene]
    assert found["stops"] < longest and found["hold"] > 0.98
    assert found["resumes"] < 1.0
    assert any(why in said for said in found["said"])


def test_it_drives_while_all_is_well(happened):
    """Less than 5 % false stops, with messages that come in disorder or twice, too.

    They are counted where the machine keeps neither process waiting.
    """
    for scene in ("latency", "reorder", "flood"):
        assert happened[scene]["false_stops"] < 0.05, scene
    assert happened["latency"]["per_s"] > 30.0
    assert happened["latency"]["p50"] < 0.02, "judged under timing, not here"


def test_a_flood_does_not_stop_its_clock(happened):
    assert happened["flood"]["written_per_s"] > 500.0
    assert happened["flood"]["p99"] < 0.1


def test_without_commands_it_stands_and_steps_aside(happened):
    found = happened["silence"]
    assert found["stands"] < 0.7 and found["twists"] > 30 and found["backs_up"] < -0.1


def test_it_comes_back_after_a_kill_and_ends_standing(happened):
    assert happened["restart"]["goes"] < 30.0
    assert happened["ends"] == {"status": 0, "last": [0.0, 0.0]}


def test_memory_is_flat(happened):
    """An hour's scans at 50 Hz."""
    found = happened["memory"]
    assert found["scans"] > 150_000
    assert found["after"] - found["before"] < 5.0


def test_a_clock_that_stands_or_jumps(happened):
    assert happened["frozen"]["stops"] < 0.3
    assert happened["frozen"]["resumes"] < 1.5
    assert happened["jump"]["ahead"] == {"stopped": True, "drives": True}
    assert happened["jump"]["back"]["drives"], "at once, if all stamps go back with it"
    assert happened["bad_clock"]["drives"]


LIFE = """
import sys, rclpy
from rclpy.parameter import Parameter
from qpavoid.ros.node import SUCCESS, SafetyNode
rclpy.init(args=["node", "--ros-args", "--params-file", sys.argv[1]])
node = SafetyNode()
for step in "configure activate deactivate cleanup configure activate".split():
    assert getattr(node, f"trigger_{step}")() is SUCCESS, step
node._step()
for name, value in {"radius.r_min_slow_m": -1.0, "scans": ["b"]}.items():
    assert not node.set_parameters([Parameter(name, value=value)])[0].successful
assert node.trigger_shutdown() is SUCCESS
"""


@pytest.mark.parametrize("name", ["turtlebot", "mir"])
def test_a_whole_life_with_shipped_parameters(python, name):
    file = ROOT / "configs" / "ros" / f"{name}.yaml"
    lines(python, "-c", LIFE, str(file), ROS_DOMAIN_ID="58")
