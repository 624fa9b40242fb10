"""Bags and logs through the guard: what is read, changed, written, and the gate."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

rosbags = pytest.importorskip("rosbags", reason="needs qpavoid[bags]")

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

import ros_messages as ros
from qpavoid.cli import main
from qpavoid.errors import DataError, InvalidInputError, UnknownNameError
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.study.bags import BagWriter, Event, Recording, bag_drive
from qpavoid.lab.study.identify import bagged, identify
from qpavoid.lab.study.replay import PIONEER, replay, robot_of, setup_for, summary
from qpavoid.model.obstacles import Obstacles
from qpavoid.ros.parameters import Wiring

RATE, START = 20.0, 1.7e9
TF = "tf2_msgs/msg/TFMessage"
SCAN, TWIST = "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/Twist"


def fill(into, given):
    """Copy the fields of a message without ROS into one of a bag."""
    for name, value in vars(given).items():
        if hasattr(value, "__dict__"):
            fill(getattr(into, name), value)
        else:
            setattr(into, name, value)
    return into


class Recorder(BagWriter):
    """Writes a bag as a robot would, of either storage."""

    def __init__(self, folder, plugin):
        super().__init__(folder.with_name("other"))
        self.__exit__(None, None, None)
        self._writer = Writer(folder, version=9, storage_plugin=plugin).__enter__()
        self._topics = {}

    def put(self, topic, kind, time, message):
        self.write(topic, kind, time, fill(self.blank(kind), message))


def chain(bag, *links):
    """A message of tf."""
    made = bag.blank("tf2_msgs/msg/TFMessage")
    for parent, child, x, *time in links:
        one = bag.stamped("geometry_msgs/msg/TransformStamped", *(time or [0]), parent)
        one.child_frame_id = child
        one.transform.translation.x, one.transform.rotation.w = x, 1.0
        made.transforms.append(one)
    return made


def record(folder, plugin=StoragePlugin.MCAP, shift=0.0, stop=None, slides=0.0):
    """A robot that drives at a wall, 2.7 m ahead of its axle, at 0.5 m/s for 4 s.

    Its mast ``slides`` ahead on it, m/s, said by /tf between the scans.
    """
    with Recorder(folder, plugin) as bag:
        for k in range(int(4 * RATE)):
            time, x = START + k / RATE, 0.5 * k / RATE
            seen = ros.wall(time - shift, 2.7 - x - slides * k / RATE, frame="laser")
            late = 0.02 if slides else 0.001
            if slides:
                then = k / RATE + 0.015
                moved = "base_link", "mast", slides * then - 0.1, START + then - shift
                bag.write("/tf", TF, START + then, chain(bag, moved))
            if stop is None or time < START + stop:
                bag.put("/scan", SCAN, time, seen)
            odom = ros.odometry(time - shift, (x, 0.0, 0.0), v=0.5)
            bag.put("/odom", "nav_msgs/msg/Odometry", time, odom)
            bag.put("/cmd_vel", TWIST, time + late, ros.twist(0.5))
        links = ("mast", "laser", 0.1), ("base_link", "mast", -0.1)
        fixed = links[:1] if slides else links
        bag.write("/tf_static", TF, START, chain(bag, *fixed))
    return folder


def run(folder, command="", wiring=None, robot="mir100_rectangle"):
    drive = bag_drive(folder, wiring, command)
    return drive, replay(drive, setup_for(drive, robot_of(robot)))


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda p: p.name)
@pytest.mark.parametrize("shift", [0.0, 1.6e9])
def test_what_would_have_been_changed(tmp_path, plugin, shift):
    """From where on it would have been slower, to the end, 0.28 m ahead of the wall."""
    drive, done = run(record(tmp_path / "bag", plugin, shift))
    assert drive.wiring.scans == ("/scan",) and drive.wiring.odometry == "/odom"
    found = summary(done)
    assert found["commands"] == 80 and found["cut"] == 0
    changed = [row["changed"] for row in done.rows]
    first = changed.index(True)
    ahead = 2.7 - 0.445 - 0.5 * first / RATE
    assert 0.17 < ahead < 1.0 and all(changed[first:]) and not any(changed[:first])
    (one,) = found["episodes"]
    assert one["begins_s"] == pytest.approx(first / RATE, abs=0.01)
    assert one["commands"] == sum(changed) and one["most_dv_mps"] > 0.3
    assert found["share_changed"] == done.changed == sum(changed) / 80


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda p: p.name)
@pytest.mark.parametrize("later", [False, True])
def test_splits_without_metadata_have_the_static_transforms_of_the_first(
    tmp_path, plugin, later
):
    """A drive in two files, as a folder, and the second one by itself.

    Commands are stamped; odometry has no twist. No command at 0.1 m/s is changed.
    """
    folder, mount = tmp_path / "drive", ("base_link", "laser", 0.0)
    folder.mkdir()
    for part in range(2):
        with Recorder(tmp_path / f"part{part}", plugin) as bag:
            if part == 0:
                bag.write("/tf_static", TF, START, chain(bag, mount))
            for k in range(40 * part, 40 * part + 40):
                time, x = START + k / RATE, 0.1 * k / RATE
                bag.put("/scan", SCAN, time, ros.wall(time, 6.0 - x, frame="laser"))
                odom = ros.odometry(time, (x, 0.0, 0.0))
                bag.put("/odom", "nav_msgs/msg/Odometry", time, odom)
                kind = "geometry_msgs/msg/TwistStamped"
                bag.put("/cmd_vel", kind, time + 1e-3, ros.twist(0.1, time=time))
        (file,) = (tmp_path / f"part{part}").glob("*.[md][cb]*")
        file.rename(folder / f"drive_{part}{file.suffix}")
    bag = folder / f"drive_1{file.suffix}" if later else folder
    _, done = run(bag)
    assert len(done.rows) == (40 if later else 80) and done.changed == 0.0
    assert done.guard.odometry.twist == pytest.approx((0.1, 0.0), abs=1e-6)


@pytest.mark.parametrize("shift", [0.0, 1.6e9])
def test_a_sensor_that_moves_on_the_robot(tmp_path, shift):
    """Where it was when it measured, between two messages of tf."""
    _, done = run(record(tmp_path / "bag", shift=shift, slides=0.15))
    for k, step in enumerate(done.steps[1:], start=1):
        ahead = 2.7 - 0.5 * (k / RATE + 0.02)
        np.testing.assert_allclose(step.obstacles.points[:, 0], ahead, atol=5e-3)


def test_a_bag_without_scans_or_commands(tmp_path):
    folder = record(tmp_path / "bag", stop=0.0)
    with pytest.raises(InvalidInputError, match="scans or clouds must name"):
        run(folder)
    with pytest.raises(UnknownNameError, match="did you mean '/cmd_vel'"):
        bag_drive(folder, Wiring(odometry="", scans=("/odom",)), "cmd_vell")
    with pytest.raises(DataError, match="nowhere: no such file or folder"):
        bag_drive(tmp_path / "nowhere", None, "")
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(next(folder.glob("*.mcap")).read_bytes()[:2000])
    with pytest.raises(DataError, match="broken.mcap: not readable"):
        bag_drive(broken, None, "")
    with pytest.raises(DataError, match="two messages or more on command"):
        setup_for(
            Recording(Wiring(), (), [Event(0.0, "command", ros.twist(0.1))]), PIONEER
        )


def test_poses_by_tf_and_a_guides_parameters(tmp_path):
    """Parameters of the role guide: the recorded commands are filtered all the same."""
    with Recorder(tmp_path / "bag", StoragePlugin.MCAP) as bag:
        for k in range(40):
            time, x = START + k / RATE, 0.2 * k / RATE
            bag.write("/tf", TF, time, chain(bag, ("odom", "base_link", x, time)))
            scan = ros.wall(time, 6.0 - x, frame="base_link")
            bag.put("/scan", SCAN, time + 1e-3, scan)
            bag.put("/cmd_vel", TWIST, time + 2e-3, ros.twist(0.2))
        bag.write("/tf_static", TF, START, chain(bag, ("base_link", "mast", 0.1)))
    wiring = Wiring(odometry="/tf", role="guide", frames=("base_link",))
    _, done = run(tmp_path / "bag", wiring=wiring._replace(frame_poses=(0.0,) * 6))
    assert len(done.rows) == 40 and done.changed == 0.0
    assert done.guard.odometry.twist[0] == pytest.approx(0.2, abs=1e-6)


def test_commands_before_anything_is_seen_are_left_out():
    events = [Event(0.1 * k, "command", ros.twist(0.5)) for k in range(4)]
    drive = Recording(Wiring(odometry=""), (), events)
    with pytest.raises(DataError, match="never seen before a command: scan"):
        replay(drive, setup_for(drive, PIONEER))
    late = Event(0.15, "scan", ros.wall(0.15, 8.0))
    drive = drive._replace(events=[*events[:2], late, *events[2:]])
    done = replay(drive, setup_for(drive, PIONEER))
    assert len(done.rows) == 2 and done.changed == 0.0
    assert done.rows[0]["v_given_mps"] == 0.5


def test_a_command_that_cannot_be_read_counts_as_changed():
    """Also where the robot stands, as it then does."""
    events = [Event(0.0, "scan", ros.wall(0.0, 8.0))]
    for k, v in enumerate((0.0, math.nan, 0.0, math.inf)):
        events.append(Event(0.05 + 0.05 * k, "command", ros.twist(v)))
    drive = Recording(Wiring(odometry=""), (), events)
    done = replay(drive, setup_for(drive, PIONEER))
    assert [row["changed"] for row in done.rows] == [False, True, False, True]
    assert {row["why"] for row in done.rows[1::2]} == {"command cannot be read"}
    assert done.changed == 0.5 and done.rows[1]["v_mps"] == 0.0
    assert summary(done)["why"] == {"command cannot be read": 2}


def two_clocks(folder, wall=lambda t: t, scan=START, odometry=START, turns=0.0):
    """Towards a wall 20 m off at 0.3 m/s; stamps of two clocks, recorded by a third.

    v is commanded for 1 s of each 2 s where it ``turns``, and driven 0.1 s later.
    """
    kinds = SCAN, "nav_msgs/msg/Odometry", TWIST
    speed = np.repeat([0.3, 0.3 - turns], 20) if turns else np.full(40, 0.3)
    heard, x = 0.3, 0.0
    with Recorder(folder, StoragePlugin.MCAP) as bag:
        for k in range(400):
            time = k / RATE
            heard += np.clip(speed[(k - 3) % 40] - heard, -0.1, 0.1) if k > 2 else 0.0
            odom = ros.odometry(time + odometry, (x, 0.0, 0.0), v=float(heard))
            x += heard / RATE
            seen = ros.wall(time + scan, 20.0 - x, frame="base_link")
            seen.range_max = 60.0
            now = START + wall(time)
            if k % 2 == 0:
                bag.put("/scan", kinds[0], now, seen)
            bag.put("/odom", kinds[1], now, odom)
            bag.put("/cmd_vel", kinds[2], now + 1e-4, ros.twist(speed[k % 40]))
    return folder


@pytest.mark.parametrize(
    "wall",
    [
        lambda t: t,
        *(lambda t: t / 0.9, lambda t: 2.0 * t, lambda t: 0.4 * t),
        lambda t: 1.5 * t + 2.0 * math.sin(t / 3.0),
        lambda t: t + 30.0 * (t > 7.0),
    ],
    ids=["1", "0.9", "0.5", "2.5", "changing", "paused"],
)
def test_a_simulation_recorded_in_time_of_the_wall(tmp_path, wall):
    """Commands without stamps are brought to its clock: none has to be changed."""
    _, done = run(two_clocks(tmp_path / "bag", wall, scan=5.0, odometry=5.0))
    assert len(done.rows) >= 398 and done.changed == 0.0


@pytest.mark.parametrize(
    ("odometry", "age"),
    [
        (START - 8_310_659.0, "8310659.000"),
        (12.5, "1699999987.500"),
        (START + 0.3, "-0.300"),
        (START - 0.4, "0.400"),
    ],
)
def test_topics_of_two_clocks_are_refused_by_name(tmp_path, odometry, age, capsys):
    folder = str(two_clocks(tmp_path / "bag", odometry=odometry))
    command = ["replay", folder, "--out", str(tmp_path / "out")]
    assert main(command) == 1
    said = capsys.readouterr().err
    assert f"/odom {age} s; allowed for /odom is" in said and "/scan 0.000 s," in said
    assert main([*command, "--json"]) == 1
    assert "/odom is stamped by another" in json.loads(capsys.readouterr().out)["error"]
    assert not (tmp_path / "out").exists()


def test_a_clock_that_was_set_back_is_refused(tmp_path):
    with Recorder(tmp_path / "bag", StoragePlugin.MCAP) as bag:
        for k in range(40):
            odom = ros.odometry(START + k % 30)
            bag.put("/odom", "nav_msgs/msg/Odometry", START + k, odom)
            bag.put("/cmd_vel", TWIST, START + k, ros.twist(0.1))
    with pytest.raises(DataError, match="its /odom go back by 29 s: a clock was set"):
        bagged(tmp_path / "bag")


OTHERS = START - 8_310_659.0, 12.5
CLOCKS = [(1.0, x) for x in (START, *OTHERS, START + 0.3)] + [(0.5, x) for x in OTHERS]


@pytest.mark.parametrize(("rate", "odometry"), CLOCKS)
def test_identify_has_the_commands_on_the_clock_of_odometry(tmp_path, rate, odometry):
    how = {"wall": lambda t: t / rate, "odometry": odometry, "turns": 0.3}
    found = identify(bagged(two_clocks(tmp_path / "bag", **how)))
    assert found.delay.low <= 0.1 <= found.delay.high
    assert found.acceleration.value == pytest.approx(2.0, rel=0.1)


def test_a_changed_command_has_its_reason(tmp_path, capsys):
    """On the terminal, in the summary and in the table: topic, fault and error."""
    folder = record(tmp_path / "bag", stop=1.0)
    wired = tmp_path / "node.yaml"
    wired.write_text(
        "/**: {ros__parameters: {dt_s: 0.05, scans: [scan], base_frame: chassis}}"
    )
    command = ["replay", str(folder), "--out", str(tmp_path / "out")]
    assert main([*command, "--params", str(wired)]) == 0
    said = capsys.readouterr().out
    reason = "scan: invalid. It cannot be read. scan: unknown frame 'laser'"
    told = json.loads((tmp_path / "out" / "replay.json").read_text())["reasons"]
    assert told["scan invalid"].startswith(reason)
    assert f"scan invalid: {reason}" in said
    with open(tmp_path / "out" / "replay.csv", encoding="utf-8") as file:
        assert next(csv.DictReader(file))["reason"].startswith(reason)
    assert main(command) == 0
    assert "/scan stale: /scan: stale. The last message is" in capsys.readouterr().out


def test_a_bag_whose_stamps_nobody_filled_in(tmp_path):
    with Recorder(tmp_path / "bag", StoragePlugin.MCAP) as bag:
        for k in range(5):
            bag.put("/scan", SCAN, START + k, ros.wall(0.0, 2.0, frame="laser"))
            bag.put("/cmd_vel", TWIST, START + k, ros.twist(0.1))
    with pytest.raises(DataError, match=r"all 5 messages of its .scan are stamped 0 s"):
        bag_drive(tmp_path / "bag", None, "")


def test_the_command_its_files_and_its_gate(tmp_path, capsys):
    folder, out = record(tmp_path / "bag"), tmp_path / "out"
    command = ["replay", str(folder), "--robot", "mir100_rectangle"]
    assert main([*command, "--out", str(out), "--allow-changed", "90%"]) == 0
    said = capsys.readouterr().out
    assert "of 80 commands changed" in said and "---" not in said
    told = json.loads((out / "replay.json").read_text())
    with (out / "replay.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert told["commands"] == len(rows) == 80
    assert sum(line.startswith("│") for line in said.splitlines()) == min(
        10, len(told["episodes"])
    )
    assert told["episodes"]
    assert (out / "replay.png").stat().st_size > 5000
    again = [*command, "--out", str(tmp_path / "again")]
    assert main([*again, "--allow-changed", "0.5%"]) == 3
    assert "more than the 0.50% that are allowed" in capsys.readouterr().err
    assert main([*command, "--out", str(out)]) == 0, "it takes the first one's place"
    (out / "bag" / "notes.txt").write_text("mine")
    assert main([*command, "--out", str(out)]) == 1, "there is something else"
    (out / "bag" / "notes.txt").unlink()
    itself = ["replay", str(out / "bag"), "--robot", "mir100_rectangle"]
    assert main([*itself, "--out", str(out)]) == 2, "it would be written over"
    with pytest.raises(SystemExit):
        main([*command, "--allow-changed", "200%"])
    with AnyReader([out / "bag"]) as reader:
        kinds = {one.topic: one.msgtype for one in reader.connections}
        assert set(kinds) == {
            f"/qpavoid/{name}" for name in ("recorded", "given", "markers")
        } | {"/tf"}
        many = dict.fromkeys(kinds, 0)
        for one, *_ in reader.messages():
            many[one.topic] += 1
        assert set(many.values()) == {80}
    assert kinds["/qpavoid/given"].endswith("TwistStamped")


WALK = 0.8
"""m/s, of the person in :func:`passed_by`."""


def passed_by(folder, commands=False, odometry=True):
    """A robot at x = 1 m, at rest in a room; a person walks by along −x, y = 1 m.

    Without odometry there is no transform either.
    """
    device, room = Lidar(LidarSettings(beams=360, noise=0.01)), np.array([4.0, 3.0])
    corners = room * [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    walls = np.hstack([corners, np.roll(corners, -1, axis=0)])
    with Recorder(folder, StoragePlugin.MCAP) as bag:
        for k in range(80):
            then, time = 0.1 * k, START + 0.1 * k
            person = (3.5 - WALK * then, 1.0, 0.25)
            world = Obstacles(discs=[person], walls=walls)
            ranges = device.measure(lambda after, seen=world: ((1.0, 0.0, 0.0), seen))
            angle = -math.pi + math.pi / 360
            scan = ros.scan(time, ranges, "laser", first=angle)
            bag.put("/scan", SCAN, time + 0.02, scan)
            if odometry:
                odom = ros.odometry(time, (1.0, 0.0, 0.0))
                bag.put("/odom", "nav_msgs/msg/Odometry", time, odom)
            if commands:
                bag.put("/cmd_vel", TWIST, time + 0.03, ros.twist(0.0))
        if odometry:
            fixed = chain(bag, ("base_link", "laser", 0.0))
            bag.write("/tf_static", TF, START, fixed)
    return folder


@pytest.mark.parametrize("commands", [False, True])
def test_a_person_who_walks_by_has_a_velocity(tmp_path, capsys, commands):
    """In the table and in the markers; the points at rest are those of the room."""
    folder, out = passed_by(tmp_path / "bag", commands), tmp_path / "out"
    command = ["replay", str(folder), "--robot", "0.4,0.4", "--out", str(out)]
    assert main([*command, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (mover,) = told["movers"]
    assert mover["lasts_s"] > 5.0 and abs(mover["median_mps"] - WALK) < 0.05
    assert ("changed" in told) == commands and told["notes"] == []
    with (out / "movers.csv").open(newline="") as file:
        rows = [{k: float(x) for k, x in row.items()} for row in csv.DictReader(file)]
    for row in rows:
        assert math.hypot(row["v_x_mps"] + WALK, row["v_y_mps"]) < 0.2
        true = 3.5 - WALK * (row["time_s"] - START), 1.0
        assert math.dist(true, (row["x_m"], row["y_m"])) < 0.1
    assert (out / "replay.png").exists() == commands
    assert (out / "perception.png").stat().st_size > 20_000
    with AnyReader([out / "bag"]) as reader:
        (kind,) = [x for x in reader.connections if x.topic == "/qpavoid/markers"]
        shown = [
            reader.deserialize(data, kind.msgtype).markers
            for *_, data in reader.messages([kind])
        ]
    drawn = [{one.ns: one.points for one in markers} for markers in shown]
    ways = [one["velocities"] for one in drawn if len(one["velocities"])]
    assert len(ways) == len(rows) > 50
    for start, end in ways:
        assert math.hypot(end.x - start.x + WALK, end.y - start.y) < 0.2
    assert main([*command, "--raw"]) == 0
    assert "0 movers" in capsys.readouterr().out
    if not commands:
        assert main([*command, "--allow-changed", "1%"]) == 2


def test_without_odometry_or_frames_the_assumption_is_said(tmp_path, capsys):
    folder, out = passed_by(tmp_path / "bag", odometry=False), tmp_path / "out"
    assert main(["replay", str(folder), "--robot", "0.4,0.4", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "1 movers" in said and "no odometry: the robot is at rest" in said
    assert "no transform of laser: at the robot's origin" in said


def test_two_scanners_whose_scans_roll(tmp_path):
    """A robot turns on the spot beside a post, 1.5 rad/s for 0.09 s in a scan."""
    turning, beams, span = 1.5, 720, 0.09
    with Recorder(tmp_path / "bag", StoragePlugin.MCAP) as bag:
        for k in range(60):
            time, yaws = START + 0.1 * k, {"front": 0.3, "rear": 0.3 - math.pi}
            angles = -math.pi + math.tau / beams * np.arange(beams)
            heading = turning * (0.1 * k + span / (beams - 1) * np.arange(beams))
            for name, yaw in yaws.items():
                off = (angles + yaw + heading - 2.618 + math.pi) % math.tau - math.pi
                seen = np.where(np.abs(off) < 0.05, 1.5, np.inf)
                scan = ros.scan(time, seen, name)
                scan.time_increment, scan.scan_time = span / (beams - 1), 0.1
                bag.put(f"/{name}", SCAN, time + span, scan)
            for late in range(0, 100, 20):
                pose = 0.0, 0.0, turning * (0.1 * k + 1e-3 * late)
                odom = ros.odometry(time + 1e-3 * late, pose, 0.0, turning)
                bag.put("/odom", "nav_msgs/msg/Odometry", time + 1e-3 * late, odom)
            bag.put("/cmd_vel", TWIST, time + 0.095, ros.twist(0.0, turning))
    poses = 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3 - math.pi
    wiring = Wiring(scans=("/front", "/rear"), odometry="/odom", frame_poses=poses)
    _, done = run(tmp_path / "bag", wiring=wiring._replace(frames=("front", "rear")))
    for row, step in zip(done.rows[10:], done.steps[10:], strict=True):
        x, y = step.obstacles.points.mean(axis=0)
        off = math.atan2(y, x) + row["heading_rad"] - 2.618
        assert abs(math.sin(off)) < 0.012
        assert math.hypot(x, y) == pytest.approx(1.5, abs=0.03)


def test_two_scanners_of_a_real_robot(tmp_path, capsys, data_folder):
    """A person walks round it for half a minute; mounts are those of its makers."""
    bag = data_folder / "scans" / "obstacle_detector" / "scans_demo.bag"
    file = tmp_path / "node.yaml"
    poses = [0.236, 0.0, 0.068, 0.0, 0.0, 0.0, -0.238, 0.005, 0.099, 0.0, 0.0, math.pi]
    named = f"frames: [front_scanner, rear_scanner], frame_poses: {poses}"
    scans = "scans: [front_scan, rear_scan], odometry: ''"
    shape = (
        "robot: {footprint_m: '[[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]'}"
    )
    file.write_text(f"/**: {{ros__parameters: {{{scans}, {named}, {shape}}}}}")
    command = ["replay", str(bag), "--params", str(file), "--out", str(tmp_path)]
    assert main([*command, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    longest = max(told["movers"], key=lambda one: one["lasts_s"])
    assert longest["lasts_s"] > 20.0 and len(told["movers"]) < 6
    assert 0.2 < longest["median_mps"] < 1.5


def test_parameters_of_the_node(tmp_path, capsys):
    """Its topics, its robot, and its frames; here a speed of 0.2 m/s at most."""
    folder, file = record(tmp_path / "bag"), tmp_path / "node.yaml"
    file.write_text(
        "/**: {ros__parameters: {dt_s: 0.05, robot_preset: jackal, scans: [scan],"
        " robot: {v_max_mps: 0.2}, freshness: {points_s: 0.4, odometry_s: 0.3}}}"
    )
    out = tmp_path / "out"
    command = ["replay", str(folder), "--params", str(file), "--out", str(out)]
    assert main(command) == 0
    told = json.loads((out / "replay.json").read_text())
    assert told["cut"] == told["commands"] == 80 and Path(out / "bag").is_dir()
    file.write_text("/**: {ros__parameters: {scan: [scan]}}")
    assert main(command) == 1
    assert "did you mean 'scans'" in capsys.readouterr().err
