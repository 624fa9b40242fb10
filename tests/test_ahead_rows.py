"""Look-ahead rows: driven in thought as in truth, gradients by finite differences."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles import point_distance, wall_distance
from qpavoid.avoidance.ahead import ahead_memory_rows, look_around
from shapes import NEEDLE, ROBOT, SHIFTED

from qpavoid.avoidance import prediction as pre
from qpavoid.avoidance import settings as sets
from qpavoid.avoidance import ways
from qpavoid.avoidance.plans import FOREVER, plan_room
from qpavoid.avoidance.prediction import TICKS, WANTED, body_contact, drive, least_room
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist

LIMITED = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
)
SETTINGS = sets.AvoidanceSettings()
TICK, N, N_STILL = SETTINGS.ahead.tick, 60, 20
BOX = (-1.0, 1.0, -1.5, 1.5)
ROBOTS = [ROBOT, LIMITED, *(replace(LIMITED, footprint=f) for f in (NEEDLE, SHIFTED))]
NAMES = ["free", "limited", "needle", "shifted"]
robots = pytest.mark.parametrize("robot", ROBOTS[:2], ids=NAMES[:2])
shapes = pytest.mark.parametrize("robot", ROBOTS, ids=NAMES)
seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-1, 1), st.floats(-1.5, 1.5)


def scene_of(robot, world, last=(0.0, 0.0), settings=SETTINGS, age=0.0):
    """Scene, greatest ticks and memory left, as ``aim`` has them; NaN if not filled."""
    record = settings.record().view(np.recarray)
    count = len(world.points) + len(world.discs) + len(world.walls)
    memory = np.full((ahead_memory_rows(count, settings.record()), 9), np.nan)
    known = robot.footprint.edges, robot.numbers, record, world.arrays
    scene, n, rest = look_around.py_func(*known, age, tuple(last), memory)
    return (*scene[:2], settings.record(), *scene[3:]), n, rest


def driven(scene, *parts):
    """The poses of a plan: parts (v, ω), or (v, ω, last tick) before the end."""
    begin = 0
    for v, omega, end in ((*part, N)[:3] for part in parts):
        drive(scene, begin, end, v, omega)
        begin = end
    return scene[5].copy()


def alone(robot, *parts, last=(0.0, 0.0)):
    return driven(scene_of(robot, Obstacles(), last)[0], *parts)


def mixed(rng, size=2.0):
    """A piece of a scan, points, discs at rest and moving, and walls."""
    start, step = rng.uniform(-size, size, 2), rng.uniform(-0.12, 0.12, 2)
    scan = start + np.arange(12)[:, None] * step + rng.normal(size=(12, 2)) * 0.01
    discs = np.column_stack([rng.uniform(-size, size, (4, 2)), rng.uniform(0, 0.3, 4)])
    points = np.vstack([scan, rng.uniform(-size, size, (2, 2))])
    velocities = rng.normal(size=(4, 2)) * [[0.6], [0.0], [0.3], [0.0]]
    return Obstacles(points, discs, velocities, rng.uniform(-size, size, (2, 4)))


def turn_back(pose, place):
    """A place of the world as the robot sees it from a pose."""
    x, y, c, s = pose[:4]
    return np.array([[c, s], [-s, c]]) @ (np.asarray(place) - (x, y))


def distance(poses, k, body):
    """The true distance at tick k to the line of a body, by the oracles."""
    time, vertices = TICK * k, ROBOT.footprint.vertices
    first = turn_back(poses[k], body[:2] + time * body[5:7])
    if (body[:2] == body[2:4]).all():
        return point_distance(vertices, first)
    return wall_distance(vertices, (*first, *turn_back(poses[k], body[2:4])))


def room_at(scene, i, k):
    return body_contact(scene, i, k)[4] - scene[3][i, WANTED]


def least_of(scene, begin, end, members=None):
    """The least room after tick ``begin`` up to ``end``: all bodies, all ticks."""
    rooms = [math.inf]
    for i in range(len(scene[3])) if members is None else members:
        last = min(end, horizon(scene[3][i]))
        rooms += [room_at(scene, i, k) for k in range(begin + 1, last + 1)]
    return min(rooms)


def horizon(body):
    return N if np.hypot(*body[5:7]) > 0.01 else N_STILL


@given(speeds, turns)
def test_without_accelerations_a_plan_is_an_arc(v, omega):
    poses = alone(ROBOT, (v, omega), last=(0.7, -0.3))
    assert poses[0, :6].tolist() == [0.0, 0.0, 1.0, 0.0, 0.7, -0.3]
    for k in range(1, N + 1):
        x, y, heading = arc(0.0, 0.0, 0.0, v, omega, k * TICK)
        expected = (x, y, math.cos(heading), math.sin(heading), v, omega)
        assert poses[k, :6] == pytest.approx(expected, abs=1e-9)


@given(speeds, turns, speeds, turns)
def test_with_accelerations_it_is_the_limits_integrated(v, omega, last_v, last_omega):
    """Against a hundred small steps a tick of what the limits let through."""
    poses = alone(LIMITED, (v, omega), last=(last_v, last_omega))
    pose, twist, dt = (0.0, 0.0, 0.0), (last_v, last_omega), TICK / 100
    for k in range(1, 21):
        for _ in range(100):
            after = limit_twist(LIMITED.numbers, v, omega, *twist, dt)
            middle = (0.5 * (twist[0] + after[0]), 0.5 * (twist[1] + after[1]))
            pose, twist = arc(*pose, *middle, dt), after
        assert poses[k, :2] == pytest.approx(pose[:2], abs=1e-3)
        heading = (math.cos(pose[2]), math.sin(pose[2]))
        assert poses[k, 2:4] == pytest.approx(heading, abs=1e-4)
        assert np.hypot(*poses[k, 2:4]) == pytest.approx(1.0, abs=1e-12)
        assert poses[k, 4:6] == pytest.approx(twist, abs=1e-9)


@robots
def test_a_plan_of_two_twists_goes_over_in_time(robot):
    both = alone(robot, (0.5, 1.0, 8), (-0.8, 0.3))
    np.testing.assert_array_equal(both[:9], alone(robot, (0.5, 1.0))[:9])
    speed = np.hypot(*np.diff(both[:, :2], axis=0).T) / TICK
    assert speed[[7, -1]] == pytest.approx([0.5, 0.8], abs=0.01)
    turned = turn_back((0.0, 0.0, *both[-2, 2:4]), both[-1, 2:4])
    assert math.atan2(*turned[::-1]) == pytest.approx(0.3 * TICK)
    assert both[-1, 4:6].tolist() == [-0.8, 0.3]


@robots
@given(speeds, turns, speeds, turns)
def test_slopes_of_the_poses(robot, v, omega, last_v, last_omega):
    """Against finite differences of what is driven; ∂γ/∂v = 0."""
    scene, _, memory = scene_of(robot, Obstacles(), (last_v, last_omega))
    step, poses = 1e-5, driven(scene, (v, omega))
    slopes = memory[: N + 1]
    ways.pose_slopes(scene, N, v, omega, slopes)
    for j, shift in enumerate(np.eye(2) * step):
        change = driven(scene, (v, omega) + shift) - driven(scene, (v, omega) - shift)
        x, y, cos, sin = change[1:, :4].T / (2 * step)
        turn = poses[1:, 2] * sin - poses[1:, 3] * cos
        assert np.abs(slopes[1:, 2 * j : 2 * j + 2].T - (x, y)).max() < 2e-3
        assert np.abs(slopes[1:, 4] * j - turn).max() < 1e-5


@robots
@given(seeds, speeds, turns)
def test_rows_are_the_gradient_of_the_true_distance(robot, seed, v, omega):
    """Of one body each; and who comes too near first gets one in its time."""
    rng = np.random.default_rng(seed)
    last, world = rng.uniform([-0.5, -1], [0.5, 1]), mixed(rng)
    scene, n, memory = scene_of(robot, world, last)
    slopes, sides = memory[: N + 1], memory[N + 1 :][: ways.most_sides(n)]
    rows, step = memory[N + 1 + ways.most_sides(n) :], 1e-5
    shifts = [(v, omega), (v - step, omega), (v + step, omega)]
    shifts += [(v, omega - step), (v, omega + step)]
    poses, *shifted = [driven(scene, shift) for shift in shifts]
    drive(scene, 0, N, v, omega)
    ways.pose_slopes(scene, n, v, omega, slopes)
    ways.nearest_sides(scene, n, sides)
    count = ways.ahead_rows(poses, slopes, sides, v, omega, rows)
    bodies, used = scene[3], sides[sides[:, 4] < ways.NEAR]
    assert count == len(used)
    for begin, past in scene[4][:, [pre.FIRST, pre.PAST]].astype(int):
        rooms = [least_of(scene, k, k + 1, range(begin, past)) for k in range(n)]
        for k in [k for k in range(n) if rooms[k] < -1e-9][:1]:
            in_time = (used[:, 5] - 1) // ways.STRIDE == k // ways.STRIDE
            assert used[in_time, 4].min() <= rooms[k] + 1e-9
    for side, row in zip(used, rows[:count], strict=True):
        k = int(side[5])
        own = [i for i in range(len(bodies)) if room_at(scene, i, k) == side[4]]
        here = side[4] + bodies[own[0], WANTED]
        there = [distance(each, k, bodies[own[0]]) for each in (poses, *shifted)]
        right = row[:2] @ (v, omega) + ways.ROOM - side[4]
        assert row[2] == pytest.approx(right, abs=1e-12)
        if here > 1e-6:
            assert there[0] == pytest.approx(here, abs=1e-7)
        for j in range(2 if here > 0.05 else 0):
            before = (there[0] - there[1 + 2 * j]) / step
            after = (there[2 + 2 * j] - there[0]) / step
            if abs(before - after) <= 1e-2:  # at a wall's corner there are two slopes
                assert row[j] == pytest.approx(0.5 * (before + after), abs=5e-3)


@shapes
@given(seeds, speeds, turns)
def test_pruning_never_changes_the_least_room(robot, seed, v, omega):
    """Bit for bit, wherever the search begins; and it names who has it, and when."""
    rng = np.random.default_rng(seed)
    last, world = rng.uniform([-1, -1.5], [1, 1.5]), mixed(rng, rng.uniform(0.5, 3.0))
    scene, _, _ = scene_of(robot, world, last)
    bodies, groups, begin = scene[3], scene[4], int(rng.integers(0, 30))
    assume(len(bodies))
    end, first = int(rng.integers(begin, N + 1)), int(rng.integers(len(groups)))
    second = tuple(rng.uniform(BOX[::2], BOX[1::2]))
    driven(scene, (v, omega, begin), second)
    true, whole = least_of(scene, begin, end), least_of(scene, 0, N)
    limits = (FOREVER, 0.0, min(true, 9.0), min(true, 9.0) + 1e-12, rng.normal() * 0.3)
    for enough, at_once in product(limits, (False, True)):
        room, g, i, k = least_room(scene, begin, end, enough, at_once, first)
        assert (i < 0) == (true >= enough)
        if i < 0 or not at_once:
            assert room == min(true, enough)
        if i >= 0:
            assert true <= room == room_at(scene, i, k) < enough
            assert begin < k <= min(end, horizon(bodies[i]))
            assert groups[g, pre.FIRST] <= i < groups[g, pre.PAST]
    for wanted in (-FOREVER, whole, whole + 1e-3, whole - 1e-3):
        hold = first, int(rng.integers(0, groups[first, TICKS] + 1))
        drive(scene, 0, begin, v, omega)
        room, _ = plan_room(scene, begin, second, wanted, hold)
        assert room == (whole if whole >= wanted else -FOREVER)


def room_of(scene, u):
    """Least of distance less distance wanted along a twist, by the oracles."""
    poses = driven(scene, u)
    looks = ((k, body) for body in scene[3] for k in range(1, horizon(body) + 1))
    return min(distance(poses, k, body) - body[WANTED] for k, body in looks)


@robots
@given(seeds)
def test_the_nearest_twist_ahead_keeps_its_distance(robot, seed):
    """By the oracles; and its cost is what it says, from the desired twist."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([0.8, -1.0], [2.5, 1.0])
    world = Obstacles([[0.9, 1.0]], [[*place, 0.2]], [-0.3 * place])
    last, start = rng.uniform([0, -0.5], [0.6, 0.5]), rng.choice([-1.0, 1.0], 2)
    scene, n, memory = scene_of(robot, world, last)
    wish, start = (BOX, (0.6, 0.0), n), (start[0], 1.5 * start[1])
    v, omega, cost = ways.nearest_ahead(scene, wish, start, math.inf, memory)
    assume(cost < math.inf)
    assert abs(v) <= 1.0 and abs(omega) <= 1.5
    assert room_of(scene, (v, omega)) >= -1e-9
    assert cost == pytest.approx((v - 0.6) ** 2 + 0.03 * omega**2, abs=1e-12)


@robots
@settings(max_examples=30)
@given(seeds, speeds, turns)
def test_least_room_is_the_least_by_the_oracles(robot, seed, v, omega):
    world = mixed(np.random.default_rng(seed), 3.0)
    scene, _, _ = scene_of(robot, world, (0.2, 0.1))
    assume(len(scene[3]))
    expected = room_of(scene, (v, omega))
    room, _, _, _ = least_room(scene, 0, N, FOREVER, False, 0)
    if expected > -1.0:  # no wall is touched: of those the oracle knows no depth
        assert room == pytest.approx(expected, abs=1e-9)
