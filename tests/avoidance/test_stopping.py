"""A robot that sees nothing more stops among what stood when it saw last."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import qpavoid as qp
from driven import driven_to
from qpavoid.avoidance.inputs import WAITING
from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import braking_twist

DT, HALF = 0.05, (0.4, 0.25)
LAZY = qp.Robot(
    "lazy",
    qp.Footprint.rectangle(2 * HALF[0], 2 * HALF[1]),
    qp.Limits(0.0, 1.5, -1.5, 1.5, acceleration=0.8, angular_acceleration=2.0),
)
POST = [(4.0, 0.1)]


def filtering(r_min=0.17, **more):
    radius = SafetyRadius(r_min, r_min)
    return qp.SafetyFilter(LAZY, qp.AvoidanceSettings(radius, dt=DT), **more)


def seen_from(pose, posts):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return (np.array(posts) - pose[:2]) @ [[c, -s], [s, c]]


def room(pose, posts):
    """The distance of the nearest post to the box."""
    beyond = np.abs(seen_from(pose, posts)) - HALF
    outside = np.hypot(*np.maximum(beyond, 0.0).T)
    return (outside + np.minimum(beyond.max(axis=1), 0.0)).min()


def drive(posts, missing, steps, wish=(1.5, 0.0), r_min=0.17, told=True, good=0.5):
    """Drive with no data in some steps; the least room, and what was driven."""
    safety = filtering(r_min, freshness=qp.Freshness(good=good))
    pose, twist, least, driven = (0.0, 0.0, 0.0), (0.0, 0.0), math.inf, []
    for k in range(steps):
        points = None if k in missing else seen_from(pose, posts)
        d = safety.step(*wish, points, driven=twist if told else None)
        assert (d.status is qp.Status.INVALID) >= (k in missing)
        twist = d.v, d.omega
        driven.append(twist)
        for _ in range(10):
            pose = driven_to(pose, *twist, DT / 10)
            least = min(least, room(pose, posts))
    return least, np.array(driven)


@pytest.mark.parametrize("step", range(10, 90, 4))
def test_a_scan_that_is_missing_in_a_curve_is_no_contact(step):
    """Braking along the arc of the moment it would turn into the post."""
    least, _ = drive(POST, {step}, 140)
    assert least >= 0.17 - 1.1e-3


@given(st.integers(0, 2**32 - 1))
def test_scans_that_are_missing_cost_no_room(seed):
    rng = np.random.default_rng(seed)
    posts = rng.uniform(-6.0, 6.0, (14, 2))
    posts = posts[np.hypot(*posts.T) > 1.2]
    missing = set(rng.integers(5, 100, 4).tolist())
    wish, told = (rng.uniform(0.3, 1.5), rng.normal(0.0, 0.5)), bool(seed % 2)
    least, twists = drive(posts, missing, 110, wish, 0.05, told, 0.3)
    assert least >= 0.05 - 1.1e-3
    changes = np.abs(np.diff(twists, axis=0, prepend=0.0))
    assert (changes <= np.array([0.8, 2.0]) * DT * (1 + 1e-9)).all()


def test_a_robot_that_waits_stands_and_goes_on_standing():
    safety = filtering(freshness=qp.Freshness(good=math.inf))
    for _ in range(40):
        safety.step(1.0, 0.0, [(30.0, 0.0)])
    safety.brake("the bumper was touched")
    for k in range(60):
        waiting = safety.step(1.0, 1.0, [(30.0, 0.0)])
        assert waiting.status is qp.Status.INVALID and waiting.problem == WAITING
        assert abs(waiting.v - max(0.0, 1.0 - 0.8 * DT * (k + 2))) < 0.1
    assert (waiting.v, waiting.omega) == (0.0, 0.0)
    # At rest it stays, whoever comes.
    near = {"discs": [(0.9, 0.0, 0.2)], "disc_velocities": [(-0.8, 0.0)]}
    assert safety.step(1.0, 1.0, Obstacles(**near))[:2] == (0.0, 0.0)
    safety.acknowledge()
    assert safety.step(1.0, 0.0, [(30.0, 0.0)]).v > 0.0


def test_what_moved_is_not_known_any_more():
    """Only braking is left, not a flight from where somebody may be."""
    safety = filtering()
    for _ in range(40):
        safety.step(1.0, 0.0, [])
    walks = {"discs": [(1.5, 0.0, 0.2)], "disc_velocities": [(-0.5, 0.0)]}
    last = safety.step(1.0, 0.0, Obstacles(**walks))
    stopped = safety.step(1.0, 0.0, None)
    assert stopped.v == pytest.approx(last.v - 0.8 * DT)


@pytest.mark.parametrize(
    "overwritten", [np.nan, np.inf], ids=["not a number", "infinite"]
)
def test_arrays_that_are_written_into_are_not_believed(overwritten):
    safety, points = filtering(), np.array([(30.0, 0.0)])
    for _ in range(30):
        d = safety.step(1.0, 0.5, points)
    points[:] = overwritten
    stopped = safety.step(1.0, 0.5, None)
    arc = braking_twist(LAZY.limit_vector, d.v, d.omega, DT)
    assert (stopped.v, stopped.omega) == pytest.approx(arc)


def test_what_is_seen_outside_counts_too():
    """A caller that knows more than the last good step says so."""
    told, silent = filtering(), filtering()
    for safety in (told, silent):
        for _ in range(40):
            safety.step(1.0, 0.3, [])
    wall = qp.Obstacles(walls=[(0.9, -2.0, 0.9, 2.0)])
    one, other = told.brake("x", seen=wall), silent.brake("x")
    assert one[:2] != other[:2] and one.clearance < other.clearance


def test_a_back_end_that_fails_is_not_asked_to_stop():
    safety = filtering(solver="qpsolvers:daqp")
    for _ in range(30):
        safety.step(1.0, 0.0, POST)

    def gone(problem):
        raise RuntimeError("no licence")

    safety._engine.use(gone)
    last, stopped = safety.step(1.0, 0.0, None), safety.step(1.0, 0.0, None)
    assert 0.0 <= stopped.v < last.v
