"""Bodies of the look-ahead, their reach and their margins."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from driven import gap_at, least_of, lines_of
from qpavoid.avoidance import bodies as table
from qpavoid.avoidance import margin as broad
from qpavoid.avoidance import proposals as lin
from qpavoid.avoidance.bodies import threshold
from qpavoid.avoidance.cbf_rows import R_MIN_TOLERANCE
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.step import look_ticks
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import stopping_time
from rollouts import (
    HORIZON,
    SETTINGS,
    every_robot,
    line_of,
    mixed,
    robots,
    rolled,
    scene_of,
    seeds,
    some_plan,
)
from shapes import ROBOT


def rows(scene):
    """The bodies, by name, in the order of the obstacles."""
    bodies = [table.Body(*body) for body in scene.bodies]
    return sorted(bodies, key=lambda body: body.owner)


@pytest.mark.parametrize("horizon", [0.0, HORIZON], ids=["present", "ahead"])
@every_robot
@given(seeds)
def test_what_is_not_in_reach_cannot_be_met(robot, horizon, seed):
    """However it is driven, what is left out stays farther away than wanted."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-6, 6, (8, 2)), rng.uniform(0, 0.4, 8)])
    velocities = rng.normal(size=(8, 2)) * rng.choice([0.0, 0.01, 0.6], 8)[:, None]
    world = Obstacles(discs=discs, disc_velocities=velocities)
    scene = scene_of(robot, world, horizon=horizon)
    lines, limits = lines_of(discs=discs, velocities=velocities), robot.limits
    twist = rng.choice([limits.v_min, limits.v_max]), limits.omega_max * rng.random()
    for i in set(range(8)) - {int(body.owner) for body in rows(scene)}:
        speed = float(np.hypot(*velocities[i]))
        if horizon == 0.0 and speed > 0.01:
            continue
        time = horizon
        if speed <= 0.01:
            time += stopping_time(robot.limit_vector, *map(float, twist), SETTINGS.dt)
        start = (0.0, 0.0, 0.0)
        least = least_of(
            robot.footprint.vertices, start, twist, time, 0.0, lines[i], math.inf
        )
        assert least > SETTINGS.radius.r_min(speed)


def test_no_more_is_wanted_of_what_stands_than_there_is():
    """Nearer than r_min, or touching: as far as now, less the tolerance.

    Or as far as the nearest that does not touch, of what is behind that.
    """
    rng, corners, met = np.random.default_rng(3), ROBOT.footprint.vertices, 0
    for _ in range(200):
        points, walls = rng.uniform(-1, 1, (3, 2)), rng.uniform(-1, 1, (1, 4))
        bodies = scene_of(ROBOT, Obstacles(points=points, walls=walls)).bodies
        lines = [[*line_of(body)[:4], 0.0, *line_of(body)[5:]] for body in bodies]
        gaps = [gap_at(corners, (0.0, 0.0, 0.0), np.array(x), 0.0) for x in lines]
        nearest = min((gap for gap in gaps if gap > 0.0), default=math.inf)
        for body, gap in zip(bodies, gaps, strict=True):
            most = min(0.17, gap + R_MIN_TOLERANCE)
            keep = table.Body(*body).required
            assert keep == pytest.approx(most, abs=1e-9) or (
                nearest + R_MIN_TOLERANCE - 1e-9 <= keep < most
            )
            met += gap < 0.169
    assert met > 100


def scanned(rng):
    """Walls and posts as a scan has them, beside other things."""
    pieces = []
    for _ in range(rng.integers(2, 5)):
        bearing, far = rng.uniform(-math.pi, math.pi), rng.uniform(0.6, 2.5)
        along = rng.uniform(-1.5, 1.5) + np.linspace(-0.7, 0.7, rng.integers(3, 90))
        cos, sin = math.cos(bearing), math.sin(bearing)
        wall = np.column_stack([far * cos - along * sin, far * sin + along * cos])
        pieces.append(wall + rng.normal(size=wall.shape) * 0.01 * (rng.random() < 0.6))
    others = mixed(rng, 2.5)
    return replaced(others, np.vstack([*pieces, others.points]))


def replaced(world, points):
    motions = world.polygon_velocities
    parts = world.discs, world.disc_velocities, world.walls, world.polygons, motions
    return Obstacles(points, *parts)


def ungrouped(scene):
    bodies = scene.bodies.copy()
    bodies["group"] = -1
    return scene._replace(bodies=bodies)


@robots
@given(seeds)
def test_no_answer_depends_on_groups(robot, seed):
    rng = np.random.default_rng(seed)
    scene = scene_of(robot, scanned(rng), rng.uniform([-0.3, -0.5], [0.8, 0.5]))
    plain, plan = ungrouped(scene), some_plan(rng)
    rollout = rolled(scene, plan)
    level = float(rng.choice([threshold(scene), 0.0, 0.1]))
    for moving in (HORIZON, -1.0):
        watch = broad.Watch((moving, level), (rollout.rest, level))
        for slack in (0.0, 1e-3):
            met = broad.violation(scene, rollout, watch, slack)
            assert met == broad.violation(plain, rollout, watch, slack)
    tables = []
    for one in (scene, plain):
        ticks = look_ticks(SETTINGS.record())
        tables.append(np.zeros(lin.most_predicted(ticks), lin.PREDICTED))
        frames = np.zeros(ticks + 1, lin.FRAME)
        lin.predict_contacts(one, rollout, tables[-1], frames)
    np.testing.assert_array_equal(*tables)


@pytest.mark.parametrize("behind", [-2.0, -3.0])
def test_active_names_what_is_in_the_way_not_what_is_behind(behind):
    """Beyond the look-ahead at what stands, and nearer than a stop."""
    limits = replace(ROBOT.limits, acceleration=0.25, angular_acceleration=1.0)
    safety = SafetyFilter(replace(ROBOT, limits=limits))
    safety.reset(1.0, 0.0)
    decision = safety.filter(1.0, 0.0, [(behind, 0.3), (2.4, 0.0)])
    assert 0 not in decision.active
