"""Passive safety: the robot is at rest when a contact comes that no plan avoids."""

import math
from dataclasses import replace

import numpy as np
import pytest

from driven import driven_to, gap_at, least_in_all, lines_of, lines_of_world
from hostile import R_MIN, Case, epsilon, make_demands, make_scene
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.obstacles import Obstacles

CASE = Case("accelerations", 0.05)
ROBOT = CASE.robot
PASSIVE = replace(CASE.settings, passive=True)


def braked_gap(v, omega, discs, velocities):
    """The least distance to discs while the robot drives a step, and then brakes."""
    a, alpha = ROBOT.limits.acceleration, ROBOT.limits.angular_acceleration
    n = max(abs(v) / (a * CASE.dt), abs(omega) / (alpha * CASE.dt), 1.0)
    n, pose, trace = math.ceil(n - 1e-9), (0.0, 0.0, 0.0), np.zeros((0, 5))
    for k in range(n if (v, omega) != (0.0, 0.0) else 0):
        u = v * (1 - k / n), omega * (1 - k / n)
        trace = np.vstack([trace, (*pose, *u)])
        pose = driven_to(pose, *u, CASE.dt)
    lines = lines_of(discs=discs, velocities=velocities)
    return least_in_all(ROBOT.footprint.vertices, trace, CASE.dt, lines)


def strangers(rng, count):
    """Discs that come near the robot within a second, from everywhere."""
    bearing, course = rng.uniform(-math.pi, math.pi, (2, count))
    speed = rng.uniform(0.3, 2.0, count)
    velocities = np.column_stack([speed * np.cos(course), speed * np.sin(course)])
    aside = rng.uniform(0.0, 0.7, count)
    places = aside[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    places = places - rng.uniform(0.3, 1.0, (count, 1)) * velocities
    return np.column_stack([places, rng.uniform(0.1, 0.3, count)]), velocities


def nearest(pose, world):
    """The least distance to anything at rest in the world."""
    corners, lines = ROBOT.footprint.vertices, lines_of_world(world)
    return min(gap_at(corners, pose, line, 0.0) for line in lines)


def caught(passive, solver="exact"):
    """Twists of a robot in a narrow passage, and when someone faster catches up."""
    settings = replace(CASE.settings, passive=passive)
    safety = SafetyFilter(ROBOT, settings, solver)
    walls, disc = [[-9.0, y, 99.0, y] for y in (-0.6, 0.6)], np.array([-4.0, 0.0, 0.3])
    pose, velocity, twists = (0.0, 0.0, 0.0), np.array([2.0, 0.0]), []
    for step in range(100):
        at = [[disc[0] + 2.0 * step * CASE.dt, 0.0, 0.3]]
        world = Obstacles(discs=at, disc_velocities=[velocity], walls=walls)
        if nearest(pose, Obstacles(discs=at)) < 0.0:
            return twists
        decision = safety.filter(0.8, 0.0, world.seen_from(pose))
        twists.append(decision[:2])
        pose = driven_to(pose, *decision[:2], CASE.dt)
    raise AssertionError("nobody caught up")


@pytest.mark.parametrize("solver", ["exact", "osqp"])
def test_it_stands_when_it_is_caught(solver):
    assert abs(caught(False, solver)[-1][0]) > 0.3
    twists = caught(True, solver)
    assert max(v for v, _ in twists) > 0.5
    assert twists[-1] == (0.0, 0.0)


def test_what_is_driven_passes_the_rule_or_is_no_worse_than_braking():
    rng, bitten = np.random.default_rng(2), 0
    filters = [
        SafetyFilter(ROBOT, replace(CASE.settings, passive=passive))
        for passive in (False, True)
    ]
    for _ in range(60):
        discs, velocities = strangers(rng, 3)
        last = rng.uniform([-0.5, -1.0], [0.8, 1.0])
        wish = rng.uniform([-1.0, -1.5], [1.0, 1.5])
        n = max(1, math.ceil(max(abs(last) / (np.array([2.0, 2.5]) * CASE.dt)) - 1e-9))
        braking = braked_gap(*last * (1 - 1 / n), discs, velocities)
        for safety, passive in zip(filters, (False, True), strict=True):
            safety.reset(*last)
            world = Obstacles(discs=discs, disc_velocities=velocities)
            decision = safety.filter(*wish, world)
            room = braked_gap(*decision[:2], discs, velocities)
            passes = room >= min(0.0, braking) - 0.004
            if decision.shortfall > R_MIN:
                assert passes or not passive
                bitten += not passes
    assert bitten > 3


def test_what_stands_is_not_touched_for_the_sake_of_what_moves():
    """The theorem of the braking rule, among strangers, with hostile demands."""
    rng, met = np.random.default_rng(3), 0
    for _ in range(12):
        safety, pose = SafetyFilter(ROBOT, PASSIVE), (0.0, 0.0, 0.0)
        world, (discs, velocities) = make_scene(rng, most=1.2), strangers(rng, 2)
        for step, wish in enumerate(make_demands(rng, 50, CASE.dt)[0]):
            shift = np.column_stack([velocities, np.zeros(2)]) * step * CASE.dt
            moving = np.zeros((len(world.discs) + 2, 2))
            moving[-2:] = velocities
            everything = Obstacles(
                points=world.points,
                discs=np.vstack([world.discs, discs + shift]),
                disc_velocities=moving,
                walls=world.walls,
            )
            decision = safety.filter(*wish, everything.seen_from(pose))
            met += decision.shortfall > R_MIN
            pose = driven_to(pose, *decision[:2], CASE.dt)
            assert nearest(pose, world) >= R_MIN - epsilon(R_MIN)
    assert met > 10
