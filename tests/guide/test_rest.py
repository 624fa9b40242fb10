"""A robot that parks: noisy localisation, dead bands, walls, slow passers-by."""

import math
from dataclasses import replace

import numpy as np
import pytest

import qpavoid as qp
import station
from guided import LIMITS, cart, loop
from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import arc


def park(limits, begin, goal, seconds, dt=0.05, settings=(), **how):
    """(n, 5) of the last minute: left of the way and turn, twist, blocked."""
    settings = qp.AvoidanceSettings(dt=dt, **dict(settings))
    guide = qp.Guide(replace(cart(), limits=limits), settings)
    if begin != goal:
        guide.go_to(begin, goal, 0.3)
    rows = loop(guide, seconds, start=begin, **how)
    told = [(*guide.left(row.pose), *row.command, row.blocked) for row in rows]
    return np.array(told)[-round(60.0 / dt) :]


@pytest.mark.parametrize("away", [0.04, 0.2, 0.6])
def test_pushed_away_it_comes_back(away):
    push = lambda k: (0.0, -away if k > 200 else 0.0, 0.0)  # noqa: E731
    rows = park(LIMITS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 60.0, noise=push)
    assert abs(rows[-1, 0] - away) < 0.012 and rows[-1, 1] < 0.02


@pytest.mark.parametrize("dt", [0.02, 0.05])
@pytest.mark.parametrize("dead", [0.05, 0.08])
@pytest.mark.parametrize("goal", [(3.0, 1.0, 0.5), (0.0, 0.0, 0.3), (0.4, 0.4, 0.0)])
def test_wheels_with_a_dead_band_arrive_and_rest(goal, dead, dt):
    def motors(twist):
        v, omega = twist
        wheels = v - 0.2 * omega, v + 0.2 * omega
        left, right = (w if abs(w) >= dead else 0.0 for w in wheels)
        return 0.5 * (left + right), (right - left) / 0.4

    limits = replace(LIMITS, v_dead=dead, omega_dead=dead / 0.2)
    rows = park(limits, (0.0, 0.0, 0.0), goal, 60.0, dt=dt, motors=motors)
    assert rows[-1, 0] < 0.05 and rows[-1, 1] < 0.1
    assert not rows[-round(5.0 / dt) :, 2:4].any()


def test_a_dead_band_is_less_than_the_greatest_speed():
    for wrong in ({"v_dead": 0.6}, {"omega_dead": 1.2}, {"v_dead": -0.1}):
        with pytest.raises(InvalidInputError, match="dead"):
            replace(LIMITS, **wrong)
    robot = qp.Robot.mir100()
    slow = replace(robot, limits=replace(robot.limits, v_dead=0.1))
    assert (slow.limit_vector == robot.limit_vector).all()
    with pytest.raises(InvalidInputError, match="dead band"):
        qp.Guide(slow).go_to((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1)


@pytest.mark.parametrize("gap", [0.13, 0.12, 0.115, 0.1])
def test_beside_a_wall_it_parks_or_rests_and_says_so(gap):
    y = np.linspace(-3.0, 3.0, 241)
    wall = qp.Obstacles(points=np.column_stack([np.full(241, 4.0), y]))
    settings = {"radius": qp.SafetyRadius(0.1, 0.15), "margins": qp.Margins(error=0.01)}
    goal = (3.7 - gap, 0.3, 0.0)
    world = lambda t: wall if t < 130.0 else qp.Obstacles()  # noqa: E731
    more = {"world": world, "settings": settings}
    rows = park(LIMITS, (0.0, 0.0, 0.0), goal, 160.0, **more)
    before = rows[:600]
    assert not before[:, 2:4].any()
    assert before[:, 0].max() < 0.01 or before[:, 4].all()
    assert rows[-1, 0] < 0.01


@pytest.mark.parametrize("speed", [0.05, 0.1])
@pytest.mark.parametrize("bearing", [0.0, 0.8, 1.6, 2.4, 3.2])
def test_a_slow_passer_by_is_given_way_to_gently(bearing, speed):
    d = np.array([math.cos(bearing), math.sin(bearing)])
    begin = -1.2 * d + 0.1 * np.array([-d[1], d[0]])

    def world(t):
        place = begin + t * speed * d
        return qp.Obstacles(discs=[(*place, 0.15)], disc_velocities=[speed * d])

    at = (0.0, 0.0, 0.0)
    rows = park(qp.Limits.symmetric(1.0, 1.5), at, at, 3.0 / speed, world=world)
    assert np.abs(rows[:, 2]).max() < 0.4
    assert rows[-1, :2].max() < 0.02


PASSERS = (
    (
        (-0.419, 0.629, 0.469, 0.312, 8.905),
        (0.031, 0.297, -0.695, 0.073, 17.401),
        (0.064, -0.182, 0.684, 0.238, 23.145),
    ),
    (
        (-0.092, 0.841, -0.991, -0.109, 6.466),
        (-0.007, 0.029, -0.968, -0.219, 17.308),
        (-0.116, 0.327, 1.004, 0.357, 23.899),
    ),
)
"""x, y, m; v_x, v_y, m/s; the time when somebody is there, s."""

BENCH = (-0.6, -0.75, 0.9, -0.75)


def at_the_bench(passers, time):
    """The bench and those who pass within 6 m, world frame."""
    x, y, *motion, when = np.reshape(passers, (-1, 5)).T
    velocities = np.column_stack(motion)
    places = np.column_stack([x, y]) + (time - when)[:, None] * velocities
    near = np.hypot(*places.T) < 6.0
    discs = np.column_stack([places, np.full(len(places), 0.25)])[near]
    moving = {"discs": discs, "disc_velocities": velocities[near]}
    return qp.Obstacles(**moving, walls=[BENCH])


def keep_station(passers, steps, pushed=None):
    """Poses of the study's cart at its station, which may be pushed at step 100."""
    guide, poses = qp.Guide(station.ROBOT, station.SETTINGS), [station.STATION]
    guide.stay(station.STATION)
    for k in range(steps):
        pose = pushed if pushed and k == 100 else poses[-1]
        world = at_the_bench(passers, k * station.SETTINGS.dt)
        assert station.clearance(pose, world) > 0.0
        twist = guide.step(pose, world.seen_from(pose))[:2]
        poses.append(arc(*pose, *twist, station.SETTINGS.dt))
    assert math.hypot(*poses[-1][:2]) < 0.02
    assert abs(math.remainder(poses[-1][2], math.tau)) < math.radians(2.0)


@pytest.mark.parametrize("passers", PASSERS)
def test_a_robot_that_evaded_for_long_comes_back(passers):
    """Lack of progress while evading is no reason to rest."""
    keep_station(passers, 800)


def test_a_robot_that_was_pushed_far_away_comes_back():
    keep_station((), 900, pushed=(1.5, 0.4, 2.0))


@pytest.mark.parametrize("turning", [0.5, 2.5])
@pytest.mark.parametrize("v_min", [-0.3, 0.0])
def test_where_nothing_is_near_a_slow_robot_comes_back(v_min, turning):
    """Its return takes longer than the time that counts as a stall elsewhere."""
    limits = replace(LIMITS, v_min=v_min, angular_acceleration=turning)
    for angle in (0.4, 2.0, 3.5, 5.1):
        begin = (0.3 * math.cos(angle), 0.3 * math.sin(angle), 0.2)
        rows = park(limits, begin, (0.0, 0.0, 0.0), 120.0)
        assert rows[-1, 0] < 0.02 and rows[-1, 1] < math.radians(2.0)
        assert not rows[:, 4].any()
