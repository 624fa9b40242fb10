"""Discs that cover a footprint, for methods without polygons."""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from qpavoid.lab.baselines.nmpc_program import BodyPoints
from qpavoid.model.robot import Robot


def round_robot(robot: Robot, ahead: float) -> float:
    """Return the radius (m) of the circle about (ahead, 0) around the footprint."""
    x, y = robot.footprint.vertices.T
    return float(np.hypot(x - ahead, y).max())


@lru_cache(maxsize=32)
def body_discs(robot: Robot, count: int) -> BodyPoints:
    """Return discs that cover the footprint: x of the centre, radius, m.

    The footprint is cut across into ``count`` equal lengths, each covered by the least
    disc about a point of the x-axis, to the nearest of 200.
    """
    corners = robot.footprint.vertices
    ends = np.roll(corners, -1, axis=0)
    cuts = np.linspace(corners[:, 0].min(), corners[:, 0].max(), count + 1)
    discs = []
    for low, high in pairwise(cuts.tolist()):
        held = [corners[(corners[:, 0] >= low) & (corners[:, 0] <= high)]]
        for cut in (low, high):
            across = (corners[:, 0] - cut) * (ends[:, 0] - cut) < 0.0
            start, way = corners[across], (ends - corners)[across]
            held.append(start + (cut - start[:, :1]) / way[:, :1] * way)
        x, y = np.vstack(held).T
        centres = np.linspace(low, high, 200)
        radii = np.hypot(x - centres[:, None], y).max(axis=1)
        best = int(radii.argmin())
        discs.append((float(centres[best]), float(radii[best])))
    return tuple(discs)
