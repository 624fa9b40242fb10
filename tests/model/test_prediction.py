"""Predictors: their tracks, what is made of their answers, and their faults."""

import math

import numpy as np
import pytest

import qpavoid as qp
from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import arc
from qpavoid.model.prediction import TRACK_LENGTH, TRACK_STEP, Prediction

ROBOT = qp.Robot.mir100()
HOME = (0.0, 0.0, 0.0)


def keep(tracks):
    """Constant velocity."""
    return np.column_stack([tracks.velocities, tracks.sigmas])


def rings(time):
    """World of eight discs that walk on rings, a disc at rest and a wall."""
    k = np.arange(8)
    angle, radius = 0.8 * k + (0.3 + 0.05 * k) * time, 2.0 + 0.8 * k
    place = radius * np.array([np.cos(angle), np.sin(angle)])
    speed = (0.3 + 0.05 * k) * radius * np.array([-np.sin(angle), np.cos(angle)])
    return place.T, speed.T


@pytest.mark.parametrize("dt", [0.05, 0.03])
def test_tracks_are_the_positions_of_the_past(dt):
    """In the world frame, for a robot that drives, in any order of the discs."""
    rng, seen = np.random.default_rng(3), []
    prediction = Prediction(lambda tracks: seen.append(tracks) or keep(tracks), dt)
    pose, begin = (0.3, -0.2, 1.0), 40
    for step in range(80):
        place, speed = rings(step * dt)
        order = rng.permutation(8 if step >= begin else 7)  # the last comes later
        discs = np.column_stack([place[order], 0.2 + 0.01 * order])
        world = qp.Obstacles(
            discs=[*discs, (9.0, 9.0, 0.5)],
            disc_velocities=[*speed[order], (0.0, 0.0)],
            walls=[(-9.0, 9.0, 9.0, 9.0)],
        )
        there = world.seen_from(pose)
        told = prediction.see(there, pose, (0.5, 0.4))
        np.testing.assert_allclose(told.capsules, there.capsules, rtol=0, atol=1e-12)
        tracks = seen[-1]
        assert tracks.pose == pose
        assert (len(tracks.others.discs), len(tracks.others.walls)) == (1, 1)
        for k in range(TRACK_LENGTH):
            time = step * dt - TRACK_STEP * (TRACK_LENGTH - 1 - k)
            truth = rings(time)[0][order]
            truth[order == 7] *= np.nan if time < begin * dt - 1e-9 else 1.0
            truth *= np.nan if time < -1e-9 else 1.0
            # Between two steps a ring is a chord.
            sagitta = (0.65 * dt) ** 2 / 8.0 * 7.6
            np.testing.assert_allclose(tracks.positions[:, k], truth, atol=sagitta)
        np.testing.assert_allclose(tracks.velocities, speed[order], atol=1e-12)
        np.testing.assert_allclose(tracks.radii, discs[:, 2])
        pose = arc(*pose, 0.5, 0.4, dt)


@pytest.mark.parametrize("seed", range(4))
def test_candidates_are_rated_among_the_predicted_and_filtered_among_the_measured(seed):
    rng = np.random.default_rng(seed)
    pose = (1.0, 2.0, 0.7)
    there = rng.uniform(-2.0, 2.0, (4, 2)) + (3.0, 0.0)
    discs = np.column_stack([there, np.full(4, 0.25)])
    measured, meant = rng.normal(0.0, 0.5, (2, 4, 2))
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    answer = np.column_stack([meant @ [(cos, sin), (-sin, cos)], [0.1] * 4])
    told = qp.Obstacles(discs=discs, disc_velocities=measured)
    known = qp.Obstacles(discs=discs, disc_velocities=meant, disc_sigmas=[0.1] * 4)
    guides = qp.Guide(ROBOT, predict=lambda t: answer), qp.Guide(ROBOT), qp.Guide(ROBOT)
    for guide in guides:
        guide.go_to(pose, (6.0, 6.0, 0.0), speed=1.0)
    differs = False
    for _ in range(30):
        worlds = zip(guides, (told, known, told), strict=True)
        found = [guide._desire(pose, (x, None, None), None) for guide, x in worlds]
        assert found[0][:2] == pytest.approx(found[1][:2], abs=1e-9)
        assert found[0][2] is told
        differs |= found[0][:2] != pytest.approx(found[2][:2], abs=0.01)
    assert differs


@pytest.mark.parametrize("seed", range(6))
def test_the_verdict_holds_for_any_prediction(seed):
    """Discs that keep their velocity, and are predicted to stand."""
    rng = np.random.default_rng(seed)
    start = rng.uniform((1.5, 2.0), (5.0, 3.0), (3, 2)) * ((1, 1), (1, -1), (1, 1))
    velocity = np.column_stack([rng.uniform(-0.3, 0.3, 3), -start[:, 1] / 3.0])
    guide = qp.Guide(ROBOT, predict=lambda t: np.zeros((len(t.radii), 3)))
    guide.go_to(HOME, (6.0, 0.0, 0.0), speed=1.0)
    pose, dt = HOME, guide.settings.dt
    least = guide.settings.radius.r_min(0.0)
    for k in range(round(8.0 / dt)):
        discs = np.column_stack([start + k * dt * velocity, np.full(3, 0.25)])
        world = qp.Obstacles(discs=discs, disc_velocities=velocity)
        step = guide.step(pose, world.seen_from(pose))
        assert step.clearance > least - 1e-3
        pose = arc(*pose, step.v, step.omega, dt)


def fails(tracks):
    raise ZeroDivisionError("no people model")


def leaves(tracks):
    raise SystemExit


@pytest.mark.parametrize(
    ("predict", "said"),
    [
        (lambda t: keep(t) * math.nan, "what predict returns"),
        (lambda t: keep(t)[:, :2], r"shape \(n, 3\)"),
        (lambda t: keep(t)[:-1], "a row for every disc"),
        (lambda t: keep(t) - (0.0, 0.0, 1.0), "σ below 0"),
        (lambda t: None, "must be numbers"),
        (fails, "ZeroDivisionError: no people model"),
        (leaves, "SystemExit"),
    ],
)
def test_a_fault_of_the_predictor_brakes(predict, said):
    faulty = [False]
    guide = qp.Guide(ROBOT, predict=lambda t: (predict if faulty[0] else keep)(t))
    guide.go_to(HOME, (8.0, 0.0, 0.0))
    world = qp.Obstacles(discs=[(6.0, 2.0, 0.3)], disc_velocities=[(0.1, 0.2)])
    while guide.step(HOME, world).v < 0.3:
        pass
    faulty[0] = True
    with pytest.raises(BaseException, match=said.partition(": ")[2] or "|" + said):
        guide.step(HOME, world, on_error="raise")
    speeds = [guide.step(HOME, world) for _ in range(200)]
    assert all(x.status is qp.Status.INVALID for x in speeds)
    assert speeds[0].problem
    assert (speeds[-1].v, speeds[-1].omega) == (0.0, 0.0)
    guide.step(HOME)  # nothing moves: the predictor is not called
    assert guide.safety.faults


def test_a_predictor_is_a_function_and_forgets():
    with pytest.raises(InvalidInputError, match="function of tracks"):
        qp.Guide(ROBOT, predict="learned")
    seen = []
    guide = qp.Guide(ROBOT, predict=lambda t: seen.append(t.positions) or keep(t))
    world = qp.Obstacles(discs=[(6.0, 2.0, 0.3)], disc_velocities=[(0.1, 0.2)])
    for _ in range(math.ceil(TRACK_STEP / guide.settings.dt) + 1):
        guide.step(HOME, world)
    assert np.isfinite(seen[-1][0, -2:]).all()
    guide.reset()
    guide.step(HOME, world)
    assert np.isnan(seen[-1][0, :-1]).all()
