"""Eq. 5 against numpy's inverse of J_0; Eq. 7 on all segments, both sides."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.laws import eq5, eq7
from qpavoid.avoidance.settings import AvoidanceSettings, Repulsion, SafetyRadius
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot

WIDE = Robot("no limits", Robot.mir100().footprint, Limits.symmetric(1e9, 1e9))
coordinate = st.floats(-1, 1)
bearing = st.floats(-math.pi, math.pi)
laws = pytest.mark.parametrize("law", ["eq5", "eq7"])


def controller(law, robot=WIDE, **repulsion):
    settings = AvoidanceSettings(repulsion=Repulsion(**repulsion))
    return make_controller(law, robot, settings).start()


def push(law, place, **repulsion):
    """The repulsive twist for one point obstacle, and its decision."""
    decision = controller(law, **repulsion)(0.0, 0.0, Obstacles(points=[place]))
    return np.array([decision.v, decision.omega]), decision


def contact(place):
    contacts = Contacts.of(WIDE.footprint, Obstacles(points=[place]))
    return contacts.point[0], contacts.normal[0], contacts.segment[0]


def around(gap, share=None):
    """Places at a gap before the middle (or a share) of each of the five edges."""
    for index, (x, y, n_x, n_y, length, _) in enumerate(WIDE.footprint.edges):
        along = length * (share if share is not None else 0.5)
        yield index, (x - along * n_y + gap * n_x, y + along * n_x + gap * n_y)


@given(coordinate, coordinate, bearing, st.floats(0, 10))
def test_eq5_is_the_inverse_of_j_0(p_x, p_y, bearing, speed):
    if abs(p_x) < 1e-6:
        p_x = 0.3
    n = np.array([math.cos(bearing), math.sin(bearing)])
    j_0 = np.array([[1.0, -p_y], [0.0, p_x]])
    expected = np.linalg.inv(j_0) @ (-speed * n)
    scale = 1.0 + np.abs(expected).max()
    assert_allclose(eq5(p_x, p_y, *n, speed, 0.0), expected, atol=1e-12 * scale)


@given(
    coordinate,
    coordinate,
    bearing,
    st.one_of(st.floats(0, 1), st.sampled_from([5e-324, 1e-200, 1e-170, 1e-9, 1e150])),
)
@example(0.0, 0.29, math.pi / 2, 0.0)
@example(0.0, 0.29, math.pi / 2, 1e-200)
@example(5e-324, 0.29, math.pi / 2, 5e-324)
@example(1e-9, 0.29, math.pi / 2, 0.0)
@example(-0.0, 0.0, 0.0, 0.0)
def test_never_nan_at_any_lever_and_damping(p_x, p_y, bearing, damping):
    n = (math.cos(bearing), math.sin(bearing))
    for law in (eq5, eq7):
        assert np.isfinite(law(p_x, p_y, *n, 10.0, damping)).all()


@pytest.mark.parametrize("share", [0.05, 0.2, 0.4, 0.6, 0.8, 0.95])
def test_eq7_turns_the_footprint_away_on_every_segment(share):
    """Independent of the formula: a small turn increases the distance."""
    for segment, place in around(0.1, share):
        u, decision = push("eq7", place, speed=1.0, activation="step")
        assert contact(place)[2] == segment
        assert u[0] == 0.0 and decision.status is Status.REPELLED
        obstacles = Obstacles(points=[place])
        turned = obstacles.seen_from((0.0, 0.0, 1e-4 * np.sign(u[1])))
        gain = Contacts.of(WIDE.footprint, turned).distance[0] - 0.1
        assert gain > 0
        assert gain == pytest.approx(1e-4 / abs(u[1]), rel=1e-2)


@laws
@given(coordinate, st.floats(0.001, 1))
def test_mirror_image(law, x, y):
    u, decision = push(law, (x, y))
    mirrored, other = push(law, (x, -y))
    assert decision.status is other.status
    assert_allclose(mirrored, u * [1, -1], rtol=1e-6, atol=1e-9)


SINGULAR = {
    "eq5": [(0.0, 0.4), (0.0, -0.4), (1e-12, 0.4)],
    "eq7": [(0.0, 0.4), (0.0, -0.4), (-0.55, 0.0), (-0.55, 1e-12)],
}


@laws
def test_exactly_singular_undamped_is_said_and_left_out(law):
    for place in SINGULAR[law]:
        decision = controller(law)(0.3, -0.2, Obstacles(points=[place]))
        assert decision.status is Status.SINGULAR
        assert (decision.v, decision.omega) == (0.3, -0.2)
        assert decision.active == (0,)
        assert "left out" in decision.status.sentence


@laws
def test_damped_singular_points_are_finite_and_repelled(law):
    for x, y in SINGULAR[law]:
        for shift in (0.0, 1e-12, 1e-5, -1e-5):
            place = (x + shift, y) if abs(y) > 0.1 else (x, y + shift)
            u, decision = push(law, place, damping=0.1)
            assert decision.status is Status.REPELLED
            assert np.abs(u).max() <= 10.0 / (2 * 0.1) + 10.0


@laws
def test_only_the_nearest_obstacle_repels(law):
    step = controller(law)
    near, far = [0.3, 0.40], [0.2, -0.45]
    both = step(0.1, 0.0, Obstacles(points=[far, near]))
    alone = step(0.1, 0.0, Obstacles(points=[near]))
    assert both[:4] == alone[:4]
    assert (both.active, alone.active) == ((1,), (0,))


def test_the_push_grows_from_r_to_r_min():
    r_min, r = SafetyRadius().r_min(), SafetyRadius().r()
    for share in (0.25, 0.5, 1.0, 1.5):
        place = (0.3, 0.29 + r - share * (r - r_min))
        u, _ = push("eq7", place, speed=3.0, activation="linear")
        assert u[1] == pytest.approx(-3.0 / 0.3 * min(share, 1.0))
