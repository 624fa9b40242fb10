"""The safety filter as a user meets it: answers, statuses, symmetries, bad input."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from driven import driven_to
from oracles import exact_answer, point_distance
from qpavoid.avoidance.cbf_rows import R_MIN_TOLERANCE
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import Actuation, AvoidanceSettings, SafetyRadius
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, SAFETY, scene

DT, R_MIN = AvoidanceSettings().dt, SafetyRadius().r_min(0.0)
FRONT = ROBOT.footprint.vertices[:, 0].max()
seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-2, 2), st.floats(-3, 3)


@given(speeds, turns)
def test_without_obstacles_only_the_limits_act(v, omega):
    decision = SAFETY.filter(v, omega)
    clipped = (min(max(v, -1), 1), min(max(omega, -1.5), 1.5))
    assert decision[:2] == pytest.approx(clipped, rel=1e-15, abs=1e-300)
    assert decision.clearance == math.inf
    assert decision.slack == decision.residual == 0 and decision.active == ()
    within = abs(v) <= 1 and abs(omega) <= 1.5
    assert decision.status is (Status.TRACKING if within else Status.FILTERED)


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


@pytest.mark.parametrize(("off", "rows"), [(0.5, 0), (-0.5, 0), (-1.5, 1)])
def test_looking_ahead_only_what_is_nearer_than_tolerated_has_a_row(off, rows):
    point = [[FRONT + R_MIN + off * R_MIN_TOLERANCE, 0.0]]
    safety = SafetyFilter(ROBOT, ahead=True)
    assert len(safety.problem(0.0, 0.0, points=point).b) == rows


@given(
    st.floats(-1, 1), st.floats(-1.5, 1.5), st.floats(0.5, 1.5), st.floats(-0.5, 0.5)
)
def test_a_late_filter_sees_what_one_at_the_place_of_effect_sees(v, omega, x, y):
    delay = 5 * DT
    pose = (0.0, 0.0, 0.0)
    for _ in range(5):
        pose = driven_to(pose, v, omega, DT)
    dx, dy = x - pose[0], y - pose[1]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    there = [[c * dx + s * dy, c * dy - s * dx]]
    late = AvoidanceSettings(actuation=Actuation(delay=delay))
    one, other = (
        SafetyFilter(ROBOT, late, ahead=False),
        SafetyFilter(ROBOT, ahead=False),
    )
    for safety in (one, other):
        safety.reset(v, omega)
    found = one.problem(1.0, 0.0, points=[[x, y]])
    known = other.problem(1.0, 0.0, points=there)
    np.testing.assert_allclose(found.A, known.A, atol=1e-9)
    np.testing.assert_allclose(found.b, known.b, atol=1e-9)
