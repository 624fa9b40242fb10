"""Positions handed to an estimator, one after the other."""

import numpy as np

from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator

DEFAULT = EstimatorSettings()


def follow(settings, times, positions):
    estimator = VelocityEstimator(settings)
    ids = range(positions.shape[1])
    motions = [
        estimator.update(t, ids, p) for t, p in zip(times, positions, strict=True)
    ]
    return (np.array(part) for part in zip(*motions, strict=True))
