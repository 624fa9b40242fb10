"""Limits that robots have: boxes, wheels, accelerations; and how long a stop takes."""

import math
from dataclasses import replace

import daqp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from problem_bank import qp
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import (
    Limits,
    Robot,
    braking_steps,
    braking_twist,
    limit_twist,
    stopping_time,
    twist_box,
)
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import solve
from shapes import ROBOT, scene

seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-3, 3), st.floats(-4, 4)
times = st.sampled_from([0.01, 0.02, 0.05, 0.1])
HAIR = 1e-9


@st.composite
def all_limits(draw):
    """Boxes that hold zero, with or without accelerations and wheels."""
    above = st.floats(0.05, 2.0)
    maybe = st.one_of(st.just(math.inf), st.floats(0.2, 5.0))
    wheel = draw(st.one_of(st.just(math.inf), st.floats(0.1, 2.0)))
    return Limits(
        -draw(st.floats(0.0, 2.0)),
        draw(above),
        -draw(above),
        draw(st.floats(0.0, 2.0)),
        draw(maybe),
        draw(maybe),
        wheel,
        draw(st.floats(0.1, 1.0)),
    )


def numbers_of(limits):
    return Robot("r", ROBOT.footprint, limits).limit_vector


def inside(limits, v, omega):
    """The nearest twist that the limits allow, for a last twist."""
    v = min(max(v, limits.v_min), limits.v_max)
    omega = min(max(omega, limits.omega_min), limits.omega_max)
    wheel = abs(v) + 0.5 * limits.track * abs(omega)
    share = min(1.0, limits.wheel_speed / wheel) if wheel > 0.0 else 1.0
    return share * v, share * omega


def check_limits(limits, last, u, dt):
    """Assert what the actuators can do; the twist ``last`` keeps the limits itself."""
    v, omega = u
    assert limits.v_min - HAIR <= v <= limits.v_max + HAIR
    assert limits.omega_min - HAIR <= omega <= limits.omega_max + HAIR
    for side in (-1.0, 1.0):
        assert abs(v + side * omega * limits.track / 2) <= limits.wheel_speed + HAIR
    assert abs(v - last[0]) <= limits.acceleration * dt + HAIR
    assert abs(omega - last[1]) <= limits.angular_acceleration * dt + HAIR


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"wheel_speed": 1.0}, "need a track"),
        ({"v_min": 0, "v_max": 0, "omega_min": 0, "omega_max": 0}, "no twist but zero"),
    ],
    ids=str,
)
def test_limits_that_make_no_sense(wrong, message):
    box = {"v_min": -1.0, "v_max": 1.0, "omega_min": -1.0, "omega_max": 1.0}
    with pytest.raises(InvalidInputError, match=message):
        Limits(**{**box, **wrong})


def test_what_is_driven_is_the_nearest_twist_that_can_follow():
    """Of a convex polygon in (v, ω): as a QP of DAQP says, which may be infeasible."""
    rng, infeasible = np.random.default_rng(5), 0
    for _ in range(10_000):
        track, wheel, dt = *rng.uniform(0.1, 1.5, 2), rng.uniform(0.01, 0.25)
        box = rng.uniform(0.05, 2.0, 4) * (-1, 1, -2, 2)
        rates = np.where(rng.random(2) < 0.3, math.inf, rng.uniform(0.1, 5.0, 2))
        robot = numbers_of(Limits(*box, *rates, wheel, track))
        last, asked = rng.uniform(-2.0, 2.0, (2, 2)) * (1.0, 2.0)
        if rng.random() < 0.5:  # a wheel at its limit
            last *= wheel / (abs(last[0]) + 0.5 * track * abs(last[1]))
        curve = asked * min(1.0, wheel / (abs(asked) @ (1.0, 0.5 * track)))
        v_low, v_high, low, high = twist_box(robot, *last, dt)
        upper, lower = np.array([v_high, high, wheel, wheel]), [v_low, low]
        found, _, solved, _ = daqp.solve(
            np.eye(2),
            -curve,
            np.array([[1.0, 0.5 * track], [1.0, -0.5 * track]]),
            upper,
            np.array([*lower, -wheel, -wheel]),
            np.zeros(4, dtype=np.int32),
            primal_tol=1e-10,
        )
        if solved != 1:
            infeasible, found = infeasible + 1, braking_twist(robot, *last, dt)
        driven = limit_twist(robot, tuple(asked), tuple(last), dt)
        assert driven == pytest.approx(found, abs=1e-7)
    assert 100 < infeasible < 3000


@given(all_limits(), speeds, turns, times)
def test_braking_comes_to_rest_within_all_limits(limits, v, omega, dt):
    robot, twist = numbers_of(limits), inside(limits, v, omega)
    steps = int(braking_steps(robot, *twist, dt))
    assume(steps < 500)
    for left in range(steps - 1, -1, -1):
        after = braking_twist(robot, *twist, dt)
        check_limits(limits, twist, after, dt)
        assert abs(after[0] * twist[1] - after[1] * twist[0]) <= 1e-9
        twist = after
        assert int(braking_steps(robot, *twist, dt)) == max(left, 1)
    assert twist == (0.0, 0.0)


@given(all_limits(), speeds, turns, times)
def test_braking_drives_the_rest_of_the_arc(limits, v, omega, dt):
    """u_b τ(u_b) = u (τ(u) − dt), and the whole way down ends where τ says."""
    robot, u = numbers_of(limits), inside(limits, v, omega)
    b = braking_twist(robot, *u, dt)
    rest = stopping_time(robot, *u, dt) - dt
    way = np.array(b) * stopping_time(robot, *b, dt)
    assert way == pytest.approx(np.array(u) * rest, abs=1e-9)
    pose, twist = arc(0.0, 0.0, 0.0, *u, dt), u
    for _ in range(int(braking_steps(robot, *u, dt))):
        twist = braking_twist(robot, *twist, dt)
        pose = arc(*pose, *twist, dt)
    expected = arc(0.0, 0.0, 0.0, *u, stopping_time(robot, *u, dt))
    assert pose == pytest.approx(expected, abs=1e-6)


def wheel_rows(track, w_max):
    half = track / 2
    rows = [[1, -half], [1, half], [-1, -half], [-1, half]]
    return rows, [-w_max] * 4


@pytest.mark.parametrize("name", ["exact", "osqp", "casadi", "qpsolvers:daqp"])
def test_hard_rows_are_never_relaxed(name):
    """Rows that want 2 m/s forwards and backwards: only they give way."""
    rng = np.random.default_rng(1)
    rows, bounds = wheel_rows(0.6, 0.7)
    relaxed = 0
    for _ in range(40):
        soft = rng.normal(size=(3, 2))
        b = [*rng.uniform(-0.5, 1.5, 3), *bounds]
        problem = qp([*soft, *rows], b, rng.normal(size=2), n_hard=4)
        exact, solution = solve(problem), solve(problem, name)
        relaxed += exact.status is SolveStatus.RELAXED
        assert solution.status is exact.status
        assert solution.slack == pytest.approx(exact.slack, abs=1e-8)
        assert solution.u == pytest.approx(exact.u, abs=1e-6)
        assert (problem.A[3:] @ solution.u >= problem.b[3:] - 1e-6).all()
        eased = problem.b[:3] - exact.slack - 1.001e-3
        assert (problem.A[:3] @ solution.u >= eased - 1e-6).all()
    assert 5 < relaxed < 40


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@given(all_limits(), seeds, times)
def test_every_answer_of_the_filter_keeps_all_limits(ahead, limits, seed, dt):
    """Step after step, feasible or not, from whatever twist the limits allow."""
    rng = np.random.default_rng(seed)
    settings = AvoidanceSettings(dt=dt)
    safety = SafetyFilter(replace(ROBOT, limits=limits), settings, ahead=ahead)
    last = inside(limits, *rng.normal(size=2))
    safety.reset(*last)
    for _ in range(4):
        decision = safety.filter(*2 * rng.normal(size=2), Obstacles(**scene(rng)))
        check_limits(limits, last, decision[:2], dt)
        last = decision[:2]


@pytest.mark.parametrize("name", ["exact", "qpsolvers:daqp"])
def test_accelerations_count_from_what_is_driven(name):
    limits = replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
    safety = SafetyFilter(replace(ROBOT, limits=limits), solver=name)
    assert safety.filter(1.0, 1.0)[:2] == pytest.approx((0.04, 0.05))
    assert safety.filter(1.0, 1.0)[:2] == pytest.approx((0.08, 0.10))
    decision = safety.filter(1.0, 1.0, driven=(0.5, -0.5))
    assert decision[:2] == pytest.approx((0.54, -0.45))
    safety.reset(0.3)
    assert safety.filter(-1.0, 0.0)[:2] == pytest.approx((0.26, 0.0))
