"""Mount and timing of a LiDAR, recovered from recordings whose truth is known."""

import json
import math
import tomllib
from functools import lru_cache

import numpy as np
import pytest

import qpavoid as qp
from qpavoid.cli import main
from qpavoid.errors import InvalidInputError
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.study.bags import BagWriter
from qpavoid.lab.study.calibrate import EXCITED, Recording, calibrate
from qpavoid.model.obstacles import Obstacles
from qpavoid.perception.settings import MOUNT
from qpavoid.ros.parameters import Wiring
from qpavoid.settings import declared

BEAMS, RATE, START = 120, 8.0, 1.7e9
BOXES = [(-4, -3, 5, 4), (2.5, 1.5, 3.5, 2.5), (-3, -2, -2, -1.2), (0.5, -2.8, 1.6, -2)]
WORLD = Obstacles(
    walls=[
        wall
        for x, y, u, v in BOXES
        for wall in ((x, y, u, y), (u, y, u, v), (u, v, x, v), (x, v, x, y))
    ]
)


def curved(time):
    return 0.35 + 0.35 * np.sin(0.7 * time), 1.3 * np.sin(0.9 * time) + 0.2


def straight(time):
    return 0.5 * np.sin(0.8 * time), 0.0 * time


def still(time):
    return 0.0 * time, 0.0 * time


@lru_cache
def recorded(motion, mount=(0.2, -0.1, 0.3), delay=0.06, sweep=-0.07, seconds=24.0):
    """Scans with one pose per beam, by small steps of time, and poses at 50 Hz."""
    random, fine = np.random.default_rng(0), np.arange(0.0, seconds, 1e-3)
    v, omega = motion(fine)
    heading = 1e-3 * np.cumsum(omega)
    x, y = (1e-3 * np.cumsum(v * f(heading)) for f in (np.cos, np.sin))
    sensor = Lidar(LidarSettings(beams=BEAMS, range=12.0, mount=mount))
    stamps, ranges = np.arange(0.5, seconds - 0.5, 1.0 / RATE), []
    share = np.arange(BEAMS) / (BEAMS - 1)
    for stamp in stamps:
        times = stamp - delay + abs(sweep) * (share if sweep > 0 else 1.0 - share)
        poses = np.array([np.interp(times, fine, one) for one in (x, y, heading)]).T
        row = [
            sensor.ranges(tuple(pose), WORLD, slice(k, k + 1))[0]
            for k, pose in enumerate(poses)
        ]
        ranges.append(row + 0.01 * random.standard_normal(BEAMS))
    poses = np.column_stack([fine, x, y, heading])[::20]
    step = 2.0 * math.pi / BEAMS
    first = -math.pi + 0.5 * step
    return Recording(stamps, np.array(ranges), first, step, (0.1, 12.0), poses)


def test_mount_delay_and_sweep_are_within_the_intervals():
    truth = dict(zip(EXCITED, (-0.15, 0.05, -2.0, -0.02, 0.08), strict=True))
    made = recorded(curved, (-0.15, 0.05, -2.0), -0.02, 0.08)
    found = calibrate(made)
    for name, value in truth.items():
        one = found.estimates[name]
        assert one.low < value < one.high, (name, one)
        assert one.high - one.low < 2.0 * EXCITED[name][0]
    assert found.thickness < 0.02
    lidar = made.lidar([one.value for one in found.estimates.values()])
    assert lidar.is_round and lidar.range_max == 12.0
    first = lidar.mount[2] - 0.5 * lidar.field_of_view  # direction of the first beam
    assert first == pytest.approx(-2.0 + made.first, abs=0.02)


@pytest.mark.parametrize(
    ("motion", "missing"),
    [(straight, ["x", "y", "sweep"]), (still, ["x", "y", "yaw", "delay", "sweep"])],
)
def test_motion_that_excites_nothing_is_refused_by_name(motion, missing):
    with pytest.raises(InvalidInputError, match="the motion does not tell") as caught:
        calibrate(recorded(motion))
    said = str(caught.value).removeprefix("the motion does not tell ")
    assert [part.split()[0] for part in said.split("; ")] == missing
    assert "turns of 90° or more" in said


def test_a_short_recording_is_refused():
    made = recorded(curved)
    with pytest.raises(InvalidInputError, match="16 s of scans"):
        calibrate(made._replace(stamps=made.stamps[:40], ranges=made.ranges[:40]))


def test_the_command_reads_a_bag_from_left_to_right(tmp_path, capsys):
    pytest.importorskip("rosbags", reason="needs qpavoid[bags]")
    yaml = pytest.importorskip("yaml")
    made, kinds = (
        recorded(curved),
        ("sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"),
    )
    with BagWriter(tmp_path / "bag") as bag:
        for stamp, ranges in zip(START + made.stamps, made.ranges, strict=True):
            scan = bag.stamped(kinds[0], stamp, "laser")
            scan.angle_min, scan.angle_increment = -made.first, -made.step
            scan.angle_max, scan.ranges = made.first, ranges[::-1].astype(np.float32)
            scan.range_min, scan.range_max = made.limits
            bag.write("/scan", kinds[0], stamp, scan)
        for time, x, y, heading in made.poses:
            odometry = bag.stamped(kinds[1], START + time, "odom")
            pose = odometry.pose.pose
            pose.position.x, pose.position.y = x, y
            pose.orientation.z, pose.orientation.w = (
                np.sin(heading / 2),
                np.cos(heading / 2),
            )
            bag.write("/odom", kinds[1], START + time, odometry)
    assert main(["calibrate", str(tmp_path / "bag"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    for name, value in zip(EXCITED, (0.2, -0.1, 0.3, 0.06, -0.07), strict=True):
        assert found[name]["low"] < value < found[name]["high"], name
    python, table, node = found["settings"].split("\n\n")
    lidar = eval(python, {"qp": qp})
    keys = tomllib.loads(table)["lidar"]
    made = dict(zip(MOUNT, lidar.mount, strict=True))
    assert keys == made | {"sweep_s": lidar.sweep, "delay_s": lidar.delay}
    assert keys.keys() <= {key for one in declared(LidarSettings) for key in one.keys}
    wiring = Wiring(**yaml.safe_load(node)["qpavoid"]["ros__parameters"])
    assert wiring.frames == ["laser"] and len(wiring.frame_poses) == 6
    x, y, *_, yaw = wiring.frame_poses
    assert (x, y, yaw) == pytest.approx((0.2, -0.1, 0.3), abs=0.02)
    assert main(["calibrate", str(tmp_path / "bag"), "--scan-topic", "/rear"]) == 2
    assert "unknown topic '/rear'" in capsys.readouterr().err
