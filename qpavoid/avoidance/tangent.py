"""Tangents: static obstacles inside r_min that are parts of one wall.

A wall given as points, or in parts, is more than its nearest point. A robot inside its
r_min may drive along it as along one segment: the tangent, the line through the nearest
point perpendicular to the contact's normal, replaces all obstacles behind it.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.contact import corner_at
from qpavoid.model.contacts import (
    DISTANCE,
    NORMAL_X,
    NORMAL_Y,
    P_X,
    P_Y,
    contact_at,
)
from qpavoid.model.kinematics import TINY
from qpavoid.types import Array, Pair

ROUNDED_IN = 1e-5
"""m; tolerance of r_min for rounding in successive steps."""

UNEVEN, SLANT = 0.01, 0.15
"""m, and m per m beyond the side in contact: tolerance by which parts of one wall may
be in front of its tangent, for the noise of a scan and a small angle to the wall."""


class Tangent(NamedTuple):
    """The line through an obstacle's nearest point, perpendicular to the normal.

    Attributes:
        normal: n, outward unit normal of the footprint at P_r.
        behind: n·z for all points z of the line, m.
        first: Least n × z of the footprint's side or corner in contact, m.
        last: Greatest n × z of it, m.
        distance: From the footprint, m; ``inf``: no tangent.
    """

    normal: Pair
    behind: float
    first: float
    last: float
    distance: float


@compiled
def no_tangent(side: Pair) -> Tangent:
    """Return the absent tangent of a side."""
    return Tangent(side, 0.0, 0.0, 0.0, math.inf)


@compiled_once
def tangent_at(edges: Array, place: Pair, normal: Pair, distance: float) -> Tangent:
    """Return the tangent of a contact of the footprint at P_r, m."""
    (x, y), (n_x, n_y) = place, normal
    foremost, first = n_x * x + n_y * y, n_x * y - n_y * x
    last = first
    for i in range(edges.shape[0]):
        corner_x, corner_y = corner_at(edges, i)
        if n_x * corner_x + n_y * corner_y > foremost - TINY:
            beside = n_x * corner_y - n_y * corner_x
            first, last = min(first, beside), max(last, beside)
    return Tangent(normal, foremost + distance, first, last, distance)


@compiled
def is_behind(tangent: Tangent, place: Pair, radius: float) -> bool:
    """Return whether a disc is behind a tangent, within the tolerance of one wall."""
    (n_x, n_y), (x, y) = tangent.normal, place
    beside = n_x * y - n_y * x
    beyond = max(tangent.first - beside, beside - tangent.last, 0.0)
    nearest = n_x * x + n_y * y - radius
    return nearest >= tangent.behind - UNEVEN - SLANT * beyond


@compiled_once
def nearest_tangent(edges: Array, contacts: Array, near: float, side: Pair) -> Tangent:
    """Return the tangent of the nearest static contact of 0 to ``near`` m.

    Contacts whose normal points to the same side as ``side`` are excluded.
    """
    nearest = no_tangent(side)
    for k in range(contacts.shape[0]):
        c = contact_at(contacts, k)
        within = 0.0 < c.distance < min(near, nearest.distance)
        if within and c.v_x == 0.0 and c.v_y == 0.0:
            if c.n_x * side[0] + c.n_y * side[1] <= 0.0:
                nearest = tangent_at(edges, (c.x, c.y), (c.n_x, c.n_y), c.distance)
    return nearest


@compiled_once
def turn_to_walls(edges: Array, contacts: Array, near: float) -> None:
    """Replace the normals of static contacts behind the nearest tangent by its normal.

    The nearest tangent to either side, within ``near`` m; distances are then along its
    normal. Otherwise a wall's point ahead of a corner acts as a post, whose row stops
    the robot.
    """
    one = nearest_tangent(edges, contacts, near, (0.0, 0.0))
    if one.distance < math.inf:
        other = nearest_tangent(edges, contacts, near, one.normal)
        for k in range(contacts.shape[0]):
            c = contact_at(contacts, k)
            if 0.0 < c.distance < near and c.v_x == 0.0 and c.v_y == 0.0:
                turn_to_wall(contacts[k], one)
                turn_to_wall(contacts[k], other)


@compiled
def turn_to_wall(row: Array, tangent: Tangent) -> None:
    """Replace the normal of a contact by that of a tangent in front of it."""
    x, y, (n_x, n_y) = row[P_X], row[P_Y], tangent.normal
    place = (x + row[DISTANCE] * row[NORMAL_X], y + row[DISTANCE] * row[NORMAL_Y])
    if tangent.distance < math.inf and is_behind(tangent, place, 0.0):
        row[NORMAL_X], row[NORMAL_Y] = n_x, n_y
        row[DISTANCE] = n_x * (place[0] - x) + n_y * (place[1] - y)
