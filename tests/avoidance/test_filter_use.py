"""A filter in use: what is clamped, what may not be changed, and by whom it is used."""

import itertools
import math
import threading
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from oracles import point_distance
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead
from qpavoid.avoidance.step import filter_step
from qpavoid.errors import InvalidInputError, ThreadError
from qpavoid.lab.scenario.methods import OURS, make_controller
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from shapes import ROBOT, STAR, scene

LIMITED = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
)
WHEELS = replace(
    ROBOT, limits=Limits(-0.4, 1.0, -0.8, 1.5, 0.7, 1.2, wheel_speed=0.9, track=0.5)
)
ROBOTS = {"free": ROBOT, "limited": LIMITED, "wheels": WHEELS}
aheads = pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
robots = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
solvers = pytest.mark.parametrize("solver", ["exact", "qpsolvers:daqp"])
GREAT = (1e3, 1e8, 1e200, 1e300, 1.7e308)


def within(robot, u):
    limits = robot.limits
    assert limits.v_min - 1e-9 <= u[0] <= limits.v_max + 1e-9
    assert limits.omega_min - 1e-9 <= u[1] <= limits.omega_max + 1e-9
    wheel = abs(u[0]) + 0.5 * limits.track * abs(u[1])
    assert wheel <= limits.wheel_speed + 1e-9


@aheads
@solvers
def test_an_equal_footprint_changes_nothing_another_one_the_next_verdict(ahead, solver):
    one, other = (SafetyFilter(LIMITED, solver=solver, ahead=ahead) for _ in range(2))
    rng, pose = np.random.default_rng(14), (0.0, 0.0, 0.0)
    known = Obstacles(**scene(rng))
    for _ in range(30):
        other.footprint = Footprint.union([ROBOT.footprint])
        seen, (v, omega) = known.seen_from(pose), rng.uniform(-1, 1, 2)
        decision = one.filter(v, omega, seen)
        assert other.filter(v, omega, seen)[:7] == decision[:7]
        pose = arc(*pose, *decision[:2], 0.02)
    for footprint in (STAR, ROBOT.footprint):
        other.footprint = footprint
        expected = Contacts.of(footprint, seen).distance.min()
        assert other.filter(0.0, 0.0, seen).clearance == expected
        assert other.robot.footprint is footprint
    with pytest.raises(InvalidInputError, match="must be a Footprint"):
        other.footprint = footprint.vertices
    thread = threading.Thread(target=lambda: one.reset() or one.filter(0.0, 0.0, seen))
    thread.start()
    thread.join()
    with pytest.raises(ThreadError):
        one.footprint = STAR


@aheads
@solvers
@pytest.mark.parametrize("signs", [(1, 0), (-1, 0), (0, 1), (1, -1), (-1, -1)])
def test_a_desired_twist_beyond_everything_gives_the_nearest(signs, solver, ahead):
    """Alone: the corner of the limits. Among obstacles: what a great one gives too."""
    safety = SafetyFilter(ROBOT, solver=solver, ahead=ahead)
    for great in GREAT:
        decision = safety.filter(signs[0] * great, signs[1] * great)
        assert decision[:2] == (signs[0] * 1.0, signs[1] * 1.5)
        assert decision.status is Status.FILTERED
    points = [[1.2, 0.3], [-0.9, 0.1], [0.2, -0.7]]
    answers = []
    for great in GREAT[1:]:
        safety.reset()
        answers.append(safety.filter(signs[0] * great, signs[1] * great, points))
    assert len({(d[:3], d.active) for d in answers}) == 1
    assert answers[0].status is not Status.STOPPED
    within(ROBOT, answers[0])


@aheads
@solvers
@robots
def test_driven_beyond_the_limits_counts_as_the_nearest_within(robot, solver, ahead):
    """Not one answer leaves the limits, whatever was driven."""
    rng = np.random.default_rng(5)
    safety = SafetyFilter(robot, solver=solver, ahead=ahead)
    for great, signs in itertools.product((3.0, *GREAT), ((1, 1), (-1, 0), (0, -1))):
        driven = signs[0] * great, signs[1] * great
        decision = safety.filter(
            *rng.uniform(-1, 1, 2), Obstacles(**scene(rng)), driven=driven
        )
        within(robot, decision)
        assert math.isfinite(decision.v) and math.isfinite(decision.omega)
        within(robot, safety.filter(0.3, 0.1, Obstacles(**scene(rng))))
        safety.reset(*driven)
        within(robot, safety.filter(0.3, 0.1, Obstacles(**scene(rng))))


@pytest.mark.parametrize("ahead", [False, True])
def test_a_robot_without_limits_is_not_driven_at_any_speed(ahead):
    free = replace(ROBOT, limits=Limits.symmetric(math.inf, math.inf))
    safety = SafetyFilter(free, ahead=ahead)
    v, omega, status, *_ = safety.filter(1e6, -1e9)
    assert (v, omega) == pytest.approx((10.0, -10.0)) and status == "filtered"


def test_it_says_for_how_long_its_plan_was_checked():
    """A new plan for the horizon, less a step; without look-ahead for no time."""
    settings = AvoidanceSettings(dt=0.1)
    safety = SafetyFilter(LIMITED, settings)
    safety.filter(0.5, 0.0)
    assert safety.foreseen == pytest.approx(2.9)
    short = replace(settings, ahead=LookAhead(0.04, 0.04, 0.04))
    for other, seconds in ((SafetyFilter(LIMITED, settings, ahead=False), 0.0),
                           (SafetyFilter(LIMITED, short), 0.0)):  # fmt: skip
        other.filter(0.5, 0.0)
        assert other.foreseen == pytest.approx(seconds)


def in_thread(work):
    """Result of a call in a thread of its own, or the exception raised."""
    found = []

    def run():
        try:
            found.append(work())
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return found[0]


@solvers
def test_a_second_thread_is_refused_and_a_reset_hands_over(solver):
    safety = SafetyFilter(ROBOT, solver=solver)
    points = [[0.9, 0.1]]
    expected = SafetyFilter(ROBOT, solver=solver).filter(0.5, 0.1, points)[:7]
    assert in_thread(lambda: safety.filter(0.5, 0.1, points)[:7]) == expected
    with pytest.raises(ThreadError, match="reset"):
        safety.filter(0.5, 0.1, points)
    safety.reset()
    assert safety.filter(0.5, 0.1, points)[:7] == expected
    refused = in_thread(lambda: safety.filter(0.5, 0.1, points))
    assert isinstance(refused, ThreadError)
    again, other = safety.filter(0.5, 0.1, points), SafetyFilter(ROBOT, solver=solver)
    other.filter(0.5, 0.1, points)
    assert again[:7] == other.filter(0.5, 0.1, points)[:7]


def test_obstacles_that_are_not_finite_are_named():
    with pytest.raises(InvalidInputError, match=r"points\[0\]"):
        Obstacles(points=[[1.0, math.nan]])
    world = Obstacles.of(np.array([[1.0, math.nan]]), Obstacles().capsules)
    with pytest.raises(InvalidInputError, match=r"points\[0\]"):
        SafetyFilter(ROBOT).filter(0.5, 0.0, world)


PLACES = np.array([[0.85, 0.1], [-0.7, 0.3], [0.2, 0.5]])


@pytest.mark.parametrize("solver", ["exact", "osqp"])
def test_inputs_are_never_changed(solver):
    safety, arrays = SafetyFilter(ROBOT, solver=solver), scene(np.random.default_rng(3))
    copies = {name: array.copy() for name, array in arrays.items()}
    safety.filter(0.8, 0.1, Obstacles(**arrays))
    safety.problem(0.8, 0.1, Obstacles(**arrays))
    for law in OURS:
        step = make_controller(law, ROBOT, AvoidanceSettings()).start()
        step(0.8, 0.1, Obstacles(**arrays))
    Obstacles(**arrays).seen_from((1.0, 2.0, 3.0))
    for name, array in arrays.items():
        assert_array_equal(array, copies[name])


@pytest.mark.parametrize(
    ("name", "ahead", "bound"),
    [
        ("qp", False, "barrier"),
        ("qp-ahead", True, "barrier"),
        ("qp-repulsion", False, "repulsion"),
    ],
)
def test_the_qp_controllers_are_the_filter(name, ahead, bound):
    step = make_controller(name, ROBOT, AvoidanceSettings(), "exact").start(0.3, 0.1)
    safety = SafetyFilter(ROBOT, AvoidanceSettings(bound=bound), ahead=ahead)
    safety.reset(0.3, 0.1)
    rng = np.random.default_rng(9)
    for _ in range(20):
        obstacles = Obstacles(**scene(rng))
        decision = step(0.7, -0.2, obstacles)
        expected = safety.filter(0.7, -0.2, obstacles)
        assert decision[:7] == expected[:7]
        assert decision.shortfall == expected.shortfall


@pytest.mark.parametrize("name", OURS)
def test_every_controller_keeps_the_limits_and_reports_the_clearance(name):
    rng = np.random.default_rng(10)
    step = make_controller(name, ROBOT, AvoidanceSettings()).start()
    for _ in range(200):
        obstacles = Obstacles(points=rng.uniform(-1.2, 1.2, (3, 2)))
        decision = step(*rng.uniform(-3, 3, 2), obstacles)
        assert abs(decision.v) <= 1.0 and abs(decision.omega) <= 1.5
        least = min(
            point_distance(ROBOT.footprint.vertices, p) for p in obstacles.points
        )
        assert decision.clearance == pytest.approx(least, abs=1e-12)


NOT_TWISTS = [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)]
NOT_TWISTS += [("fast", 0.0), (None, 0.0), ([0.1, 0.2], 0.0), (10**400, 0.0)]
WRONG = [
    *(({"age": age}, "age") for age in (-1e-9, -1.0, math.nan, math.inf, "old", None)),
    *(({"driven": twist}, "twist") for twist in NOT_TWISTS),
    ({"driven": (0.1,)}, "twist"),
    ({"driven": 0.1}, "twist"),
    ({"v": math.nan}, "twist"),
    ({"omega": 10**400}, "twist"),
    ({"age": 10**400}, "age"),
    ({"points": [[0.9, math.nan]]}, r"points\[0\]"),
    ({"points": [[9.0, 9.0], [math.inf, 0.0]]}, r"points\[1\]"),
    ({"points": [[1e200, 0.0]]}, r"points\[0\]"),
    ({"points": [[1.0], [2.0, 3.0]]}, "points"),
    ({"points": None}, "points"),
    ({"obstacles": [[2.0, 0.0]]}, "not both"),
]


def busy_filter(ahead, solver="exact"):
    """A filter that has something to remember."""
    safety = SafetyFilter(LIMITED, None, solver, ahead)
    for step in range(8):
        disc = [[1.5 - 0.01 * step, 0.1, 0.1]]
        safety.filter(0.8, 0.1, Obstacles(discs=disc, disc_velocities=[[-0.5, 0.0]]))
    return safety


@solvers
@aheads
@pytest.mark.parametrize(("wrong", "message"), WRONG, ids=str)
def test_what_is_refused_leaves_the_memory_as_it_was(ahead, solver, wrong, message):
    safety, fresh = busy_filter(ahead, solver), busy_filter(ahead, solver)
    arguments = {"v": 0.8, "omega": 0.1, "points": [[1.2, 0.3]]}
    methods = (safety.filter,) if "driven" in wrong else (safety.filter, safety.problem)
    for method in methods:
        with pytest.raises(InvalidInputError, match=message):
            method(**{**arguments, **wrong})
    for _ in range(3):
        assert safety.filter(**arguments)[:7] == fresh.filter(**arguments)[:7]


@pytest.mark.parametrize("twist", NOT_TWISTS, ids=str)
def test_a_filter_is_not_reset_to_nonsense(twist):
    safety, fresh = busy_filter(True), busy_filter(True)
    with pytest.raises(InvalidInputError, match="twist"):
        safety.reset(*twist)
    assert safety.filter(0.8, 0.1)[:7] == fresh.filter(0.8, 0.1)[:7]


def test_looking_at_the_problem_changes_nothing():
    safety, fresh = busy_filter(True), busy_filter(True)
    safety.problem(-1.0, 1.0, points=[[0.9, 0.2]], age=0.3)
    assert (
        safety.filter(0.8, 0.1, [[1.2, 0.3]])[:7]
        == fresh.filter(0.8, 0.1, [[1.2, 0.3]])[:7]
    )


def test_a_reset_filter_is_a_new_one():
    safety = busy_filter(True)
    safety.reset()
    limits = safety.robot
    arguments = (0.8, 0.1, [[1.2, 0.3]])
    assert safety.filter(*arguments)[:7] == SafetyFilter(limits).filter(*arguments)[:7]


@pytest.mark.long
def test_another_type_of_age_compiles_nothing_anew(monkeypatch):
    """By numba, as where no machine code came with the package."""
    monkeypatch.setitem(vars(filter_step), "call", filter_step.dispatcher)
    safety = busy_filter(True)
    known = len(filter_step.signatures)
    for age in (0, 1, True, np.float32(0.1), np.float64(0.1)):
        safety.filter(0.5, 0.0, PLACES, age=age)
    assert 1 <= len(filter_step.signatures) == known
