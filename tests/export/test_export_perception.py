"""Perception in C: the obstacles and twists of Python, to the last bit."""

import ctypes
import math
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import qpavoid as qp
from in_c import COMPILER, STRICT
from qpavoid.cli import main
from qpavoid.export.write import Capacity, export_c
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from timing.exported import problem_type

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

ROBOT = qp.Robot.mir100()
SETTINGS = qp.AvoidanceSettings(dt=0.05)
ROUND = qp.Lidar(mount=(0.3, 0.1, 0.4), no_echo="free")
SWEPT = qp.Lidar(4.7, (0.35, 0.0, 0.0), 8.0, 0.2, sweep=-0.07, delay=0.02)
FILES = "qpavoid_perception.c", "qpavoid_filter.c"


def compiled(folder, *command):
    flags = ["-std=c99", "-O2", "-ffp-contract=off", *STRICT]
    subprocess.run([COMPILER, *flags, *command, *FILES, "-lm"], cwd=folder, check=True)


@pytest.mark.parametrize("lidar", [ROUND, SWEPT])
def test_the_robot_of_the_example_evades_a_person(tmp_path, lidar):
    """Its answers have the bits of Python below; here it sees, and drives."""
    export_c(tmp_path, ROBOT, SETTINGS, Capacity(64, 3000, beams=270), lidar=lidar)
    compiled(tmp_path, "-o", "perceive", "perceive.c")
    done = subprocess.run(["./perceive"], cwd=tmp_path, capture_output=True, text=True)
    row = r"([\d.]+) s  (\d+) points  (\d) discs  (\S+) m/s  (\S+) rad/s"
    lines = [re.fullmatch(row, line) for line in done.stdout.splitlines()]
    times, points, discs, v, _ = np.array([one.groups() for one in lines], float).T
    np.testing.assert_allclose(times, 0.1 * np.arange(60))
    assert points.min() > 150 and discs.max() >= 1
    assert np.abs(v).max() > 0.3 and not v[discs == 0][:5].any()


class InC:
    """Perception in C behind the interface of Python's."""

    def __init__(self, folder, capacity, lidar):
        export_c(folder, ROBOT, SETTINGS, capacity, lidar=lidar)
        compiled(folder, "-shared", "-fPIC", "-o", "perception.so")
        self.library = ctypes.CDLL(str(folder / "perception.so"))
        self.memory = ctypes.create_string_buffer(1 << 23)
        self.seen = np.zeros((), problem_type(capacity)["obstacles"])
        self.filter = ctypes.create_string_buffer(1 << 23)
        self.library.qpavoid_init(self.filter)
        self.library.qpavoid_perception_init(self.memory)

    def fit(self, corners):
        """Change the footprint to one convex part."""
        kinds = [("counts", np.int32, 2), ("corners", np.float64, (5, 2))]
        given = np.zeros((), np.dtype(kinds, align=True))
        given["counts"], given["corners"][: len(corners)] = (1, len(corners)), corners
        at = given.ctypes.data_as(ctypes.c_void_p)
        assert self.library.qpavoid_set_footprint(self.filter, at) == 0

    def update(self, ranges, stamp, pose, twist):
        arrays = (np.array(x, dtype=float) for x in (ranges, pose, twist))
        ranges, pose, twist = (np.ctypeslib.as_ctypes(x) for x in arrays)
        time = ctypes.c_double(stamp)
        return self.library.qpavoid_perceive(
            *(self.memory, self.filter, ranges, time, pose, twist)
        )

    def obstacles(self, time, pose):
        """Points, discs and velocities, and how many were left out."""
        at, seen = np.ctypeslib.as_ctypes(np.array(pose, dtype=float)), self.seen
        out = self.library.qpavoid_perceived(
            *(self.memory, self.filter, ctypes.c_double(time), at),
            seen.ctypes.data_as(ctypes.c_void_p),
        )
        n, m = int(seen["n_points"]), int(seen["n_discs"])
        moving = seen["discs"][:m], seen["disc_velocities"][:m]
        return seen["points"][:n], *moving, out


def drive(seed):
    """Scans, stamps, poses and twists of a robot among people, with faults."""
    rng = np.random.default_rng(seed)
    view = LidarSettings(field_of_view=4.7, beams=270, noise=0.01, dropout=0.02)
    device, pose = Lidar(view), (0.0, 0.0, 0.0)
    walls = [(-3, -3, 6, -3), (6, -3, 6, 4), (6, 4, -3, 4), (-3, 4, -3, -3)]
    for k in range(120):
        time = 0.08 * k
        discs = [(5 - time, 0.5, 0.25), (2.0, time - 3, 0.25), (-1.5, 2.0, 0.2)]
        twist = 0.2, 0.4 * math.sin(time)
        pose = (pose[0] + 0.01, pose[1], pose[2] + 0.08 * twist[1])
        ranges = device.ranges(pose, qp.Obstacles(discs=discs, walls=walls))
        stamp = time
        if k % 11 == 5:
            stamp -= 0.5  # time runs backwards
        if k % 13 == 6:
            stamp -= 0.08  # the last one again
        if k % 17 == 7:
            ranges = np.where(rng.random(270) < 0.3, math.nan, ranges)
        if k == 70:
            pose = (30.0, -5.0, 2.0)
        if k % 19 == 8:
            twist = math.nan, 0.0
        yield ranges, stamp, pose, twist


@pytest.mark.parametrize("seed", range(3))
def test_every_obstacle_has_the_bits_of_python(tmp_path, seed):
    machine = InC(tmp_path, Capacity(64, 4000, beams=270), SWEPT)
    perception, found, refused = qp.Perception(ROBOT, SWEPT), 0, 0
    changes = {40: qp.Footprint.rectangle(8.0, 8.0), 60: ROBOT.footprint}
    for k, (ranges, stamp, pose, twist) in enumerate(drive(seed)):
        if k in changes:
            machine.fit(changes[k].vertices)
            perception.fit(replace(ROBOT, footprint=changes[k]))
        try:
            perception.update(ranges, stamp, pose, twist=twist)
            assert machine.update(ranges, stamp, pose, twist) == 0
        except qp.InvalidInputError:
            assert machine.update(ranges, stamp, pose, twist) == -1
            refused += 1
        expected = perception.obstacles(stamp + 0.03, pose)
        points, discs, velocities, out = machine.obstacles(stamp + 0.03, pose)
        assert out == 0 and points.tobytes() == expected.points.tobytes()
        assert discs.tobytes() == expected.discs.tobytes()
        assert velocities.tobytes() == expected.disc_velocities.tobytes()
        found += len(discs)
    assert found > 20 and refused > 10


def test_the_nearest_are_kept_where_there_is_no_room(tmp_path):
    machine = InC(tmp_path, Capacity(1, 50, beams=270), SWEPT)
    perception = qp.Perception(ROBOT, SWEPT)
    for ranges, stamp, pose, twist in list(drive(0))[:4]:
        machine.update(ranges, stamp, pose, twist)
        perception.update(ranges, stamp, pose, twist=twist)
    points, *_, out = machine.obstacles(stamp, pose)
    known = perception.obstacles(stamp, pose).points
    assert out == len(known) - len(points) and len(points) == 50
    away = np.sort(np.hypot(*known.T))
    np.testing.assert_array_equal(np.sort(np.hypot(*points.T)), away[: len(points)])
    assert machine.obstacles(math.nan, pose)[3] == -1


def test_the_command_line_writes_it_of_a_scenario_and_of_a_preset(tmp_path, capsys):
    assert main(["export-c", "--beams", "90", "--points", "400", str(tmp_path)]) == 0
    assert str(tmp_path / "qpavoid_perception.c") in capsys.readouterr().out.split()
    compiled(tmp_path, "-o", "perceive", "perceive.c")
    header = tmp_path / "qpavoid_perception.h"
    assert "#define QPAVOID_BEAMS 90\n" in header.read_text()
    assert main(["export-c", "--robot", "demo/jackal_mujoco", str(tmp_path)]) == 0
    lidar = load_scenario("demo/jackal_mujoco").lidar
    assert f"#define QPAVOID_BEAMS {lidar.beams}\n" in header.read_text()
    assert f"#define QPAVOID_RANGE_MAX {lidar.range}\n" in header.read_text()
