"""Stop and wait, potential field, VFH+ and dynamic window against oracles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines import DT, HEAVY, seeds, standing, start, towards
from oracles import point_distance, wall_distance
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines import apf, dwa, vfh
from qpavoid.lab.baselines.drive import Baseline
from qpavoid.lab.baselines.stopping import free_time
from qpavoid.lab.baselines.vfh import SECTORS, WIDE
from qpavoid.model.contacts import CONTACT_SIZE, contact_table, empty_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import stopping_time, twist_box
from shapes import ROBOT as MIR
from shapes import clearance

SETUP = Baseline(MIR, AvoidanceSettings()).setup
robots = pytest.mark.parametrize("robot", (MIR, HEAVY), ids=("quick", "heavy"))


@given(
    seed=seeds,
    v=st.floats(-1, 1),
    omega=st.floats(-1.5, 1.5),
    margin=st.sampled_from([0.0, 0.05, 0.14]),
)
def test_free_time_is_that_of_a_fine_rollout(seed, v, omega, margin):
    """Distances along the arc come from the contacts, one look each millimetre."""
    obstacles, horizon = standing(np.random.default_rng(seed)), 2.0
    arrays, numbers = obstacles.arrays, MIR.limit_vector
    free = free_time(SETUP, arrays, margin, (v, omega), horizon)
    rooms = [
        clearance(obstacles, arc(0.0, 0.0, 0.0, v, omega, time)) - margin
        for time in np.linspace(0.0, free, 200)
    ]
    assert min(rooms) > -2e-3
    if free < horizon:
        speed = abs(v) + abs(omega) * numbers[8]
        assert rooms[-1] <= 2.1e-3
        after = np.linspace(free, free + 5e-3 / speed, 20)
        poses = [arc(0.0, 0.0, 0.0, v, omega, time) for time in after]
        assert min(clearance(obstacles, pose) for pose in poses) <= margin + 1e-9


@pytest.mark.parametrize("name", ["stop", "dwa"])
@robots
@settings(max_examples=25)
@given(seed=seeds)
def test_nothing_that_stands_is_touched(name, robot, seed):
    rng = np.random.default_rng(seed)
    obstacles, step = standing(rng), start(name, robot)
    pose, driven = (0.0, 0.0, 0.0), (0.0, 0.0)
    goal, desired = rng.uniform(-3, 3, 2), rng.uniform(-1, 1, 2)
    for k in range(60):
        if k % 15 == 0:
            desired = rng.uniform((-0.5, -1.5), (1.0, 1.5))
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        x, y = goal - pose[:2]
        guide = towards(cos * x + sin * y, cos * y - sin * x, driven, pose[2])
        decision = step(*desired, obstacles.seen_from(pose), guide)
        for part in np.linspace(0.0, DT, 4):
            assert clearance(obstacles, arc(*pose, *decision[:2], part)) > 0.0
        pose, driven = arc(*pose, *decision[:2], DT), decision[:2]


def test_stop_and_wait_says_what_it_does():
    """Slow, braking, holding, and on when the way is free again."""
    step, seen, x = start("stop", HEAVY), [], 3.0
    for _ in range(160):
        decision = step(0.8, 0.0, Obstacles(discs=[[x, 0.0, 0.2]]))
        x -= DT * decision.v
        seen.append(decision.status)
    order = [s for k, s in enumerate(seen) if k == 0 or s is not seen[k - 1]]
    assert order[-2:] == [Status.BRAKING, Status.HOLDING]
    assert Status.STEERED in order
    decisions = [step(0.8, 0.0, Obstacles()) for _ in range(40)]
    assert decisions[-1].status is Status.TRACKING


def energy(obstacles, pose, strength, reach):
    """U of all obstacles by the oracles' distances, at a pose."""
    seen, vertices = obstacles.seen_from(pose), MIR.footprint.vertices
    distances = [point_distance(vertices, p) for p in seen.points]
    distances += [point_distance(vertices, d[:2]) - d[2] for d in seen.discs]
    distances += [wall_distance(vertices, w) for w in seen.walls]
    return sum(
        0.5 * strength * (1.0 / d - 1.0 / reach) ** 2 for d in distances if d < reach
    )


@given(seed=seeds)
def test_the_force_is_the_gradient_of_the_potential(seed):
    obstacles, reach, h = standing(np.random.default_rng(seed)), 0.8, 1e-6
    edges, arrays = MIR.footprint.edges, obstacles.arrays
    table = empty_contacts(edges, arrays)
    count, _ = contact_table(edges, MIR.limit_vector[8], arrays, reach, table)
    found = apf.whole_force(table[: count * CONTACT_SIZE], 0.02, reach)
    for value, (x, y) in zip(found, ((h, 0.0), (0.0, h)), strict=True):
        before = energy(obstacles, (-x, -y, 0.0), 0.02, reach)
        after = energy(obstacles, (x, y, 0.0), 0.02, reach)
        slope = (after - before) / (2 * h)
        assert value == pytest.approx(-slope, abs=1e-5, rel=1e-4)


def test_the_force_ends_at_its_reach_and_stays_finite_at_contact():
    assert apf.force(0.5, 1.0, 0.5) == 0.0
    at_contact = apf.force(0.0, 1.0, 0.5)
    assert at_contact == apf.force(-1.0, 1.0, 0.5) == (50 - 2) * 2500


@given(seed=seeds, heading=st.floats(-7, 7))
def test_the_histogram_is_that_of_rays(seed, heading):
    """A sector is as bad as the nearest cell whose circle its ray meets."""
    rng = np.random.default_rng(seed)
    cells = np.column_stack([rng.uniform(-3, 3, (12, 2)), rng.uniform(0, 0.5, 12)])
    radius, reach, found = 0.5, 2.0, np.empty(SECTORS)
    vfh.polar_histogram(cells, radius, reach, heading, found)
    for k in range(SECTORS):
        angle = 2 * math.pi * k / SECTORS - heading
        ray = np.array([math.cos(angle), math.sin(angle)])
        worst, doubtful = 0.0, False
        for x, y, wide in cells:
            away = math.hypot(x, y)
            along = ray @ (x, y)
            aside = math.sqrt(max(away * away - along * along, 0.0))
            meets = along >= 0.0 and (aside <= radius + wide or away <= radius + wide)
            doubtful |= abs(aside - radius - wide) < 1e-6 or abs(along) < 1e-6
            distance = max(away - wide, 0.0)
            if meets and distance < reach:
                worst = max(worst, 1.0 - (distance / reach) ** 2)
        assert doubtful or found[k] == pytest.approx(worst)


def test_what_lies_on_the_tightest_turn_bars_what_is_behind_it():
    beside = np.array([[0.3, 0.9, 0.0]])
    bearing = math.atan2(0.9, 0.3)
    assert vfh.reachable(beside, 0.5, 2.0, 0.4) == (bearing, math.pi)
    beside[0, 1] *= -1.0
    assert vfh.reachable(beside, 0.5, 2.0, 0.4) == (math.pi, bearing)
    assert vfh.reachable(beside, 0.5, 2.0, 0.0) == (math.pi, math.pi)
    assert vfh.reachable(beside, 0.5, 0.9, 0.4) == (math.pi, math.pi)


def openings(blocked):
    """All runs of free sectors: lists of sectors in a row."""
    n, runs = len(blocked), []
    for k in range(n):
        if not blocked[k] and blocked[k - 1]:
            runs.append([k])
            while not blocked[(runs[-1][-1] + 1) % n]:
                runs[-1].append(runs[-1][-1] + 1)
    return runs


@given(
    blocks=st.lists(st.tuples(st.integers(0, 71), st.integers(1, 30)), max_size=4),
    ways=st.tuples(*[st.floats(0, 71.9)] * 3),
)
def test_the_cheapest_opening_is_chosen(blocks, ways):
    blocked = np.zeros(SECTORS, dtype=bool)
    for first, length in blocks:
        blocked[np.arange(first, first + length) % SECTORS] = True
    found, target = vfh.choose(blocked.astype(float), *ways), ways[0]
    if not blocked.any():
        assert found == target
        return
    candidates = []
    for opening in openings(blocked):
        first, last = opening[0], opening[-1]
        if len(opening) <= WIDE:
            candidates.append((first + last) / 2)
        else:
            right, left = first + WIDE / 2, last - WIDE / 2
            turned = [target + k * SECTORS for k in (-1, 0, 1, 2)]
            candidates += [right, left, *[t for t in turned if right <= t <= left]]

    def cost(way):
        turns = [2 * math.pi * (way - other) / SECTORS for other in ways]
        off = [abs(math.atan2(math.sin(t), math.cos(t))) for t in turns]
        return np.dot(vfh.COSTS, off) * SECTORS / (2 * math.pi)

    if not candidates:
        assert found == -1.0
    else:
        assert cost(found) == pytest.approx(min(map(cost, candidates)), abs=1e-6)


def test_a_robot_that_is_shut_in_holds():
    ring = [[math.cos(a), math.sin(a)] for a in np.linspace(0, 6.28, 40)]
    obstacles = Obstacles(points=ring)
    assert start("vfh")(0.5, 0.0, obstacles).status is Status.HOLDING
    moving = start("vfh", HEAVY, 0.5, 0.0)(0.5, 0.0, obstacles)
    assert moving.status is Status.BRAKING and 0.0 < moving.v < 0.5


@given(seed=seeds)
def test_the_window_holds_what_a_rollout_admits_and_its_best(seed):
    rng = np.random.default_rng(seed)
    obstacles, driven = standing(rng), (0.4, rng.uniform(-1, 1))
    window = dwa.Window(
        Baseline(HEAVY, AvoidanceSettings(dt=DT)).setup,
        obstacles.arrays,
        weights=(1.0, 0.5, 0.3),
        look=0.6,
        reach=1.5,
        margin=0.05,
        target=tuple(rng.uniform(-3, 3, 2).tolist()),
        driven=driven,
        pace=0.8,
    )
    best, v, omega = dwa.best_twist(window)
    scores = []
    low, high, omega_low, omega_high = twist_box(HEAVY.limit_vector, *driven, DT)
    for each in np.linspace(max(low, 0.0), min(high, 0.8), dwa.SPEEDS_TRIED):
        for rate in np.linspace(omega_low, omega_high, dwa.RATES_TRIED):
            score = dwa.judge(window, (each, rate), -math.inf)
            scores.append(score)
    assert best == pytest.approx(max(scores), abs=1e-9)
    if best == -math.inf:
        return
    rest = stopping_time(HEAVY.limit_vector, v, omega, DT)
    for time in np.linspace(0.0, rest, 100):
        assert clearance(obstacles, arc(0.0, 0.0, 0.0, v, omega, time)) > 0.05 - 2e-3
