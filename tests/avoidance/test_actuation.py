"""Actuation of the base: delay, ramps and jitter, modelled by the filter."""

import math

import numba
import numpy as np
import pytest

from driven import point_gap
from hostile import epsilon
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.plan import PENDING, frame_of_effect, fresh_state
from qpavoid.avoidance.settings import (
    Actuation,
    AvoidanceSettings,
    LookAhead,
    SafetyRadius,
)
from qpavoid.guide.guide import Guide
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot

LIMITS = Limits(-1.0, 1.0, -1.5, 1.5, acceleration=1.0, angular_acceleration=2.0)
FOOTPRINTS = (
    Footprint.pentagon(0.89, 0.58, math.radians(40.0)),
    Footprint.rectangle(0.5, 0.43),
    Footprint.polygon([(-0.9, -0.2), (0.3, -0.3), (0.5, 0.0), (0.3, 0.3), (-0.9, 0.2)]),
)
R_MIN, DT, LOOK = 0.02, 0.1, LookAhead()
BASES = {
    "as said": Actuation(),
    "late": Actuation(delay=DT),
    "later": Actuation(delay=2.5 * DT),
    "ramps": Actuation(ramps=True),
    "odd times": Actuation(jitter=1.0),
    "late at odd times": Actuation(delay=8.0 * DT, jitter=0.5),
    "all": Actuation(delay=DT, jitter=1.0, ramps=True),
}


@numba.njit(cache=True)
def least_gap(corners, x, y, heading, points):
    """The least distance of the footprint to all points."""
    cos, sin, least = math.cos(heading), math.sin(heading), math.inf
    for k in range(points.shape[0]):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        seen = cos * dx + sin * dy, cos * dy - sin * dx
        least = min(least, point_gap(corners, seen[0], seen[1]))
    return least


@numba.njit(cache=True)
def move(corners, pose, twist, wanted, rates, time, fine, points):
    """Drive towards what is wanted, in small arcs, and return the least distance."""
    least, many = math.inf, max(1, math.ceil(time / fine))
    h = time / many
    for i in range(2):
        if rates[i] == math.inf:
            twist[i] = wanted[i]
    for _ in range(many):
        v, omega = twist[0], twist[1]
        twist[0] += min(max(wanted[0] - v, -rates[0] * h), rates[0] * h)
        twist[1] += min(max(wanted[1] - omega, -rates[1] * h), rates[1] * h)
        middle = pose[2] + 0.25 * h * (omega + twist[1])
        pose[0] += 0.5 * h * (v + twist[0]) * math.cos(middle)
        pose[1] += 0.5 * h * (v + twist[0]) * math.sin(middle)
        pose[2] += 0.5 * h * (omega + twist[1])
        least = min(least, least_gap(corners, pose[0], pose[1], pose[2], points))
    return least


def least_distance(
    base, seed, ahead, said=None, dt=DT, look=LOOK, held=0.0, guided=False
):
    """Close the loop with a base, of which something is said; hostile demands.

    For 6 s, at a period dt; a demand is held for some ``held`` s. If ``guided`` the
    demands are goals of a guide, anywhere, obstacles included.
    """
    rng, demand = np.random.default_rng(seed), None
    footprint = FOOTPRINTS[seed % len(FOOTPRINTS)]
    corners, reach = footprint.vertices, footprint.circumradius
    robot = Robot("it", footprint, LIMITS)
    radius = SafetyRadius(r_min_slow=R_MIN, r_min_fast=R_MIN)
    said = base if said is None else said
    settings = AvoidanceSettings(
        radius=radius, gamma=min(10.0, 1.0 / dt), dt=dt, actuation=said, ahead=look
    )
    safety, guide = SafetyFilter(robot, settings, ahead=ahead), Guide(robot, settings)
    points = rng.uniform(-2.5, 2.5, (60, 2)) + np.array([1.0, 0.0])
    gaps = [least_gap(corners, 0.0, 0.0, 0.0, point[None]) for point in points]
    points = points[np.array(gaps) > R_MIN + rng.uniform(0.0, 0.3)]
    rates = np.array([LIMITS.acceleration, LIMITS.angular_acceleration])
    if not base.ramps:
        rates = np.array([math.inf, math.inf])
    pose, twist, least = np.zeros(3), np.zeros(2), math.inf
    now, queue, active = 0.0, [], np.zeros(2)
    for _ in range(round(6.0 / dt)):
        near = points[np.hypot(*(points - pose[:2]).T) < reach + 3.0]
        offset, (cos, sin) = near - pose[:2], (math.cos(pose[2]), math.sin(pose[2]))
        seen = offset @ np.array([[cos, -sin], [sin, cos]])
        if demand is None or rng.uniform() > held / (held + dt):
            turn = rng.choice([0.0, 9.0, -9.0, 0.5])
            demand = [math.copysign(9.0, rng.normal()), turn]
            if rng.uniform() < 0.5:
                demand[0] = 9.0
            goal = (*rng.uniform(-3.0, 3.0, 2), rng.uniform(-3.0, 3.0))
            guide.go_to(tuple(pose), goal, speed=1.0)
        decision = safety.filter(*demand, seen)
        if guided:
            decision = guide.step(tuple(pose), seen)
        queue.append((now + base.delay, np.array([decision.v, decision.omega])))
        end = now + dt * (1.0 + base.jitter * rng.choice([-0.5, 0.0, 1.0, 1.0]))
        while now < end - 1e-12:
            while queue and queue[0][0] <= now + 1e-12:
                active = queue.pop(0)[1]
            until = min([end, *(start for start, _ in queue)])
            found = move(
                *(corners, pose, twist, active, rates, until - now, dt / 40, points)
            )
            least, now = min(least, found), until
    return least


@pytest.mark.parametrize("count", [8, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@pytest.mark.parametrize("name", BASES)
def test_r_min_is_kept_by_a_base_that_does_what_is_said_of_it(name, ahead, count):
    least = min(least_distance(BASES[name], seed, ahead) for seed in range(count))
    assert least >= R_MIN - epsilon(R_MIN)


@pytest.mark.parametrize("ramps", [False, True])
def test_the_frame_of_effect_is_where_the_pending_twists_lead(ramps):
    """The last half of a step and two whole ones, in steps of 10 µs."""
    state, twists = fresh_state(), [(0.4, 0.3), (0.3, 0.1), (0.38, 0.3), (0.3, 0.1)]
    state[PENDING : PENDING + 8] = np.ravel(twists)
    settings = AvoidanceSettings(dt=DT, actuation=Actuation(2.5 * DT, ramps=ramps))
    robot = Robot("cart", FOOTPRINTS[1], LIMITS)
    at = frame_of_effect(robot.limit_vector, settings.record(), state)
    x, y, heading, h = 0.0, 0.0, 0.0, 1e-5
    for k, begin in ((2, 0.5 * DT), (1, 0.0), (0, 0.0)):
        for time in np.arange(begin, DT, h):
            share = [time * 1.0, time * 2.0] if ramps else [math.inf, math.inf]
            gap = np.subtract(twists[k], twists[k + 1])
            v, omega = twists[k + 1] + np.clip(gap, np.negative(share), share)
            x, y = x + h * v * math.cos(heading), y + h * v * math.sin(heading)
            heading += h * omega
    assert (at.x, at.y) == pytest.approx((x, y), abs=1e-3)
    assert math.atan2(at.sin, at.cos) == pytest.approx(heading, abs=1e-3)


@pytest.mark.parametrize("name", ["late", "ramps", "odd times"])
def test_what_is_not_said_costs_r_min(name):
    """The scenes are hard enough: a filter that is told nothing passes r_min."""
    base, silent = BASES[name], Actuation()
    found = [least_distance(base, seed, False, silent) for seed in range(12)]
    assert min(found) < R_MIN - epsilon(R_MIN)


PERIODS = (0.01, 0.03, 1 / 16, 0.09, 0.11, 1 / 9, 1 / 8, 1 / 7, 0.17, 0.25)


def least_at(dt, seed):
    """The least distance of a loop at a period, with a horizon that is off its grid."""
    rng = np.random.default_rng([seed, round(1e6 * dt)])
    horizon = rng.choice([0.5, 0.7, *rng.uniform(0.1, 1.5, 2) * (dt, 2.0)])
    look = LookAhead(horizon, min(1.0, horizon), min(0.05, horizon))
    delay = rng.choice([0.0, 0.0, dt, rng.uniform(0.0, 8.0) * dt, 8.0 * dt])
    rough = rng.uniform() < 0.25
    base = Actuation(delay, jitter=0.5 * rough, ramps=bool(rough))
    held, ahead = rng.choice([0.0, 0.3, 1.0]), rng.uniform() < 0.8
    return least_distance(base, seed, ahead, None, dt, look, held, seed % 4 == 3)


@pytest.mark.parametrize("count", [24, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("dt", PERIODS)
def test_r_min_is_kept_at_any_period_and_horizon(dt, count):
    """Plans last whole control steps, whatever the period (theorem 1)."""
    count = min(count, round(600 * dt)) if count == 24 else count
    assert min(least_at(dt, k) for k in range(count)) >= R_MIN - epsilon(R_MIN)
