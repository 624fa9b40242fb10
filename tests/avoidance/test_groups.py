"""Points of a scan are told clear together: nothing of an answer depends on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from qpavoid.avoidance import bodies as table
from qpavoid.avoidance import margin as broad
from qpavoid.avoidance import proposals as lin
from qpavoid.avoidance.bodies import FEW, MOST_GROUPED, WIDEST_GROUP, threshold
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.proposals import violation
from qpavoid.avoidance.step import look_ticks
from qpavoid.model.obstacles import Obstacles
from rollouts import (
    HORIZON,
    SETTINGS,
    mixed,
    robots,
    rolled,
    scene_of,
    seeds,
    some_plan,
)
from shapes import ROBOT


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


def groups_of(scene):
    """Each group with the rows that it holds."""
    for begin in np.flatnonzero(scene.bodies["group"] >= 0):
        group = scene.groups[scene.bodies[begin].group]
        yield group, scene.bodies[begin : group.owner]


@given(seeds)
def test_who_keeps_away_from_a_group_keeps_away_from_its_points(seed):
    rng = np.random.default_rng(seed)
    scene = scene_of(ROBOT, scanned(rng))
    for group, rows in groups_of(scene):
        assert FEW <= len(rows) <= MOST_GROUPED
        apart = math.hypot(rows[-1].x - rows[0].x, rows[-1].y - rows[0].y)
        assert apart < WIDEST_GROUP * math.hypot(rows[0].x, rows[0].y)
        one = np.array([group.x + group.x1, group.y + group.y1])
        way = np.array([group.x2 - group.x1, group.y2 - group.y1])
        for seen in rng.uniform(-3, 3, (20, 2)):
            share = np.clip((seen - one) @ way / max(way @ way, 1e-18), 0.0, 1.0)
            room = np.hypot(*(seen - one - share * way)) - group.required
            for body in rows:
                assert body.kind == table.STANDS
                assert room <= math.hypot(*(seen - (body.x, body.y))) - body.required
                waived = body.required - body.beyond_r_min
                assert group.required - group.beyond_r_min <= waived + 1e-12


@robots
@given(seeds)
def test_no_answer_depends_on_groups(robot, seed):
    rng = np.random.default_rng(seed)
    scene = scene_of(robot, scanned(rng), rng.uniform([-0.3, -0.5], [0.8, 0.5]))
    plain, plan = ungrouped(scene), some_plan(rng)
    rollout = rolled(scene, plan, scene.last, 0.0, 2)
    level = float(rng.choice([threshold(scene), 0.0, 0.1]))
    for moving in (HORIZON, -1.0):
        watch = broad.Watch((moving, level), (rollout.rest, level))
        for one, other in ((scene, plain), (plain, scene)):
            kept = broad.keeps_all(one, rollout, watch)
            assert kept == (broad.first_violated(other, rollout, watch, 0.0).body < 0)
        met = broad.first_violated(scene, rollout, watch, 1e-3)
        assert met == broad.first_violated(plain, rollout, watch, 1e-3)
    for first in (-1, len(scene.bodies) // 2):
        assert violation(scene, rollout, first) == violation(plain, rollout, first)
    tables = []
    for one in (scene, plain):
        ticks = look_ticks(SETTINGS.record())
        sides = np.zeros(lin.most_predicted(ticks), lin.PREDICTED)
        frames = np.zeros(ticks + 1, lin.FRAME)
        lin.predict_contacts(one, rollout, lin.Tables(sides, frames))
        tables.append(sides)
    np.testing.assert_array_equal(*tables)


@pytest.mark.parametrize("behind", [-2.0, -3.0])
def test_active_names_what_is_in_the_way_not_what_is_behind(behind):
    """Beyond the look-ahead at what stands, and nearer than a stop."""
    limits = replace(ROBOT.limits, acceleration=0.25, angular_acceleration=1.0)
    safety = SafetyFilter(replace(ROBOT, limits=limits))
    safety.reset(1.0, 0.0)
    decision = safety.filter(1.0, 0.0, [(behind, 0.3), (2.4, 0.0)])
    assert 0 not in decision.active
