"""Scans of several sensors become static and moving obstacles in the node."""

import math

import numpy as np
import pytest
import ros_guards
from ros_guards import AT_ONCE, BEAMS, DT, Loop

import ros_messages as ros
from qpavoid.avoidance.inputs import Fault
from qpavoid.ros.guard import NO_ODOMETRY
from qpavoid.ros.report import markers

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
    made.angle_max = made.angle_min + (len(ranges) - 1) * made.angle_increment
    return made


def clockwise(ranges, time, name):
    made = beam_first(ranges[::-1], time, name)
    made.angle_min, made.angle_max = made.angle_max, made.angle_min
    made.angle_increment *= -1.0
    return made


def watching(guard, made=beam_first, names=("scan",)):
    """A loop in a room with a person who comes at the robot at 1 m/s."""
    loop = Loop(guard, ROOM, [(5.0, 0.3, 0.25, -1.0, 0.0)])
    loop.world.corners = (-0.445, -0.29, 0.445, 0.29)
    loop.mounts, loop.made = {name: MOUNTS[name] for name in names}, made
    loop.command, loop.every = (0.0, 0.0), 2
    return loop


def assert_known(loop, step):
    """One moving obstacle where the person is, drawn and given to the filter."""
    drawn = {one.name: one.points for one in markers(loop.guard, step)}
    ((begin, end),) = drawn["velocities"].reshape(-1, 2, 2)
    (x, y, heading), ((*person, _, _, _),) = loop.before
    c, s = math.cos(heading), math.sin(heading)
    back = np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(end - begin, back @ (-1.0, 0.0), atol=0.15)
    np.testing.assert_allclose(begin, back @ np.subtract(person, (x, y)), atol=0.08)


@pytest.mark.parametrize("made", [beam_first, clockwise])
def test_a_person_has_a_velocity_in_command_and_markers(made):
    loop = watching(guarded(), made)
    step = loop.run(2.5)[-1]
    assert_known(loop, step)
    assert len(step.obstacles.points) > 300, "walls stay points"
    while step.v == 0.0 and loop.world.time < 4.0:
        step = loop.step()
    assert step.v != 0.0, "it evades somebody whom a point would let come near"


def test_a_driving_robot_knows_its_walls_from_people():
    loop = watching(guarded())
    loop.command = (0.2, 0.3)
    steps = loop.run(2.2, lambda k: setattr(loop, "every", 1 + 7 * k % 3))
    assert_known(loop, steps[-1])


def test_two_scanners_are_one_map():
    loop = watching(guarded(scans=tuple(MOUNTS)), names=MOUNTS)
    assert_known(loop, loop.run(2.5)[-1])
    assert loop.guard.sensing.perceiver.taken == set(MOUNTS)


def test_a_scanner_may_be_upside_down():
    """An upside-down scanner turns to the right: beams and lean are mirrored."""
    poses = (0.35, 0.0, 0.2, math.pi, 0.0, 0.4)
    guard = guarded(frames=("scan",), frame_poses=poses)
    loop = watching(guard, lambda ranges, *rest: beam_first(ranges[::-1], *rest))
    loop.mounts = {"scan": (0.35, 0.0, 0.4)}
    assert_known(loop, loop.run(2.5)[-1])


def test_without_odometry_all_is_at_rest_and_that_is_said():
    loop = watching(guarded(odometry=""))
    step = loop.run(2.5)[-1]
    assert loop.guard.errors["perception"] == NO_ODOMETRY
    assert len(step.obstacles.points) == BEAMS and not len(step.obstacles.discs)
    off = watching(guarded({"perception.enabled": False})).run(2.5)[-1]
    assert len(off.obstacles.points) == BEAMS and not len(off.obstacles.discs)


def test_after_a_jump_of_odometry_echoes_count_until_the_map_is_new():
    loop = watching(guarded())
    loop.run(2.5)
    assert loop.guard.sensing.perceiver.taken
    loop.mounts, loop.world.pose = {}, np.array([30.0, 0.0, 0.0])
    assert loop.step().faults == {"odom": Fault.JUMPED}
    step = loop.step()
    nearest = np.hypot(*step.obstacles.points.T).min()
    assert not loop.guard.sensing.perceiver.taken
    assert nearest == pytest.approx(5.0 - 2.4 - 0.25, abs=0.3)


def test_points_of_a_depth_camera_have_velocities():
    """A cloud of what a scanner sees, at three heights: floor, knee, lamp."""

    def lifted(ranges, time, name):
        angles = np.arange(BEAMS) * math.tau / BEAMS - math.pi
        flat = np.column_stack([np.cos(angles), np.sin(angles)]) * ranges[:, None]
        rows = [np.column_stack([flat, np.full(BEAMS, z)]) for z in (-0.2, 0.3, 2.0)]
        return ros.cloud(time, "xyz", np.vstack(rows), name)

    loop = watching(guarded(scans=(), clouds=("scan",)), lifted)
    assert_known(loop, loop.run(2.5)[-1])


def test_another_number_of_beams_is_said_and_the_map_stays():
    loop = watching(guarded(), lambda ranges, *rest: ros.scan(rest[0], ranges, rest[1]))
    loop.run(2.4)
    loop.beams = 180
    step = loop.step()
    assert "scan: 180 beams, 360 before" in step.sentence
    assert_known(loop, step)
    assert "before" not in loop.run(0.15)[-1].sentence


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

    def spoilt(*given):
        message, time = beam_first(*given), loop.world.time
        if time > 6.0 or round(time / DT) % 3 == 1:
            spoil(message)
        return message

    loop = watching(guarded({"freshness.points_s": 0.5}), spoilt)
    loop.command = (0.5, 0.0)
    steps = loop.run(12.0)
    assert all(math.isfinite(step.v + step.omega) for step in steps)
    assert loop.least[: len(ROOM)].min() > 0.12
    explained = loop.guard.sensing.perceiver.explain()
    assert explained is None or len(explained.tracks) < 10


def test_a_clock_that_is_set_back_begins_a_new_map():
    loop = watching(guarded())
    loop.run(2.0)
    loop.now -= 60.0
    step = loop.run(2.0)[-1]
    assert loop.guard.sensing.perceiver.taken and step.decision is not None
    assert len(step.obstacles.points) > 200


def test_a_sensor_later_than_another_is_points_at_rest():
    """By 0.15 s: the map does not go back so far; its echoes count all the same."""

    def made(ranges, time, name):
        return beam_first(ranges, time - 0.25 * (name == "back"), name)

    guard = guarded({"freshness.points_s": 0.6}, scans=tuple(MOUNTS))
    loop = watching(guard, made, MOUNTS)
    step = loop.run(1.5)[-1]
    assert loop.guard.sensing.perceiver.taken == {"scan"}
    assert "back: its echoes count as at rest" in step.sentence
    assert len(step.obstacles.points) >= 2 * BEAMS - 60


def test_the_robots_own_points_outside_of_its_outline_stay_masked():
    """A bumper 3 cm before the outline, seen from the start on; then a box there."""

    def made(ranges, time, name):
        ranges[abs(np.arange(BEAMS) - 180) < 10] = bumper
        return beam_first(ranges, time, name)

    bumper = 0.125
    loop = watching(guarded(mask_m=0.05), made)
    loop.command = (0.3, 0.0)
    step = loop.run(2.0)[-1]
    assert step.v == pytest.approx(0.3)
    assert np.hypot(*step.obstacles.points.T).min() > 1.0
    bumper = 0.2
    assert max(step.v for step in loop.run(0.5)[5:]) < 0.05
