"""Parts of the filter alone: what reaches, bounds, is aimed at, and takes effect."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from driven import driven_to
from qpavoid.avoidance.cbf_rows import R_MIN_TOLERANCE, closing_bound, row_reach
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.margin import ArcTwist, end_time, least_margin
from qpavoid.avoidance.plan import hold
from qpavoid.avoidance.proposals import Query, start_twist
from qpavoid.avoidance.settings import Actuation, AvoidanceSettings, SafetyRadius
from qpavoid.avoidance.verdict import first_twist
from qpavoid.model.contact import Contact
from qpavoid.model.contacts import CONTACT, contact_table, empty_contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import braking_twist
from rollouts import BOX, LIMITED, ROBOT, SETTINGS, rolled, scene_of, speeds, turns

DT, R_MIN = SETTINGS.dt, SafetyRadius().r_min(0.0)
FRONT = ROBOT.footprint.vertices[:, 0].max()


@given(st.floats(0.0, 2.0), st.floats(-1.0, 1.0))
def test_without_accelerations_a_stop_takes_one_step(margin, a_v):
    bound = closing_bound(ROBOT.limit_vector, DT, (a_v, 0.3), margin)
    assert bound * DT == pytest.approx(margin)


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_a_passive_filter_sees_as_far_as_both_go_until_it_rests(speed):
    """Driven at full speed at what comes, then braked step by step."""
    settings = AvoidanceSettings(gamma=50.0, passive=True)
    world = Obstacles(discs=[[9.0, 0.0, 0.1]], disc_velocities=[[-speed, 0.0]])
    twist, gone = (LIMITED.limits.v_max, 0.0), 0.0
    while twist != (0.0, 0.0):
        gone += DT * (twist[0] + speed)
        twist = braking_twist(LIMITED.limit_vector, *twist, DT)
    known = LIMITED.limit_vector, settings.record(), world.capsules
    assert row_reach(*known, 0.0) >= gone + settings.radius.r_min(speed)


def test_without_room_to_brake_it_sees_as_far_as_a_row_can_be_violated():
    """γ(d − r_min) < V, with V = |v| + |ω| R + |v_o|; never farther than its reach."""
    limits, speed = LIMITED.limits, 0.4
    world = Obstacles(discs=[[2.0, 0.0, 0.1]], disc_velocities=[[-speed, 0.0]])
    most = limits.v_max + limits.omega_max * LIMITED.footprint.circumradius + speed
    for reach in (math.inf, 0.5):
        settings = AvoidanceSettings(braking_room=False, reach=reach)
        found = row_reach(LIMITED.limit_vector, settings.record(), world.capsules, 0.0)
        wanted = settings.radius.r_min(speed) + most / settings.gamma
        assert found == pytest.approx(min(wanted, reach))


@pytest.mark.parametrize(("off", "rows"), [(0.5, 0), (-0.5, 0), (-1.5, 1)])
def test_looking_ahead_only_what_is_nearer_than_tolerated_has_a_row(off, rows):
    point = [[FRONT + R_MIN + off * R_MIN_TOLERANCE, 0.0]]
    safety = SafetyFilter(ROBOT, ahead=True)
    assert len(safety.problem(0.0, 0.0, points=point).b) == rows


def test_of_the_contacts_only_those_within_reach_are_kept():
    """The nearest came first; the second lies in the circle but beyond the reach."""
    side = ROBOT.footprint.vertices[:, 1].max()
    world = Obstacles(points=[[FRONT + 0.05, 0.0], [0.0, side + 0.2], [9.0, 0.0]])
    table = empty_contacts(ROBOT.footprint.edges, world.arrays)
    radius = math.hypot(*np.abs(ROBOT.footprint.vertices).max(axis=0))
    known = ROBOT.footprint.edges, radius, world.arrays
    assert contact_table(*known, 0.1, table) == (1, 0)
    assert contact_table(*known, 0.3, table) == (2, 0)
    assert table.view(CONTACT)["distance"][:2] == pytest.approx([0.05, 0.2])


def test_the_first_twist_of_a_plan_of_one_step_is_that_of_the_plan():
    scene = scene_of(LIMITED, Obstacles(), last=(0.5, 0.2))
    for steps in (1, 2, 3):
        assert first_twist(scene, hold(0.52, 0.21, steps * DT)) == (0.52, 0.21)
    ended = first_twist(scene, hold(0.52, 0.21, 0.0))
    assert ended == braking_twist(LIMITED.limit_vector, 0.5, 0.2, DT)


def test_the_least_room_is_that_at_the_end_where_it_is_less_and_less():
    """For as many looks as there are, and a last one."""
    scene = scene_of(ROBOT, Obstacles(points=[[FRONT + 1.7, 0.0]]), last=(0.4, 0.0))
    end, speed = 8.0, 1.0 / 8.0
    rollout = rolled(scene, hold(speed, 0.0, end), (speed, 0.0), DT, 1)
    room, when = least_margin(scene, rollout, 0, (0.0, end), 9.0)
    assert room == pytest.approx(1.7 - R_MIN - 1.0, abs=1e-6)
    assert when == pytest.approx(end, abs=1e-6)


def test_what_the_robot_leaves_for_good_is_never_reached():
    contact = Contact(0.0, 0.0, 1.0, 0.0, 1.0, 0)
    time = end_time(
        contact, (1.0, 0.0, 0.0, 0.0), ArcTwist(-0.5, 0.0, False), (0.5, 0.2, 0.0)
    )
    assert time == math.inf


def test_of_a_pair_of_starts_the_right_one_comes_first():
    query = Query(BOX, (0.4, 0.3), (0.4, 0.3), 1, None, None, 0, 0.0, True)
    starts = [start_twist.py_func(query, g, m) for g in (0, 2) for m in (0, 1)]
    v_min, v_max, right, left = BOX
    assert starts == [(v_max, right), (v_max, left), (v_min, right), (v_min, left)]


@given(speeds, turns, st.floats(0.5, 1.5), st.floats(-0.5, 0.5))
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


def test_what_is_active_without_looking_ahead_are_obstacles_alone():
    safety = SafetyFilter(ROBOT, ahead=False)
    told = safety.filter(0.5, 0.0, points=[[FRONT + R_MIN + 0.02, 0.1], [9.0, 9.0]])
    assert told.active == (0,)
