"""The way of a plan: driven in thought as step by step in truth, and its slopes."""

import math

import numpy as np
import pytest
from hypothesis import given

from driven import driven_to, gap_at
from qpavoid.avoidance import proposals as lin
from qpavoid.avoidance.bodies import BODY
from qpavoid.avoidance.plan import hold
from qpavoid.avoidance.proposals import Query, fill_slopes, slopes_at
from qpavoid.avoidance.step import look_ticks
from qpavoid.model.obstacles import Obstacles
from rollouts import (
    BOX,
    HORIZON,
    SETTINGS,
    every_robot,
    frame_of,
    line_of,
    mixed,
    robots,
    rolled,
    scene_of,
    seeds,
    some_plan,
    speeds,
    steps_of,
    turns,
)

DT, NOTHING, REST = SETTINGS.dt, Obstacles(), (0.0, 0.0, 0.0)


def close(one, other, within):
    """Whether two poses are the same; headings by the turn."""
    turn = math.remainder(one[2] - other[2], 2 * math.pi)
    assert np.hypot(one[0] - other[0], one[1] - other[1]) <= within
    assert abs(turn) <= within


@every_robot
@given(seeds)
def test_the_way_is_that_of_the_steps(robot, seed):
    """At the start of every step and within it, until it stands."""
    rng = np.random.default_rng(seed)
    limits, plan = robot.limits, some_plan(rng)
    low, high = (limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)
    last = tuple(0.5 * rng.uniform(low, high))
    rollout = rolled(scene_of(robot, NOTHING, last), plan)
    trace = steps_of(robot, plan, last, DT, HORIZON + 1.5)
    assert (trace[-1, 3:] == 0.0).all()
    share = rng.uniform()
    for k, row in enumerate(trace):
        close(frame_of(rollout, k * DT), row[:3], 1e-7)
        there = driven_to(tuple(row[:3]), *row[3:], share * DT)
        close(frame_of(rollout, (k + share) * DT), there, 1e-7)
    stands = np.flatnonzero(np.abs(trace[:, 3:]).max(axis=1) > 1e-12)
    rest = DT * (stands[-1] + 1 if len(stands) else 0)
    assert rest <= rollout.rest + 1e-9 and rollout.rest <= max(rest, plan.end) + 2 * DT
    assert rollout.speed >= np.abs(trace[:, 3]).max() - 1e-12
    assert rollout.turning >= np.abs(trace[:, 4]).max() - 1e-12


@every_robot
@given(seeds)
def test_the_rest_of_a_plan_is_the_same_way(robot, seed):
    """Premise of the theorems: a plan's remainder, a step later, is its motion."""
    rng = np.random.default_rng(seed)
    plan, last = some_plan(rng), (0.1, -0.2)
    trace = steps_of(robot, plan, last, DT, HORIZON + 1.5)
    for k in (1, 2, int(rng.integers(3, 140))):
        moved = plan._replace(
            switch=max(plan.switch - k * DT, 0.0), end=max(plan.end - k * DT, 0.0)
        )
        rollout = rolled(scene_of(robot, NOTHING, trace[k - 1, 3:]), moved)
        for j in range(k, len(trace), 7):
            x, y, heading = frame_of(rollout, (j - k) * DT)
            at = trace[k, :3]
            c, s = math.cos(at[2]), math.sin(at[2])
            there = at[0] + c * x - s * y, at[1] + s * x + c * y, at[2] + heading
            close(there, trace[j, :3], 1e-7)


@robots
@pytest.mark.parametrize("many", [1, 3])
@given(speeds, turns, speeds, turns)
def test_slopes_are_those_of_finite_differences(robot, many, v, omega, last_v, last_w):
    scene = scene_of(robot, NOTHING, (last_v, last_w))
    plan = hold(v, omega, HORIZON + DT)

    def driven(d_v, d_omega):
        changed = hold(v + d_v, omega + d_omega, plan.end)
        return rolled(scene, changed, many)

    rollout, h = driven(0.0, 0.0), 1e-6
    fill_slopes(rollout, DT)
    times = np.linspace(0.1, HORIZON - 0.1, 9)
    shifted = [[driven(*d) for d in ((s, 0.0), (0.0, s))] for s in (-h, h)]
    for time in times:
        row = np.searchsorted(rollout.arcs["begin"], time, "right") - 1
        _, _, x_v, y_v, x_w, y_w, turn = slopes_at(rollout.arcs[row], time, DT)
        before, after = ([frame_of(one, time) for one in both] for both in shifted)
        change = (np.array(after) - before) / (2 * h)
        away = np.abs(np.array(after) - 2 * np.array(frame_of(rollout, time)) + before)
        if away.max() > 1e-9 or np.abs(change).max() > 1e3:
            continue  # a kink: the last step towards the target becomes another one
        assert (x_v, y_v) == pytest.approx(change[0, :2], abs=1e-4)
        assert (x_w, y_w) == pytest.approx(change[1, :2], abs=1e-4)
        assert (0.0, turn) == pytest.approx(change[:, 2], abs=1e-4)


NOBODY_MET = lin.Violation(-1, 0.0)


def query():
    ticks = look_ticks(SETTINGS.record())
    sides = lin.most_predicted(ticks)
    made, rows = np.zeros(sides, lin.PREDICTED), np.full((sides + 8, 9), np.nan)
    tables = made, np.zeros(ticks + 1, lin.FRAME), np.zeros(0, BODY)
    return Query(BOX, REST[:2], REST[:2], *tables, rows, 0, 1e-3, True)


def rollout_of(scene, twist):
    return rolled(scene, hold(*twist, HORIZON + DT))


def room(scene, rollout, body, time, corners):
    return gap_at(corners, frame_of(rollout, time), line_of(body), time)


def granted(body):
    """Relaxation of the row of a body that is already inside its required distance."""
    return max(lin.ROW_ROOM - body.margin_now, 0.0)


@robots
@given(seeds, speeds, turns)
def test_rows_are_the_gradients_of_the_true_rooms(robot, seed, v, omega):
    """Of one body each, at one time; rows say how much room is left there."""
    rng, corners, h = np.random.default_rng(seed), robot.footprint.vertices, 1e-6
    scene = scene_of(robot, mixed(rng), rng.uniform([-0.5, -1], [0.5, 1]))
    asked, about = query(), (v, omega)
    rollout, rows = rollout_of(scene, about), asked.rows
    count = lin.linearised_rows(scene, asked, rollout, about, NOBODY_MET)
    used = [side for side in asked.predicted if side.margin < lin.ROW_WITHIN]
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
