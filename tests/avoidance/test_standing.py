"""Theorem 1 of qpavoid.avoidance.judge: what stands still is never driven into."""

import math
from dataclasses import replace

import numpy as np
import pytest

from driven import driven_to, gap_at, least_in_all, lines_of, lines_of_world
from hostile import LIMITS, R_MIN, ROBOT, Case, epsilon, make_demands, make_scene
from oracles import point_distance, wall_distance
from qpavoid.avoidance.decision import BRAKING, HOLDING, RELAXED, STATUSES, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.obstacles import Obstacles
from shapes import UNIONS

EPSILON = epsilon(R_MIN)
REST = (0.0, 0.0, 0.0)
AWAY = (Status.RELAXED, Status.FILTERED, Status.TRACKING, Status.PLANNED)
STEPS = (0.02, 0.05, 0.1)
limits = pytest.mark.parametrize("limits", LIMITS)
steps = pytest.mark.parametrize("dt", STEPS)
aheads = pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])


def holds(case, scenes, seed):
    """Run a study, and hold it to the theorem; return how often each status came."""
    outcomes, counts = case.study(scenes, seed)
    least, excess, lies = outcomes.T
    assert least.min() >= case.r_min - epsilon(case.r_min)
    assert excess.max() <= 1e-9
    assert lies.sum() == 0
    return counts


@limits
@steps
@aheads
@pytest.mark.parametrize("count", [60, pytest.param(10_000, marks=pytest.mark.slow)])
def test_nothing_that_stands_is_touched(limits, dt, ahead, count):
    """Slow: 10,000 scenes for every robot and step; looking ahead, a fifth of them."""
    holds(Case(limits, dt, ahead), count // 5 if ahead else count, seed=count)


@limits
@steps
@aheads
@pytest.mark.parametrize("count", [20, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("r_min", [0.02, 0.005, 0.001])
def test_a_small_radius_is_kept_too(r_min, count, ahead, dt, limits):
    """With a steep barrier, that asks for more deceleration than there is."""
    case = Case(limits, dt, ahead, r_min=r_min, gamma=10.0)
    holds(case, count // 4 if ahead else count, seed=3)


@steps
@aheads
@pytest.mark.parametrize("count", [20, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("footprint", UNIONS.values(), ids=UNIONS)
def test_nothing_that_stands_is_touched_by_any_part(footprint, count, ahead, dt):
    case = Case("wheels", dt, ahead, footprint=footprint)
    holds(case, count // 2 if ahead else count, seed=5)


@aheads
@pytest.mark.parametrize("count", [8, pytest.param(300, marks=pytest.mark.slow)])
def test_a_footprint_changes_at_rest_and_is_kept_from_then_on(count, ahead):
    """Obstacles inside r_min of a larger one are never nearer than at that moment."""
    case, near, rng = Case("accelerations", 0.05, ahead), 0, np.random.default_rng(13)
    safety = SafetyFilter(case.robot, case.settings, ahead=ahead)
    for _ in range(count):
        world, pose = make_scene(rng, most=1.5), REST
        lines = lines_of_world(world)
        for footprint in rng.permutation([ROBOT.footprint, *UNIONS.values()]):
            safety.reset()
            safety.footprint, trace = footprint, []
            gaps = [gap_at(x, pose, one, 0.0) for x in footprint.parts for one in lines]
            for v, omega in make_demands(rng, 40, case.dt)[0]:
                decision = safety.filter(v, omega, world.seen_from(pose))
                trace.append((*pose, *decision[:2]))
                pose = driven_to(pose, *decision[:2], case.dt)
            known = np.array(trace), case.dt, lines
            least = min(least_in_all(part, *known) for part in footprint.parts)
            assert least >= min(*gaps, R_MIN) - EPSILON
            near += min(gaps) < R_MIN
    assert near >= count // 2


@steps
def test_without_room_to_brake_r_min_is_passed_and_walls_are_hit(dt):
    """So that the tests above are known to bite."""
    for r_min, gamma, seed in ((R_MIN, 2.0, 1), (0.02, 10.0, 3)):
        case = Case("accelerations", dt, False, False, r_min, gamma)
        outcomes, _ = case.study(100, seed)
        assert (outcomes[:, 0] < r_min - 0.01).sum() > 0
    assert (outcomes[:, 0] < 0.0).sum() > 0


def test_a_long_siege_wears_nothing_away():
    """Ten minutes at full rate against one obstacle: the tolerance does not add up."""
    case, steps = Case("accelerations", 0.02), 30_000
    rng = np.random.default_rng(4)
    for world in (
        Obstacles(points=[[1.0, 0.2]]),
        Obstacles(walls=[[-2.0, 0.7, 2.0, 0.6]], discs=[[-0.9, -0.2, 0.1]]),
    ):
        demands, hunted = make_demands(rng, steps, case.dt)
        outcome, _, _ = case.drive(world, demands, np.ones_like(hunted))
        assert outcome.least >= R_MIN - EPSILON
        outcome, _, _ = case.drive(world, demands, hunted)
        assert outcome.least >= R_MIN - EPSILON


def brute_distance(pose, world):
    """The least distance to anything in the world, by the oracles."""
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    outline = ROBOT.footprint.vertices @ np.array([[c, s], [-s, c]]) + (x, y)
    places = [(p, 0.0) for p in world.points] + [(d[:2], d[2]) for d in world.discs]
    gaps = [point_distance(outline, p) - radius for p, radius in places]
    return min(gaps + [wall_distance(outline, wall) for wall in world.walls])


@limits
@aheads
def test_from_below_r_min_it_never_comes_nearer(limits, ahead):
    """At rest nearer than r_min, then driven hostilely: never nearer than that."""
    case, rng, met = Case(limits, 0.05, ahead), np.random.default_rng(6), 0
    for _ in range(15 if ahead else 60):
        world = make_scene(rng, least=0.005, most=1.0)
        start = brute_distance(REST, world)
        outcome, _, _ = case.drive(world, *make_demands(rng, 60, case.dt))
        assert outcome.least >= min(start, R_MIN) - EPSILON
        assert outcome.excess <= 1e-9 and outcome.lies == 0
        met += start < R_MIN
    assert met > 5


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("v", [0.3, -0.3])
@pytest.mark.parametrize("noise", [0.0, 0.004])
def test_along_a_wall_of_points_inside_r_min_it_drives_on(noise, v, side):
    """As along the same wall as a segment, whatever its points and the start."""
    rng, case = np.random.default_rng(12), Case(dt=0.05, ahead=True, r_min=0.1)
    for _ in range(6):
        gap, spacing = rng.uniform(0.02, 0.098), rng.uniform(0.01, 0.1)
        x = np.arange(-4.0, 4.0, spacing) + rng.uniform(0.0, spacing)
        wall = np.column_stack([x, np.full(len(x), side * (0.29 + gap))])
        safety, pose, trace = SafetyFilter(case.robot, case.settings), REST, []
        for _ in range(100):
            seen = wall + rng.normal(0.0, 1.0, wall.shape) * noise
            world = Obstacles(points=seen).seen_from(pose)
            trace.append((*pose, *safety.filter(v, 0.0, world)[:2]))
            pose = driven_to(pose, *trace[-1][3:], case.dt)
        lines = lines_of(points=wall)
        least = least_in_all(ROBOT.footprint.vertices, np.array(trace), case.dt, lines)
        assert abs(pose[0]) > (1.4 if noise == 0.0 else 0.8)
        assert least >= gap - 1e-6 - 3.0 * noise


def test_what_stands_out_of_a_wall_inside_r_min_keeps_r_min():
    case = Case(dt=0.05, ahead=True, r_min=0.1)
    x, pose = np.arange(-3.0, 3.0, 0.02), REST
    wall = np.column_stack([x, np.full(len(x), 0.29 + 0.05)])
    for post in ((2.0, 0.0), (2.0, 0.28), (2.0, -0.3)):
        world = Obstacles(points=np.vstack([wall, post]))
        safety, pose = SafetyFilter(case.robot, case.settings), REST
        for _ in range(200):
            decision = safety.filter(0.5, 0.0, world.seen_from(pose))
            pose = driven_to(pose, *decision[:2], case.dt)
        alone = Obstacles(points=[post])
        assert pose[0] > 0.8
        assert 0.1 - 0.016 <= brute_distance(pose, alone) < 0.4


@limits
@aheads
def test_in_contact_it_moves_away_or_holds(limits, ahead):
    """Whatever is wanted: out of the obstacle, or stay."""
    case, rng, statuses = Case(limits, 0.05, ahead), np.random.default_rng(7), set()
    safety = SafetyFilter(case.robot, case.settings, ahead=ahead)
    for _ in range(100):
        world = Obstacles(
            points=rng.uniform([-0.4, -0.28], [0.4, 0.28], (rng.integers(1, 3), 2)),
            walls=rng.uniform(-2, 2, (rng.integers(0, 2), 4)),
        )
        safety.reset()
        decision = safety.filter(*rng.uniform(-2, 2, 2), world)
        statuses.add(decision.status)
        u = decision[:2]
        assert decision.clearance < 0.0
        assert decision.clearance == pytest.approx(along(case, REST, (0, 0), world))
        if u == (0.0, 0.0):
            assert decision.status in (Status.HOLDING, Status.RELAXED)
            continue
        assert decision.status in AWAY
        assert along(case, REST, u, world) >= decision.clearance - 1e-7
        after = driven_to(REST, *u, case.dt)
        assert along(case, after, (0.0, 0.0), world) > decision.clearance
    assert Status.RELAXED in statuses


def along(case, pose, twist, world):
    """The least distance while a twist is driven for a control step."""
    trace = np.array([[*pose, *twist]])
    lines = lines_of_world(world)
    return least_in_all(ROBOT.footprint.vertices, trace, case.dt, lines)


def stop_from(case, pose, v, omega, world):
    """The least distance while braking from a twist; a formula of its own."""
    a, alpha = case.robot.limits.acceleration, case.robot.limits.angular_acceleration
    n = max(
        1, math.ceil(max(abs(v) / (a * case.dt), abs(omega) / (alpha * case.dt)) - 1e-9)
    )
    least = along(case, pose, (0.0, 0.0), world)
    for k in range(1, n):
        u = v * (1 - k / n), omega * (1 - k / n)
        least = min(least, along(case, pose, u, world))
        pose = driven_to(pose, *u, case.dt)
    return least


@limits
@steps
@aheads
def test_never_worse_than_braking_at_once(limits, dt, ahead):
    """From any twist at any distance: drive the answer and then brake, or brake.

    Looking ahead, the answer may be the beginning of another plan than to brake.
    """
    case, rng = Case(limits, dt, ahead), np.random.default_rng(8)
    safety = SafetyFilter(case.robot, case.settings, ahead=ahead)
    given = np.zeros(len(STATUSES), dtype=int)
    for _ in range(60):
        world = make_scene(rng, least=0.005, most=1.0)
        safety.reset(*rng.uniform([-0.25, -0.7], [0.5, 0.7]))
        last = safety._engine.state[:2].copy()
        decision = safety.filter(*rng.uniform(-2, 2, 2), world)
        given[STATUSES.index(decision.status)] += 1
        u = decision[:2]
        braked = stop_from(case, REST, *last, world)
        least = along(case, REST, u, world)
        if not ahead or STATUSES.index(decision.status) in (BRAKING, HOLDING):
            least = min(least, stop_from(case, driven_to(REST, *u, dt), *u, world))
        assert least >= min(braked, R_MIN - EPSILON) - 1e-7
    assert given[RELAXED] + given[BRAKING] + given[HOLDING] > 0


@aheads
def test_the_desired_twist_is_never_passed_on_where_it_is_not_admissible(ahead):
    """``tracking`` means: the twist itself keeps rows, limits and room to stop."""
    case, rng, tracked = (
        Case("accelerations", 0.05, ahead),
        np.random.default_rng(10),
        0,
    )
    safety = SafetyFilter(case.robot, case.settings, ahead=ahead)
    for _ in range(200):
        world = make_scene(rng, most=1.5)
        last = rng.uniform([-0.3, -0.7], [0.3, 0.7])
        wish = last + rng.uniform(-0.15, 0.15, 2)
        safety.reset(*last)
        problem = safety.problem(*wish, world)
        decision = safety.filter(*wish, world)
        if decision.status is Status.TRACKING:
            tracked += 1
            assert decision[:2] == tuple(wish)
            assert decision.slack == decision.shortfall == 0.0
            assert (problem.A @ wish >= problem.b - 1e-8).all()
            assert (np.abs(wish - last) <= np.array([2.0, 2.5]) * case.dt + 1e-9).all()
            after = stop_from(case, driven_to(REST, *wish, case.dt), *wish, world)
            braked = stop_from(case, REST, *last, world)
            assert after >= min(R_MIN - EPSILON, braked - 1e-7)
        elif decision.status in (Status.BRAKING, Status.HOLDING, Status.STOPPED):
            assert decision[:2] != tuple(wish)
    assert 20 < tracked < 190


SLOW = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=0.5, angular_acceleration=1.0)
)
DT = 0.05


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@pytest.mark.parametrize("r_min", [0.17, 0.02])
@pytest.mark.parametrize("speed", [0.009, 0.011, 0.05, 0.09])
def test_who_drives_at_what_creeps_does_not_touch_it(speed, r_min, ahead):
    """At 1 m/s, with 0.5 m/s², straight or in a curve, wherever it comes from."""
    settings = AvoidanceSettings(SafetyRadius(r_min, r_min), dt=DT)
    for k in range(12):
        rng = np.random.default_rng([7, k])
        turn, wish = rng.uniform(-math.pi, math.pi), (1.0, rng.choice([0.0, 0.3, -0.5]))
        place = rng.uniform([1.2, -0.4], [2.5, 0.4])
        velocity = speed * np.array([math.cos(turn), math.sin(turn)])
        if k % 2:
            velocity = -speed * place / np.hypot(*place)
        safety, pose, trace = SafetyFilter(SLOW, settings, ahead=ahead), (0.0,) * 3, []
        for step in range(80):
            disc = [[*(place + step * DT * velocity), 0.1]]
            world = Obstacles(discs=disc, disc_velocities=[velocity])
            decision = safety.filter(*wish, world.seen_from(pose))
            trace.append((*pose, decision.v, decision.omega))
            pose = driven_to(pose, decision.v, decision.omega, DT)
        lines = lines_of(discs=[[*place, 0.1]], velocities=[velocity])
        moving = np.abs(np.array(trace)[:, 3:]).max(axis=1) > 1e-9
        last = 1 + (np.flatnonzero(moving)[-1] if moving.any() else 0)
        trace = np.array(trace)[:last]
        assert least_in_all(SLOW.footprint.vertices, trace, DT, lines) > 0.0
