"""Margins for errors, age, acceleration and closing speed; horizons."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from oracles import point_distance
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import (
    AvoidanceSettings,
    Margins,
    Repulsion,
    SafetyRadius,
)
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT

DT = 0.02
seeds = st.integers(0, 2**32 - 1)


def distance(discs):
    """The least distance, by the oracles."""
    vertices = ROBOT.footprint.vertices
    return min(point_distance(vertices, disc[:2]) - disc[2] for disc in discs)


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@given(seeds)
def test_margins_act_like_greater_obstacles(ahead, seed):
    """An error, an age, an acceleration: the same as so much more radius."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-2, 2, (2, 2)), [0.1, 0.2]])
    velocities = rng.normal(size=(2, 2)) * 0.4
    assume(distance(discs) > 0.6)
    age, error, a = rng.uniform(0, [0.3, 0.05, 0.3])
    settings = AvoidanceSettings(margins=Margins(error, a))
    old = SafetyFilter(ROBOT, settings, ahead=ahead)
    wider = error + age * (np.hypot(*velocities.T) + a * age) + 0.5 * a * DT**2
    grown = discs + np.outer(wider, [0, 0, 1])
    assume(distance(grown) > SafetyRadius().r_min(9.0))
    one = old.filter(
        0.6, 0.2, Obstacles(discs=discs, disc_velocities=velocities), age=age
    )
    other = SafetyFilter(ROBOT, ahead=ahead).filter(
        0.6, 0.2, Obstacles(discs=grown, disc_velocities=velocities)
    )
    assert one[:2] == pytest.approx(other[:2], abs=1e-5)
    assert one.status is other.status
    assert one.shortfall == pytest.approx(other.shortfall, abs=1e-6)


def driving(ahead, margins=None):
    """A filter of a robot with accelerations that drives at 0.8 m/s."""
    limits = replace(ROBOT.limits, acceleration=1.0, angular_acceleration=2.0)
    settings = AvoidanceSettings(gamma=10.0, margins=margins or Margins())
    safety = SafetyFilter(replace(ROBOT, limits=limits), settings, ahead=ahead)
    safety.reset(0.8, 0.0)
    return safety


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@given(seeds)
def test_age_widens_points_also_where_they_bar_a_stop(ahead, seed):
    """Points that may have moved since: as discs that stand, with room to brake."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([0.8, -0.3], [1.5, 0.3], (3, 2))
    age, a = rng.uniform(0.05, [0.2, 2.0])
    wider = a * age**2 + 0.5 * a * DT**2
    discs = np.column_stack([points, [wider] * 3])
    one = driving(ahead, Margins(0.0, a)).filter(0.8, 0.0, points, age=age)
    other = driving(ahead).filter(0.8, 0.0, Obstacles(discs=discs))
    assert one[:2] == pytest.approx(other[:2], abs=1e-5)
    assert one.status is other.status


aged = given(seeds, st.floats(0.05, 30.0), st.floats(0.0, 2.0))
"""A scene, an age in s, and the margin of the acceleration in m/s²."""


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@aged
def test_nothing_is_fled_from_for_its_age(ahead, seed, age, a):
    """A robot that wants to stand, farther than r_min from what stands, stands."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-2, 2, (3, 2)), [0.0, 0.1, 0.2]])
    assume(distance(discs) > SafetyRadius().r_min(0.0) + 0.5 * a * DT**2)
    safety = SafetyFilter(ROBOT, AvoidanceSettings(margins=Margins(0, a)), ahead=ahead)
    told = safety.filter(
        0.0, 0.0, Obstacles(points=discs[:1, :2], discs=discs[1:]), age=age
    )
    assert told[:2] == (0.0, 0.0) and told.status in (Status.TRACKING, Status.HOLDING)


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@aged
def test_what_may_be_anywhere_is_braked_for(ahead, seed, age, a):
    """Along the arc until the robot stands, whatever stood or moved where."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-2, 2, 2)
    velocity = rng.normal(size=2) * rng.integers(0, 2)
    come = age * (np.hypot(*velocity) + a * age)
    assume(come > SafetyRadius().r_min(0.0) and distance([[x, y, 0.1]]) < come)
    safety = driving(ahead, Margins(0.0, a))
    safety.reset(0.8, 0.4)
    for k in range(41):
        seen = Obstacles(discs=[[x, y, 0.1]], disc_velocities=[velocity])
        told = safety.filter(0.8, -1.0, seen, age=age)
        left = 1.0 - min(k + 1, 40) / 40
        assert told[:2] == pytest.approx((0.8 * left, 0.4 * left), abs=1e-9)
        assert told.status in (Status.BRAKING, Status.HOLDING)
    assert told[:2] == (0.0, 0.0)


@given(st.floats(0, 3), st.floats(0.2, 10), st.floats(-0.4, 0.4))
def test_closing_radius_is_a_smaller_gamma(closing, gamma, speed):
    """r_min + κ·(−ḋ) in ḋ ≥ −γ(d − r_min) leaves ḋ ≥ −γ/(1 + γκ)·(d − r_min)."""
    radius = SafetyRadius(closing_gain=closing)
    settings = AvoidanceSettings(radius, gamma=gamma, braking_room=False)
    safety = SafetyFilter(ROBOT, settings, ahead=False)
    disc, velocity = [[0.95, 0.0, 0.05]], [[-speed, 0.0]]
    problem = safety.problem(1.0, 0.0, Obstacles(discs=disc, disc_velocities=velocity))
    room = distance(disc) - radius.r_min(abs(speed))
    rate = gamma / (1.0 + gamma * closing) if room > 0.0 else gamma
    assume(1.0 > rate * room - speed)
    assert problem.b[0] == pytest.approx(-rate * room + speed, abs=1e-9)
    closed = problem.b[0] - speed
    if room > 0.0:
        assert closed >= -gamma * (room + closing * closed) - 1e-9


@pytest.mark.parametrize("law", ["eq5", "eq7"])
def test_the_laws_repel_from_as_far_as_the_margins_say(law):
    """r grows with the error, and with the speed at which the obstacle closes in."""
    radius, still, coming = SafetyRadius(), [[0.0, 0.0]], [[0.0, -0.1]]
    push = Repulsion(1.0, "step")

    def status(gap, velocity, closing=0.0, error=0.0):
        settings = AvoidanceSettings(
            SafetyRadius(closing_gain=closing), push, margins=Margins(error)
        )
        step = make_controller(law, ROBOT, settings).start()
        disc = [[0.3, 0.29 + gap + 0.1, 0.1]]
        return step(0.0, 0.0, Obstacles(discs=disc, disc_velocities=velocity)).status

    r = radius.r()
    for velocity, settings, grown in (
        (still, {}, r),
        (still, {"error": 0.05}, r + 0.05),
        (coming, {"closing": 0.5}, r + 0.05),
        (still, {"closing": 0.5}, r),
    ):
        assert status(grown - 1e-6, velocity, **settings) is Status.REPELLED
        assert status(grown + 1e-6, velocity, **settings) is Status.TRACKING
