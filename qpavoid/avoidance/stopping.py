"""Last static map: the static obstacles of the last good step, for a blind stop."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST
from qpavoid.avoidance.validation import as_table
from qpavoid.model.given import NO_DISCS, NO_POINTS, NO_TURNS, NO_WALLS
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.validation import NO_POLYGONS
from qpavoid.types import Arrays, Pose


class LastSeen(NamedTuple):
    """Obstacles of a step, and the robot's motion since then.

    The arrays are the caller's, uncopied: later changes count.

    Attributes:
        given: Positional arguments: v, ω and obstacles.
        named: Keyword arguments.
        pose: x, y (m), γ (rad) of the robot in the robot frame of that step.
    """

    given: tuple[Any, ...]
    named: Mapping[str, Any]
    pose: Pose = (0.0, 0.0, 0.0)

    def after(self, v: float, omega: float, dt: float) -> "LastSeen":
        """Return the map after (v, ω) has been driven for dt, s."""
        return self._replace(pose=integrate(self.pose, (v, omega), 0.0, dt))

    def standing(self) -> Arrays:
        """Return the static obstacles in the present robot frame.

        Moving ones are left out: their positions are unknown.

        Raises:
            InvalidInputError: The arrays no longer hold valid obstacles.
        """
        told = {k: x for k, x in self.named.items() if k in OBSTACLES}
        told |= dict(zip(OBSTACLES, self.given[2:], strict=False))
        seen = Obstacles.of(*as_table(*(OBSTACLES | told).values()))
        still = seen.capsules[seen.speeds <= SPEED_AT_REST]
        return Obstacles.of(seen.points, still).seen_from(self.pose).arrays


OBSTACLES = {
    "points": NO_POINTS,
    "discs": NO_DISCS,
    "disc_velocities": NO_POINTS,
    "walls": NO_WALLS,
    "polygons": NO_POLYGONS,
    "polygon_velocities": NO_TURNS,
}
"""Obstacle arguments of a call, in order, with their defaults."""
