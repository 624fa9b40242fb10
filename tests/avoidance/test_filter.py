"""The safety filter as a user meets it: answers, statuses, symmetries, bad input."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from oracles import exact_answer, point_distance
from qpavoid.avoidance.decision import SENTENCES, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.qp.solve import solve
from shapes import ROBOT, SAFETY, scene

seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-2, 2), st.floats(-3, 3)


def present(**settings):
    """The filter that does not look ahead."""
    return SafetyFilter(ROBOT, AvoidanceSettings(**settings), ahead=False)


# ------------------------------------------------------------- without obstacles
@given(speeds, turns)
def test_without_obstacles_only_the_limits_act(v, omega):
    decision = SAFETY.filter(v, omega)
    clipped = (min(max(v, -1), 1), min(max(omega, -1.5), 1.5))
    assert decision[:2] == pytest.approx(clipped, rel=1e-15, abs=1e-300)
    assert decision.clearance == math.inf
    assert decision.slack == decision.residual == 0 and decision.active == ()
    within = abs(v) <= 1 and abs(omega) <= 1.5
    assert decision.status is (Status.TRACKING if within else Status.FILTERED)


@pytest.mark.parametrize("nothing", [[], (), np.empty((0, 2)), np.empty(0)], ids=repr)
def test_empty_input_means_no_obstacles(nothing):
    plain = SAFETY.filter(0.6, 0.1)
    assert SAFETY.filter(0.6, 0.1, nothing)[:7] == plain[:7]
    assert SAFETY.filter(0.6, 0.1, [], [], [], [])[:7] == plain[:7]


# ----------------------------------------------------------------- right answers
@given(seeds, speeds, turns)
def test_filter_solves_its_problem(seed, v, omega):
    """Filter, problem + solve, and exact fractions agree."""
    obstacles = scene(np.random.default_rng(seed), size=1)
    obstacles["walls"] = obstacles["walls"][:1]
    decision = SAFETY.filter(v, omega, **obstacles)
    problem = SAFETY.problem(v, omega, **obstacles)
    assert_array_equal(problem.desired, [v, omega])
    solution = solve(problem)
    assert decision[:2] == pytest.approx(solution.u, abs=1e-12)
    assert decision.slack == pytest.approx(solution.slack, abs=1e-12)
    assert (decision.status is Status.RELAXED) == (solution.status == "relaxed")
    rows = np.unique(np.column_stack([problem.A, problem.b]), axis=0)
    if len(rows) == len(problem.b) <= 6 and (np.hypot(*problem.A.T) > 1e-6).all():
        u, slack = exact_answer(problem)
        assert decision[:2] == pytest.approx(u, abs=1e-6)
        assert decision.slack == pytest.approx(slack, abs=1e-9)


@given(seeds, speeds, turns)
def test_twist_is_admissible_and_keeps_its_rows(seed, v, omega):
    obstacles = scene(np.random.default_rng(seed))
    decision = SAFETY.filter(v, omega, **obstacles)
    assert abs(decision.v) <= 1.0 and abs(decision.omega) <= 1.5
    problem = SAFETY.problem(v, omega, **obstacles)
    assert decision.status is not Status.STOPPED
    assert decision.residual <= 1e-6
    if len(problem.b):
        violation = (problem.b - problem.A @ decision[:2]).max()
        assert violation <= decision.slack + 1.001e-3 * (decision.slack > 0) + 1e-9


@given(seeds)
def test_clearance_is_the_distance_to_the_nearest(seed):
    points = np.random.default_rng(seed).uniform(-3, 3, (5, 2))
    least = min(point_distance(ROBOT.footprint.vertices, p) for p in points)
    assert SAFETY.filter(0.0, 0.0, points).clearance == pytest.approx(least, abs=1e-12)


def test_the_robot_brakes_before_a_point_ahead_by_hand():
    """Apex at 0.688 m: γ (d − r_min) = 2 (0.212 − 0.17) m/s is what it may drive."""
    apex = 0.445 + 0.29 * math.tan(math.radians(40))
    dear = present(weights=(1.0, 100.0))
    decision = dear.filter(1.0, 0.0, points=[[0.9, 0.0]])
    assert decision.v == pytest.approx(2 * (0.9 - apex - 0.17), abs=1e-9)
    assert decision.omega == pytest.approx(0.0, abs=1e-9)
    assert decision.status is Status.FILTERED and decision.active == (0,)


def test_a_parked_robot_steps_aside():
    """An obstacle approaches from behind: it drives on, not to be touched."""
    disc, velocity = [[-0.8, 0.0, 0.1]], [[0.3, 0.0]]
    decision = SAFETY.filter(0.0, 0.0, discs=disc, disc_velocities=velocity)
    assert decision.v > 0.1 and decision.status is Status.FILTERED
    away = SAFETY.filter(0.0, 0.0, discs=disc, disc_velocities=[[-0.3, 0.0]])
    assert away[:3] == (0.0, 0.0, Status.TRACKING)


@pytest.mark.parametrize("place", [(0.3, 0.1), (-0.4, 0.0), (0.6, 0.02), (0.1, -0.25)])
def test_points_inside_have_a_negative_clearance_and_are_left(place):
    """The distance grows along the answer: it moves out, not deeper in."""
    decision = SAFETY.filter(0.0, 0.0, points=[place])
    assert decision.clearance < 0
    assert decision.status in (Status.FILTERED, Status.RELAXED)
    assert decision.v != 0.0 or decision.omega != 0.0
    pose = arc(0.0, 0.0, 0.0, decision.v, decision.omega, 1e-3)
    seen = Obstacles(points=[place]).seen_from(pose).points[0]
    assert point_distance(ROBOT.footprint.vertices, seen) > decision.clearance


def test_the_middle_of_the_robot_is_a_defined_case():
    decision = SAFETY.filter(0.5, 0.2, points=[[0.0, 0.0]])
    assert np.isfinite(decision[:2]).all() and decision.clearance < 0


# -------------------------------------------------------------------- statuses
def test_each_status_with_its_sentence():
    wall = [[0.9, -2.0, 0.9, 2.0]]
    squeezed = [[0.75, 0.0], [-0.50, 0.2], [-0.50, -0.2]]
    cases = {
        Status.TRACKING: SAFETY.filter(-0.2, 0.0, walls=wall),
        Status.FILTERED: SAFETY.filter(0.9, 0.0, walls=wall),
        Status.RELAXED: SAFETY.filter(0.2, 0.0, points=squeezed),
    }
    for status, decision in cases.items():
        assert decision.status is status
        assert status.sentence.endswith(".") and " " in status.sentence
        assert (decision.slack > 0) == (status is Status.RELAXED)
        assert decision.solve_time_s > 0
    assert set(SENTENCES) == set(Status)
    assert cases[Status.TRACKING][:2] == (-0.2, 0.0)


def test_relaxed_reports_the_least_slack():
    """Point ahead and behind, both 0.06 m off: neither can be given 0.17 m."""
    squeezed = [[0.748, 0.0], [-0.505, 0.0]]
    decision = SAFETY.filter(0.5, 0.0, points=squeezed)
    problem = SAFETY.problem(0.5, 0.0, points=squeezed)
    u, slack = exact_answer(problem)
    assert decision.status is Status.RELAXED
    assert decision.slack == pytest.approx(slack, abs=1e-9)
    assert slack == pytest.approx(2 * (0.17 - 0.06), abs=2e-3)
    assert decision[:2] == pytest.approx(u, abs=1e-6)


def test_abeam_of_the_axle_nothing_helps_and_that_is_said():
    """The row is null: relaxed, with the whole need as slack, not thrown about."""
    for bearing in (1, -1):
        disc, velocity = [[0.0, bearing * 0.5, 0.1]], [[0.0, -bearing * 0.5]]
        decision = SAFETY.filter(0.3, 0.1, discs=disc, disc_velocities=velocity)
        assert decision.status is Status.RELAXED
        assert decision.slack == pytest.approx(2 * (0.23 - 0.11) + 0.5)
        assert decision[:2] == pytest.approx((0.3, 0.1))


# -------------------------------------------------------- who holds the twist
def test_active_numbers_points_then_discs_then_walls():
    far = [5.0, 5.0]
    point, disc = [[0.85, 0.0]], [[0.95, 0.0, 0.1]]
    wall = [[0.9, -2.0, 0.9, 2.0]]
    assert SAFETY.filter(1.0, 0.0, points=[far, *point]).active == (1,)
    decision = SAFETY.filter(1.0, 0.0, points=[far], discs=[[5, 5, 1], *disc])
    assert decision.active == (2,)
    decision = SAFETY.filter(
        1.0, 0.0, [far], [[5, 5, 1]], [[0, 0]], [[9, 9, 9, 8], *wall]
    )
    assert set(decision.active) == {3}
    assert SAFETY.filter(-0.1, 0.0, points=point).active == ()


@given(seeds, speeds, turns)
def test_active_obstacles_are_exactly_those_that_matter(seed, v, omega):
    """The answer stays if only the active ones are kept."""
    points = np.random.default_rng(seed).uniform(-1.5, 1.5, (6, 2))
    decision = SAFETY.filter(v, omega, points)
    assume(decision.status is Status.FILTERED)
    assert len(decision.active) <= 2 and len(set(decision.active)) == len(
        decision.active
    )
    alone = SAFETY.filter(v, omega, points[list(decision.active)])
    assert alone[:2] == pytest.approx(decision[:2], abs=1e-9)


# --------------------------------------------------------------------- symmetries
@given(seeds, speeds, turns)
def test_mirror_image(seed, v, omega):
    obstacles = scene(np.random.default_rng(seed))
    mirrored = {
        "points": obstacles["points"] * [1, -1],
        "discs": obstacles["discs"] * [1, -1, 1],
        "disc_velocities": obstacles["disc_velocities"] * [1, -1],
        "walls": obstacles["walls"] * [1, -1, 1, -1],
    }
    one = SAFETY.filter(v, omega, **obstacles)
    other = SAFETY.filter(v, -omega, **mirrored)
    assert other[:2] == pytest.approx((one.v, -one.omega), abs=1e-6)
    assert other.status is one.status
    assert other.clearance == pytest.approx(one.clearance, abs=1e-12)


@given(seeds, speeds, turns)
def test_a_far_obstacle_changes_nothing(seed, v, omega):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.5, 1.5, (3, 2))
    bearing = rng.uniform(-math.pi, math.pi)
    far = [[50 * math.cos(bearing), 50 * math.sin(bearing)]]
    near = SAFETY.filter(v, omega, points)
    more = SAFETY.filter(v, omega, np.vstack([points, far]))
    assert more[:7] == near[:7]


@given(seeds, speeds, turns)
def test_order_and_repetition_of_obstacles_do_not_matter(seed, v, omega):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.5, 1.5, (5, 2))
    shuffled = rng.permutation(np.repeat(points, 2, axis=0))
    one, other = SAFETY.filter(v, omega, points), SAFETY.filter(v, omega, shuffled)
    assert other[:2] == pytest.approx(one[:2], abs=1e-7)
    assert (other.status, other.clearance) == (one.status, one.clearance)


@given(seeds, speeds, turns)
def test_points_discs_of_no_radius_and_walls_of_no_length_are_the_same(seed, v, omega):
    points = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, 2))
    assume(min(point_distance(ROBOT.footprint.vertices, p) for p in points) > 1e-3)
    one = SAFETY.filter(v, omega, points)
    discs = SAFETY.filter(v, omega, discs=np.column_stack([points, np.zeros(3)]))
    walls = SAFETY.filter(v, omega, walls=np.hstack([points, points]))
    assert discs[:6] == one[:6]
    assert walls[:2] == pytest.approx(one[:2], abs=1e-7)


@given(seeds, speeds, turns)
def test_filtering_twice_is_filtering_once(seed, v, omega):
    obstacles = scene(np.random.default_rng(seed))
    once = SAFETY.filter(v, omega, **obstacles)
    twice = SAFETY.filter(once.v, once.omega, **obstacles)
    assert twice[:2] == pytest.approx(once[:2], abs=1e-6)


def test_weights_choose_between_turning_and_braking():
    obstacle = [[0.95, 0.05]]
    braking, turning = (
        present(weights=(1.0, w)).filter(0.8, 0.0, points=obstacle)
        for w in (100.0, 0.001)
    )
    assert turning.v > braking.v
    assert turning.omega < -0.1 and abs(braking.omega) < 0.05


def test_the_present_alone_needs_no_memory():
    obstacles = {"points": [[0.85, 0.1]]}
    first = SAFETY.filter(0.8, 0.1, **obstacles)
    SAFETY.filter(-1.0, 1.0, points=np.random.default_rng(0).normal(size=(50, 2)))
    assert SAFETY.filter(0.8, 0.1, **obstacles)[:7] == first[:7]


def test_settings_and_robots_are_what_is_used():
    tight = present(radius=SafetyRadius(0.0, 0.0))
    ahead = [[0.75, 0.0]]
    assert tight.filter(1.0, 0.0, ahead).v > SAFETY.filter(1.0, 0.0, ahead).v
    small = Robot("small", Footprint.rectangle(0.2, 0.2), Limits.symmetric(0.3, 0.5))
    decision = SafetyFilter(small).filter(9.0, 9.0, points=ahead)
    assert decision[:2] == pytest.approx((0.3, 0.5))
    assert decision.clearance == pytest.approx(0.65)
