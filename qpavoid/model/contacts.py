"""Contacts of a footprint with all obstacles, as a table for every method."""

import math
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.capsules import (
    OWNER,
    PIVOT_X,
    PIVOT_Y,
    RADIUS,
    TURN,
    V_X,
    V_Y,
    axis_of,
    chain_end,
    has_length,
    velocity_at,
)
from qpavoid.model.contact import (
    NO_CONTACT,
    Contact,
    feature_contact,
    feature_count,
    part_at,
    point_contact_of,
    separation,
)
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.validation import FARTHEST
from qpavoid.types import Array, Arrays, Edges, Table, Vector, VectorWritten, layout

Names: TypeAlias = npt.NDArray[np.int64]


class ObstacleContact(NamedTuple):
    """One row of the table: a contact with an obstacle.

    Attributes:
        x: P_r in the robot frame, m.
        y: Of P_r, m.
        n_x: Outward normal there.
        n_y: Of the normal.
        distance: To the surface of the obstacle, signed, m.
        v_x: Over ground, of the obstacle's point nearest to P_r, m/s.
        v_y: Of the velocity, m/s.
        obstacle: Its number.
        segment: Edge of the footprint.
    """

    x: float
    y: float
    n_x: float
    n_y: float
    distance: float
    v_x: float
    v_y: float
    obstacle: int
    segment: int


CONTACT = layout(ObstacleContact)
CONTACT_SIZE = CONTACT.itemsize // 8
"""Layout of the table of contacts, and numbers of memory per contact."""

MOST_COUNTED = 1_000_000_000
"""Greatest number of contacts; more are counted as this many, and do not fit."""


@entry
@compiled_once
def _contact_at_fits(memory: Vector, row: int) -> bool:
    """Return whether the table has such a row."""
    all_fit: bool = 0 <= row < memory.shape[0] // CONTACT_SIZE
    return all_fit


@entry_if(_contact_at_fits)
@compiled
def contact_at(memory: Vector, row: int) -> ObstacleContact:
    """Return a copy of a row of the table."""
    c = memory.view(CONTACT)[row]
    obstacle, segment = int(c.obstacle), int(c.segment)
    # fmt: off
    return ObstacleContact(c.x, c.y, c.n_x, c.n_y, c.distance, c.v_x, c.v_y, obstacle,
                           segment)
    # fmt: on


@entry
@compiled_once
def _contact_table_fits(
    edges: Edges,
    circumradius: float,
    obstacles: Arrays,
    reach: float,
    memory: VectorWritten,
) -> bool:
    """Return whether the table has room for all contacts."""
    most = most_contacts(edges, obstacles)
    all_fit: bool = memory.shape[0] >= most * CONTACT_SIZE
    return all_fit


@entry_if(_contact_table_fits)
@compiled
def contact_table(
    edges: Edges,
    circumradius: float,
    obstacles: Arrays,
    reach: float,
    memory: VectorWritten,
) -> tuple[int, int]:
    """Write the table of the contacts within reach, and of the nearest one.

    An obstacle farther than the reach from the circumscribed circle of the footprint,
    and farther than the least distance so far, is skipped at the cost of a comparison:
    contacts within reach are never skipped.

    Args:
        edges: Edges of the footprint, as in :class:`Footprint`.
        circumradius: Of the footprint round the origin, m.
        obstacles: Points and capsules; see :class:`Obstacles`.
        reach: Greatest distance from the footprint of interest, m.
        memory: Of :func:`empty_contacts`: a table of :class:`ObstacleContact`.

    Returns:
        The number of contacts, and the row of least distance, the first of equal ones;
        −1 if there is no contact, −2 if a number is not finite or a radius negative.
    """
    (points, capsules), contacts = obstacles, memory.view(CONTACT)
    count, nearest = point_contacts(edges, points, (circumradius, reach), contacts)
    least, end = contacts[nearest].distance if nearest >= 0 else math.inf, 0
    while end < capsules.shape[0] and nearest > -2:
        begin, end = end, chain_end(capsules, end)
        chain = capsules[begin:end]
        # The nearest obstacle counts beyond the reach, too: it is the clearance.
        far = passed_over(chain, circumradius, max(reach, least))
        if far < 0:
            return 0, -2
        if far > 0:
            continue
        stop = 0
        while stop < edges.shape[0]:
            part = part_at(edges, stop)
            stop = part.end
            features, overlap = 1, NO_CONTACT
            if has_length(chain, 0):
                overlap = separation(edges, part, chain)
                if overlap.distance > 0.0:
                    features = feature_count(part, chain)
            for feature in range(features):
                contact = overlap
                if overlap.distance > 0.0:
                    contact = feature_contact(edges, part, chain, feature)
                distance = contact.distance - chain[0, RADIUS]
                # The nearest is stored even beyond the reach.
                if distance < least:
                    nearest, least = count, distance
                elif distance > reach or contact.segment < 0:
                    continue
                contacts[count] = capsule_contact(contact, chain)
                count += 1
    return count, nearest


@compiled
def point_contacts(
    edges: Array, points: Array, within: tuple[float, float], contacts: Table
) -> tuple[int, int]:
    """Fill in the contacts of points; ``within``: circumradius and reach, m."""
    count, nearest, least, beyond, end = 0, -1, math.inf, math.inf, 0
    while end < edges.shape[0]:
        part = part_at(edges, end)
        end = part.end
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            if not (abs(x) < FARTHEST and abs(y) < FARTHEST):
                return 0, -2
            if x * x + y * y > beyond:
                continue
            contact = point_contact_of(edges, part, x, y)
            if contact.distance < least:
                nearest, least = count, contact.distance
                # One square per new minimum instead of a root per point.
                beyond = (within[0] + max(within[1], least)) ** 2
            elif contact.distance > within[1]:
                continue
            (p_x, p_y, n_x, n_y, distance, segment), z = contact, 0.0
            row = ObstacleContact(p_x, p_y, n_x, n_y, distance, z, z, i, segment)
            contacts[count] = row
            count += 1
    return count, nearest


@compiled_once
def passed_over(chain: Array, circumradius: float, within: float) -> int:
    """Return 1 if an obstacle is certainly farther than ``within`` m, 0 if not.

    Decided by its circumscribed circle round the pivot. −1 if one of its numbers is not
    finite, or its radius negative.
    """
    x, y, square = chain[0, PIVOT_X], chain[0, PIVOT_Y], 0.0
    for i in range(chain.shape[0]):
        x1, y1, x2, y2 = axis_of(chain, i)
        # A sum is not finite if one of its terms is not; NaN fails comparisons.
        size = abs(x1) + abs(y1) + abs(x2) + abs(y2) + abs(x) + abs(y)
        size += abs(chain[i, V_X]) + abs(chain[i, V_Y]) + abs(chain[i, TURN])
        if not (size + chain[i, RADIUS] < FARTHEST and chain[i, RADIUS] >= 0.0):
            return -1
        square = max(square, (x1 - x) ** 2 + (y1 - y) ** 2)
        square = max(square, (x2 - x) ** 2 + (y2 - y) ** 2)
    radius = chain[0, RADIUS] + math.sqrt(square)
    return int(x * x + y * y > (circumradius + radius + within) ** 2)


@compiled
def capsule_contact(contact: Contact, chain: Array) -> ObstacleContact:
    """Return the contact with a capsule from that with its axis; v_o nearest P_r."""
    p_x, p_y, n_x, n_y, distance, segment = contact
    distance = distance - chain[0, RADIUS]
    v_x, v_y = velocity_at(chain, 0, p_x + distance * n_x, p_y + distance * n_y)
    owner = int(chain[0, OWNER])
    return ObstacleContact(p_x, p_y, n_x, n_y, distance, v_x, v_y, owner, segment)


@entry
@compiled
def most_contacts(edges: Edges, obstacles: Arrays) -> int:
    """Return the greatest number of contacts; see :func:`feature_count`."""
    count, stop = 0, 0
    while stop < edges.shape[0]:
        part = part_at(edges, stop)
        stop, end = part.end, 0
        count = min(count + len(obstacles[0]), MOST_COUNTED)
        while end < len(obstacles[1]):
            begin, end = end, chain_end(obstacles[1], end)
            if has_length(obstacles[1], begin):
                count += feature_count(part, obstacles[1][begin:end])
            else:
                count += 1
            count = min(count, MOST_COUNTED)
    return count


def empty_contacts(edges: Array, obstacles: Arrays) -> Array:
    """Return uninitialised memory for the table of all contacts."""
    return np.empty(most_contacts(edges, obstacles) * CONTACT_SIZE)


def clearance_of(footprint: Footprint, obstacles: Arrays) -> float:
    """Return the signed distance of the nearest obstacle, m; ∞ without obstacles."""
    contacts = empty_contacts(footprint.edges, obstacles)
    _, nearest = contact_table(
        footprint.edges, footprint.circumradius, obstacles, 0.0, contacts
    )
    return contact_at(contacts, nearest).distance if nearest >= 0 else math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Contacts:
    """All contacts of a footprint with some obstacles, robot frame.

    Attributes:
        point: (n, 2) P_r, the footprint point nearest to the obstacle, m.
        normal: (n, 2) outward unit normal of the footprint there; d̂_o = −normal.
        distance: (n,) signed distance to the obstacle's surface, m; negative inside.
        velocity: (n, 2) v_o over ground of the obstacle's point nearest to P_r, m/s.
        obstacle: (n,) number of the obstacle: points, then discs, walls, polygons.
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
        memory = empty_contacts(footprint.edges, arrays)
        count, _ = contact_table(
            footprint.edges, footprint.circumradius, arrays, math.inf, memory
        )
        table = memory.view(CONTACT)[:count]
        columns = (
            np.column_stack([table["x"], table["y"]]),
            np.column_stack([table["n_x"], table["n_y"]]),
            table["distance"].copy(),
            np.column_stack([table["v_x"], table["v_y"]]),
            table["obstacle"].astype(np.int64),
            table["segment"].astype(np.int64),
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
