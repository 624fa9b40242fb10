"""Predictors of people: exact on the motions that they assume, and the fit."""

import math
from dataclasses import replace

import numpy as np
import pytest

import qpavoid as qp
from closed_loop import drive
from displacement import FUTURE, NOWHERE, Moment, errors, fit
from predictors import AHEAD, PREDICTORS, constant_turn
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.model.prediction import TRACK_LENGTH, TRACK_STEP

PAST = TRACK_STEP * np.arange(1 - TRACK_LENGTH, 1)


def seen(place, times=PAST):
    """Tracks of one person who is at place(t), with the velocity of now."""
    positions = np.array([[place(t) for t in times]])
    velocity = (np.array(place(0.0)) - place(-1e-6)) / 1e-6
    known = positions, velocity[None], np.zeros(1), np.full(1, 0.25)
    return qp.Tracks(*known, NOWHERE, (0.0, 0.0), qp.Obstacles())


@pytest.mark.parametrize("predict", PREDICTORS.values(), ids=PREDICTORS)
def test_straight_on_and_without_a_history(predict):
    tracks = seen(lambda t: (1.0 + 0.9 * t, 2.0 - 0.5 * t))
    new = tracks._replace(positions=tracks.positions.copy())
    new.positions[:, :-1] = math.nan
    for known in (tracks, new):
        v_x, v_y, sigma = np.asarray(predict(known))[0]
        assert (v_x, v_y) == pytest.approx((0.9, -0.5), abs=0.04)  # weights: 0.97
        assert 0.0 <= sigma < 0.1


def test_a_turn_goes_on_and_so_does_braking():
    def turns(t):
        return 2.0 * math.sin(0.5 * t), -2.0 * math.cos(0.5 * t)

    (told,) = constant_turn(seen(turns))
    way = np.subtract(turns(AHEAD), turns(0.0)) / AHEAD
    assert told[:2] == pytest.approx(way, abs=1e-3)
    # From 1 m/s, at 0.5 m/s², 1 m is left to go.
    (told,) = constant_turn(seen(lambda t: (t - 0.25 * t * t, 0.0)))
    assert told[:2] == pytest.approx((1.0 / AHEAD, 0.0), abs=0.08)


def test_the_fit_finds_weights_and_spread():
    """People whose next velocity is the mean of the last two, with known errors."""
    rng, people = np.random.default_rng(0), []
    for _ in range(400):
        past = rng.normal(0.0, 0.2, (9, 7, 2)) + rng.normal(0.0, 1.0, (9, 1, 2))
        ways = np.cumsum(TRACK_STEP * past, axis=1)
        positions = np.concatenate([np.zeros((9, 1, 2)), ways], axis=1)
        next_v = past[:, -2:].mean(axis=1) + rng.normal(0.0, 0.15, (9, 2))
        truth = positions[:, -1:] + next_v[:, None] * FUTURE[:, None]
        known = positions, past[:, -1], np.zeros(9), np.full(9, 0.25)
        tracks = qp.Tracks(*known, NOWHERE, (0.0, 0.0), qp.Obstacles())
        people.append(Moment(tracks, np.ones(9, dtype=bool), truth))
    made = fit([people])
    weights = made.keywords["weights"]
    np.testing.assert_allclose(weights, [0, 0, 0, 0, 0, 0.5, 0.5], atol=0.05)
    off, sigmas = errors(made, people)
    assert np.median(sigmas) == pytest.approx(0.15, rel=0.1)
    inside = np.abs(off[:, 7]) < (FUTURE[7] * sigmas)[:, None]
    assert inside.mean() == pytest.approx(0.683, abs=0.03)


def test_constant_velocity_by_a_predictor_is_the_usual_closed_loop():
    scenario = replace(load_scenario("paper/test_case_2"), duration=3.0)
    plain, same = (drive(scenario, x) for x in (None, PREDICTORS["constant velocity"]))
    for name in ("min_room_m", "max_error_m", "length_m", "jerk_mps3"):
        assert plain[name] == pytest.approx(same[name], abs=1e-6)

    def comes(tracks):
        return np.append(tracks.pose[:2] - tracks.positions[0, -1], 0.0)[None]

    # Predicted to come at once, the disc holds the robot that would give way.
    assert drive(scenario, comes)["length_m"] < 0.5 * plain["length_m"]
