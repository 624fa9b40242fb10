"""The choice weighs what another reckoning weighs, and keeps what it chose."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpavoid as qp
from qpavoid.avoidance.bodies import BODY, Scene, bodies_in_reach
from qpavoid.avoidance.plan import ARC
from qpavoid.guide.choice import (
    KIND,
    LEFT,
    NOT_CHOSEN,
    PACE,
    choose,
    driven_candidate,
    track_on,
    twist_of,
)
from qpavoid.guide.rollout import (
    FOLLOW,
    HOLD,
    PARK,
    ROWS,
    STAY,
    TICK,
    TRACK,
    Candidate,
    Course,
    arrival,
    park_twist,
    roll_on,
)
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import Stage
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import GREATEST, limit_twist
from qpavoid.tracking.kanayama import Gains, tracking_error
from qpavoid.tracking.station import StationKeeping, Tracker

ROBOT = qp.Robot.mir100()
SETTINGS = qp.AvoidanceSettings()
LAW = Tracker(Gains(), StationKeeping(), ROBOT.limits).array
DT = SETTINGS.dt


def straight(speed=0.7, aside=0.0, rows=ROWS):
    """The reference ahead: along the x axis."""
    ahead = np.zeros((rows, 5))
    ahead[:, 0], ahead[:, 1], ahead[:, 3] = speed * TICK * np.arange(rows), aside, speed
    return ahead


def course(obstacles, ahead=None, driven=(0.5, 0.0), guide=None):
    stage = Stage.of(ROBOT, guide or GuideSettings(), SETTINGS, LAW)
    bodies = np.zeros(200, BODY)
    edges, robot, record = stage.setup
    rest = driven, (0.0, 0.0), np.zeros(0, ARC), bodies[:0], DT, 0.0, math.inf
    scene = Scene(edges, robot, record, bodies, *rest)
    count = bodies_in_reach(scene, obstacles.arrays, 0.0, 3.0)
    scene = Scene(edges, robot, record, bodies[:count], *rest)
    ahead = straight() if ahead is None else ahead
    return Course(scene, ahead, LAW, stage.settings, GREATEST)


def nothing():
    chosen = np.zeros(PACE + 1)
    chosen[KIND] = NOT_CHOSEN
    return chosen


def chosen_twist(course, desired=(0.5, 0.0)):
    chosen = nothing()
    choose(course, chosen, False)
    return driven_candidate(chosen), twist_of(course, driven_candidate(chosen), desired)


def test_where_nothing_is_near_the_reference_is_tracked():
    candidate, twist = chosen_twist(course(qp.Obstacles()), (0.31, -0.17))
    assert candidate.kind == TRACK and twist == (0.31, -0.17)


def test_of_two_ways_that_cost_the_same_the_one_to_the_right_is_taken():
    ahead = qp.Obstacles(discs=[(2.0, 0.0, 0.3)])
    candidate, (v, omega) = chosen_twist(course(ahead))
    assert candidate.kind == FOLLOW and candidate.a < 0.0
    assert v > 0.0 and omega < 0.0


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_mirror_images_are_mirrored(seed):
    rng = np.random.default_rng(seed)
    discs = np.column_stack(
        [rng.uniform(0.9, 4, 3), rng.uniform(-1.5, 1.5, 3), [0.2] * 3]
    )
    velocities, flip = rng.uniform(-0.5, 0.5, (3, 2)), np.array([1.0, -1.0])
    world = qp.Obstacles(discs=discs, disc_velocities=velocities)
    mirrored = qp.Obstacles(discs=discs * (1, -1, 1), disc_velocities=velocities * flip)
    ahead, other = straight(aside=0.1), straight(aside=-0.1)
    one, (v, omega) = chosen_twist(course(world, ahead, (0.4, 0.2)), (0.5, 0.1))
    two, (w, turn) = chosen_twist(course(mirrored, other, (0.4, -0.2)), (0.5, -0.1))
    costs = [
        roll_on(course(world, ahead, (0.4, 0.2)), c, math.inf)
        for c in (one, mirror(two))
    ]
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)
    if one == mirror(two):
        assert (v, omega) == pytest.approx((w, -turn), abs=1e-9)


def mirror(candidate):
    kind, a, b, held = candidate
    if kind == FOLLOW:
        return Candidate(kind, -a, b, held)
    return Candidate(kind, a, -b, held) if kind == HOLD else candidate


def test_what_was_chosen_is_left_only_for_what_is_clearly_cheaper():
    world = qp.Obstacles(discs=[(2.0, 0.01, 0.3)])
    chosen = nothing()
    choose(course(world), chosen, False)
    assert driven_candidate(chosen).a < 0.0
    left = mirror(driven_candidate(chosen))
    chosen[:] = *left, 0.0
    choose(course(world), chosen, False)
    assert driven_candidate(chosen).a > 0.0
    chosen[:] = *left, 0.0
    choose(course(world, guide=GuideSettings(hysteresis=0.0)), chosen, False)
    assert driven_candidate(chosen).a < 0.0


def test_tracking_that_is_set_is_not_weighed_until_something_moves():
    world, chosen = qp.Obstacles(discs=[(1.2, 0.0, 0.3)]), nothing()
    track_on(chosen)
    ticks = chosen[LEFT]
    choose(course(world), chosen, False)
    assert driven_candidate(chosen) == (TRACK, 0.0, 1.0, ticks - 1.0)
    walks = qp.Obstacles(discs=[(1.2, 0.0, 0.3)], disc_velocities=[(-0.3, 0.0)])
    choose(course(walks), chosen, False)
    assert driven_candidate(chosen).kind != TRACK


def test_without_progress_it_would_rather_stand_than_turn():
    world = qp.Obstacles(walls=[(0.75, -4.0, 0.75, 4.0)])
    here, chosen = course(world, driven=(0.0, 0.0)), nothing()
    choose(here, chosen, False)
    assert driven_candidate(chosen)[:3] != (HOLD, 0.0, 0.0)
    choose(here, chosen, True)
    assert driven_candidate(chosen)[:3] == (HOLD, 0.0, 0.0)
    chosen[:] = nothing()
    choose(course(qp.Obstacles()), chosen, True)
    assert driven_candidate(chosen).kind == TRACK


def resting(goal):
    """The reference ahead: at rest."""
    return np.tile([*goal, 0.0, 0.0], (ROWS, 1))


@settings(max_examples=60, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.1, 3.1), st.booleans())
def test_parking_reaches_any_pose_within_a_centimetre_and_a_degree(x, y, turn, back):
    limits = qp.Limits.symmetric(1.0, 1.5) if back else qp.Limits(0.0, 1.0, -1.5, 1.5)
    robot = qp.Robot("R", ROBOT.footprint, limits).limit_vector
    pose, twist, driven = (0.0, 0.0, 0.0), (0.0, 0.0), 0.0
    for _ in range(120):
        e = tracking_error(pose, (x, y, turn))
        twist = limit_twist(robot, park_twist(robot, e), twist, TICK)
        pose = arc(*pose, *twist, TICK)
        driven += TICK * abs(twist[0])
    e_x, e_y, e_turn = tracking_error(pose, (x, y, turn))
    assert math.hypot(e_x, e_y) < 0.01 and abs(e_turn) < math.radians(1.0)
    assert driven < 1.3 * math.hypot(x, y) + 0.01
    assert park_twist(robot, (e_x, e_y, e_turn)) == (0.0, 0.0)


def test_a_robot_beside_its_goal_parks_although_it_must_turn_away_first():
    beside = course(qp.Obstacles(), resting((0.0, 0.12, 0.0)), (0.0, 0.0))
    candidate, twist = chosen_twist(beside)
    assert candidate.kind == PARK and twist[0] == 0.0 and abs(twist[1]) == 1.5


def test_an_arrival_counts_only_if_it_is_clear_and_stays_so():
    at_goal, goal = Candidate(PARK, 0.0, 0.0, 0.0), resting((1.0, 0.0, 0.0))
    free = arrival(course(qp.Obstacles(), goal, (0.0, 0.0)), at_goal, 60)
    assert 15 < free < 30
    wall = qp.Obstacles(walls=[(0.9, -1.0, 0.9, 1.0)])
    assert arrival(course(wall, goal, (0.0, 0.0)), at_goal, 60) == 60
    for late, wanted in ((0.5 * STAY, 60), (2.0 * STAY, free)):
        meets = TICK * (free + late)
        comes = qp.Obstacles(
            discs=[(1.0, 0.7 + 0.6 * meets, 0.1)], disc_velocities=[(0.0, -0.6)]
        )
        assert arrival(course(comes, goal, (0.0, 0.0)), at_goal, 60) == wanted
    assert arrival(course(qp.Obstacles(), goal, (0.0, 0.0)), at_goal, free) == free
