"""The safety filter as a user meets it: answers, statuses, symmetries, bad input."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from oracles import exact_answer, point_distance
from qpavoid.avoidance.decision import AT_REST, Decision, Status, blocked_if
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from shapes import ROBOT, SAFETY, scene

seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-2, 2), st.floats(-3, 3)


def present(**settings):
    """The filter that does not look ahead."""
    return SafetyFilter(ROBOT, AvoidanceSettings(**settings), ahead=False)


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
    assert SAFETY.filter(0.6, 0.1, Obstacles())[:7] == plain[:7]


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
    decision = SAFETY.filter(0.0, 0.0, Obstacles(discs=disc, disc_velocities=velocity))
    assert decision.v > 0.1 and decision.status is Status.FILTERED
    away = SAFETY.filter(0.0, 0.0, Obstacles(discs=disc, disc_velocities=[[-0.3, 0.0]]))
    assert away[:3] == (0.0, 0.0, Status.TRACKING)


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
        decision = SAFETY.filter(
            0.3, 0.1, Obstacles(discs=disc, disc_velocities=velocity)
        )
        assert decision.status is Status.RELAXED
        assert decision.slack == pytest.approx(2 * (0.23 - 0.11) + 0.5)
        assert decision[:2] == pytest.approx((0.3, 0.1))


def test_active_numbers_points_then_discs_then_walls():
    far = [5.0, 5.0]
    point, disc = [[0.85, 0.0]], [[0.95, 0.0, 0.1]]
    wall = [[0.9, -2.0, 0.9, 2.0]]
    assert SAFETY.filter(1.0, 0.0, points=[far, *point]).active == (1,)
    decision = SAFETY.filter(
        1.0, 0.0, Obstacles(points=[far], discs=[[5, 5, 1], *disc])
    )
    assert decision.active == (2,)
    walls = [[9, 9, 9, 8], *wall]
    seen = Obstacles(points=[far], discs=[[5, 5, 1]], walls=walls)
    decision = SAFETY.filter(1.0, 0.0, seen)
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


@given(seeds, speeds, turns)
def test_points_discs_of_no_radius_and_walls_of_no_length_are_the_same(seed, v, omega):
    points = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, 2))
    assume(min(point_distance(ROBOT.footprint.vertices, p) for p in points) > 1e-3)
    one = SAFETY.filter(v, omega, points)
    discs = SAFETY.filter(
        v, omega, Obstacles(discs=np.column_stack([points, np.zeros(3)]))
    )
    walls = SAFETY.filter(v, omega, Obstacles(walls=np.hstack([points, points])))
    assert discs[:6] == one[:6]
    assert walls[:2] == pytest.approx(one[:2], abs=1e-7)


@given(seeds, speeds, turns)
def test_filtering_twice_is_filtering_once(seed, v, omega):
    obstacles = scene(np.random.default_rng(seed))
    once = SAFETY.filter(v, omega, Obstacles(**obstacles))
    twice = SAFETY.filter(once.v, once.omega, Obstacles(**obstacles))
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
    first = SAFETY.filter(0.8, 0.1, Obstacles(**obstacles))
    SAFETY.filter(-1.0, 1.0, points=np.random.default_rng(0).normal(size=(50, 2)))
    assert SAFETY.filter(0.8, 0.1, Obstacles(**obstacles))[:7] == first[:7]


def test_settings_and_robots_are_what_is_used():
    tight = present(radius=SafetyRadius(0.0, 0.0))
    ahead = [[0.75, 0.0]]
    assert tight.filter(1.0, 0.0, ahead).v > SAFETY.filter(1.0, 0.0, ahead).v
    small = Robot("small", Footprint.rectangle(0.2, 0.2), Limits.symmetric(0.3, 0.5))
    decision = SafetyFilter(small).filter(9.0, 9.0, points=ahead)
    assert decision[:2] == pytest.approx((0.3, 0.5))
    assert decision.clearance == pytest.approx(0.65)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("v", "omega", "stands"),
    [
        (0.0, 0.0, True),
        (0.9 * AT_REST, 0.9 * AT_REST, True),
        (AT_REST, 0.0, False),
        (0.0, AT_REST, False),
    ],
)
def test_blocked_is_said_of_what_stands(v, omega, stands, sign):
    made = Decision(sign * v, sign * omega, Status.HOLDING, 0.3, 0.0, 0.0, (), 0.0)
    assert blocked_if(made, False) == made
    found = blocked_if(made, True)
    assert (found.status is Status.BLOCKED) == stands
    assert found._replace(status=made.status) == made
