"""Look-ahead rows: driven in thought as in truth, gradients by finite differences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles import point_distance, wall_distance
from shapes import NEEDLE, ROBOT, SHIFTED

from qpavoid.avoidance.ahead import ahead_memory_rows, fresh_state, look_around
from qpavoid.avoidance.plans import FOREVER, plan_room
from qpavoid.avoidance.prediction import (
    FIRST,
    OWNER,
    PAST,
    SPREAD,
    TICKS,
    TOGETHER,
    WANTED,
    WIDTH,
    body_contact,
    drive,
    least_room,
)
from qpavoid.avoidance.settings import (
    AvoidanceSettings,
    LookAhead,
    Margins,
    SafetyRadius,
)
from qpavoid.avoidance.ways import (
    NEAR,
    ROOM,
    STRIDE,
    ahead_rows,
    most_sides,
    nearest_ahead,
    nearest_sides,
    pose_slopes,
)
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist

LIMITED = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
)
SETTINGS = AvoidanceSettings()
TICK, N, N_STILL = SETTINGS.ahead.tick, 60, 20
BOX = (-1.0, 1.0, -1.5, 1.5)
robots = pytest.mark.parametrize("robot", [ROBOT, LIMITED], ids=["free", "limited"])
shapes = pytest.mark.parametrize(
    "robot",
    [
        ROBOT,
        *(replace(LIMITED, footprint=f) for f in (ROBOT.footprint, NEEDLE, SHIFTED)),
    ],
    ids=["free", "limited", "needle", "shifted"],
)
seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-1, 1), st.floats(-1.5, 1.5)


def scene_of(robot, world, last=(0.0, 0.0), settings=SETTINGS, age=0.0):
    """Scene, greatest ticks and memory left, as ``aim`` has them; NaN if not filled."""
    known = robot.footprint.edges, robot.numbers, settings.record()
    count = len(world.points) + len(world.discs) + len(world.walls)
    memory = np.full((ahead_memory_rows(count, known[2]), 9), np.nan)
    return look_around.py_func(*known, world.arrays, age, tuple(last), memory)


def driven(scene, *parts):
    """The poses of a plan: parts (v, ω), or (v, ω, last tick) before the end."""
    begin = 0
    for v, omega, *end in parts:
        drive(scene, begin, end[0] if end else N, v, omega)
        begin = end[0] if end else N
    return scene[5].copy()


def alone(robot, *parts, last=(0.0, 0.0)):
    return driven(scene_of(robot, Obstacles(), last)[0], *parts)


def mixed(rng, size=2.0):
    """A piece of a scan, points, discs at rest and moving, and walls."""
    start, step = rng.uniform(-size, size, 2), rng.uniform(-0.12, 0.12, 2)
    scan = start + np.arange(12)[:, None] * step + rng.normal(size=(12, 2)) * 0.01
    discs = np.column_stack([rng.uniform(-size, size, (4, 2)), rng.uniform(0, 0.3, 4)])
    return Obstacles(
        points=np.vstack([scan, rng.uniform(-size, size, (2, 2))]),
        discs=discs,
        disc_velocities=rng.normal(size=(4, 2)) * [[0.6], [0.0], [0.3], [0.0]],
        walls=rng.uniform(-size, size, (2, 4)),
    )


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


def horizon(body):
    return N if np.hypot(*body[5:7]) > 0.01 else N_STILL


# ------------------------------------------------------------------------- drive
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
    numbers = LIMITED.numbers
    for k in range(1, 21):
        for _ in range(100):
            after = limit_twist(numbers, v, omega, *twist, dt)
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
    assert speed[7] == pytest.approx(0.5, abs=0.01)
    assert speed[-1] == pytest.approx(0.8, abs=0.01)
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
    pose_slopes(scene, N, v, omega, slopes)
    for j in range(2):
        a, b = (step, 0.0) if j == 0 else (0.0, step)
        ahead, behind = (
            driven(scene, (v + a, omega + b)),
            driven(scene, (v - a, omega - b)),
        )
        true = (ahead - behind)[1:, :4] / (2 * step)
        got = slopes[1:, 2 * j : 2 * j + 2]
        np.testing.assert_allclose(got, true[:, :2], rtol=0, atol=2e-3)
        turn = poses[1:, 2] * true[:, 3] - poses[1:, 3] * true[:, 2]
        expected = slopes[1:, 4] if j == 1 else np.zeros(N)
        np.testing.assert_allclose(turn, expected, rtol=0, atol=1e-3)


# --------------------------------------------------------------------- the bodies
def test_bodies_by_hand():
    settings = AvoidanceSettings(ahead=LookAhead(2.0, 0.5, 0.1))
    obstacles = Obstacles(
        points=[[1.0, 0.0], [50.0, 0.0]],
        discs=[[2.0, 1.0, 0.3], [-1.0, 0.8, 0.2]],
        disc_velocities=[[-0.3, 0.0], [0.0, 0.0]],
        walls=[[1.0, -1.0, 1.0, 1.0]],
    )
    (*_, bodies, groups, _), ticks, _ = scene_of(ROBOT, obstacles, settings=settings)
    assert bodies[:, OWNER].tolist() == [0, 2, 3, 4]
    assert groups[:, FIRST].tolist() == [0, 1, 2, 3]
    assert groups[:, PAST].tolist() == [1, 2, 3, 4]
    assert groups[:, TICKS].tolist() == [5, 20, 5, 5]
    assert ticks == 20
    assert bodies[1, :4].tolist() == [2.0, 1.0, 2.0, 1.0]
    assert bodies[1, 5:7].tolist() == [-0.3, 0.0]
    assert bodies[3, :4].tolist() == [1.0, -1.0, 1.0, 1.0]
    assert not bodies[[0, 2, 3], 5:7].any()
    wanted = np.array([0.17, 0.3 + 0.2, 0.2 + 0.17, 0.17])
    assert (bodies[:, WANTED] >= wanted).all()
    assert (bodies[:, WANTED] <= np.hypot(wanted, 0.15)).all()
    assert bodies[:, SPREAD] == pytest.approx(bodies[:, WANTED] + [0, 0, 0, 1])


@given(seeds)
def test_groups_hold_their_bodies(seed):
    """Each body in one; together only what stands, has no length, and is near."""
    rng = np.random.default_rng(seed)
    scene, ticks, _ = scene_of(ROBOT, mixed(rng, 1.0))
    bodies, groups = scene[3], scene[4]
    ends = [0, *groups[:, PAST].astype(int)]
    assert groups[:, FIRST].tolist() == ends[:-1] and ends[-1] == len(bodies)
    assert len(bodies) - len(groups) >= 5
    for group, begin, end in zip(groups, ends, ends[1:], strict=True):
        members = bodies[begin:end]
        lines = members[:, :4].reshape(-1, 2, 2)
        away = np.hypot(*np.moveaxis(lines - group[:2], 2, 0)).max(axis=1)
        assert (away + members[:, WANTED] <= group[SPREAD] + 1e-12).all()
        assert (members[:, 5:7] == group[5:7]).all()
        assert group[8] == np.hypot(*group[5:7])
        assert group[TICKS] == horizon(members[0]) <= ticks
        if len(members) > 1:
            assert len(members) <= TOGETHER and not members[:, 5:7].any()
            assert (lines[:, 0] == lines[:, 1]).all()
            assert np.ptp(lines[:, 0], axis=0).max() <= WIDTH


@robots
@given(seeds)
def test_what_is_not_in_reach_cannot_be_met(robot, seed):
    """However it is driven, what is left out stays farther away than wanted."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-6, 6, (8, 2)), rng.uniform(0, 0.4, 8)])
    velocities = rng.normal(size=(8, 2)) * rng.choice([0.0, 0.6], 8)[:, None]
    world = Obstacles(discs=discs, disc_velocities=velocities)
    scene, _, _ = scene_of(robot, world)
    poses = driven(scene, rng.choice([-1, 1], 2) * [1.0, rng.uniform(0, 1.5)])
    for i in set(range(8)) - set(scene[3][:, OWNER].tolist()):
        body = np.array([*discs[i, :2], *discs[i, :2], 0.0, *velocities[i]])
        least = min(distance(poses, k, body) for k in range(1, horizon(body) + 1))
        speed = float(np.hypot(*velocities[i]))
        assert least - discs[i, 2] > SETTINGS.radius.r_min(speed)


# ---------------------------------------------------------------------- gradients
@robots
@given(seeds, speeds, turns)
def test_rows_are_the_gradient_of_the_true_distance(robot, seed, v, omega):
    """Of one body each; and who comes too near first gets one in its time."""
    rng = np.random.default_rng(seed)
    last, world = rng.uniform([-0.5, -1], [0.5, 1]), mixed(rng)
    scene, n, memory = scene_of(robot, world, last)
    slopes, sides = memory[: N + 1], memory[N + 1 :][: most_sides(n)]
    rows, step = memory[N + 1 + most_sides(n) :], 1e-5
    shifts = [(v, omega), (v - step, omega), (v + step, omega)]
    shifts += [(v, omega - step), (v, omega + step)]
    poses, *shifted = [driven(scene, shift) for shift in shifts]
    drive(scene, 0, N, v, omega)
    pose_slopes(scene, n, v, omega, slopes)
    nearest_sides(scene, n, sides)
    count = ahead_rows(poses, slopes, sides, v, omega, rows)
    bodies, used = scene[3], sides[sides[:, 4] < NEAR]
    assert count == len(used)
    for group in scene[4]:
        for k in range(1, int(group[TICKS]) + 1):
            least = least_of(
                scene, k - 1, k, range(int(group[FIRST]), int(group[PAST]))
            )
            if least < -1e-9:
                in_time = (used[:, 5] - 1) // STRIDE == (k - 1) // STRIDE
                assert used[in_time, 4].min() <= least + 1e-9
                break
    for side, row in zip(used, rows[:count], strict=True):
        k, here = int(side[5]), side[4] + bodies[:, WANTED]
        true = np.array([distance(poses, k, body) for body in bodies])
        i = np.abs(true - here).argmin()
        if here[i] > 1e-6 or (here > 0.0).all():
            assert true[i] == pytest.approx(here[i], abs=1e-7)
            room = true[i] - bodies[i, WANTED]
            assert row[2] == pytest.approx(row[:2] @ (v, omega) + ROOM - room, abs=1e-7)
        if here[i] > 0.05:
            there = [distance(each, k, bodies[i]) for each in shifted]
            for j in range(2):  # at a wall's corner there are two slopes
                before = (true[i] - there[2 * j]) / step
                after = (there[2 * j + 1] - true[i]) / step
                if abs(before - after) <= 1e-2:
                    assert row[j] == pytest.approx(0.5 * (before + after), abs=5e-3)


# --------------------------------------------------------------------- least room
def least_of(scene, begin, end, members=None):
    """The least room after tick ``begin`` up to ``end``: all bodies, all ticks."""
    bodies = scene[3]
    return min(
        (
            body_contact(scene, i, k)[4] - bodies[i, WANTED]
            for i in (range(len(bodies)) if members is None else members)
            for k in range(begin + 1, min(end, horizon(bodies[i])) + 1)
        ),
        default=math.inf,
    )


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
    second = rng.uniform([-1, -1.5], [1, 1.5])
    driven(scene, (v, omega, begin), second)
    true = least_of(scene, begin, end)
    for enough in (FOREVER, 0.0, true, true + 1e-12, rng.normal() * 0.3):
        enough = min(enough, FOREVER)
        room, g, i, k = least_room(scene, begin, end, enough, False, first)
        assert room == min(true, enough)
        assert (i < 0) == (true >= enough)
        one, _, j, when = least_room(scene, begin, end, enough, True, first)
        assert (j < 0) == (true >= enough)
        assert true <= one < enough if j >= 0 else one == enough
        for r, body, tick in ((room, i, k), (one, j, when)):
            if body >= 0:
                assert begin < tick <= min(end, horizon(bodies[body]))
                assert body_contact(scene, body, tick)[4] - bodies[body, WANTED] == r
        assert i < 0 or groups[g, FIRST] <= i < groups[g, PAST]


@robots
@given(seeds, speeds, turns)
def test_the_room_of_a_plan_is_the_least_over_all_ticks(robot, seed, v, omega):
    """Exact where it is wanted, whatever held the plan before."""
    rng = np.random.default_rng(seed)
    middle, second = int(rng.integers(0, N + 1)), rng.uniform([-1, -1.5], [1, 1.5])
    scene, _, _ = scene_of(robot, mixed(rng), rng.uniform([-1, -1.5], [1, 1.5]))
    assume(len(scene[3]))
    scene[4][:, TICKS] = N_STILL + (N - N_STILL) * (scene[4][:, 8] > 0.01)
    driven(scene, (v, omega, middle), second)
    true = least_of(scene, 0, N)
    for wanted in (-FOREVER, true, true + 1e-3, true - 1e-3):
        hold = int(rng.integers(len(scene[4]))), int(rng.integers(0, N_STILL + 1))
        drive(scene, 0, middle, v, omega)
        room, hold = plan_room(scene, middle, tuple(second), wanted, hold)
        assert room == (true if true >= wanted else -FOREVER)


# ------------------------------------------------------------------ nearest_ahead
def room_of(scene, u):
    """Least of distance less distance wanted along a twist, by the oracles."""
    poses = driven(scene, u)
    return min(
        distance(poses, k, body) - body[WANTED]
        for body in scene[3]
        for k in range(1, horizon(body) + 1)
    )


@robots
@given(seeds)
def test_the_nearest_twist_ahead_keeps_its_distance(robot, seed):
    """By the oracles; and its cost is what it says, from the desired twist."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([0.8, -1.0], [2.5, 1.0])
    world = Obstacles(
        discs=[[*place, 0.2]], disc_velocities=[-0.3 * place], points=[[0.9, 1.0]]
    )
    last, start = rng.uniform([0, -0.5], [0.6, 0.5]), rng.choice([-1.0, 1.0], 2)
    scene, n, memory = scene_of(robot, world, last)
    wish, start = (BOX, (0.6, 0.0), n), (start[0], 1.5 * start[1])
    v, omega, cost = nearest_ahead(scene, wish, start, math.inf, memory)
    assume(cost < math.inf)
    assert abs(v) <= 1.0 and abs(omega) <= 1.5
    assert room_of(scene, (v, omega)) >= -1e-9
    assert cost == pytest.approx((v - 0.6) ** 2 + 0.03 * omega**2, abs=1e-12)


@robots
@given(seeds, speeds, turns)
def test_least_room_is_the_least_by_the_oracles(robot, seed, v, omega):
    rng = np.random.default_rng(seed)
    world = Obstacles(
        discs=[[*rng.uniform(-2, 2, 2), 0.2]],
        disc_velocities=rng.normal(size=(1, 2)) * 0.5,
        points=rng.uniform(-1.5, 1.5, (2, 2)),
        walls=rng.uniform(-2, 2, (1, 4)),
    )
    scene, _, _ = scene_of(robot, world, (0.2, 0.1))
    expected = room_of(scene, (v, omega))
    room, _, _, _ = least_room(scene, 0, N, FOREVER, False, 0)
    if room + scene[3][:, WANTED].max() > 0.0 and expected > -0.1:
        assert room == pytest.approx(expected, abs=1e-9)


# ------------------------------------------------------------------ what widens them
def test_margins_and_age_widen_the_bodies():
    world = Obstacles(discs=[[2.0, 1.0, 0.3]], disc_velocities=[[-0.3, 0.0]])
    size = ROBOT.footprint.circumradius

    def wanted(age=0.0, closing=0.0, v=0.0, **margins):
        radius = SafetyRadius(closing=closing)
        settings = AvoidanceSettings(radius, margins=Margins(**margins))
        missed = 0.5 * TICK * (0.3 + 1.0 + 0.75 * size)
        scene, _, _ = scene_of(ROBOT, world, (v, 0.7), settings, age)
        return math.sqrt(scene[3][0, WANTED] ** 2 - missed**2)

    assert wanted() == pytest.approx(0.3 + 0.2)
    assert wanted(age=0.4) == pytest.approx(0.5 + 0.4 * 0.3)
    assert wanted(error=0.05) == pytest.approx(0.55)
    accelerating = 0.4 * (0.3 + 0.4 * 0.5) + 0.5 * 0.5 * 0.02**2
    assert wanted(age=0.4, acceleration=0.5) == pytest.approx(0.5 + accelerating)
    towards = 2.0 / math.hypot(2.0, 1.0)
    assert wanted(closing=0.5) == pytest.approx(0.5 + 0.15 * towards)
    assert wanted(closing=0.5, v=0.4) == pytest.approx(0.5 + 0.35 * towards)
    assert wanted(closing=0.5, v=-0.4) == pytest.approx(0.5)


def test_a_fresh_memory_knows_no_way():
    state = fresh_state()
    assert state[4] == FOREVER
    assert np.count_nonzero(state) == 1
