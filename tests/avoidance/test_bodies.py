"""Bodies of the look-ahead, their reach and their margins."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from driven import gap_at, least_of, lines_of
from qpavoid.avoidance import bodies as table
from qpavoid.avoidance.cbf_rows import R_MIN_TOLERANCE
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import stopping_time
from rollouts import (
    HORIZON,
    SETTINGS,
    every_robot,
    line_of,
    scene_of,
    seeds,
)
from shapes import ROBOT

EVERYTHING = Obstacles(
    points=[[1.0, 0.0], [50.0, 0.0], [1.2, 0.24]],
    discs=[[2.0, 1.0, 0.3], [-1.0, 0.8, 0.2], [1.5, 0.0, 0.1]],
    disc_velocities=[[-0.3, 0.0], [0.0, 0.0], [0.0, 0.06]],
    walls=[[1.0, -1.0, 1.0, 1.0]],
    polygons=[[(1.0, 1.0), (1.4, 1.0), (1.2, 1.3)]],
    polygon_velocities=[(0.1, 0.0, 0.5)],
)


def rows(scene):
    """The bodies, by name, in the order of the obstacles."""
    bodies = [table.Body(*body) for body in scene.bodies]
    return sorted(bodies, key=lambda body: body.owner)


def test_bodies_by_hand():
    scene = scene_of(ROBOT, EVERYTHING)
    bodies = rows(scene)
    one = bodies[2]
    assert (one.x, one.y, one.v_x, one.v_y) == (2.0, 1.0, -0.3, 0.0)
    assert not any(any(bodies[i][6:9]) for i in (0, 1, 3, 5))
    spins = np.hypot(0.1, 0.0) + 0.5 * np.hypot(0.2, 0.1)  # of its farthest corner
    r_min = SETTINGS.radius.r_min
    wanted = [0.17, 0.17, 0.3 + r_min(0.3), 0.2 + 0.17, 0.1 + 0.17, 0.17]
    assert [b.required for b in bodies[:6]] == pytest.approx(wanted)
    assert [b.required for b in bodies[6:]] == pytest.approx([r_min(spins)] * 3)
    assert [b.turn for b in bodies[6:]] == [0.5] * 3
    lines = lines_of(
        polygons=[[(1.0, 1.0), (1.4, 1.0), (1.2, 1.3)]], motions=[(0.1, 0.0, 0.5)]
    )
    for line in lines:
        back = [*line[2:4], *line[:2], *line[4:]]
        assert any(
            line_of(body._replace(required=0.0)) == pytest.approx(ends, abs=1e-12)
            for body in bodies[6:]
            for ends in (list(line), back)
        )


def test_who_does_not_look_ahead_sees_what_stands_or_creeps():
    """For as long as a stop takes."""
    near = rows(scene_of(ROBOT, EVERYTHING, horizon=0.0))
    assert [body.owner for body in near] == [6]
    limits = replace(ROBOT.limits, acceleration=0.5)
    slow = replace(ROBOT, limits=limits)
    bodies = rows(scene_of(slow, EVERYTHING, horizon=0.0))
    assert [body.owner for body in bodies] == [0, 2, 4, 5, 6]
    assert [body.kind for body in bodies] == [0, 0, 0, 2, 0]
    assert [body.growth for body in bodies] == pytest.approx([0, 0, 0, 0.06, 0])


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
