"""What the filter takes, refuses and hands out; and its fellow controllers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from oracles import point_distance
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import filter_step
from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.methods import OURS, make_controller
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, scene

PLACES = np.array([[0.85, 0.1], [-0.7, 0.3], [0.2, 0.5]])


@pytest.mark.parametrize("solver", ["exact", "osqp"])
def test_inputs_are_never_changed(solver):
    safety, arrays = SafetyFilter(ROBOT, solver=solver), scene(np.random.default_rng(3))
    copies = {name: array.copy() for name, array in arrays.items()}
    safety.filter(0.8, 0.1, **arrays)
    safety.problem(0.8, 0.1, **arrays)
    for law in OURS:
        step = make_controller(law, ROBOT, AvoidanceSettings()).start()
        step(0.8, 0.1, Obstacles(**arrays))
    Obstacles(**arrays).seen_from((1.0, 2.0, 3.0))
    for name, array in arrays.items():
        assert_array_equal(array, copies[name])


@pytest.mark.parametrize("solver", ["exact", "osqp"])
def test_decisions_are_plain_values(solver):
    """Python's own types, so that they can be logged, compared and serialised."""
    decision = SafetyFilter(ROBOT, solver=solver).filter(0.9, 0.2, PLACES)
    numbers = (decision.v, decision.omega, decision.clearance, decision.slack)
    assert all(type(x) is float for x in (*numbers, decision.residual))
    assert type(decision.active) is tuple
    assert all(type(i) is int for i in decision.active)
    assert type(decision.status) is Status and decision.status == "filtered"


# -------------------------------------------------------------------- controllers
@pytest.mark.parametrize(("name", "ahead"), [("qp", False), ("qp-ahead", True)])
def test_the_qp_controllers_are_the_filter(name, ahead):
    step = make_controller(name, ROBOT, AvoidanceSettings(), "exact").start(0.3, 0.1)
    safety = SafetyFilter(ROBOT, ahead=ahead)
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


# ------------------------------------------------------- what may be wrong is refused
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
    ({"discs": [[2, 0, 1]], "disc_velocities": [[0, 0]] * 2}, "disc_velocities"),
    ({"disc_velocities": [[0.0, 0.0]]}, "disc_velocities"),
    ({"walls": [[1.0, 2.0, math.nan, 0.0]]}, r"walls\[0\]"),
    ({"discs": [[2.0, 0.0, -0.1]]}, "negative radius"),
]


def busy_filter(ahead, solver="exact"):
    """A filter that has something to remember."""
    limits = replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
    safety = SafetyFilter(replace(ROBOT, limits=limits), None, solver, ahead)
    for step in range(8):
        disc = [[1.5 - 0.01 * step, 0.1, 0.1]]
        safety.filter(0.8, 0.1, discs=disc, disc_velocities=[[-0.5, 0.0]])
    return safety


@pytest.mark.parametrize("solver", ["exact", "qpsolvers:daqp"])
@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
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
