"""The filter that looks ahead: what it keeps, where the present alone does not."""

import math
from itertools import product

import numpy as np
import pytest

from driven import gap_at, gaps_at, lines_of_world
from oracles import point_distance, wall_distance
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.plan import fresh_state
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead, SafetyRadius
from qpavoid.avoidance.step import filter_step, memory_size
from qpavoid.lab.scenario.world import Track, World
from qpavoid.model.contacts import most_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from rollouts import BOX, mixed, robots
from shapes import ROBOT

RADIUS, DT = SafetyRadius(), 0.02


def parked(pose):
    return 0.0, 0.0


def along_x(pose):
    """0.6 m/s along the x axis."""
    return 0.6, -1.0 * pose[1] - 2.0 * pose[2]


def distance(obstacles, pose):
    """The least distance at a pose, by the oracles."""
    seen, vertices = obstacles.seen_from(pose), ROBOT.footprint.vertices
    near = seen.points[np.hypot(*seen.points.T) < 1.2]
    gaps = [point_distance(vertices, p) for p in near]
    gaps += [point_distance(vertices, d[:2]) - d[2] for d in seen.discs]
    return min(gaps + [wall_distance(vertices, wall) for wall in seen.walls], default=9)


def drive(safety, world, seconds, wish=parked):
    """Return the least distance within and between steps, poses and decisions."""
    pose, least, poses, decisions = (0.0, 0.0, 0.0), math.inf, [], []
    for k in range(round(seconds / DT)):
        seen = world.at(k * DT).seen_from(pose)
        decision = safety.filter(*wish(pose), seen)
        poses.append(pose)
        decisions.append(decision)
        if decision.clearance < 0.6:
            for share in (0.5, 1.0):
                there = arc(*pose, *decision[:2], share * DT)
                least = min(least, distance(world.at((k + share) * DT), there))
        pose = arc(*pose, *decision[:2], DT)
    return least, np.array([*poses, pose]), decisions


def moving(place, velocity, radius):
    """A world of one disc that keeps its velocity."""
    return World(tracks=(Track.straight(np.array(place), np.array(velocity), radius),))


NEAREST = Status.TRACKING, Status.FILTERED


@robots
@pytest.mark.parametrize(
    ("speed", "bearing"),
    [(0.1, 1), (0.2, -1), (0.4, 1), (0.7, -1), (1.0, 1), (1.4, -1)],
)
def test_an_obstacle_straight_from_abeam_is_avoided(robot, speed, bearing):
    """Its row is empty, so that the one-step filter lets it come."""
    start = 1.0 + 2.0 * speed
    world = moving([0.0, bearing * start], [0.0, -bearing * speed], 0.1)
    seconds = (start + 1.0) / speed
    least, _, decisions = drive(SafetyFilter(robot), world, seconds)
    assert least >= RADIUS.r_min(speed) - 1e-3
    statuses = {d.status for d in decisions}
    assert Status.FILTERED in statuses
    assert statuses <= {*NEAREST, Status.PLANNED, Status.HOLDING}
    assert max(d.shortfall for d in decisions) == 0.0
    blind = SafetyFilter(robot, ahead=False)
    assert drive(blind, world, seconds)[0] < 0.0


def best_rooms(robot, world):
    """The most room that constant twists, and plans of two extreme ones, keep; m."""
    (line,), corners = lines_of_world(world), robot.footprint.vertices
    line[4] += RADIUS.r_min(float(np.hypot(*line[5:7])))

    limits, steps = robot.limits, 150
    grid = list(product(np.linspace(*BOX[:2], 21), np.linspace(*BOX[2:], 21)))
    extremes, switches = list(product(BOX[:2], BOX[2:])), (80, 55, 35, 20, 10, 5)
    extremes += [(0.0, 0.0), *product(BOX[:2], [0.0]), *product([0.0], BOX[2:])]
    plans = [(*twist, steps, *twist) for twist in grid]
    plans += [(*u, k, *w) for u, w, k in product(extremes, extremes, switches)]
    first, switch, then = np.split(np.array(plans), [2, 3], axis=1)
    most = DT * np.array([limits.acceleration, limits.angular_acceleration])
    u, pose = np.zeros_like(first), np.zeros((len(plans), 3))
    least = gap_at(corners, (0.0, 0.0, 0.0), line, 0.0)
    for k in range(steps):
        u = u + np.clip(np.where(k < switch, first, then) - u, -most, most)
        middle = pose[:, 2] + 0.5 * DT * u[:, 1]
        chord = DT * u[:, 0] * np.sinc(0.5 * DT * u[:, 1] / math.pi)
        pose += np.array(
            [chord * np.cos(middle), chord * np.sin(middle), DT * u[:, 1]]
        ).T
        if k % 2:
            least = np.minimum(least, gaps_at(corners, pose, line, DT * (k + 1)))
    return least[: len(grid)].max(), least[len(grid) :].max()


@robots
def test_relaxed_exactly_where_nothing_keeps_r_min(robot):
    """Against all constant twists of a grid, and all plans of two extreme ones."""
    rng, hopeless, kept = np.random.default_rng(3), 0, 0
    for _ in range(40):
        bearing, reach = rng.uniform(-math.pi, math.pi), rng.uniform(0.8, 1.6)
        place = reach * np.array([math.cos(bearing), math.sin(bearing)])
        aim = rng.uniform([-0.4, -0.2], [0.4, 0.2])
        velocity = (aim - place) / reach * rng.uniform(0.2, 1.5)
        world = Obstacles(discs=[[*place, 0.1]], disc_velocities=[velocity])
        decision = SafetyFilter(robot).filter(0.0, 0.0, world)
        constant, planned = best_rooms(robot, world)
        assert (decision.status is Status.RELAXED) == (decision.shortfall > 0.0)
        if constant > 0.02:
            assert decision.shortfall == 0.0
            kept += 1
        elif max(constant, planned) < -0.005:
            assert decision.shortfall == pytest.approx(-planned, abs=0.015)
            hopeless += 1
    assert kept > 10 and hopeless > 5


@robots
def test_a_step_keeps_to_its_memory(robot):
    """Memory before and after it is unchanged; its previous content has no effect."""
    rng = np.random.default_rng(8)
    known = robot.footprint.edges, robot.limit_vector
    for look in ((), (1.9, 0.7, 0.07), (0.3, 0.3, 0.1)):
        record = AvoidanceSettings(ahead=LookAhead(*look)).record()
        for _ in range(25):
            world, states = mixed(rng, rng.uniform(0.6, 4.0)), []
            size = memory_size(
                most_contacts(robot.footprint.edges, world.arrays), record
            )
            wishes = rng.uniform(BOX[::2], BOX[1::2], (4, 2))
            for sentinel in (7.5, math.nan, -1e300):
                memory, state = np.full(size + 80, sentinel), fresh_state()
                given = []
                for v, omega in wishes:
                    inner = memory[40:-40]
                    given += filter_step(
                        *known, record, *world.arrays, 0.0, True, v, omega, state, inner
                    )
                np.testing.assert_array_equal(memory[:40], sentinel)
                np.testing.assert_array_equal(memory[-40:], sentinel)
                states.append((state.tobytes(), tuple(given)))
            assert len(set(states)) == 1


@pytest.mark.parametrize("speed", [0.0, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("offset", [0.0, 0.02, -0.02])
def test_a_disc_head_on_is_passed_on_one_side(speed, offset):
    world = moving([3.0, offset], [-speed, 0.0], 0.2)
    least, poses, decisions = drive(SafetyFilter(ROBOT), world, 7.0, along_x)
    assert least >= RADIUS.r_min(speed) - 1e-3
    assert poses[-1, 0] > 3.5
    aside = poses[np.abs(poses[:, 1]) > 0.02, 1]
    assert (np.sign(aside) == np.sign(aside[0])).all()
    assert np.abs(aside).max() > 0.4
    turning = [np.sign(d.omega) for d in decisions if d.active and abs(d.omega) > 0.1]
    assert len(turning) > 50
    assert np.count_nonzero(np.diff(turning)) <= 12


@pytest.mark.parametrize(("hysteresis", "kept"), [(0.2, True), (0.0, False)])
def test_a_side_is_kept_although_the_other_becomes_a_little_cheaper(hysteresis, kept):
    """A disc that wanders 2 cm over to the side on which it is passed."""
    settings = AvoidanceSettings(ahead=LookAhead(hysteresis=hysteresis))
    for side in (1.0, -1.0):
        safety, turned = SafetyFilter(ROBOT, settings), []
        for offset in (-0.2, -0.15, -0.1, -0.05, 0.0, *[0.02] * 30):
            disc = [[1.6, side * offset, 0.2]]
            decision = safety.filter(
                0.6, 0.0, Obstacles(discs=disc, disc_velocities=[[-0.3, 0]])
            )
            turned.append(side * decision.omega)
        assert turned[0] > 0.1
        assert (turned[-1] > 0.1) if kept else (turned[-1] < -0.1)
