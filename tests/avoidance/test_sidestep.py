"""A robot that stands before something at rest is turned aside until it is past."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qpavoid as qp
from aside_scenes import (
    DT,
    ENDS,
    FORWARD,
    R_MIN,
    ROBOTS,
    SETTINGS,
    THINGS,
    box,
    drive,
    mirrored,
)
from driven import driven_to
from qpavoid.avoidance.lanes import (
    FINE,
    HERE,
    NEARER,
    SPARE,
    LaneSearch,
    free_share,
    nearest,
)
from qpavoid.avoidance.sidestep import BLOCKED_TIME, Sidestep
from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import like
from qpavoid.model.contacts import empty_contacts
from qpavoid.model.kinematics import arc

STOP = 0.0, 0.0
EPSILON = 1e-3
"""m; by how much the filter may undercut r_min."""


def test_without_a_lane_the_wish_is_passed_on_until_it_is_blocked():
    wish = 0.5, 0.1
    early, late = (Sidestep(wish, still=t) for t in (BLOCKED_TIME - 1, BLOCKED_TIME))
    assert early._hold().desired == wish and late._hold().desired == STOP


robots = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
things = pytest.mark.parametrize("world", THINGS.values(), ids=THINGS)
ends = pytest.mark.parametrize("world", ENDS.values(), ids=ENDS)
aheads = pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
POST, JACKAL = THINGS["post"], ROBOTS["jackal"]


def make(robot=JACKAL, ahead=False, aside=True, solver="exact"):
    return qp.SafetyFilter(robot, SETTINGS, solver, ahead, aside)


def until_it_acts(safety, world=POST):
    """Drive until the robot turns aside; where it is then."""
    pose = (0.0, 0.0, 0.0)
    for _ in range(400):
        decision = safety.filter(*FORWARD, world.seen_from(pose))
        pose = driven_to(pose, decision.v, decision.omega, DT)
        if abs(decision.omega) > 0.5:
            return pose
    raise AssertionError("it never does")


# ------------------------------------------------------------------ it gets past
@robots
@aheads
@things
def test_it_gets_past_what_stands(world, ahead, robot):
    found = drive(make(robot, ahead), world, 15.0)
    assert found.time_past(2.5) < 15.0
    assert found.least(robot, world) >= R_MIN - EPSILON
    assert found.turns <= 4


@robots
def test_without_it_the_robot_stands(robot):
    found = drive(make(robot, aside=False), POST, 15.0)
    assert found.time_past(2.0) == math.inf
    assert tuple(found.trace[-1, 3:]) == pytest.approx(STOP, abs=1e-3)
    past = drive(make(robot), POST, 15.0)
    assert past.least(robot, POST) >= R_MIN - 1e-6
    assert abs(past.trace[-1, 2]) < 0.05
    assert past.y < 0.0


@given(st.integers(0, 2**32 - 1))
def test_what_may_be_driven_comes_no_nearer_than_looks_do(seed):
    """A long robot that turns or drives among points, against a thousand looks."""
    rng = np.random.default_rng(seed)
    edges = qp.Footprint.rectangle(3.2, 0.8).edges
    bearing, far = rng.uniform(-math.pi, math.pi, 3), rng.uniform(0.6, 2.0, 3)
    places = far[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    things = qp.Obstacles(places).arrays
    memory = like(things), empty_contacts(edges, things)
    radius, times = math.hypot(1.6, 0.4), np.linspace(0.0, 1.5, 1001)
    search = LaneSearch(edges, things, *memory, radius, 0.1, 0.5, 0.8, -0.2, 2.0)
    twist = [(0.0, 0.8), (0.0, -0.8), (0.5, 0.0), (0.4, 0.6)][seed % 4]
    ways = (arc(0.0, 0.0, 0.0, *twist, t) for t in times)
    room = np.array([nearest(search, pose)[0] for pose in ways])
    level = min(SPARE, room[0] - NEARER)
    end = free_share(search, HERE, twist, 1.5) * 1.5
    assert room[times <= end].min() >= level - FINE
    fastest = twist[0] + abs(twist[1]) * radius
    assert end == 1.5 or room[times <= end + 0.01 + FINE / fastest].min() < level + FINE


@aheads
@pytest.mark.parametrize("offset", [0.02, 0.05, 0.1])
def test_mirror_images_are_mirrored(offset, ahead):
    world = qp.Obstacles(discs=[(2.0, offset, 0.2)], polygons=[box(2.1, -0.4, 0.1)])
    one = drive(make(ahead=ahead), world, 12.0)
    other = drive(make(ahead=ahead), mirrored(world), 12.0)
    assert one.trace == pytest.approx(other.trace * (1, -1, -1, 1, -1), abs=1e-6)


def test_backwards_is_forwards_turned_round():
    """A rectangle is the same from behind; the right is that of where it drives."""
    world = qp.Obstacles(discs=[(-2.0, 0.0, 0.15)])
    found = drive(make(), world, 15.0, wish=(-0.5, 0.0)).trace
    forwards = drive(make(), POST, 15.0).trace
    assert found[-1, 0] < -2.5
    assert found == pytest.approx(forwards * (-1, -1, 1, -1, 1), abs=1e-6)


def test_a_back_end_gets_past_too():
    pytest.importorskip("qpsolvers")
    exact = drive(make(), POST, 14.0).trace
    found = drive(make(solver="qpsolvers:daqp"), POST, 14.0).trace
    assert found == pytest.approx(exact, abs=1e-3)


# ------------------------------------------------------------- it waits, or says so
@robots
@ends
def test_where_there_is_no_way_it_says_so(world, robot):
    found = drive(make(robot), world, 20.0)
    blocked = [decision.status is qp.Status.BLOCKED for decision in found.decisions]
    first = blocked.index(True)
    assert 10.0 <= first * DT <= 18.0
    assert all(blocked[first:])
    assert not found.trace[first:, 3:].any()


@pytest.mark.parametrize("name", ["dead end", "dead end of points"])
def test_looking_ahead_too(name):
    found = drive(make(ahead=True), ENDS[name], 40.0)
    assert found.decisions[-1].status is qp.Status.BLOCKED


def test_where_the_filter_forbids_the_turn_it_says_so():
    """Velocities that ramp, at whatever rate: it does not trust any turn so near."""
    ramps = qp.AvoidanceSettings(dt=DT, actuation=qp.Actuation(delay=DT, ramps=True))
    safety = qp.SafetyFilter(ROBOTS["mir"], ramps, ahead=False, aside=True)
    found = drive(safety, POST, 30.0)
    assert found.time_past(2.0) == math.inf
    assert found.decisions[-1].status is qp.Status.BLOCKED


def test_it_goes_on_when_the_way_is_free():
    safety = make()
    found = drive(safety, ENDS["wall across"], 20.0)
    assert found.decisions[-1].status is qp.Status.BLOCKED
    free = [safety.filter(*FORWARD, qp.Obstacles()) for _ in range(40)]
    assert free[-1][:3] == (*FORWARD, qp.Status.TRACKING)


CORRIDOR = qp.Obstacles(walls=[(-3, -2.5, 9, -2.5), (9, 2.5, -3, 2.5)])
MOVERS = {
    "ahead of it": (CORRIDOR, (2.0, 0.0), (0.05, 0.0)),
    "towards it": (CORRIDOR, (4.0, 0.0), (-0.2, 0.0)),
    "across": (qp.Obstacles(), (2.2, -2.0), (0.0, 0.3)),
}


@aheads
@pytest.mark.parametrize(("beside", "place", "velocity"), MOVERS.values(), ids=MOVERS)
def test_what_moves_is_waited_for(beside, place, velocity, ahead):
    person = qp.Obstacles(discs=[(*place, 0.3)], disc_velocities=[velocity])
    world = beside.joined(person)
    found = drive(make(ahead=ahead), world, 12.0)
    alone = drive(make(ahead=ahead, aside=False), world, 12.0)
    assert np.array_equal(found.trace, alone.trace)


# ---------------------------------------------------------------- the user's word
def test_a_stop_stops_at_once():
    safety = make()
    pose = until_it_acts(safety)
    assert safety.filter(*STOP, POST.seen_from(pose))[:2] == STOP


@pytest.mark.parametrize("wish", [(-0.3, 0.0), (0.0, 0.4), (0.1, -0.4)])
def test_another_wish_is_what_is_desired(wish):
    safety = make()
    pose = until_it_acts(safety)
    assert safety.filter(*wish, POST.seen_from(pose))[:2] == pytest.approx(wish)


def test_a_reset_forgets():
    safety, fresh = make(), make()
    until_it_acts(safety)
    safety.reset()
    assert np.array_equal(drive(safety, POST, 9.0).trace, drive(fresh, POST, 9.0).trace)


def test_what_is_invalid_changes_nothing():
    safety, other = make(), make()
    pose = until_it_acts(safety)
    until_it_acts(other)
    with pytest.raises(InvalidInputError):
        safety.filter(*FORWARD, [(math.nan, 0.0)])
    with pytest.raises(InvalidInputError):
        safety.filter(math.nan, 0.0, POST.seen_from(pose))
    assert safety.filter(*FORWARD, POST)[:2] == other.filter(*FORWARD, POST)[:2]


def test_the_problem_is_that_of_the_decision():
    safety = make()
    pose = until_it_acts(safety)
    for _ in range(60):
        seen = POST.seen_from(pose)
        problem = safety.problem(*FORWARD, seen)
        decision = safety.filter(*FORWARD, seen)
        assert qp.solve(problem).u == pytest.approx(decision[:2], abs=1e-6)
        pose = driven_to(pose, decision.v, decision.omega, DT)


def test_the_heading_is_that_of_what_is_driven():
    """A base that turns at half the rate; told so, the filter turns it back as far."""
    safety, pose, driven = make(), (0.0, 0.0, 0.0), STOP
    for _ in range(400):
        decision = safety.filter(*FORWARD, POST.seen_from(pose), driven=driven)
        driven = decision.v, 0.5 * decision.omega
        pose = driven_to(pose, *driven, DT)
    assert pose[0] > 2.5
    assert abs(pose[2]) < 0.05


def test_a_robot_that_cannot_turn_is_blocked():
    rail = qp.Robot("rail", JACKAL.footprint, qp.Limits(-1.0, 1.0, 0.0, 0.0))
    found = drive(make(rail), POST, 16.0)
    assert found.decisions[-1].status is qp.Status.BLOCKED


# -------------------------------------------------------------------- whatever stands
things_ahead = st.tuples(
    st.booleans(), st.floats(1.5, 3.0), st.floats(-0.6, 0.6), st.floats(0.05, 0.5)
)


@settings(max_examples=30)
@given(things_ahead, st.sampled_from(sorted(ROBOTS)), st.booleans())
def test_room_is_kept_and_the_robot_gets_on_or_says_not(thing, name, ahead):
    is_disc, x, y, size = thing
    robot, place = ROBOTS[name], (x + size, y)
    world = qp.Obstacles(discs=[(*place, size)])
    if not is_disc:
        world = qp.Obstacles(polygons=[box(*place, size)])
    found = drive(make(robot, ahead), world, 25.0)
    assert found.least(robot, world) >= R_MIN - EPSILON
    blocked = found.decisions[-1].status is qp.Status.BLOCKED
    assert blocked or math.dist(found.trace[-1, :2], (0.0, 0.0)) > x
    assert found.turns <= 8
