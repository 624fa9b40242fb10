"""MPC with discrete-time control barrier functions [Zeng2021]."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from qpavoid.lab.baselines.nmpc import NmpcController
from qpavoid.lab.baselines.nmpc_program import BodyPoints, Keep, disc_barriers
from qpavoid.model.robot import Robot


@dataclass(frozen=True)
class MpcCbfController(NmpcController):
    """MPC-CBF: over a short horizon no barrier may shrink faster than by a share.

    The program is that of NMPC (cost, unicycle, limits, slack, IPOPT), but for what
    keeps clear: h(k) ≥ (1 − γ) h(k − 1) at every stage, for the distance h of each disc
    of the body from the nearest few obstacles' discs widened by r_min. Theirs is the
    square of it less that of the radii; γ = 1 asks for h ≥ 0 alone. One start, the last
    plan: as theirs, it does not look for another way round. Theirs has no slack; here
    it costs ``penalty`` per metre, as in NMPC.

    Attributes:
        stages: N of the horizon, shorter than that of NMPC.
        tick: s, of a stage.
        held_up: ∞: no plan counts as held up, so that no other start is tried.
        gamma: γ, of a stage.
        discs: How many hold the body.

    The others are those of :class:`NmpcController`.
    """

    stages: int = 8
    tick: float = 0.2
    held_up: float = float("inf")
    gamma: float = 0.3
    discs: int = 2

    @property
    def keep(self) -> Keep:
        """What keeps clear of the discs: those of the body."""
        return Keep(disc_barriers, body_discs(self.robot, self.discs), self.gamma)


@lru_cache(maxsize=32)
def body_discs(robot: Robot, count: int) -> BodyPoints:
    """Return discs that hold the footprint together: x of the centre, radius, m.

    The footprint is cut across into ``count`` equal lengths, each held by the least
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
