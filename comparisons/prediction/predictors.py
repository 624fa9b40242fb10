"""Predictors of people: functions for ``qp.Guide(robot, predict=…)``.

Each returns a velocity over the coming :data:`AHEAD` s, and its σ; a disc without a
history keeps its measured velocity.
"""

import numpy as np

import qpavoid as qp
from qpavoid.model.prediction import TRACK_STEP
from qpavoid.types import Array

AHEAD = 3.2
"""s for which a motion is predicted."""

SLOW, TURN_TIME = 0.3, 3
"""m/s below which a heading is noise; steps over which a rate of turn is measured."""

WEIGHTS = np.array([0.028, 0.028, 0.033, 0.05, 0.167, 0.27, 0.397])
SPREAD = np.array([0.06, 0.45])
"""Of :func:`learned`, printed by ``displacement.py``: weights of seven velocities, the
newest last; m/s and share of their scatter in σ."""


def past_velocities(tracks: qp.Tracks) -> Array:
    """Return (n, 7, 2) velocities between samples, m/s; unknown ones as measured."""
    past = np.diff(tracks.positions, axis=1) / TRACK_STEP
    return np.where(np.isfinite(past), past, tracks.velocities[:, None])


def constant_velocity(tracks: qp.Tracks) -> Array:
    """Return the measured velocities."""
    return np.column_stack([tracks.velocities, tracks.sigmas])


def constant_turn(tracks: qp.Tracks) -> Array:
    """Return the mean velocity on an arc of the last rate of turn, or until a stop."""
    past, now = past_velocities(tracks), tracks.velocities
    headings = np.unwrap(np.arctan2(past[..., 1], past[..., 0]), axis=1)
    turn = (headings[:, -1] - headings[:, -1 - TURN_TIME]) / (TURN_TIME * TRACK_STEP)
    speeds = np.hypot(past[..., 0], past[..., 1])
    turn = np.where(speeds[:, -1 - TURN_TIME :].min(axis=1) > SLOW, turn, 0.0)
    slower = (speeds[:, -1 - TURN_TIME] - speeds[:, -1]) / (TURN_TIME * TRACK_STEP)
    # Deceleration a goes on until rest: v / 2a at the present speed is left to go.
    stop = 0.5 * np.hypot(*now.T) / np.maximum(slower, 1e-9)
    share = np.minimum(stop / AHEAD, 1.0)
    half = 0.5 * AHEAD * share * turn
    chord = share * np.sinc(half / np.pi)
    cos, sin = chord * np.cos(half), chord * np.sin(half)
    mean = cos * now[:, 0] - sin * now[:, 1], sin * now[:, 0] + cos * now[:, 1]
    return np.column_stack([*mean, tracks.sigmas])


def learned(
    tracks: qp.Tracks, weights: Array = WEIGHTS, spread: Array = SPREAD
) -> Array:
    """Return Σ w_k v_k of the last velocities, and σ = a + b √(mean |v_k − Σ|²)."""
    mean, scatter = weighted(past_velocities(tracks), weights)
    return np.column_stack([mean, spread[0] + spread[1] * scatter])


def weighted(past: Array, weights: Array) -> tuple[Array, Array]:
    """Return weighted sums (n, 2) of velocities (n, 7, 2), and the scatter (n,)."""
    mean = np.einsum("k,nkd->nd", weights, past)
    off = past - mean[:, None]
    return mean, np.sqrt(np.einsum("nkd,nkd->n", off, off) / past.shape[1])


PREDICTORS = {
    "constant velocity": constant_velocity,
    "constant turn, stop": constant_turn,
    "learned": learned,
}
