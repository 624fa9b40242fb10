"""A scene with some of every kind of obstacle, and every velocity that there is."""

import math

import numpy as np


def scene(rng):
    """Of everything some, with every velocity that there is."""
    turns = [regular(n, rng) for n in (3, 4, 7)]
    return {
        "points": rng.normal(size=(3, 2)),
        "discs": np.abs(rng.normal(size=(2, 3))),
        "disc_velocities": rng.normal(size=(2, 2)),
        "walls": rng.normal(size=(2, 4)),
        "wall_velocities": rng.normal(size=(2, 2)),
        "polygons": turns,
        "polygon_velocities": rng.normal(size=(3, 3)),
    }


def regular(n, rng):
    """Corners on a circle, not evenly."""
    angles = (np.arange(n) + rng.uniform(0, 0.8, n)) * 2 * math.pi / n
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return rng.normal(size=2) * 3 + rng.uniform(0.2, 2) * circle
