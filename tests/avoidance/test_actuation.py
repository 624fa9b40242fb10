"""What a base does to a twist, and the filter is told: late, ramped, at odd times."""

import math

import numba
import numpy as np
import pytest

from driven import point_gap
from hostile import epsilon
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import Actuation, AvoidanceSettings, SafetyRadius
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot

LIMITS = Limits(-1.0, 1.0, -1.5, 1.5, acceleration=1.0, angular_acceleration=2.0)
FOOTPRINTS = (
    Footprint.pentagon(0.89, 0.58, math.radians(40.0)),
    Footprint.rectangle(0.5, 0.43),
    Footprint.polygon([(-0.9, -0.2), (0.3, -0.3), (0.5, 0.0), (0.3, 0.3), (-0.9, 0.2)]),
)
R_MIN, DT = 0.02, 0.1
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


def least_distance(base, seed, ahead, said=None, steps=60):
    """Close the loop with a base, of which something is said; hostile demands."""
    rng = np.random.default_rng(seed)
    footprint = FOOTPRINTS[seed % len(FOOTPRINTS)]
    corners, reach = footprint.vertices, footprint.circumradius
    robot = Robot("it", footprint, LIMITS)
    radius = SafetyRadius(r_min_slow=R_MIN, r_min_fast=R_MIN)
    said = base if said is None else said
    settings = AvoidanceSettings(radius=radius, gamma=10.0, dt=DT, actuation=said)
    safety = SafetyFilter(robot, settings, ahead=ahead)
    points = rng.uniform(-2.5, 2.5, (60, 2)) + np.array([1.0, 0.0])
    gaps = [least_gap(corners, 0.0, 0.0, 0.0, point[None]) for point in points]
    points = points[np.array(gaps) > R_MIN + rng.uniform(0.0, 0.3)]
    rates = np.array([LIMITS.acceleration, LIMITS.angular_acceleration])
    if not base.ramps:
        rates = np.array([math.inf, math.inf])
    pose, twist, least = np.zeros(3), np.zeros(2), math.inf
    now, queue, active = 0.0, [], np.zeros(2)
    for _ in range(steps):
        near = points[np.hypot(*(points - pose[:2]).T) < reach + 3.0]
        offset, (cos, sin) = near - pose[:2], (math.cos(pose[2]), math.sin(pose[2]))
        seen = offset @ np.array([[cos, -sin], [sin, cos]])
        demand = [math.copysign(9.0, rng.normal()), rng.choice([0.0, 9.0, -9.0, 0.5])]
        if rng.uniform() < 0.5:
            demand[0] = 9.0
        decision = safety.filter(*demand, points=seen)
        queue.append((now + base.delay, np.array([decision.v, decision.omega])))
        end = now + DT * (1.0 + base.jitter * rng.choice([-0.5, 0.0, 1.0, 1.0]))
        while now < end - 1e-12:
            while queue and queue[0][0] <= now + 1e-12:
                active = queue.pop(0)[1]
            until = min([end, *(start for start, _ in queue)])
            found = move(
                *(corners, pose, twist, active, rates, until - now, DT / 40, points)
            )
            least, now = min(least, found), until
    return least


def worst(base, seeds, ahead):
    return min(least_distance(base, seed, ahead) for seed in seeds)


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@pytest.mark.parametrize("name", BASES)
def test_r_min_is_kept_by_a_base_that_does_what_is_said_of_it(name, ahead):
    assert worst(BASES[name], range(12), ahead) >= R_MIN - epsilon(R_MIN)


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@pytest.mark.parametrize("name", BASES)
def test_r_min_is_kept_in_a_thousand_scenes(name, ahead):
    assert worst(BASES[name], range(1000), ahead) >= R_MIN - epsilon(R_MIN)


@pytest.mark.parametrize("name", ["late", "ramps", "odd times"])
def test_what_is_not_said_costs_r_min(name):
    """The scenes are hard enough: a filter that is told nothing passes r_min."""
    base, silent = BASES[name], Actuation()
    found = [least_distance(base, seed, False, silent) for seed in range(12)]
    assert min(found) < R_MIN - epsilon(R_MIN)
