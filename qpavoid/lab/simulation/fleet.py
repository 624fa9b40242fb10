"""Several robots in one world: what each of them is to the others."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from qpavoid.model.capsules import OWNER, PIVOT_X, PIVOT_Y, TURN, V_X
from qpavoid.model.footprint import Footprint
from qpavoid.model.given import NO_POINTS
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Pose, Twist


class RobotObstacle:
    """A robot as the others meet it: its footprint, a convex polygon under way.

    Args:
        footprint: Of the robot.
        number: Of the robot, to tell it from others.
    """

    def __init__(self, footprint: Footprint, number: int) -> None:
        self._outline, self._number = Obstacles(polygons=[footprint.vertices]), number

    def at(
        self,
        pose: Pose,
        twist: Twist = (0.0, 0.0),
        lateral: float = 0.0,
        dt: float = 0.0,
    ) -> Array:
        """Return its capsules at a pose, world frame.

        Their velocity, of the centroid, is the mean while it drives for ``dt`` s as it
        does: at their end the polygon is just where the robot is. With 0 s it is that
        of now.

        Args:
            pose: World frame.
            twist: v (m/s), ω (rad/s).
            lateral: Speed to the left, m/s.
            dt: s
        """
        capsules, (v, omega) = self._outline.capsules.copy(), twist
        c_x, c_y = capsules[0, PIVOT_X : PIVOT_Y + 1].tolist()
        velocity = v - omega * c_y, lateral + omega * c_x
        if dt > 0.0:
            x, y, turned = integrate((0.0, 0.0, 0.0), twist, lateral, dt)
            cos, sin = math.cos(turned), math.sin(turned)
            # The way of the centroid, by which capsules are moved: that of the axle's
            # middle, and what the turn about it adds.
            x, y = x + cos * c_x - sin * c_y - c_x, y + sin * c_x + cos * c_y - c_y
            velocity = x / dt, y / dt
        capsules[:, V_X : TURN + 1] = *velocity, omega
        placed = Obstacles.of(NO_POINTS, capsules).seen_from(inverse(pose)).capsules
        placed[:, OWNER] = self._number
        return placed


def inverse(pose: Pose) -> Pose:
    """Return the pose of the world as a robot at ``pose`` sees it."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return -cos * x - sin * y, sin * x - cos * y, -heading


def among(world: Obstacles, bodies: Sequence[Array]) -> Iterator[Obstacles]:
    """Yield what there is for each of several robots: the world, and all the others.

    Of no bodies, for one robot alone: the world.
    """
    for i in range(len(bodies) or 1):
        others = [*bodies[:i], *bodies[i + 1 :]]
        yield world.joined(_all(others)) if others else world


def _all(bodies: Sequence[Array]) -> Obstacles:
    return Obstacles.of(NO_POINTS, np.vstack(bodies))
