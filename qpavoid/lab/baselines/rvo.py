"""Interface between ORCA here and the RVO2 library (pyrvo)."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import MissingExtraError
from qpavoid.lab.baselines.drive import wide_discs
from qpavoid.model.capsules import X1, Y1, Y2
from qpavoid.model.given import NO_POINTS
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Twist


class Near(NamedTuple):
    """Obstacles for RVO2, robot frame.

    Attributes:
        discs: (n, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        still: Corners of static obstacles, from :func:`by_motion`.
    """

    discs: Array
    still: list[Array]

    @property
    def restless(self) -> list[int]:
        """Discs that a step of RVO2 changes: moving ones, and those that walls push."""
        moves = self.discs[:, 3:].any(axis=1) | bool(self.still)
        return [int(k) for k in np.flatnonzero(moves)]


def by_motion(obstacles: Obstacles) -> tuple[list[Array], Obstacles]:
    """Return the corners (n, 2) of static walls and polygons, and the other obstacles.

    The others are points and discs: those around moving obstacles, too.
    """
    moves = ~obstacles.is_disc & (obstacles.speeds > 0.0)
    still = obstacles.chosen(~moves)
    moving = Obstacles.of(NO_POINTS, obstacles.capsules[moves]).as_discs
    corners = [
        one[:, X1 : Y1 + 1] if len(one) > 1 else one[0, X1 : Y2 + 1].reshape(2, 2)
        for one in still.lengthy
    ]
    return corners, still.chosen(still.is_disc).joined(moving)


def what_is_near(obstacles: Obstacles, settings: AvoidanceSettings) -> Near:
    """Return the obstacles for RVO2."""
    still, rest = by_motion(obstacles)
    return Near(wide_discs(rest, settings), still)


def least_way(corners: Array) -> float:
    """Return the distance (m) of the box about corners (n, 2) from the origin."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    return float(np.hypot(*np.maximum(0.0, np.maximum(low, -high))))


def found_by(world: Any) -> Twist:
    """Return RVO2's velocity of the effective centre, m/s."""
    velocity = world.get_agent_velocity(0)
    return velocity.x, velocity.y


def half_planes(world: Any) -> Iterator[tuple[float, float, float]]:
    """Yield a, b of RVO2's half-planes a·w ≥ b, with unit a; m/s.

    Allowed velocities lie to the left of a line.
    """
    for i in range(world.get_agent_num_orca_lines(0)):
        (d_x, d_y), (p_x, p_y) = world.get_agent_orca_line(0, i)
        yield -d_y, d_x, d_x * p_y - d_y * p_x


def violation(world: Any, velocity: Twist) -> float:
    """Return the violation of the half-planes by a velocity, m/s, at least 0."""
    x, y = velocity
    return max([0.0, *(b - a_x * x - a_y * y for a_x, a_y, b in half_planes(world))])


def library() -> Any:
    """Return pyrvo, or raise MissingExtraError."""
    try:
        import pyrvo
    except ImportError:
        raise MissingExtraError("pyrvo", "baselines") from None
    return pyrvo
