"""What the look-ahead rows see: bodies, their groups, reach and margins."""

import math

import numpy as np
import pytest
from hypothesis import given
from shapes import ROBOT
from test_ahead_rows import (
    SETTINGS,
    TICK,
    distance,
    driven,
    horizon,
    robots,
    scene_of,
    seeds,
)

from qpavoid.avoidance import prediction as pre
from qpavoid.avoidance import settings as sets
from qpavoid.avoidance.prediction import TICKS, WANTED
from qpavoid.model.obstacles import Obstacles


def test_bodies_by_hand():
    settings = sets.AvoidanceSettings(ahead=sets.LookAhead(2.0, 0.5, 0.1))
    obstacles = Obstacles(
        points=[[1.0, 0.0], [50.0, 0.0], [1.2, 0.0], [1.2, 0.24], [1.3, 0.0]],
        discs=[[2.0, 1.0, 0.3], [-1.0, 0.8, 0.2]],
        disc_velocities=[[-0.3, 0.0], [0.0, 0.0]],
        walls=[[1.0, -1.0, 1.0, 1.0]],
    )
    (*_, bodies, groups, _), ticks, _ = scene_of(ROBOT, obstacles, settings=settings)
    assert bodies[:, pre.OWNER].tolist() == [0, 2, 3, 4, 5, 6, 7] and ticks == 20
    spans = groups[:, [pre.FIRST, pre.PAST, TICKS]].tolist()
    assert spans == [[0, 3, 5], [3, 4, 5], [4, 5, 20], [5, 6, 5], [6, 7, 5]]
    spread = bodies[0, WANTED] + math.hypot(0.1, 0.12)
    assert groups[0, [0, 1, 7]] == pytest.approx([1.1, 0.12, spread])
    assert bodies[4, [0, 1, 2, 3, 5, 6]].tolist() == [2.0, 1.0, 2.0, 1.0, -0.3, 0.0]
    assert bodies[6, :4].tolist() == [1.0, -1.0, 1.0, 1.0]
    assert not bodies[[0, 1, 2, 3, 5, 6], 5:7].any()
    wanted = np.array([*[0.17] * 4, 0.3 + 0.2, 0.2 + 0.17, 0.17])
    assert (bodies[:, WANTED] >= wanted).all()
    assert (bodies[:, WANTED] <= np.hypot(wanted, 0.15)).all()
    assert bodies[:, pre.SPREAD] == pytest.approx(bodies[:, WANTED] + [*[0] * 6, 1])


@robots
@given(seeds)
def test_what_is_not_in_reach_cannot_be_met(robot, seed):
    """However it is driven, what is left out stays farther away than wanted."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-6, 6, (8, 2)), rng.uniform(0, 0.4, 8)])
    velocities = rng.normal(size=(8, 2)) * rng.choice([0.0, 0.6], 8)[:, None]
    scene, _, _ = scene_of(robot, Obstacles(discs=discs, disc_velocities=velocities))
    poses = driven(scene, rng.choice([-1, 1], 2) * [1.0, rng.uniform(0, 1.5)])
    for i in set(range(8)) - set(scene[3][:, pre.OWNER].tolist()):
        body = np.array([*discs[i, :2], *discs[i, :2], 0.0, *velocities[i]])
        least = min(distance(poses, k, body) for k in range(1, horizon(body) + 1))
        speed = float(np.hypot(*velocities[i]))
        assert least - discs[i, 2] > SETTINGS.radius.r_min(speed)


def test_margins_and_age_widen_the_bodies():
    world = Obstacles(discs=[[2.0, 1.0, 0.3]], disc_velocities=[[-0.3, 0.0]])

    def wanted(age=0.0, closing=0.0, v=0.0, **margins):
        radius = sets.SafetyRadius(closing=closing)
        settings = sets.AvoidanceSettings(radius, margins=sets.Margins(**margins))
        missed = 0.5 * TICK * (1.3 + 0.75 * ROBOT.footprint.circumradius)
        scene, _, _ = scene_of(ROBOT, world, (v, 0.7), settings, age)
        return math.sqrt(scene[3][0, WANTED] ** 2 - missed**2)

    assert wanted() == pytest.approx(0.3 + 0.2)
    assert wanted(age=0.4) == pytest.approx(0.5 + 0.4 * 0.3)
    assert wanted(error=0.05) == pytest.approx(0.55)
    accelerating = 0.4 * (0.3 + 0.4 * 0.5) + 0.5 * 0.5 * 0.02**2
    assert wanted(age=0.4, acceleration=0.5) == pytest.approx(0.5 + accelerating)
    towards = 2.0 / math.hypot(2.0, 1.0)
    assert wanted(closing=0.5) == pytest.approx(0.5 + 0.15 * towards)
    assert wanted(closing=0.5, v=0.4) == pytest.approx(0.5 + 0.35 * towards)
    assert wanted(closing=0.5, v=-0.4) == pytest.approx(0.5)
