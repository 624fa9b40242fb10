"""Contacts: the nearest footprint point P_r to each obstacle, and J_0 there (Eq. 4).

All in the robot frame. The normal is the outward unit normal of the footprint at P_r:
it points from the robot to the obstacle, and the paper's repulsive direction is
d̂_o = −normal. Its velocity-space row is d̂_oᵀ J_0, see :func:`approach_row`.

For a point or disc outside, the signed distance is continuously differentiable, across
corners too, with gradient −normal with respect to P_r. It is negative inside. A wall
gives several contacts: its two ends against the footprint, and every footprint corner
that projects into it; the least of their distances is the distance of the wall, and
together their rows constrain both ends of a side that moves along it. A wall that cuts
the footprint gives one: the least shift that separates them. A convex polygon counts as
several walls, their common ends counted once; if it overlaps with the footprint, it
gives one as well: the least shift that ends the overlap. All this for each convex part
of a footprint; the distance to the footprint is the least one.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.capsules import X1, Y1, Segment, axis_of
from qpavoid.types import Array, Edges, Pair

NO_LENGTH = 1e-12
"""m; shorter vectors have no direction beyond rounding."""


class Contact(NamedTuple):
    """The nearest footprint point P_r, with the normal towards an obstacle.

    Attributes:
        x: P_r in the robot frame, m.
        y: Of P_r, m.
        n_x: Outward unit normal of the footprint at P_r.
        n_y: Of the normal.
        distance: Signed, m.
        segment: Edge of the footprint that holds P_r, or faces the obstacle most.
    """

    x: float
    y: float
    n_x: float
    n_y: float
    distance: float
    segment: int


NO_CONTACT = Contact(0.0, 0.0, 1.0, 0.0, math.inf, -1)
"""No contact: the nearest points of a corner and a wall are other features."""


class Part(NamedTuple):
    """Convex part of a footprint: rows ``begin`` to before ``end`` of its edges."""

    begin: int
    end: int


class Edge(NamedTuple):
    """One edge of a footprint; see :class:`Footprint`.

    Attributes:
        x: Its start in the robot frame, m.
        y: Of the start, m.
        n_x: Outward unit normal; the unit tangent is (−n_y, n_x).
        n_y: Of the normal.
        length: m.
    """

    x: float
    y: float
    n_x: float
    n_y: float
    length: float


@compiled
def edge_at(edges: Array, row: int) -> Edge:
    """Return an edge of the footprint."""
    # Element by element: in C the edges are a constant table.
    x, y, n_x, n_y = edges[row, 0], edges[row, 1], edges[row, 2], edges[row, 3]
    return Edge(x, y, n_x, n_y, edges[row, 4])


@compiled
def part_at(edges: Array, begin: int) -> Part:
    """Return the part whose first edge is in that row."""
    end = edges[begin, 5]
    # Of an invalid table the loops over parts end, too.
    return Part(begin, int(end) if begin < end <= edges.shape[0] else edges.shape[0])


@compiled
def corner_at(edges: Array, corner: int) -> tuple[float, float]:
    """Return a corner of the footprint, m: the start of the edge of that number."""
    edge = edge_at(edges, corner)
    return edge.x, edge.y


@compiled
def point_contact_of(edges: Array, part: Part, x: float, y: float) -> Contact:
    """Return the contact of a convex part with the point (x, y).

    The supporting line with the greatest signed distance s decides. Inside (s ≤ 0)
    and where the point projects into that edge, s is the distance. Else the nearest
    footprint point is the corner at that end of the edge: at a corner all other lines
    lie nearer, since their normals make a greater angle with the way to the point.
    The segment is the edge that faces the point most.
    """
    greatest = -math.inf
    segment = part.begin
    for i in range(part.begin, part.end):
        edge = edge_at(edges, i)
        s = edge.n_x * (x - edge.x) + edge.n_y * (y - edge.y)
        if s > greatest:
            greatest = s
            segment = i
    edge = edge_at(edges, segment)
    n_x, n_y = edge.n_x, edge.n_y
    along = n_x * (y - edge.y) - n_y * (x - edge.x)
    # Beyond the ends of this edge the nearest point is a corner, which the normal
    # starts from.
    if greatest > 0.0 and not 0.0 <= along <= edge.length:
        corner = segment if along < 0.0 else segment + 1
        if corner == part.end:
            corner = part.begin
        p_x, p_y = corner_at(edges, corner)
        d_x, d_y = x - p_x, y - p_y
        distance = math.sqrt(d_x * d_x + d_y * d_y)
        # On the corner itself any normal between the edges' is valid.
        if distance > NO_LENGTH:
            n_x, n_y = d_x / distance, d_y / distance
        return Contact(p_x, p_y, n_x, n_y, distance, segment)
    p_x, p_y = x - greatest * n_x, y - greatest * n_y
    return Contact(p_x, p_y, n_x, n_y, greatest, segment)


@entry
@compiled
def point_contact(edges: Edges, x: float, y: float) -> Contact:
    """Return the nearest contact of a footprint with the point (x, y)."""
    part = part_at(edges, 0)
    nearest = point_contact_of(edges, part, x, y)
    while part.end < edges.shape[0]:
        part = part_at(edges, part.end)
        contact = point_contact_of(edges, part, x, y)
        if contact.distance < nearest.distance:
            nearest = contact
    return nearest


@compiled_once
def corner_contact(edges: Array, part: Part, corner: int, wall: Segment) -> Contact:
    """Return the contact of one corner of a part with the interior of a wall.

    :data:`NO_CONTACT` if the corner projects beyond the wall's ends: an end is nearer.
    """
    x1, y1, x2, y2 = wall
    length = math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2)
    if length < NO_LENGTH:
        return NO_CONTACT
    t_x, t_y = (x2 - x1) / length, (y2 - y1) / length
    p_x, p_y = corner_at(edges, corner)
    # At the ends themselves point_contact gives the same.
    if not 0.0 < t_x * (p_x - x1) + t_y * (p_y - y1) < length:
        return NO_CONTACT
    distance = t_x * (y1 - p_y) - t_y * (x1 - p_x)
    side = 1.0 if distance >= 0.0 else -1.0
    n_x, n_y = -side * t_y, side * t_x
    segment = facing_segment(edges, part, corner, (n_x, n_y))
    return Contact(p_x, p_y, n_x, n_y, side * distance, segment)


@compiled_once
def facing_segment(edges: Array, part: Part, corner: int, normal: Pair) -> int:
    """Return the one of the two edges at a corner that faces a direction more."""
    (n_x, n_y), other = normal, (corner if corner > part.begin else part.end) - 1
    after, before = edge_at(edges, corner), edge_at(edges, other)
    facing = n_x * after.n_x + n_y * after.n_y
    facing_before = n_x * before.n_x + n_y * before.n_y
    return corner if facing >= facing_before else other


@compiled_once
def wall_separation(edges: Array, part: Part, wall: Segment) -> Contact:
    """Return the contact along the axis of least overlap of a part and a wall.

    Two convex sets are disjoint if and only if a normal of one of their edges separates
    them [Gottschalk1996]. The distance is the greatest separation over these normals;
    if negative, it is minus the least shift that ends the overlap.
    """
    greatest, contact = -math.inf, NO_CONTACT
    x1, y1, x2, y2 = wall
    for i in range(part.begin, part.end):
        a_x, a_y, n_x, n_y, edge_length = edge_at(edges, i)
        s_1 = n_x * (x1 - a_x) + n_y * (y1 - a_y)
        s_2 = n_x * (x2 - a_x) + n_y * (y2 - a_y)
        # The end that comes nearest along this normal decides whether it separates.
        s, x, y = (s_1, x1, y1) if s_1 <= s_2 else (s_2, x2, y2)
        if s > greatest:
            along = n_x * (y - a_y) - n_y * (x - a_x)
            along = min(max(along, 0.0), edge_length)
            greatest = s
            p_x, p_y = a_x - along * n_y, a_y + along * n_x
            contact = Contact(p_x, p_y, n_x, n_y, s, i)
    length = math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2)
    if length < NO_LENGTH:
        return contact
    # A wall has no interior: both of its normals may separate.
    for side in (-1.0, 1.0):
        n_x, n_y = -side * (y2 - y1) / length, side * (x2 - x1) / length
        least, corner = side_separation(edges, part, (n_x, n_y), (x1, y1))
        if least > greatest:
            greatest = least
            segment = facing_segment(edges, part, corner, (n_x, n_y))
            p_x, p_y = corner_at(edges, corner)
            contact = Contact(p_x, p_y, n_x, n_y, least, segment)
    return contact


@compiled_once
def side_separation(
    edges: Array, part: Part, normal: Pair, place: Pair
) -> tuple[float, int]:
    """Return the distance of a line from a part, m, and the nearest corner.

    ``normal``: unit normal of the line; ``place``: a point of it.
    """
    (n_x, n_y), (x, y), least, corner = normal, place, math.inf, part.begin
    for i in range(part.begin, part.end):
        a_x, a_y = corner_at(edges, i)
        s = n_x * (x - a_x) + n_y * (y - a_y)
        if s < least:
            least, corner = s, i
    return least, corner


@compiled_once
def wall_contact_of(edges: Array, part: Part, wall: Segment) -> Contact:
    """Return a part's nearest contact with a wall; that of the overlap if it cuts."""
    contact = wall_separation(edges, part, wall)
    # Cut: the distances of ends and corners do not give the separating shift.
    if contact.distance <= 0.0:
        return contact
    contact = point_contact_of(edges, part, wall.x1, wall.y1)
    end = point_contact_of(edges, part, wall.x2, wall.y2)
    if end.distance < contact.distance:
        contact = end
    for corner in range(part.begin, part.end):
        side = corner_contact(edges, part, corner, wall)
        if side.distance < contact.distance:
            contact = side
    return contact


@compiled_once
def wall_contact(edges: Array, wall: Segment) -> Contact:
    """Return the nearest contact of a footprint with a wall."""
    part = part_at(edges, 0)
    nearest = wall_contact_of(edges, part, wall)
    while part.end < edges.shape[0]:
        part = part_at(edges, part.end)
        contact = wall_contact_of(edges, part, wall)
        if contact.distance < nearest.distance:
            nearest = contact
    return nearest


@compiled_once
def polygon_separation(edges: Array, part: Part, chain: Array) -> Contact:
    """Return the contact along the axis of least overlap of a part and a polygon.

    As :func:`wall_separation`, over the normals of the edges of both; it holds where
    one lies wholly within the other, too.
    """
    greatest, contact = -math.inf, NO_CONTACT
    for i in range(part.begin, part.end):
        a_x, a_y, n_x, n_y, edge_length = edge_at(edges, i)
        least, x, y = math.inf, 0.0, 0.0
        for j in range(chain.shape[0]):
            s = n_x * (chain[j, X1] - a_x) + n_y * (chain[j, Y1] - a_y)
            if s < least:
                least, x, y = s, chain[j, X1], chain[j, Y1]
        if least > greatest:
            along = n_x * (y - a_y) - n_y * (x - a_x)
            along = min(max(along, 0.0), edge_length)
            greatest = least
            p_x, p_y = a_x - along * n_y, a_y + along * n_x
            contact = Contact(p_x, p_y, n_x, n_y, least, i)
    for j in range(chain.shape[0]):
        x1, y1, x2, y2 = axis_of(chain, j)
        length = math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2)
        n_x, n_y = -(y2 - y1) / length, (x2 - x1) / length
        least, corner = side_separation(edges, part, (n_x, n_y), (x1, y1))
        if least > greatest:
            greatest = least
            segment = facing_segment(edges, part, corner, (n_x, n_y))
            p_x, p_y = corner_at(edges, corner)
            contact = Contact(p_x, p_y, n_x, n_y, least, segment)
    return contact


@compiled
def separation(edges: Array, part: Part, chain: Array) -> Contact:
    """Return the contact along the axis of least overlap, negative if they overlap.

    ``chain``: rows of an obstacle with a length. Of a capsule it is that of its axis.
    """
    if chain.shape[0] > 1:
        return polygon_separation(edges, part, chain)
    return wall_separation(edges, part, axis_of(chain, 0))


@compiled
def feature_count(part: Part, chain: Array) -> int:
    """Return the greatest number of contacts of a part, and an obstacle with a length.

    Of a wall its two ends and each corner of the part; of each edge of a polygon one
    end and each corner.
    """
    corners, sides = part.end - part.begin, int(chain.shape[0])
    return sides * (1 + corners) if sides > 1 else 2 + corners


@compiled_once
def feature_contact(edges: Array, part: Part, chain: Array, feature: int) -> Contact:
    """Return one of the contacts that :func:`feature_count` counts; of the axis.

    :data:`NO_CONTACT` for a corner behind an edge of a polygon: others are nearer.
    """
    row, one, ends = 0, feature, 2
    if chain.shape[0] > 1:
        each, ends = 1 + part.end - part.begin, 1
        row, one = feature // each, feature % each
    axis = axis_of(chain, row)
    if one == 0:
        return point_contact_of(edges, part, axis.x1, axis.y1)
    if one < ends:
        return point_contact_of(edges, part, axis.x2, axis.y2)
    contact = corner_contact(edges, part, part.begin + one - ends, axis)
    behind = (axis.x2 - axis.x1) * contact.n_y < (axis.y2 - axis.y1) * contact.n_x
    # Only the outer side of a polygon's edge can be in contact.
    if ends == 1 and contact.segment >= 0 and behind:
        return NO_CONTACT
    return contact


@compiled
def approach_row(p_x: float, p_y: float, n_x: float, n_y: float) -> tuple[float, float]:
    """Return d̂_oᵀ J_0 with d̂_o = −normal: P_r's speed away from the obstacle.

    In the robot frame Eq. 4 reads J_0 = [[1, −p_y], [0, p_x]], so that P_r moves with
    (v − ω p_y, ω p_x). The row times (v, ω), minus the same for the obstacle's
    velocity, is the rate of the distance in m/s.
    """
    return -n_x, n_x * p_y - n_y * p_x
