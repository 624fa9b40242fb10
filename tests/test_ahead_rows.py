"""Look-ahead rows: driven in thought as in truth, gradients by finite differences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles import point_distance, wall_distance
from shapes import ROBOT

from qpavoid.avoidance.ahead import fresh_state
from qpavoid.avoidance.prediction import bodies_in_reach, drive, least_room
from qpavoid.avoidance.settings import (
    AvoidanceSettings,
    LookAhead,
    Margins,
    SafetyRadius,
)
from qpavoid.avoidance.ways import FOREVER, NEAR, ahead_rows, nearest_ahead
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist

LIMITED = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
)
SETTINGS = AvoidanceSettings()
TICK, TICKS = SETTINGS.ahead.tick, 60
robots = pytest.mark.parametrize("robot", [ROBOT, LIMITED], ids=["free", "limited"])
seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-1, 1), st.floats(-1.5, 1.5)


def driven(robot, plan, last=(0.0, 0.0), ticks=TICKS, tick=TICK):
    """Return the poses (ticks + 1, 5) of a plan."""
    plan = [*plan, FOREVER, 0.0, 0.0] if len(plan) == 2 else plan
    poses = np.empty((ticks + 1, 5))
    drive(robot.numbers, tick, np.array(last), np.array(plan, dtype=float), poses)
    return poses


REST = np.zeros(2)


def turn_back(poses, k, place):
    """A place of the world as the robot sees it from pose k."""
    x, y, c, s, _ = poses[k]
    return np.array([[c, s], [-s, c]]) @ (np.asarray(place) - (x, y))


def distance(poses, k, body):
    """The true distance at tick k to the line of a body, by the oracles."""
    time, vertices = TICK * k, ROBOT.footprint.vertices
    first = turn_back(poses, k, body[:2] + time * body[5:7])
    if (body[:2] == body[2:4]).all():
        return point_distance(vertices, first)
    return wall_distance(vertices, (*first, *turn_back(poses, k, body[2:4])))


def gradients_of(robot, plan, last, step=1e-6):
    shifts = [np.array([step, 0.0]), np.array([0.0, step])]
    ahead, behind = (
        np.array([driven(robot, plan + sign * shift, last) for shift in shifts])
        for sign in (1, -1)
    )
    return (ahead - behind) / (2 * step)


# ------------------------------------------------------------------------- drive
@given(speeds, turns)
def test_without_accelerations_a_plan_is_an_arc(v, omega):
    poses = driven(ROBOT, (v, omega), last=(0.7, -0.3))
    for k in range(TICKS + 1):
        x, y, heading = arc(0.0, 0.0, 0.0, v, omega, k * TICK)
        expected = (x, y, math.cos(heading), math.sin(heading), heading)
        assert poses[k] == pytest.approx(expected, abs=1e-9)


@given(speeds, turns, speeds, turns)
def test_with_accelerations_it_is_the_limits_integrated(v, omega, last_v, last_omega):
    """Against a hundred small steps a tick of what the limits let through."""
    poses = driven(LIMITED, (v, omega), (last_v, last_omega))
    pose, twist, dt = (0.0, 0.0, 0.0), (last_v, last_omega), TICK / 100
    numbers = LIMITED.numbers
    for k in range(1, 21):
        for _ in range(100):
            after = limit_twist(numbers, v, omega, *twist, dt)
            middle = (0.5 * (twist[0] + after[0]), 0.5 * (twist[1] + after[1]))
            pose, twist = arc(*pose, *middle, dt), after
        assert poses[k, :2] == pytest.approx(pose[:2], abs=1e-3)
        assert poses[k, 4] == pytest.approx(pose[2], abs=1e-4)
        assert poses[k, 2:4] == pytest.approx(
            (math.cos(poses[k, 4]), math.sin(poses[k, 4]))
        )


@robots
def test_a_plan_of_two_twists_goes_over_in_time(robot):
    one, other = (0.5, 1.0), (-0.8, 0.3)
    both = driven(robot, (*one, 0.4, *other))
    first = driven(robot, one, ticks=8)
    np.testing.assert_array_equal(both[:9], first)
    speed = np.hypot(*np.diff(both[:, :2], axis=0).T) / TICK
    assert speed[7] == pytest.approx(0.5, abs=0.01)
    assert speed[-1] == pytest.approx(0.8, abs=0.01)
    assert np.diff(both[-2:, 4])[0] == pytest.approx(0.3 * TICK)


# --------------------------------------------------------------------- the bodies
def test_bodies_by_hand():
    settings = AvoidanceSettings(ahead=LookAhead(2.0, 0.5, 0.1))
    obstacles = Obstacles(
        points=[[1.0, 0.0], [50.0, 0.0]],
        discs=[[2.0, 1.0, 0.3], [-1.0, 0.8, 0.2]],
        disc_velocities=[[-0.3, 0.0], [0.0, 0.0]],
        walls=[[1.0, -1.0, 1.0, 1.0]],
    )
    bodies, owner = bodies_in_reach(
        ROBOT.numbers, settings.record(), obstacles.arrays, 0.0, REST
    )
    assert owner.tolist() == [0, 2, 3, 4]
    assert bodies[:, 7].tolist() == [5, 20, 5, 5]
    assert bodies[1, :4].tolist() == [2.0, 1.0, 2.0, 1.0]
    assert bodies[1, 5:7].tolist() == [-0.3, 0.0]
    assert bodies[3, :4].tolist() == [1.0, -1.0, 1.0, 1.0]
    assert not bodies[[0, 2, 3], 5:7].any()
    wanted = np.array([0.17, 0.3 + 0.2, 0.2 + 0.17, 0.17])
    assert (bodies[:, 4] >= wanted).all()
    assert (bodies[:, 4] <= np.hypot(wanted, 0.15)).all()


@robots
@given(seeds)
def test_what_is_not_in_reach_cannot_be_met(robot, seed):
    """However it is driven, what is left out stays farther away than wanted."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-6, 6, (8, 2)), rng.uniform(0, 0.4, 8)])
    velocities = rng.normal(size=(8, 2)) * rng.choice([0.0, 0.6], 8)[:, None]
    world = Obstacles(discs=discs, disc_velocities=velocities)
    _, owner = bodies_in_reach(
        robot.numbers, SETTINGS.record(), world.arrays, 0.0, REST
    )
    poses = driven(robot, rng.choice([-1, 1], 2) * [1.0, rng.uniform(0, 1.5)])
    for i in set(range(8)) - set(owner.tolist()):
        speed = float(np.hypot(*velocities[i]))
        horizon = TICKS if speed > 0 else 20
        body = np.array([*discs[i, :2], *discs[i, :2], 0.0, *velocities[i]])
        least = min(distance(poses, k, body) for k in range(1, horizon + 1))
        assert least - discs[i, 2] > SETTINGS.radius.r_min(speed)


# ---------------------------------------------------------------------- gradients
@robots
@given(seeds, speeds, turns)
def test_rows_are_the_gradient_of_the_true_distance(robot, seed, v, omega):
    rng = np.random.default_rng(seed)
    obstacles = Obstacles(
        points=rng.uniform(-2, 2, (1, 2)),
        discs=[[*rng.uniform(-2, 2, 2), 0.2]],
        disc_velocities=rng.normal(size=(1, 2)) * 0.5,
        walls=rng.uniform(-2, 2, (1, 4)),
    )
    last, plan = rng.uniform([-0.5, -1], [0.5, 1]), np.array([v, omega])
    bodies, _ = bodies_in_reach(
        robot.numbers, SETTINGS.record(), obstacles.arrays, 0.0, REST
    )
    poses = driven(robot, plan, last)
    A, b = np.empty((len(bodies) * TICKS, 2)), np.empty(len(bodies) * TICKS)
    count = ahead_rows(
        ROBOT.footprint.edges, robot.numbers, TICK, bodies, poses,
        gradients_of(robot, plan, last), A, b,
    )  # fmt: skip
    row, step, compared = 0, 1e-5, 0
    for body in bodies:
        for k in range(1, int(body[7]) + 1):
            here = distance(poses, k, body)
            if here - body[4] > NEAR:
                continue
            if here > 0.0:
                assert b[row] == pytest.approx(body[4] - here, abs=1e-7)
            if here > 0.05 and k % 5 == 0:
                compared += compare_row(robot, plan, last, k, body, A[row], step)
            row += 1
    assert row == count
    assume(compared)


def compare_row(robot, plan, last, k, body, row, step):
    """Compare where the distance has one slope: at a wall's corner it has two."""
    for j in range(2):
        shift = np.eye(2)[j] * step
        there = [
            distance(driven(robot, plan + sign * shift, last), k, body)
            for sign in (-1, 0, 1)
        ]
        before, after = np.diff(there) / step
        if abs(before - after) > 1e-2:
            return 0
        assert row[j] == pytest.approx(0.5 * (before + after), abs=5e-3)
    return 1


# ------------------------------------------------------------------ nearest_ahead
def room_of(robot, u, last, bodies):
    """Least of distance less distance wanted along a twist, by the oracles."""
    poses = driven(robot, u, last)
    return min(
        distance(poses, k, body) - body[4]
        for body in bodies
        for k in range(1, int(body[7]) + 1)
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
    desired, last = np.array([0.6, 0.0]), rng.uniform([0, -0.5], [0.6, 0.5])
    start = rng.choice([-1.0, 1.0], 2) * [1.0, 1.5]
    bodies, _ = bodies_in_reach(
        robot.numbers, SETTINGS.record(), world.arrays, 0.0, REST
    )
    lower, upper = np.array([-1.0, -1.5]), np.array([1.0, 1.5])
    v, omega, cost = nearest_ahead(
        ROBOT.footprint.edges, robot.numbers, SETTINGS.record(), lower, upper,
        last, desired, start, bodies, np.empty((TICKS + 1, 5)),
    )  # fmt: skip
    assume(cost < math.inf)
    assert abs(v) <= 1.0 and abs(omega) <= 1.5
    assert room_of(robot, (v, omega), last, bodies) >= -1e-9
    assert cost == pytest.approx((v - 0.6) ** 2 + 0.03 * omega**2, abs=1e-12)


@robots
@given(seeds, speeds, turns)
def test_least_room_is_the_least_over_all_ticks(robot, seed, v, omega):
    rng = np.random.default_rng(seed)
    world = Obstacles(
        discs=[[*rng.uniform(-2, 2, 2), 0.2]],
        disc_velocities=rng.normal(size=(1, 2)) * 0.5,
        points=rng.uniform(-1.5, 1.5, (2, 2)),
        walls=rng.uniform(-2, 2, (1, 4)),
    )
    bodies, _ = bodies_in_reach(
        robot.numbers, SETTINGS.record(), world.arrays, 0.0, REST
    )
    args = (ROBOT.footprint.edges, robot.numbers, TICK, bodies)
    expected = room_of(robot, (v, omega), (0.2, 0.1), bodies)
    poses = driven(robot, (v, omega), (0.2, 0.1))
    room, which = least_room(*args, poses, False, FOREVER, -FOREVER)
    alone, _ = least_room(*args[:3], bodies[which : which + 1], poses, False, 9.0, -9.0)
    assert alone == room
    if room + bodies[:, 4].max() > 0.0 and expected > -0.1:
        assert room == pytest.approx(expected, abs=1e-9)
    capped, _ = least_room(*args, poses, False, 0.1, -FOREVER)
    assert capped == pytest.approx(min(room, 0.1))


# ------------------------------------------------------------------ what widens them
def test_margins_and_age_widen_the_bodies():
    world = Obstacles(discs=[[2.0, 1.0, 0.3]], disc_velocities=[[-0.3, 0.0]])

    def wanted(age=0.0, closing=0.0, v=0.0, **margins):
        radius = SafetyRadius(closing=closing)
        settings = AvoidanceSettings(radius, margins=Margins(**margins))
        record, missed = settings.record(), 0.5 * TICK * (0.3 + 1.0 + 0.75 * size)
        bodies, _ = bodies_in_reach(
            ROBOT.numbers, record, world.arrays, age, np.array([v, 0.7])
        )
        return math.sqrt(bodies[0, 4] ** 2 - missed**2)

    size = ROBOT.footprint.circumradius
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
