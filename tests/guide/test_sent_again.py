"""Goals and paths sent again, speeds that are asked for, twists as measured."""

import math

import numpy as np
import pytest

import qpavoid as qp
from guided import FREE, HOME, cart, loop
from qpavoid.avoidance.inputs import FaultError, Stamps
from qpavoid.errors import InvalidInputError, QPAvoidError
from qpavoid.guide.headway import start_row
from qpavoid.tracking.path import SplinePath

DT = 0.05
SETTINGS = qp.AvoidanceSettings(dt=DT)
WALL = qp.Obstacles(points=[(4.0, 0.02 * k) for k in range(-60, 61)])
LINE = np.column_stack([np.linspace(0.0, 8.0, 161), np.zeros(161)])


def drive(send, world=FREE, seconds=60.0, goal=(8.0, 0.0), robot=None):
    """Poses and decisions; ``send(guide, k, poses)`` is called before every step."""
    guide = qp.Guide(robot or cart(), SETTINGS)
    near = lambda pose: math.dist(pose[:2], goal) < 0.15  # noqa: E731
    rows = loop(guide, seconds, world, send=send, until=near)
    return np.array([HOME, *(row.pose for row in rows)]), [row.step for row in rows]


TURN = np.linspace(-0.5, 0.5, 40)[:, None] * math.pi
BEND = np.vstack(
    [
        np.column_stack([np.linspace(0.0, 5.0, 40), np.zeros(40)]),
        (5.0, 1.0) + np.column_stack([np.cos(TURN), np.sin(TURN)]),
        np.column_stack([np.linspace(5.0, 0.0, 40), np.full(40, 2.0)]),
    ]
)
RNG = np.random.default_rng(3)


def from_before(guide, k, poses):
    """A path that begins where the robot was 0.4 s ago."""
    x, y, _ = poses[max(0, len(poses) - 9)]
    guide.follow(np.vstack([[(x, y)], LINE[LINE[:, 0] > x + 0.1]]))


AGAIN = {
    "the same points": (lambda g, k, p: g.follow(LINE), (8.0, 0.0), 17.0),
    "the same spline": (lambda g, k, p: g.follow(SplinePath(LINE, 0.5)), (8, 0), 17.0),
    "0.4 s old": (from_before, (8.0, 0.0), 18.0),
    "there and back": (lambda g, k, p: g.follow(BEND), (0.0, 2.0), 28.0),
    "noise": (
        lambda g, k, p: g.follow(BEND + RNG.normal(0.0, 0.02, BEND.shape)),
        (0.0, 2.0),
        34.0,
    ),
    "a goal": (lambda g, k, p: g.go_to(p[-1], (8.0, 0.0, 0.0)), (8.0, 0.0), 17.0),
    "a goal that moves": (
        lambda g, k, p: g.go_to(p[-1], (8.0, 0.002 * k, 0.0)),
        (8.0, 0.6),
        18.0,
    ),
}


@pytest.mark.parametrize("every", [4, 20])
@pytest.mark.parametrize("name", AGAIN)
def test_a_task_that_is_sent_again_goes_on(name, every):
    send, goal, most = AGAIN[name]
    poses, _ = drive(lambda *a: a[1] % every or send(*a), FREE, most, goal)
    assert math.dist(poses[-1, :2], goal) < 0.2


@pytest.mark.parametrize("every", [4, 20, 40])
@pytest.mark.parametrize(
    "send",
    [
        lambda g, k, p: g.go_to(p[-1], (8.0, 0.0, 0.0)),
        lambda g, k, p: g.go_to(p[-1], (8.0, 0.1 * math.sin(k), 0.0)),
        lambda g, k, p: g.go_to(p[-1], (8.0, 0.0, 0.0), 0.4 + 0.1 * (k % 3 == 0)),
        lambda g, k, p: g.follow(LINE),
        from_before,
    ],
    ids=["goal", "goal nearby", "other speeds", "path", "path from the robot"],
)
def test_before_a_wall_it_gets_round_however_often_it_is_told(send, every):
    poses, decisions = drive(lambda *a: a[1] % every or send(*a), WALL, 45.0)
    assert math.dist(poses[-1, :2], (8.0, 0.0)) < 0.3
    assert min(d.clearance for d in decisions) > SETTINGS.radius.r_min_slow - 1e-3


def test_blocked_is_said_in_time_however_often_the_goal_is_sent():
    closed = [(3, -8, 3, 8), (-2, -8, 3, -8), (-2, 8, 3, 8), (-2, -8, -2, 8)]
    world = lambda t: FREE if t > 50.0 else qp.Obstacles(walls=closed)  # noqa: E731
    send = lambda g, k, p: k % 20 or g.go_to(p[-1], (6.0, 0.0, 0.0))  # noqa: E731
    poses, decisions = drive(send, world, 80.0, (6.0, 0.0))
    first = next(k for k, d in enumerate(decisions) if d.status is qp.Status.BLOCKED)
    best = np.minimum.accumulate(np.hypot(*(poses[:, :2] - (6.0, 0.0)).T))
    came = np.flatnonzero(best > best[first] + 0.15)[-1]
    assert (first - came) * DT < 12.0
    assert math.dist(poses[-1, :2], (6.0, 0.0)) < 0.2


def test_a_lap_and_a_path_elsewhere_begin_at_their_beginnings():
    angles = np.linspace(0.0, 2.0 * math.pi, 60)
    lap = np.column_stack([np.sin(angles), 1.0 - np.cos(angles)])
    poses, _ = drive(lambda g, k, p: k % 600 or g.follow(lap), FREE, 50.0, (9.0, 9.0))
    assert np.abs(poses[620:1000, 1]).max() > 1.8
    plan = SplinePath(LINE + (3.0, 0.0), 0.5).sample(np.arange(0.0, 10.0, DT))
    assert start_row(plan, (0.0, 0.0, 0.0)) == start_row(plan, (5.0, 0.0, 0.0)) == 0
    assert plan[start_row(plan, (3.4, 0.1, 0.0)), 0] == pytest.approx(3.4, abs=0.03)


POST = qp.Obstacles(discs=[(1.5, 0.05, 0.05)])
PERSON = lambda t: qp.Obstacles(discs=[(3.0, 0.0, 0.6)] if t < 15 else [])  # noqa: E731


@pytest.mark.parametrize("world", [FREE, POST, PERSON, WALL])
@pytest.mark.parametrize("path", [None, LINE, SplinePath(LINE, 0.3)])
def test_the_speed_is_a_cap_in_every_stage(world, path):
    def send(guide, k, poses):
        if k == 0 and path is None:
            guide.go_to(poses[0], (8.0, 0.0, 0.0), 0.3)
        elif k == 0:
            guide.follow(path, 0.3)

    poses, decisions = drive(send, world, 70.0, robot=cart(v_max=2.0))
    assert max(abs(d.v) for d in decisions) < 0.33
    assert math.dist(poses[-1, :2], (8.0, 0.0)) < 0.2


def test_it_speeds_up_from_the_twist_that_is_measured():
    guide, x, real, rise = qp.Guide(cart(acceleration=0.5), SETTINGS), 0.0, 0.0, []
    guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0, 0.0))
    for k in range(200):
        decision = guide.step((x, 0.0, 0.0), driven=(real, 0.0))
        rise.append(decision.v - real)
        real = 0.0 if 80 <= k < 140 else decision.v
        x += DT * real
    assert max(rise) < 0.5 * DT + 1e-9 and real > 0.45


def test_on_error_it_brakes_or_raises_as_the_filter_does():
    def at_speed():
        guide = qp.Guide(cart(), SETTINGS)
        guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0, 0.0))
        for k in range(40):
            now = Stamps(k * DT, points=k * DT, steady=k * DT)
            decision = guide.step((0.4 * DT * k, 0.0, 0.0), [(9.0, 3.0)], stamps=now)
        return guide, decision.v, Stamps(3.0, points=2.9, steady=3.0)

    late = Stamps(4.0, steady=4.0)
    for pose, seen, more in (
        (None, (), {}),
        ((math.nan, 0.0, 0.0), (), {}),
        ((0.8, 0.0, 0.0), None, {}),
        ((0.8, 0.0, 0.0), "points", {}),
        ((0.8, 0.0, 0.0), (), {"driven": "fast"}),
        ((0.8, 0.0, 0.0), (), {"age": math.inf}),
        ((0.8, 0.0, 0.0), (), {"stamps": late}),
    ):
        guide, speed, good = at_speed()
        with pytest.raises(QPAvoidError):
            guide.step(pose, seen, on_error="raise", **({"stamps": good} | more))
        guide, speed, good = at_speed()
        more = {"stamps": good} | more
        braked = guide.step(pose, seen, **more)
        assert braked.status is qp.Status.INVALID and braked.problem
        assert 0.0 <= braked.v < speed
        after = guide.step((0.8, 0.0, 0.0), (), stamps=good)
        assert after.status is qp.Status.INVALID and after.v < speed
        assert guide.safety.faults
    with pytest.raises(FaultError):
        at_speed()[0].step((0.8, 0.0, 0.0), (), stamps=late, on_error="raise")
    with pytest.raises(InvalidInputError, match="on_error"):
        guide.step((0.8, 0.0, 0.0), on_error="stop")


def test_reset_takes_the_nearest_twist_and_names_what_is_none():
    guide = qp.Guide(cart(), SETTINGS)
    guide.reset(1e9, 0.0)
    assert guide.step((0.0, 0.0, 0.0)).v < 0.6
    for v in (None, "1", math.nan, math.inf, [1.0, 2.0], 1j):
        with pytest.raises(InvalidInputError):
            guide.reset(v, 0.0)


def test_a_path_sent_again_to_a_goal_that_is_occupied_is_not_begun_anew():
    """Nobody comes back from its end to its beginning."""
    world, path = qp.Obstacles(discs=[(4.0, 0.0, 0.3)]), LINE[LINE[:, 0] <= 4.0]
    send = lambda guide, k, poses: k % 20 or guide.follow(path, 0.5)  # noqa: E731
    poses, decisions = drive(send, world)
    assert sum(d.status is qp.Status.BLOCKED for d in decisions) > 300
    assert max(np.maximum.accumulate(poses[:, 0]) - poses[:, 0]) < 1.0
