"""Among what a robot stops that sees nothing more: what stood when it saw last."""

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
    """What a step was told of obstacles, and where the robot has come since.

    The arrays are the caller's: what is written into them counts.

    Attributes:
        given: v, ω and obstacles, as far as they were given by place.
        named: The same by name, and others.
        pose: x, y (m), γ (rad) of the robot, from where it saw them.
    """

    given: tuple[Any, ...]
    named: Mapping[str, Any]
    pose: Pose = (0.0, 0.0, 0.0)

    def after(self, v: float, omega: float, dt: float) -> "LastSeen":
        """Return the same when (v, ω) has been driven for dt, s."""
        return self._replace(pose=integrate(self.pose, (v, omega), 0.0, dt))

    def standing(self) -> Arrays:
        """Return what stood, as the robot would see it where it is now.

        What moved is not known any more, and left out.

        Raises:
            InvalidInputError: The arrays do not hold obstacles any more.
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
"""The obstacles of a call, in order, where there are none."""
