"""Perception against worlds of known obstacles, by a ray caster of its own."""

import math
import os

import numpy as np
import pytest

import qpavoid as qp
from qpavoid.errors import InvalidInputError
from ray_world import ray_ranges

ROBOT = qp.Robot.mir100_rectangle()
BEAMS = 360
ANGLES = 2.0 * math.pi * np.arange(BEAMS) / BEAMS - math.pi
CORNERS = np.array([(-5.0, -4.0), (5.0, -4.0), (5.0, 4.0), (-5.0, 4.0)])
ROOM = np.hstack([CORNERS, np.roll(CORNERS, -1, axis=0)])


def beams_from(pose, discs=(), angles=ANGLES):
    """Ranges of beams to discs (x, y, r) and the walls of the room."""
    return ray_ranges(pose, ROOM, discs, angles)


def walk(time, speed=0.8):
    """Return the disc of a person who walks past the robot from 2 s on."""
    return (-3.0 + speed * max(time - 2.0, 0.0), 1.5, 0.25)


def watched(seconds=5.0, place=None, frame=(0.0, 0.0, 0.0), sight=math.inf):
    """Return perception after it has seen a person walk, and the last obstacles."""
    perception, rng, found = qp.Perception(ROBOT), np.random.default_rng(1), None
    place = place or (lambda time: (0.0, 0.0, 0.0))
    for time in np.arange(0.0, seconds, 0.1):
        pose = place(time)
        ranges = beams_from(pose, [walk(time)]) + 0.01 * rng.standard_normal(BEAMS)
        ranges[ranges > sight] = math.inf
        found = perception.update(ranges, time, in_frame(pose, frame))
    return perception, found


def in_frame(pose, frame):
    """Return a pose in a frame that is moved by ``frame``."""
    c, s = math.cos(frame[2]), math.sin(frame[2])
    x, y = frame[0] + c * pose[0] - s * pose[1], frame[1] + s * pose[0] + c * pose[1]
    return x, y, frame[2] + pose[2]


@pytest.mark.parametrize("sight", [math.inf, 3.8])
def test_a_walker_has_its_place_and_velocity_and_room_or_open_space_none(sight):
    _, found = watched(sight=sight)
    assert len(found.discs) == 1
    x, y, radius = walk(4.9)
    assert np.hypot(*(found.discs[0, :2] - (x, y))) < 0.03
    assert np.hypot(*(found.disc_velocities[0] - (0.8, 0.0))) < 0.1
    assert radius <= found.discs[0, 2] < radius + 0.1
    assert 250 < len(found.points) < 800 or (sight < 4.0 and len(found.points) < 200)


@pytest.mark.parametrize("frame", [(100.0, -50.0, 2.0), (0.0, 0.0, -3.1)])
def test_the_frame_of_the_odometry_does_not_matter(frame):
    _, here = watched()
    _, there = watched(frame=frame)
    assert np.allclose(here.discs, there.discs, atol=0.02)
    assert np.allclose(here.disc_velocities, there.disc_velocities, atol=0.05)


def test_a_robot_that_drives_and_turns_sees_velocities_over_ground():
    def place(time):
        return 0.3 * math.sin(0.5 * time), 0.1 * time - 0.5, 0.8 * time

    _, found = watched(place=place)
    x, y, heading = place(4.9)
    c, s = math.cos(heading), math.sin(heading)
    there = np.array([[c, s], [-s, c]]) @ np.subtract(walk(4.9)[:2], (x, y))
    v = np.array([[c, s], [-s, c]]) @ (0.8, 0.0)
    assert np.hypot(*(found.discs[0, :2] - there)) < 0.05
    assert np.hypot(*(found.disc_velocities[0] - v)) < 0.15


@pytest.mark.parametrize("rate", [5.0, 25.0])
def test_nothing_moves_in_a_room_at_rest_whatever_the_robot_does(rate):
    posts = [(1.0, 2.0, 0.03), (1.6, 2.0, 0.03), (-2.0, -2.0, 0.3), (3.0, 0.5, 0.15)]
    perception, rng = qp.Perception(ROBOT), np.random.default_rng(2)
    for time in np.arange(0.0, 12.0, 1.0 / rate):
        pose = (2.0 * math.sin(0.4 * time), 0.0, 1.2 * time)
        ranges = beams_from(pose, posts) + 0.02 * rng.standard_normal(BEAMS)
        assert len(perception.update(ranges, time, pose).discs) == 0


def test_every_echo_is_a_point_or_in_a_disc():
    rng, perception = np.random.default_rng(3), qp.Perception(ROBOT)
    for time in np.arange(0.0, 9.0, 0.1):
        people = [
            walk(time),
            (walk(time)[0], 2.15, 0.25),
            (2.5, 3.5 - 0.6 * time, 0.25),
        ]
        pose = (0.0, -1.0, 0.3 * time)
        ranges = beams_from(pose, people) + 0.01 * rng.standard_normal(BEAMS)
        found = perception.update(ranges, time, pose)
        echoes = ranges[:, None] * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
        away = (echoes[:, None] - found.points).transpose(2, 0, 1)
        apart = np.hypot(*away).min(axis=1)
        for x, y, r in found.discs:
            apart = np.minimum(apart, np.hypot(*(echoes - (x, y)).T) - r)
        assert apart.max() < 0.05  # the alignment moves points by as much


def test_what_left_the_view_is_remembered_until_it_is_seen_through():
    front = np.abs(ANGLES) < 0.75 * math.pi
    perception = qp.Perception(ROBOT, qp.Lidar())
    post = (-1.5, 0.0, 0.2)

    def look(time, heading, discs):
        ranges = beams_from((0.0, 0.0, heading), discs)
        ranges = np.where(front, ranges, math.nan)
        found = perception.update(ranges, time, (0.0, 0.0, heading))
        c, s = math.cos(heading), math.sin(heading)
        world = found.points @ np.array([[c, s], [-s, c]])
        return (np.hypot(*(world - post[:2]).T) < 0.3).any()

    assert all(look(0.1 * k, 3.0, [post]) for k in range(5))
    assert all(look(0.5 + 0.1 * k, 0.0, [post]) for k in range(150))
    assert not [look(16.0 + 0.1 * k, 3.0, []) for k in range(6)][-1]


def test_a_person_out_of_view_is_remembered_for_seconds():
    front = ANGLES[np.abs(ANGLES) < 0.75 * math.pi]
    perception = qp.Perception(ROBOT, qp.Lidar(front[-1] - front[0]))
    for time in np.arange(0.0, 9.9, 0.1):
        heading = math.pi / 2 if time < 4.0 else -math.pi / 2
        pose = (0.0, 0.0, heading)
        ranges = beams_from(pose, [walk(time)], angles=front)
        found = perception.update(ranges, time, pose)
        if 4.3 < time < 7.3:
            (ahead, left, _), (x, y, _) = found.discs[0], walk(time)
            assert math.hypot(x - left, y + ahead) < 0.5
            assert math.hypot(*found.disc_velocities[0]) > 0.6
            assert 0.1 < found.disc_sigmas[0] < 1.0 + time


def test_a_body_cut_by_the_edge_of_the_view_keeps_its_velocity():
    """270°: a person leaves to the rear, and is followed where no beam is."""
    angles = np.linspace(-0.75 * math.pi, 0.75 * math.pi, 541)
    perception = qp.Perception(ROBOT, qp.Lidar(field_of_view=1.5 * math.pi))
    for time in np.arange(0.0, 6.0, 0.1):
        x = 3.0 - time
        ranges = beams_from((0.0, 0.0, 0.0), [(x, -1.13, 0.23)], angles=angles)
        found = perception.update(ranges, time, (0.0, 0.0, 0.0))
        if time > 2.0:
            (disc,), (velocity,) = found.discs, found.disc_velocities
            assert velocity == pytest.approx((-1.0, 0.0), abs=0.15)
            assert disc[:2] == pytest.approx(
                (x, -1.13), abs=0.05 + 0.1 * max(-1 - x, 0)
            )


def test_obstacles_are_predicted_to_the_time_asked_for():
    perception, found = watched()
    later = perception.obstacles(5.4, (0.0, 0.0, 0.0))
    moved = found.discs[0, :2] + 0.5 * found.disc_velocities[0]
    assert np.allclose(later.discs[0, :2], moved, atol=1e-6)
    assert len(later.points) == len(found.points)


def test_the_stamp_of_the_last_scan_again_changes_nothing():
    perception, found = watched()
    again = perception.update(np.full(BEAMS, 0.5), 4.9, (0.0, 0.0, 0.0))
    assert np.array_equal(again.points, found.points)
    assert np.array_equal(again.discs, found.discs)


@pytest.mark.parametrize("value", [math.nan, 0.0, -1.0, 0.05, 11.0])
def test_unknown_ranges_free_nothing(value):
    lidar = qp.Lidar(no_echo="free")
    perception = qp.Perception(ROBOT, lidar)
    for k in range(10):
        perception.update(np.full(BEAMS, value), 0.1 * k, (0.0, 0.0, 0.0))
    grid = perception.explain().grid
    assert not (grid == 100).any()
    assert (grid >= 0).sum() < 40  # where the robot is


@pytest.mark.parametrize("reach", [10.0, 30.0])
@pytest.mark.parametrize("meaning", ["free", "unknown", "auto"])
@pytest.mark.parametrize("lost", [0.0, 0.03, 0.14])
def test_no_echo_is_free_where_few_are_lost_and_some_are_far(meaning, lost, reach):
    lidar = qp.Lidar(no_echo=meaning, range_max=reach)
    rng, perception = np.random.default_rng(4), qp.Perception(ROBOT, lidar)
    for k in range(30):
        ranges = beams_from((0.0, 0.0, 0.0))
        ranges[rng.random(BEAMS) < lost] = math.inf
        ranges[:60] = math.inf
        perception.update(ranges, 0.1 * k, (0.0, 0.0, 0.0))
    explained = perception.explain()
    place = np.subtract((-3.0, -1.5), explained.origin) / explained.resolution
    i, j = place.astype(int)
    free = explained.grid[j, i] >= 0
    assert free == (meaning == "free" or (meaning, lost, reach) == ("auto", 0.0, 10.0))


def test_a_scan_taken_while_the_robot_turns_is_straightened():
    lidar = qp.Lidar(sweep=0.1)
    sharp, bent = qp.Perception(ROBOT, lidar), qp.Perception(ROBOT)
    spread = []
    for one in (sharp, bent):
        for k in range(20):
            times = 0.1 * k + 0.1 * np.arange(BEAMS) / (BEAMS - 1)
            poses = [(0.0, 0.0, 2.0 * t) for t in times]
            ranges = [
                beams_from(p, angles=ANGLES[i : i + 1])[0] for i, p in enumerate(poses)
            ]
            found = one.update(ranges, 0.1 * k, poses[0], twist=(0.0, 2.0))
        points = found.points @ np.array(
            [[math.cos(poses[0][2]), math.sin(poses[0][2])],
             [-math.sin(poses[0][2]), math.cos(poses[0][2])]]
        )  # fmt: skip
        wall = np.minimum(abs(abs(points[:, 0]) - 5.0), abs(abs(points[:, 1]) - 4.0))
        spread.append(np.quantile(wall, 0.9))
    assert spread[0] < 0.02 < 0.1 < spread[1]


def test_two_sensors_see_what_one_would():
    half = math.pi
    lidars = {
        "front": qp.Lidar(field_of_view=half, mount=(0.3, 0.0, 0.0)),
        "rear": qp.Lidar(field_of_view=half, mount=(-0.3, 0.0, math.pi)),
    }
    perception = qp.Perception(ROBOT, lidars)
    angles = np.linspace(-0.5 * half, 0.5 * half, 181)
    for time in np.arange(0.0, 6.0, 0.1):
        for name, lidar in lidars.items():
            seen = beams_from(lidar.mount, [walk(time)], angles=angles)
            found = perception.update(seen, time, (0.0, 0.0, 0.0), sensor=name)
    assert len(found.discs) == 1
    assert np.hypot(*(found.discs[0, :2] - walk(5.9)[:2])) < 0.15  # each sees a half
    assert min((found.points[:, 0] > 4.8).sum(), (found.points[:, 0] < -4.8).sum()) > 40
    with pytest.raises(InvalidInputError, match="no sensor 'left'"):
        perception.update(seen, 7.0, (0.0, 0.0, 0.0), sensor="left")


def test_points_of_a_depth_camera_are_a_scan():
    lidar = qp.Lidar(field_of_view=1.5, range_max=8.0)
    perception = qp.Perception(ROBOT, lidar)
    angles = np.radians(np.arange(-43, 44))
    for time in np.arange(0.0, 4.0, 0.1):
        person = (2.5, -2.0 + 0.8 * time, 0.25)
        r = beams_from((0.0, 0.0, 0.0), [person], angles=angles)
        points = np.column_stack([r * np.cos(angles), r * np.sin(angles), 0.5 + 0 * r])
        points = np.vstack([points, [[np.nan, 0.0, 0.0]]])
        found = perception.update(None, time, (0.0, 0.0, 0.0), points=points)
    assert len(found.discs) == 1
    assert np.hypot(*(found.disc_velocities[0] - (0.0, 0.8))) < 0.2


def test_what_lies_in_the_footprint_is_the_robot():
    perception = qp.Perception(ROBOT)
    corners = [0.9 * v for v in ROBOT.footprint.vertices]
    for k in range(5):
        ranges = beams_from((0.0, 0.0, 0.0), [(*c, 0.02) for c in corners])
        found = perception.update(ranges, 0.1 * k, (0.0, 0.0, 0.0))
    edges = ROBOT.footprint.edges
    reach = (edges[:, :2] * edges[:, 2:4]).sum(axis=1)
    assert not (found.points @ edges[:, 2:4].T <= reach).all(axis=1).any()


def test_a_jump_of_the_odometry_begins_the_map_anew():
    perception, found = watched()
    again = perception.update(beams_from((0.0, 0.0, 0.0)), 5.0, (20.0, 5.0, 1.0))
    assert len(again.discs) == 0
    assert len(again.points) <= BEAMS < len(found.points) + 1


BAD = {
    "no ranges": dict(ranges=None),
    "text": dict(ranges="ranges"),
    "empty": dict(ranges=[]),
    "another number": dict(ranges=np.ones(90)),
    "complex": dict(ranges=np.ones(BEAMS) * 1j),
    "both": dict(points=np.ones((3, 2))),
    "stamp": dict(stamp=math.nan),
    "no number": dict(stamp="now"),
    "backwards": dict(stamp=1.0),
    "pose": dict(odometry=(0.0, math.nan, 0.0)),
    "two": dict(odometry=(0.0, 0.0)),
    "far": dict(odometry=(1e9, 0.0, 0.0)),
    "twist": dict(twist=(math.inf, 0.0)),
    "sensor": dict(sensor="left"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_an_error_and_nothing_is_lost(name):
    perception, _ = watched()
    before = perception.explain()
    good = dict(ranges=np.ones(BEAMS), stamp=5.0, odometry=(0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError):
        perception.update(**{**good, **BAD[name]})
    after = perception.explain()
    assert after.tracks == before.tracks
    assert np.array_equal(after.grid, before.grid)
    assert len(perception.update(**good).points)


@pytest.mark.parametrize(
    "wrong",
    [
        dict(field_of_view=7.0),
        dict(range_max=-1.0),
        dict(range_min=20.0),
        dict(sweep=2.0),
        dict(no_echo="maybe"),
        dict(mount=(0.0, math.nan, 0.0)),
    ],
)
def test_a_lidar_that_cannot_be_is_refused(wrong):
    with pytest.raises(InvalidInputError):
        qp.Lidar(**wrong)


ODDS = 0.4, 0.3, 0.1, 0.1, 0.04, 0.03, 0.03
"""Of the coordinates of hostile poses."""

RANGES = np.array([0.0, -1.0, 1e-300, 0.1, 3.0, 9.99, 10.0, 1e300, np.inf, np.nan])
STEPS = [1e-9, 0.05, 0.1, 3.0, 0.0, -0.01, -1e3, 1e9, math.nan, math.inf]
"""Hostile ranges, m, and times between stamps, s; the first four come more often."""


def hostile_update(rng, time):
    """Return the arguments of an update with random ranges or points, and a pose."""
    kind, size = rng.integers(6), 90 if rng.random() < 0.95 else rng.integers(400)
    pose = rng.choice([0.0, 1e-3, 1.0, -2.0, 9e6, 1e12, math.nan], 3, p=ODDS)
    given = {"sensor": "ab"[int(kind == 1)], "stamp": time, "odometry": pose}
    if kind == 0:
        given["ranges"] = rng.choice(RANGES, size)
    elif kind == 1:
        given["points"] = rng.choice([*-RANGES, *RANGES], (size, rng.integers(1, 4)))
    elif kind == 2:
        given["ranges"] = [None, "far", 1j, [[1.0], [2.0]], object()][rng.integers(5)]
    elif kind == 3:
        given["ranges"] = np.repeat(rng.uniform(0.3, 9.0, size // 10), 10)
    else:
        given["ranges"] = rng.uniform(0.2, 12.0, size)
    if rng.random() < 0.1:
        given["twist"] = rng.choice([0.0, 1.0, -1e300, math.inf, math.nan], 2)
    return given


@pytest.mark.parametrize(
    "hostile", [3000, pytest.param(1_000_000, marks=pytest.mark.slow)]
)
def test_hostile_updates_raise_the_packages_errors_alone(hostile):
    rng = np.random.default_rng(5)
    lidars = {"a": qp.Lidar(no_echo="free"), "b": qp.Lidar(4.0, sweep=-0.1)}
    perception, time, sizes, taken = qp.Perception(ROBOT, lidars), 0.0, [], 0
    for k in range(hostile):
        if k % (hostile // 10) == 0:
            sizes.append(resident_bytes())
        if rng.random() < 0.01:
            sensor = ["a", "b", "c"][rng.integers(3)]
            perception.set_lidar(sensor, qp.Lidar(rng.uniform(0.1, 6.0)))
        if time > 1e8 or rng.random() < 1e-3:
            perception.reset()
            time = 0.0
        step = STEPS[rng.integers(4 if rng.random() < 0.8 else len(STEPS))]
        try:
            found = perception.update(**hostile_update(rng, time + step))
        except InvalidInputError:
            continue
        time, taken = time + step, taken + 1
        assert np.isfinite(found.points).all() and np.isfinite(found.capsules).all()
    assert taken > 0.3 * hostile
    assert max(sizes[2:]) - sizes[2] < 4e6


def resident_bytes():
    """Return the size of this process in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_guide_with_scans_lets_a_walker_pass():
    settings = qp.AvoidanceSettings(dt=0.1, radius=qp.SafetyRadius(0.10, 0.15))
    robot = qp.Robot(
        "cart", qp.Footprint.rectangle(0.8, 0.5), qp.Limits(-0.6, 1.2, -1.5, 1.5)
    )
    guide, pose, least = qp.Guide(robot, settings), (0.0, 0.0, 0.0), math.inf
    guide.stay(pose)
    for time in np.arange(0.0, 12.0, 0.1):
        person = (0.1, 3.0 - 0.7 * max(time - 1.0, 0.0), 0.25)
        decision = guide.step(pose, scan=beams_from(pose, [person]), stamp=time)
        pose = in_frame((0.1 * decision.v, 0.0, 0.1 * decision.omega), pose)
        local = np.subtract(person[:2], pose[:2])
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x, y = c * local[0] + s * local[1], c * local[1] - s * local[0]
        apart = math.hypot(max(abs(x) - 0.4, 0.0), max(abs(y) - 0.25, 0.0)) - 0.25
        least = min(least, apart)
    assert least > 0.0
    assert math.hypot(*pose[:2]) < 0.03


FAILED = {
    "NaN": {"scan": np.full(BEAMS, math.nan)},
    "zeros": {"scan": np.zeros(BEAMS)},
    "the stamp again": {"scan": np.full(BEAMS, 5.0), "stamp": 1.0},
    "none": {},
    "none, but a stamp": {"scan": None},
}


@pytest.mark.parametrize("failed", FAILED.values(), ids=FAILED)
def test_a_guide_without_valid_scans_stops(failed):
    guide, pose = qp.Guide(ROBOT, qp.AvoidanceSettings(dt=0.1)), (0.0, 0.0, 0.0)
    guide.go_to(pose, (3.0, 0.0, 0.0))
    for k in range(11):
        scan = {"scan": beams_from(pose), "stamp": 0.1 * k}
        moving = guide.step(pose, **scan, on_error="brake")
    assert moving.v > 0.1
    for k in range(11, 20):
        given = {"stamp": 0.1 * k} | failed if failed else {}
        last = guide.step(pose, **given, on_error="brake")
    assert last[:2] == (0.0, 0.0)
    assert last.status is qp.Status.INVALID and "scan: stale" in last.problem
    with pytest.raises(qp.QPAvoidError, match="scan: stale"):
        guide.step(pose, **given, on_error="raise")


def test_a_step_without_a_scan_has_the_obstacles_known_so_far():
    guide, pose = qp.Guide(ROBOT, qp.AvoidanceSettings(dt=0.1)), (0.0, 0.0, 0.0)
    guide.go_to(pose, (3.0, 0.0, 0.0))
    seen = guide.step(pose, scan=beams_from(pose), stamp=0.0)
    assert guide.step(pose).clearance == pytest.approx(seen.clearance)


def test_a_guide_that_expects_scans_does_not_drive_before_the_first():
    guide = qp.Guide(ROBOT, perception=qp.Perception(ROBOT))
    with pytest.raises(qp.QPAvoidError, match="scan: never seen"):
        guide.step((0.0, 0.0, 0.0), stamp=0.0, on_error="raise")
