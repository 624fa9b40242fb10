"""Displacement errors of predictors on recorded people, and the fit of the learned one.

Eight positions every 0.4 s are seen, the next twelve predicted. ADE is the mean
distance between prediction and truth, FDE that of the last one, m. The learned
predictor is fitted anew without the scene that it predicts. Coverage is the share of
the coordinates within one and two stated σ·t after 3.2 s, per scene; of a normal
distribution 68 % and 95 %. The last line is the fit to all scenes.

Run: python comparisons/prediction/displacement.py [--data FOLDER]
"""

import argparse
from collections import defaultdict
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

import qpavoid as qp
from predictors import PREDICTORS, learned, past_velocities, weighted
from qpavoid.lab.worlds.crowd import PERSON, SCENES, SET_FPS, find_scene, read_tracks
from qpavoid.model.prediction import TRACK_LENGTH, TRACK_STEP, Predictor
from qpavoid.types import Array

FUTURE, NOWHERE = TRACK_STEP * np.arange(1, 13), (1e6, 0.0, 0.0)
"""s; times of the predicted positions. Pose of a robot that nobody reacts to."""

FITTED_AT, ROUNDS, LEAST = [2, 4, 7], 30, 0.02
"""Predicted positions for the fit of σ; iterations, and m below which an error counts
as that, of the fit of least distances (Weiszfeld)."""


class Moment(NamedTuple):
    """People at one time.

    Attributes:
        tracks: Of all that were seen at least twice.
        whole: (n,) whether all 20 positions of a person are known.
        truth: (n, 12, 2) their next positions; NaN: unknown.
    """

    tracks: qp.Tracks
    whole: Array
    truth: Array


def moments(scene: str, data: str | None) -> list[Moment]:
    """Return all times of a scene at which somebody is to be predicted."""
    path = find_scene(scene, data)
    rows = defaultdict(list)
    for one in read_tracks(path, SET_FPS[path.parent.name]):
        count = len(one.times)
        gaps = np.diff(one.times) > 1.1 * TRACK_STEP
        padded = np.full((count + TRACK_LENGTH + len(FUTURE), 2), np.nan)
        padded[TRACK_LENGTH - 1 : TRACK_LENGTH - 1 + count] = one.positions
        for k in range(1, count):
            near = gaps[max(k - TRACK_LENGTH + 1, 0) : k + len(FUTURE)]
            if not near.any():
                rows[round(one.times[k], 2)].append(padded[k : k + 20])
    found = []
    for people in map(np.array, rows.values()):
        whole = np.isfinite(people).all(axis=(1, 2))
        if whole.any():
            past, count = people[:, :TRACK_LENGTH], len(people)
            speeds = (past[:, -1] - past[:, -2]) / TRACK_STEP
            known = past, speeds, np.zeros(count), np.full(count, PERSON)
            tracks = qp.Tracks(*known, NOWHERE, (0.0, 0.0), qp.Obstacles())
            found.append(Moment(tracks, whole, people[:, TRACK_LENGTH:]))
    return found


def fit(scenes: list[list[Moment]]) -> partial[Array]:
    """Return the learned predictor of some scenes, each of the same weight.

    Weights have the least mean distance between prediction and truth, by iterated
    least squares; a and b of σ the greatest likelihood, by a search on a grid.
    """
    each = [x for scene in scenes for x in scene]
    past = np.concatenate([past_velocities(x.tracks)[x.whole] for x in each])
    here = np.concatenate([x.tracks.positions[x.whole, -1:] for x in each])
    truth = np.concatenate([x.truth[x.whole] for x in each]) - here
    counts = [sum(x.whole.sum() for x in scene) for scene in scenes]
    share = np.repeat(1.0 / np.array(counts), counts)
    weights = np.full(past.shape[1], 1.0 / past.shape[1])
    for _ in range(ROUNDS):
        mean = np.einsum("k,nkd->nd", weights, past)
        off = mean[:, None] * FUTURE[:, None] - truth
        pull = share[:, None] / np.maximum(np.hypot(off[..., 0], off[..., 1]), LEAST)
        square = np.einsum("n,nkd,nld->kl", pull @ FUTURE**2, past, past)
        goal = np.einsum("nh,nhd->nd", pull * FUTURE, truth)
        weights = np.linalg.solve(square, np.einsum("nkd,nd->k", past, goal))
    _, scatter = weighted(past, weights)
    error = (off[:, FITTED_AT] / FUTURE[FITTED_AT, None]) ** 2
    best, spread = np.inf, np.zeros(2)
    for a, b in product(np.arange(0.01, 0.2, 0.01), np.arange(0.0, 1.0, 0.05)):
        sigma = (a + b * scatter)[:, None]
        loss = error.sum(axis=2) / sigma**2 + 4.0 * np.log(sigma)
        if (cost := float((share @ loss).sum())) < best:
            best, spread = cost, np.array([a, b])
    return partial(learned, weights=weights, spread=spread)


def errors(predict: Predictor, people: list[Moment]) -> tuple[Array, Array]:
    """Return (N, 12, 2) errors, m, and (N,) stated σ, m/s, of all predictions."""
    off, sigmas = [], []
    for tracks, whole, truth in people:
        told = np.asarray(predict(tracks))[whole]
        ahead = told[:, None, :2] * FUTURE[:, None]
        off.append(tracks.positions[whole, -1:] + ahead - truth[whole])
        sigmas.append(told[:, 2])
    return np.concatenate(off), np.concatenate(sigmas)


def main() -> None:
    """Print the table and the fit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="folder of the published sets")
    data = parser.parse_args().data
    worlds = {scene: moments(scene, data) for scene in SCENES}
    print("| predictor |", " | ".join(SCENES), "| mean | 1σ | 2σ |")
    for name, predict in PREDICTORS.items():
        means, inside = [], []
        for scene, people in worlds.items():
            others = [x for y, x in worlds.items() if y != scene]
            used = fit(others) if predict is learned else predict
            off, sigmas = errors(used, people)
            away = np.hypot(off[..., 0], off[..., 1])
            means.append((away.mean(), away[:, -1].mean()))
            share = np.abs(off[:, 7]) / np.maximum(FUTURE[7] * sigmas, LEAST)[:, None]
            inside.append([(share <= k).mean() for k in (1.0, 2.0)])
        cells = ["{:.2f} / {:.2f}".format(*x) for x in [*means, np.mean(means, axis=0)]]
        cells += [str(x) for x in np.round(inside, 2).T.tolist()]
        print(f"| {name} |", " | ".join(cells), "|", flush=True)
    print({k: x.round(3) for k, x in fit(list(worlds.values())).keywords.items()})


if __name__ == "__main__":
    main()
