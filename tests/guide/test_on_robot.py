"""Closed loops of a guide with noise, late measurements and motors that stick."""

import copy
import math
import pickle

import numpy as np
import pytest
import shapely
import shapely.affinity

import qpavoid as qp
from guided import FREE, HOME, cart, loop
from qpavoid.avoidance.inputs import Stamps
from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import arc

SIGMA = np.array([0.02, 0.02, math.radians(0.5)])


def driven(rows):
    """Metres driven."""
    return sum(abs(r.moved[0]) for r in rows) * (rows[1].time - rows[0].time)


def held(rng, seconds, hold=1.0, kept=0.0):
    """Noise that is new every ``hold`` s, correlated from each to the next."""
    states = [rng.normal(0.0, SIGMA)]
    while len(states) < seconds / hold + 2:
        new = rng.normal(0.0, SIGMA)
        states.append(kept * states[-1] + math.sqrt(1.0 - kept * kept) * new)
    return lambda time: states[int(time / hold)]


@pytest.mark.parametrize("dt", [0.02, 0.05, 0.2])
@pytest.mark.parametrize(
    ("hold", "kept"), [(0.0, 0.0), (1.0, 0.0), (0.1, 0.9), (0.2, 0.9), (1.0, 0.9)]
)
def test_a_parked_robot_rests_under_noise_at_any_rate(dt, hold, kept):
    for seed in range(2):
        guide = qp.Guide(cart(), qp.AvoidanceSettings(dt=dt))
        guide.stay(HOME)
        noise = held(np.random.default_rng(seed), 70.0, max(hold, dt), kept)
        rows = loop(guide, 70.0, noise=lambda k, noise=noise: noise(k * dt))
        assert driven(rows) < 0.05
        assert max(math.hypot(*r.pose[:2]) for r in rows) < SIGMA[0]


@pytest.mark.parametrize("v_min", [-0.3, 0.0])
def test_it_drives_to_its_place_under_noise_and_rests_there(v_min):
    guide = qp.Guide(cart(v_min=v_min), qp.AvoidanceSettings(dt=0.1))
    guide.go_to(HOME, (2.0, 1.0, 1.0), 0.4)
    noise = held(np.random.default_rng(5), 100.0, 0.2)
    rows = loop(guide, 100.0, noise=lambda k: noise(0.1 * k))
    assert driven(rows[400:]) < 0.05
    assert math.dist(rows[-1].pose[:2], (2.0, 1.0)) < 1.5 * SIGMA[0]
    assert abs(rows[-1].pose[2] - 1.0) < 3.0 * SIGMA[2]


GOAL = (4.0, 0.0, 0.0)


def swaying(time):
    place = (4.0 + 0.1 * math.sin(time), 0.1 * math.cos(0.7 * time), 0.3)
    speed = (0.1 * math.cos(time), -0.07 * math.sin(0.7 * time))
    return qp.Obstacles(discs=[place], disc_velocities=[speed])


def unsure(time):
    """A standing person whose estimated velocity is noise."""
    speed = np.random.default_rng(round(10 * time)).normal(0.0, 0.03, 2)
    return qp.Obstacles(discs=[(4.0, 0.0, 0.3)], disc_velocities=[speed])


CRATE = qp.Obstacles(polygons=[[(3.5, -0.5), (4.5, -0.5), (4.5, 0.5), (3.5, 0.5)]])
ROOM = qp.Obstacles(
    walls=[(3, -8, 3, 8), (-2, -8, 3, -8), (-2, 8, 3, 8), (-2, -8, -2, 8)]
)
CLOSED = {
    "a swaying person": swaying,
    "a person of unsure velocity": unsure,
    "a crate": lambda time: CRATE,
    "a room": lambda time: ROOM,
}


@pytest.mark.parametrize("speed", [0.3, 0.6])
@pytest.mark.parametrize("v_min", [-0.3, 0.0])
@pytest.mark.parametrize("name", CLOSED)
def test_blocked_is_said_within_ten_seconds_and_withdrawn(name, v_min, speed):
    """Counted from the last 5 cm nearer to the goal, wherever the robot drives."""
    guide = qp.Guide(cart(v_min=v_min), qp.AvoidanceSettings(dt=0.1))
    guide.go_to(HOME, GOAL, speed)
    rows = loop(guide, 90.0, lambda time: CLOSED[name](time) if time < 50 else FREE)
    shut = rows[:500]
    nearest = np.minimum.accumulate([math.dist(r.pose[:2], GOAL[:2]) for r in shut])
    steps = np.flatnonzero(np.diff(np.floor(nearest / 0.05)))
    last = shut[steps[-1] + 1].time
    first = next(r.time for r in shut if r.blocked)
    assert first < last + 12.0
    after = [r for r in shut if r.time > first]
    assert np.mean([r.blocked for r in after]) > 0.95
    assert driven(after) < 1.0
    assert not rows[-1].blocked
    assert math.dist(rows[-1].pose[:2], GOAL[:2]) < 0.02


def test_a_detour_of_a_minute_is_not_blocked():
    tunnel = qp.Obstacles(walls=[(-2, -1, 6, -1), (-2, 1, 6, 1), (2.5, -1, 2.5, 1)])
    guide = qp.Guide(cart(), qp.AvoidanceSettings(dt=0.1))
    guide.go_to(HOME, GOAL, 0.6)
    rows = loop(guide, 80.0, lambda time: tunnel)
    assert not any(r.blocked for r in rows)
    assert math.dist(rows[-1].pose[:2], GOAL[:2]) < 0.02


def test_kept_from_its_goal_by_people_it_is_blocked():
    """For most of the time, from 35 s on; 23 % if that without progress restarts."""
    shares = []
    for phase in (0.0, 0.3, 0.6, 0.9):

        def circling(time, phase=phase):
            ways = np.exp(1j * (time / 2.4 + phase + np.arange(5) * math.tau / 5))
            discs = [(4.0 + 1.2 * z.real, 1.2 * z.imag, 0.3) for z in ways]
            speeds = [(-0.5 * z.imag, 0.5 * z.real) for z in ways]
            return qp.Obstacles(discs=discs, disc_velocities=speeds)

        guide = qp.Guide(cart(), qp.AvoidanceSettings(dt=0.1))
        guide.go_to(HOME, GOAL, 0.6)
        said = [r.blocked for r in loop(guide, 40.0, circling)]
        assert said.index(True) < 350
        shares.append(np.mean(said[said.index(True) :]))
    assert np.mean(shares) > 0.5


AREA = [(-0.6, -0.4), (0.8, -0.4), (0.8, 0.2), (0.1, 0.2), (0.1, 0.7), (-0.6, 0.7)]


def passers(seed):
    """People who walk through the station, one every 9 s."""
    rng, people = np.random.default_rng(seed), []
    for k in range(5):
        angle = rng.uniform(-math.pi, math.pi)
        way = np.array([math.cos(angle), math.sin(angle)])
        aside = rng.uniform(-0.5, 0.5) * np.array([-way[1], way[0]])
        people.append((aside, rng.uniform(0.3, 1.2) * way, 8.0 + 9.0 * k))

    def world(time):
        near = [x for x in people if abs(time - x[2]) < 6.0]
        discs = [(*(place + (time - at) * v), 0.25) for place, v, at in near]
        return qp.Obstacles(discs=discs, disc_velocities=[v for _, v, _ in near])

    return world


@pytest.mark.parametrize("v_min", [-0.3, 0.0])
@pytest.mark.parametrize(
    "bounds", [{}, {"max_away": 0.5}, {"region": AREA}, {"max_away": 0.3}]
)
def test_it_gives_way_within_its_area_and_comes_back(v_min, bounds):
    outside = shapely.Polygon(AREA) if "region" in bounds else shapely.Point(0.0, 0.0)
    least, gone = bounds.get("max_away", 0.0), []
    for seed in range(3):
        guide = qp.Guide(cart(v_min=v_min), qp.AvoidanceSettings(dt=0.1))
        guide.stay(HOME, **bounds)
        rows = loop(guide, 75.0, passers(seed))
        gone += [outside.distance(shapely.Point(r.pose[:2])) - least for r in rows]
        assert math.hypot(*rows[-1].pose[:2]) < 0.1
        assert abs(math.remainder(rows[-1].pose[2], math.tau)) < math.radians(10.0)
        assert max(math.hypot(*r.pose[:2]) for r in rows) > 0.2
    assert max(gone) < 2e-3 if bounds else max(gone) > 0.6


def test_a_guide_is_not_copied():
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="cannot be copied"):
            copied(qp.Guide(cart()))


def test_an_area_that_is_none_is_named_and_the_last_one_kept():
    guide = qp.Guide(cart(), qp.AvoidanceSettings(dt=0.1))
    guide.stay(HOME, region=AREA)
    for wrong, said in (
        ({"max_away": 0.0}, "max_away must be above 0"),
        ({"max_away": math.nan}, "max_away must be"),
        ({"max_away": "far"}, "max_away must be"),
        ({"region": [(0.0, 0.0), (1.0, 0.0)]}, "n >= 3 vertices"),
        ({"region": [(0.0, 0.0), (1.0, 0.0), (1.0, math.nan)]}, "region"),
        ({"region": AREA[::-1]}, "clockwise"),
        ({"region": np.add(AREA, 5.0)}, "inside its region"),
        ({"region": "here"}, "must be numbers"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            guide.stay(HOME, **wrong)
    rows = loop(guide, 75.0, passers(0))
    area = shapely.Polygon(AREA).buffer(2e-3)
    assert all(area.contains(shapely.Point(r.pose[:2])) for r in rows)


def test_pushed_among_walls_a_robot_that_only_drives_forwards_returns_or_says_so():
    walls = qp.Obstacles(walls=[(-1.5, -0.7, 1.5, -0.7), (1.1, -0.7, 1.1, 2.0)])
    rng, back = np.random.default_rng(8), 0
    for _ in range(8):
        x, y, turn = rng.uniform((-0.9, -0.05, -3.0), (0.5, 0.9, 3.0))
        guide = qp.Guide(cart(v_min=0.0), qp.AvoidanceSettings(dt=0.1))
        guide.stay(HOME)
        rows = loop(guide, 60.0, lambda time: walls, start=(x, y, turn))
        away, off = guide.left(rows[-1].pose)
        is_back = away < 0.1 and off < math.radians(10.0)
        assert is_back or rows[-1].blocked
        assert driven(rows[-200:]) < 0.05
        back += is_back
    assert back >= 6


def sticking(dead):
    return lambda u: u if abs(u[0]) >= dead[0] or abs(u[1]) >= dead[1] else (0.0, 0.0)


@pytest.mark.parametrize("dt", [0.02, 0.1])
@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("acceleration", [0.5, math.inf])
def test_no_command_within_the_dead_band_but_zero(late, acceleration, dt):
    dead = (0.08, 0.4)
    robot = cart(v_dead=dead[0], omega_dead=dead[1], acceleration=acceleration)
    settings = qp.AvoidanceSettings(dt=dt)
    guide, world = qp.Guide(robot, settings), qp.Obstacles(discs=[(1.6, 0.1, 0.2)])
    guide.go_to(HOME, (3.0, 1.0, 0.5), 0.4)
    rows = loop(guide, 50.0, lambda time: world, motors=sticking(dead), late=late)
    assert all(r.moved == r.command for r in rows)
    assert math.dist(rows[-1].pose[:2], (3.0, 1.0)) < 0.05
    assert not any(any(r.command) for r in rows[-round(5.0 / dt) :])


@pytest.mark.parametrize("late", [0, 2])
@pytest.mark.parametrize("dead", [(0.08, 0.4), (0.1, 0.0), (0.0, 0.3)])
def test_a_filter_commands_nothing_within_the_dead_band(dead, late):
    """Against points, with every speed asked for; the distances are kept."""
    robot = cart(v_dead=dead[0], omega_dead=dead[1])
    safety = qp.SafetyFilter(robot, qp.AvoidanceSettings(dt=0.05))
    wall = qp.Obstacles(points=[(1.5, 0.03 * k) for k in range(-60, 61)])
    pose, told, least, fastest = HOME, [(0.0, 0.0)] * (late + 1), math.inf, 0.0
    for k in range(1200):
        wanted = 0.5 * math.sin(0.01 * k), 0.8 * math.sin(0.013 * k)
        seen = wall.seen_from(pose)
        step = safety.step(*wanted, seen, driven=told[0] if late else None)
        v, omega, inside = abs(step.v), abs(step.omega), step[:2] == (0.0, 0.0)
        assert inside or (v and v >= dead[0]) or (omega and omega >= dead[1])
        pose = arc(*pose, *step[:2], 0.05)
        told = [*told[1:], step[:2]]
        least, fastest = min(least, step.clearance), max(fastest, v)
    assert least > safety.settings.radius.r_min_slow - 1e-3
    assert fastest > 0.3


def test_guide_and_filter_have_the_same_faults_and_latch():
    rng = np.random.default_rng(3)
    settings, robot = qp.AvoidanceSettings(dt=0.1), cart()
    guide, safety = qp.Guide(robot, settings), qp.SafetyFilter(robot, settings)
    guide.go_to(HOME, (90.0, 0.0, 0.0))
    x, seen, stopped = 0.0, np.array([(9.0, 3.0)]), []
    for k in range(600):
        now, age, points = 0.1 * k, 0.0, 0.1 * k
        kind = rng.integers(40)
        if kind == 0:
            points = now - rng.uniform(0.2, 3.0)
        elif kind == 1:
            points = now + 1.0
        elif kind == 2:
            age = 0.5
        stamps = None if kind == 3 else Stamps(now, points, steady=now)
        given = None if kind == 4 else seen
        told = {"stamps": stamps, "age": age}
        step = guide.step((x, 0.0, 0.0), given, **told)
        other = safety.step(0.5, 0.0, given, **told)
        assert (step.status is qp.Status.INVALID) == (other.status is qp.Status.INVALID)
        assert guide.safety.faults == safety.faults
        stopped.append(step.status is qp.Status.INVALID)
        x, _, _ = arc(x, 0.0, 0.0, step.v, 0.0, 0.1)
    assert 50 < sum(stopped) < 500 and len(safety.faults) >= 4
