"""Rows of the look-ahead: gradients of true distances; and the twists they lead to."""

import math

import numpy as np
import pytest
from hypothesis import assume, given

from driven import gap_at
from qpavoid.avoidance import bodies as table
from qpavoid.avoidance import proposals as lin
from qpavoid.avoidance.bodies import threshold
from qpavoid.avoidance.margin import least_margin
from qpavoid.avoidance.plan import hold
from qpavoid.avoidance.proposals import Query, Tables, proposal_near, violation
from qpavoid.avoidance.step import look_ticks
from qpavoid.model.obstacles import Obstacles
from rollouts import (
    BOX,
    HORIZON,
    SETTINGS,
    STILL,
    frame_of,
    line_of,
    mixed,
    robots,
    rolled,
    scene_of,
    seeds,
    speeds,
    turns,
)

NOBODY_MET = lin.Violation(-1, 0.0)
DT, MANY = SETTINGS.dt, max(1, round(SETTINGS.ahead.tick / SETTINGS.dt))


def tables():
    ticks = look_ticks(SETTINGS.record())
    sides = lin.most_predicted(ticks)
    tables = Tables(np.zeros(sides, lin.PREDICTED), np.zeros(ticks + 1, lin.FRAME))
    return tables, np.full((sides + 8, 9), np.nan)


def rollout_of(scene, twist, many=MANY):
    return rolled(scene, hold(*twist, HORIZON + DT), scene.last, 0.0, many)


def horizon(body):
    return HORIZON if body.kind == table.MOVES else STILL


def room(scene, rollout, body, time, corners):
    return gap_at(corners, frame_of(rollout, time), line_of(body), time)


def least(scene, body):
    """Least sufficient margin: −ε for static obstacles, −ε/2 for moving ones."""
    return (0.5 if body.kind == table.MOVES else 1.0) * threshold(scene)


def granted(body):
    """Relaxation of the row of a body that is already inside its required distance."""
    return max(lin.ROW_ROOM - body.margin_now, 0.0)


@robots
@given(seeds, speeds, turns)
def test_rows_are_the_gradients_of_the_true_rooms(robot, seed, v, omega):
    """Of one body each, at one time; rows say how much room is left there."""
    rng, corners, h = np.random.default_rng(seed), robot.footprint.vertices, 1e-6
    scene = scene_of(robot, mixed(rng), rng.uniform([-0.5, -1], [0.5, 1]))
    (made, rows), about = tables(), (v, omega)
    rollout = rollout_of(scene, about)
    count = lin.linearised_rows(scene, rollout, NOBODY_MET, made, rows)
    used = [side for side in made.predicted if side.margin < lin.ROW_WITHIN]
    assert count == len(used)
    around = [(v - h, omega), (v + h, omega), (v, omega - h), (v, omega + h)]
    shifted = [rollout_of(scene, twist) for twist in around]
    for side, row in zip(used, rows[:count], strict=True):
        time, spare = side.time, side.margin
        owner = scene.bodies[side.body].owner
        assert row[3] == owner
        right = row[:2] @ about + lin.ROW_ROOM - spare
        assert row[2] == pytest.approx(right, abs=1e-9)
        own = [
            body
            for body in scene.bodies
            if body.owner == owner
            and abs(room(scene, rollout, body, time, corners) + granted(body) - spare)
            < 1e-9
        ]
        assert own or spare < 0.0
        if not own or spare + own[0].required < 0.05:
            continue
        extra = granted(own[0])
        rooms = [room(scene, one, own[0], time, corners) + extra for one in shifted]
        for j in range(2):
            before, after = (spare - rooms[2 * j]) / h, (rooms[2 * j + 1] - spare) / h
            if abs(before - after) <= 1e-3:  # at a wall's corner there are two slopes
                assert row[j] == pytest.approx(0.5 * (before + after), abs=2e-3)


@robots
@given(seeds, speeds, turns)
def test_who_stays_too_near_gets_a_row(robot, seed, v, omega):
    """Or another that comes nearer; ticks may be left out, not all."""
    rng, corners = np.random.default_rng(seed), robot.footprint.vertices
    scene = scene_of(robot, mixed(rng), rng.uniform([-0.5, -1], [0.5, 1]))
    (made, _), rollout = tables(), rollout_of(scene, (v, omega))
    lin.predict_contacts(scene, rollout, made)
    spares, tick = made.predicted["margin"], SETTINGS.ahead.tick
    for body in scene.bodies:
        ticks = range(1, round(horizon(body) / tick) + 1)
        rooms = [room(scene, rollout, body, k * tick, corners) for k in ticks]
        wanted = least(scene, body)
        if any(max(rooms[k : k + 3]) < wanted for k in range(1, len(rooms) - 3)):
            assert spares.min() < lin.ROW_ROOM


@robots
@given(seeds)
def test_the_nearest_twist_ahead_keeps_its_distance(robot, seed):
    """And its cost is what it says, from the desired twist."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([0.8, -1.0], [2.5, 1.0])
    world = Obstacles([[0.9, 1.0]], [[*place, 0.2]], [-0.3 * place])
    scene = scene_of(robot, world, rng.uniform([0, -0.5], [0.6, 0.5]))
    wish, start = (0.6, 0.0), rng.choice([-1.0, 1.0], 2)
    query = Query(BOX, wish, wish, MANY, *tables(), 0, 1e-3, True)
    twist = (start[0], 1.5 * start[1])
    found = proposal_near(scene, query, twist, math.inf)
    assume(found.cost < math.inf)
    v, omega = found.twist
    assert abs(v) <= 1.0 and abs(omega) <= 1.5
    cost = (v - 0.6) ** 2 + 0.03 * omega**2
    assert found.cost == pytest.approx(cost, abs=1e-12)
    rollout, corners = (
        rollout_of(scene, found.twist),
        robot.footprint.vertices,
    )
    for body in scene.bodies:
        for time in np.linspace(0.0, horizon(body), 60):
            wanted = least(scene, body) - 1e-9
            assert room(scene, rollout, body, time, corners) >= wanted


@robots
@given(seeds, speeds, turns)
def test_too_near_is_who_has_no_room(robot, seed, v, omega):
    """Wherever the search begins."""
    rng = np.random.default_rng(seed)
    scene = scene_of(robot, mixed(rng, rng.uniform(1.0, 3.0)), (0.2, 0.1))
    assume(len(scene.bodies))
    rollout = rollout_of(scene, (v, omega))
    rooms = [
        least_margin(scene, rollout, i, (0.0, horizon(body)), 1e9)[0]
        for i, body in enumerate(scene.bodies)
    ]
    clear = [r > 0.03 for r in rooms]
    for first in (0, len(rooms) // 2, len(rooms) - 1):
        body = violation(scene, rollout, first).body
        if body < 0:
            wanted = [least(scene, body) - 1e-9 for body in scene.bodies]
            assert (np.array(rooms) >= wanted).all()
        assert not all(clear) or body < 0
        assert body < 0 or not clear[body]
