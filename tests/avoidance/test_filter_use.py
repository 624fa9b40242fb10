"""A filter in use: what is clamped, what may not be changed, and by whom it is used."""

import itertools
import math
import threading
from dataclasses import replace

import numpy as np
import pytest

from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead
from qpavoid.errors import InvalidInputError, ThreadError
from qpavoid.lab.simulation.methods import make_controller
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from shapes import ROBOT, scene

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


# ---------------------------------------------------------------------- clamped
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
        decision = safety.filter(*rng.uniform(-1, 1, 2), **scene(rng), driven=driven)
        within(robot, decision)
        assert math.isfinite(decision.v) and math.isfinite(decision.omega)
        within(robot, safety.filter(0.3, 0.1, **scene(rng)))
        safety.reset(*driven)
        within(robot, safety.filter(0.3, 0.1, **scene(rng)))


# --------------------------------------------------------------------- read-only


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


# ----------------------------------------------------------------------- threads
def in_thread(work):
    """What happens in a thread of its own: a result, or what was raised."""
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


# ---------------------------------------------------------- not arrays of numbers


# ------------------------------------------------------------- obstacles as one
@aheads
@solvers
def test_obstacles_are_taken_in_place_of_arrays(solver, ahead):
    rng = np.random.default_rng(6)
    for _ in range(5):
        arrays = scene(rng)
        one, other = (SafetyFilter(ROBOT, None, solver, ahead) for _ in range(2))
        for age in (0.0, 0.1):
            named = one.filter(0.6, 0.2, **arrays, age=age)
            assert other.filter(0.6, 0.2, Obstacles(**arrays), age=age)[:7] == named[:7]
        a, b = (
            one.problem(0.6, 0.2, **arrays),
            other.problem(0.6, 0.2, Obstacles(**arrays)),
        )
        np.testing.assert_array_equal(a.A, b.A)
        np.testing.assert_array_equal(a.b, b.b)


def test_obstacles_that_are_not_finite_are_named():
    with pytest.raises(InvalidInputError, match=r"points\[0\]"):
        Obstacles(points=[[1.0, math.nan]])
    world = Obstacles.of(np.array([[1.0, math.nan]]), Obstacles().capsules)
    with pytest.raises(InvalidInputError, match=r"points\[0\]"):
        SafetyFilter(ROBOT).filter(0.5, 0.0, world)


def test_the_literal_bound_is_a_controller_of_its_own():
    """Whatever the bound of the settings: the repulsive velocity, by the present."""
    rng, acted = np.random.default_rng(5), 0
    literal = SafetyFilter(ROBOT, AvoidanceSettings(bound="repulsion"), ahead=False)
    step = make_controller("qp-repulsion", ROBOT, AvoidanceSettings()).start()
    for _ in range(50):
        seen = Obstacles(points=rng.uniform([0.4, 0.3], [0.8, 0.5], (2, 2)))
        wish = rng.uniform([-1.0, -1.5], [1.0, 1.5])
        one, other = step(*wish, seen), literal.filter(*wish, seen)
        assert one[:2] == other[:2] and one.status is other.status
        acted += one.status is not Status.TRACKING
    assert acted > 10
