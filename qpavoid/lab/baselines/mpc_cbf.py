"""MPC with discrete-time control barrier functions [Zeng2021]."""

from dataclasses import dataclass

from qpavoid.lab.baselines.discs import body_discs
from qpavoid.lab.baselines.nmpc import NmpcController
from qpavoid.lab.baselines.nmpc_program import Keep, disc_barriers


@dataclass(frozen=True)
class MpcCbfController(NmpcController):
    """MPC-CBF: over a short horizon no barrier may decay faster than by a share.

    The program is that of NMPC (cost, unicycle, limits, slack, IPOPT), but for the
    constraints: h(k) ≥ (1 − γ) h(k − 1) at every stage, for the distance h of each disc
    of the body from the nearest few obstacles' discs inflated by r_min. In the original
    h is the squared distance minus the squared radii; γ = 1 requires h ≥ 0 only. One
    start, the last plan, as in the original. There is no slack in the original; here it
    costs ``penalty`` per metre, as in NMPC.

    Attributes:
        stages: N of the horizon, shorter than that of NMPC.
        tick: s, of a stage.
        held_up: ∞: no other start is tried.
        gamma: γ, of a stage.
        discs: Number of discs that cover the body.

    The others are those of :class:`NmpcController`; values as found on the training
    scenes (``comparisons/results/tuned.toml``), γ = 1 among them.
    """

    stages: int = 12
    tick: float = 0.2
    held_up: float = float("inf")
    gamma: float = 1.0
    discs: int = 2
    heading: float = 0.1
    effort: float = 0.3
    last: float = 20.0

    @property
    def keep(self) -> Keep:
        """Barriers between the obstacles' discs and those of the body."""
        return Keep(disc_barriers, body_discs(self.robot, self.discs), self.gamma)
