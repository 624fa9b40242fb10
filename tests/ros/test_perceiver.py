"""Scans of several sensors become static and moving obstacles in the node."""

import math

import numpy as np
import pytest
import ros_guards
from ros_guards import AT_ONCE, DT

import ros_messages as ros
from driven import driven_to
from qpavoid.avoidance.inputs import Fault
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.ros.guard import NO_ODOMETRY
from qpavoid.ros.report import markers

BEAMS = 360
ROOM = [(-4, -3, 6, -3), (6, -3, 6, 3), (6, 3, -4, 3), (-4, 3, -4, -3)]
MOUNTS = {"scan": (0.35, 0.0, 0.0), "back": (-0.35, 0.0, math.pi)}


def guarded(changed=(), **wiring):
    poses = [(x, y, 0.2, 0.0, 0.0, yaw) for x, y, yaw in MOUNTS.values()]
    known = {"frames": tuple(MOUNTS), "frame_poses": tuple(np.ravel(poses))}
    values = AT_ONCE | {"freshness.points_s": 0.3} | dict(changed)
    return ros_guards.guarded(values, **known | wiring)


def beam_first(ranges, time, name):
    """The usual scan: from right to left, the first beam behind."""
    made = ros.scan(time, ranges, name)
    made.angle_min += 0.5 * made.angle_increment
    made.angle_max = made.angle_min + (len(ranges) - 1) * made.angle_increment
    return made


def clockwise(ranges, time, name):
    made = beam_first(ranges[::-1], time, name)
    made.angle_min, made.angle_max = made.angle_max, made.angle_min
    made.angle_increment *= -1.0
    return made


def person(time):
    """Disc of somebody who comes at the robot, over ground."""
    return 5.0 - 1.0 * time, 0.3, 0.25


class World:
    """A robot in a room with a person; its scanners' messages go through ``made``."""

    def __init__(self, guard, made=beam_first, every=2):
        self.guard, self.made, self.pose, self.time = guard, made, (0.0, 0.0, 0.0), 0.0
        self.devices = {
            name: Lidar(LidarSettings(beams=BEAMS, mount=MOUNTS[name], noise=0.005))
            for name in guard.wiring.scans
        }
        self.due, self.every = 0.0, every

    def walls(self):
        return Obstacles(discs=[person(self.time)], walls=ROOM)

    def step(self, v=0.0, omega=0.0, **spoilt):
        self.time += DT
        now = (100.0 + self.time,) * 2
        if self.guard.wiring.odometry:
            told = ros.odometry(now[0], self.pose, *self.guard.driven)
            self.guard.see("odom", told, *now)
        if self.time >= self.due:
            for name, device in self.devices.items():
                ranges = device.ranges(self.pose, self.walls())
                message = self.made(ranges, now[0], name)
                self.guard.see(name, spoilt.get(name, lambda m: m)(message), *now)
            gap = self.every(self.time) if callable(self.every) else self.every * DT
            self.due = self.time + gap - 1e-9
        self.guard.command(ros.twist(v, omega), *now)
        step = self.guard.step(*now)
        self.was = self.pose
        self.pose = driven_to(self.pose, step.v, step.omega, DT)
        return step

    def run(self, until, *command):
        """Return the last of the steps until a time."""
        while self.time < until - 1e-9:
            last = self.step(*command)
        return last

    def velocities(self, step):
        """Starts and velocities of the drawn arrows, robot frame."""
        drawn = {one.name: one.points for one in markers(self.guard, step)}
        begin, end = drawn["velocities"].reshape(-1, 2, 2).swapaxes(0, 1)
        return begin, end - begin


def assert_known(world, step):
    """One moving obstacle where the person is, drawn and given to the filter."""
    begin, velocity = world.velocities(step)
    x, y, heading = world.was
    c, s = math.cos(heading), math.sin(heading)
    back = np.array([[c, s], [-s, c]])
    place = back @ (np.array(person(world.time)[:2]) - (x, y))
    assert len(begin) == 1
    np.testing.assert_allclose(velocity[0], back @ (-1.0, 0.0), atol=0.15)
    np.testing.assert_allclose(begin[0], place, atol=0.08)


@pytest.mark.parametrize("made", [beam_first, clockwise])
def test_a_person_has_a_velocity_in_command_and_markers(made):
    world = World(guarded(), made)
    step = world.run(2.5)
    assert_known(world, step)
    assert len(step.obstacles.points) > 300, "walls stay points"
    while step.v == 0.0 and world.time < 4.0:
        step = world.step()
    assert step.v != 0.0, "it evades somebody whom a point would let come near"


def test_a_driving_robot_knows_its_walls_from_people():
    world = World(guarded(), every=lambda t: 0.05 + 0.1 * abs(math.sin(7.0 * t)))
    assert_known(world, world.run(2.2, 0.2, 0.3))


def test_two_scanners_are_one_map():
    world = World(guarded(scans=tuple(MOUNTS)))
    assert_known(world, world.run(2.5))
    assert world.guard.sensing.perceiver.taken == set(MOUNTS)


def test_a_scanner_may_be_upside_down():
    """An upside-down scanner turns to the right: beams and lean are mirrored."""
    poses = (0.35, 0.0, 0.2, math.pi, 0.0, 0.4)
    guard = guarded(frames=("scan",), frame_poses=poses)
    world = World(guard, lambda ranges, *rest: beam_first(ranges[::-1], *rest))
    world.devices["scan"] = Lidar(
        LidarSettings(beams=BEAMS, mount=(0.35, 0.0, 0.4), noise=0.005)
    )
    assert_known(world, world.run(2.5))


def test_without_odometry_all_is_at_rest_and_that_is_said():
    world = World(guarded(odometry=""))
    step = world.run(2.5)
    assert world.guard.errors["perception"] == NO_ODOMETRY
    assert len(step.obstacles.points) == BEAMS and not len(step.obstacles.discs)
    off = World(guarded({"perception.enabled": False})).run(2.5)
    assert len(off.obstacles.points) == BEAMS and not len(off.obstacles.discs)


def test_after_a_jump_of_odometry_echoes_count_until_the_map_is_new():
    world = World(guarded())
    world.run(2.5)
    assert world.guard.sensing.perceiver.taken
    world.due, world.pose = math.inf, (30.0, 0.0, 0.0)
    assert world.step().faults == {"odom": Fault.JUMPED}
    step = world.step()
    nearest = np.hypot(*step.obstacles.points.T).min()
    assert not world.guard.sensing.perceiver.taken
    assert nearest == pytest.approx(5.0 - 2.4 - 0.25, abs=0.3)


def test_points_of_a_depth_camera_have_velocities():
    """A cloud of what a scanner sees, at three heights: floor, knee, lamp."""

    def lifted(ranges, time, name):
        angles = (np.arange(BEAMS) + 0.5) * math.tau / BEAMS - math.pi
        flat = np.column_stack([np.cos(angles), np.sin(angles)]) * ranges[:, None]
        rows = [np.column_stack([flat, np.full(BEAMS, z)]) for z in (-0.2, 0.3, 2.0)]
        return ros.cloud(time, "xyz", np.vstack(rows), name)

    guard = guarded(scans=(), clouds=("scan",))
    world = World(guard, lifted)
    world.devices = {"scan": Lidar(LidarSettings(mount=MOUNTS["scan"], noise=0.005))}
    assert_known(world, world.run(2.5))


def test_another_number_of_beams_is_said_and_the_map_stays():
    world = World(guarded(), lambda ranges, *rest: ros.scan(rest[0], ranges, rest[1]))
    world.run(2.4)
    world.devices["scan"] = Lidar(LidarSettings(beams=180, mount=MOUNTS["scan"]))
    step = world.step()
    assert "scan: 180 beams, 360 before" in step.sentence
    assert_known(world, step)
    world.step(), world.step()
    assert "before" not in world.step().sentence


def second_turn(message):
    message.ranges = np.append(np.full(BEAMS, np.inf), message.ranges)
    message.angle_max = 0.0


HOSTILE = {
    "no echo is a number": lambda m: setattr(m, "ranges", np.full(BEAMS, np.nan)),
    "half of them": lambda m: m.ranges.__setitem__(slice(0, None, 2), np.nan),
    "no ranges": lambda m: setattr(m, "ranges", np.empty(0)),
    "one range": lambda m: setattr(m, "ranges", m.ranges[:1]),
    "echoes in a second turn": second_turn,
    "angle_max does not fit": lambda m: setattr(m, "ranges", m.ranges[:200]),
    "a step of nearly 0": lambda m: setattr(m, "angle_increment", 1e-320),
    "a step of five turns": lambda m: setattr(m, "angle_increment", 31.0),
    "no angle_max": lambda m: setattr(m, "angle_max", 0.0),
    "a range_max beyond numbers": lambda m: setattr(m, "range_max", math.inf),
    "negative ranges": lambda m: setattr(m, "ranges", -m.ranges),
    "a sweep against time": lambda m: setattr(m, "time_increment", -1e-4),
    "a stamp of yesterday": lambda m: setattr(m.header.stamp, "sec", 1),
}


@pytest.mark.parametrize("spoil", HOSTILE.values(), ids=HOSTILE)
def test_hostile_messages_neither_raise_nor_free_anything(spoil):
    """Every third scan, and then all, of a robot that is sent at a wall."""

    def spoilt(message):
        if world.time > 6.0 or round(world.time / DT) % 3 == 0:
            spoil(message)
        return message

    world = World(guarded({"freshness.points_s": 0.5}))
    for _ in range(240):
        step = world.step(0.5, scan=spoilt)
        walls = Obstacles(walls=ROOM).seen_from(world.pose)
        near = Contacts.of(world.guard.setup.robot.footprint, walls).distance.min()
        assert math.isfinite(step.v + step.omega) and near > 0.12
    explained = world.guard.sensing.perceiver.explain()
    assert explained is None or len(explained.tracks) < 10


def test_a_clock_that_is_set_back_begins_a_new_map():
    world = World(guarded())
    world.run(2.0)
    world.time -= 60.0
    world.due = world.time
    for _ in range(40):
        step = world.step()
    assert world.guard.sensing.perceiver.taken and step.decision is not None
    assert len(step.obstacles.points) > 200


def test_a_sensor_later_than_another_is_points_at_rest():
    """By 0.15 s: the map does not go back so far; its echoes count all the same."""

    def made(ranges, time, name):
        return beam_first(ranges, time - 0.25 * (name == "back"), name)

    world = World(guarded({"freshness.points_s": 0.6}, scans=tuple(MOUNTS)), made)
    step = world.run(1.5)
    assert world.guard.sensing.perceiver.taken == {"scan"}
    assert "back: its echoes count as at rest" in step.sentence
    assert len(step.obstacles.points) >= 2 * BEAMS - 60


def test_the_robots_own_points_outside_of_its_outline_stay_masked():
    """A bumper 3 cm before the outline, seen from the start on; then a box there."""

    def made(ranges, time, name):
        ranges[abs(np.arange(BEAMS) - 179.5) < 10] = bumper
        return beam_first(ranges, time, name)

    bumper = 0.125
    world = World(guarded(mask_m=0.05), made)
    for _ in range(40):
        step = world.step(0.3)
    assert step.v == pytest.approx(0.3)
    assert np.hypot(*step.obstacles.points.T).min() > 1.0
    bumper = 0.2
    assert max(world.step(0.3).v for _ in range(10)[5:]) < 0.05
