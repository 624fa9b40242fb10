"""All contacts of a footprint with its obstacles: the table that every method reads."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled
from qpavoid.model.contact import Touch, corner_contact, point_contact, wall_separation
from qpavoid.model.footprint import Array, Footprint
from qpavoid.model.obstacles import FARTHEST, Arrays, Obstacles

Names: TypeAlias = npt.NDArray[np.int64]


@compiled
def contact_table(
    edges: Array,
    circumradius: float,
    obstacles: Arrays,
    reach: float,
    contacts: Array,
) -> tuple[int, int]:
    """Fill ``contacts`` with those within reach, and always the nearest one.

    A point or disc that is farther than the reach from the circle round the origin that
    holds the footprint, and farther than the least distance so far, is passed over at
    the cost of a comparison: that never changes what lies within reach.

    Args:
        edges: Edges of the footprint, as in :class:`Footprint`.
        circumradius: Of the footprint round the origin, m.
        obstacles: Points, discs, disc velocities, walls; see :class:`Obstacles`.
        reach: Distance from the footprint that matters to the caller, m.
        contacts: (:func:`most_contacts`, 9) filled: P_r, normal, signed distance, v_o,
            number of the obstacle, segment.

    Returns:
        How many there are, and the row of least distance, the first of equal ones, or
        −1 if there is no contact. A row −2 says that a number is not finite or a radius
        negative.
    """
    points, discs, disc_velocities, walls = obstacles
    corners, n_points, n_discs = edges.shape[0], points.shape[0], discs.shape[0]
    count, nearest, least = 0, -1, math.inf
    beyond = math.inf
    for i in range(n_points):
        x, y = points[i, 0], points[i, 1]
        if not (abs(x) < FARTHEST and abs(y) < FARTHEST):
            return 0, -2
        if x * x + y * y > beyond:
            continue
        touch = point_contact(edges, x, y)
        if touch[4] < least:
            nearest, least = count, touch[4]
            beyond = (circumradius + max(reach, least)) ** 2
        elif touch[4] > reach:
            continue
        add_contact(contacts, count, touch, 0.0, 0.0, 0.0, i)
        count += 1
    for i in range(n_discs):
        x, y, radius = discs[i, 0], discs[i, 1], discs[i, 2]
        v_x, v_y = disc_velocities[i, 0], disc_velocities[i, 1]
        size = abs(x) + abs(y) + abs(v_x) + abs(v_y) + radius
        if not (size < FARTHEST and radius >= 0.0):
            return 0, -2
        if x * x + y * y > (circumradius + radius + max(reach, least)) ** 2:
            continue
        touch = point_contact(edges, x, y)
        if touch[4] - radius < least:
            nearest, least = count, touch[4] - radius
        elif touch[4] - radius > reach:
            continue
        add_contact(contacts, count, touch, radius, v_x, v_y, n_points + i)
        count += 1
    for i in range(walls.shape[0]):
        x1, y1, x2, y2 = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
        if not abs(x1) + abs(y1) + abs(x2) + abs(y2) < FARTHEST:
            return 0, -2
        overlap = wall_separation(edges, x1, y1, x2, y2)
        for feature in range(2 + corners if overlap[4] > 0.0 else 1):
            if overlap[4] <= 0.0:
                touch = overlap
            elif feature == 0:
                touch = point_contact(edges, x1, y1)
            elif feature == 1:
                touch = point_contact(edges, x2, y2)
            else:
                touch = corner_contact(edges, feature - 2, x1, y1, x2, y2)
            if touch[4] < least:
                nearest, least = count, touch[4]
            elif touch[4] > reach or touch[5] < 0:
                continue
            add_contact(contacts, count, touch, 0.0, 0.0, 0.0, n_points + n_discs + i)
            count += 1
    return count, nearest


@compiled
def add_contact(
    contacts: Array,
    row: int,
    touch: Touch,
    radius: float,
    v_x: float,
    v_y: float,
    obstacle: int,
) -> None:
    """Write one row of the table: the contact with a disc of that radius."""
    contacts[row, 0], contacts[row, 1] = touch[0], touch[1]
    contacts[row, 2], contacts[row, 3] = touch[2], touch[3]
    contacts[row, 4] = touch[4] - radius
    contacts[row, 5], contacts[row, 6] = v_x, v_y
    contacts[row, 7], contacts[row, 8] = obstacle, touch[5]


@compiled
def most_contacts(edges: Array, obstacles: Arrays) -> int:
    """Return how many contacts there can be: a wall has its ends and all corners."""
    points, discs, _, walls = obstacles
    return len(points) + len(discs) + len(walls) * (2 + len(edges))


@dataclass(frozen=True, eq=False, slots=True)
class Contacts:
    """All contacts of a footprint with some obstacles, robot frame.

    Attributes:
        point: (n, 2) P_r, the footprint point nearest to the obstacle, m.
        normal: (n, 2) outward unit normal of the footprint there; d̂_o = −normal.
        distance: (n,) signed distance to the obstacle's surface, m; negative inside.
        velocity: (n, 2) v_o, the obstacle's velocity over ground, m/s.
        obstacle: (n,) number of the obstacle: points, then discs, then walls.
        segment: (n,) footprint edge that holds P_r; at a corner the one that faces the
            obstacle most.
    """

    point: Array
    normal: Array
    distance: Array
    velocity: Array
    obstacle: Names
    segment: Names

    @classmethod
    def of(cls, footprint: Footprint, obstacles: Obstacles) -> "Contacts":
        """Return the contacts of a footprint with obstacles in the robot frame."""
        arrays = obstacles.arrays
        table = np.empty((most_contacts(footprint.edges, arrays), 9))
        count, _ = contact_table(
            footprint.edges, footprint.circumradius, arrays, math.inf, table
        )
        table = table[:count]
        columns = (
            table[:, 0:2],
            table[:, 2:4],
            table[:, 4],
            table[:, 5:7],
            table[:, 7].astype(np.int64),
            table[:, 8].astype(np.int64),
        )
        for column in columns:
            column.setflags(write=False)
        return cls(*columns)

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def jacobian(self) -> Array:
        """(n, 2, 2) J_0 of Eq. 4 in the robot frame: velocity of P_r = J_0 (v, ω)."""
        j_0 = np.zeros((len(self), 2, 2))
        j_0[:, 0, 0] = 1.0
        j_0[:, 0, 1] = -self.point[:, 1]
        j_0[:, 1, 1] = self.point[:, 0]
        return j_0
