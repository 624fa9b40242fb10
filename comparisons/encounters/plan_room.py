"""How near a robot comes to everything in a scene: at a time, and along a plan.

Distances of its own for carts, and those of :mod:`qpavoid.model.contact`, which are
checked elsewhere, for points, discs and walls. Nothing here knows a controller.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from encounter_movers import PIECE, Mover, mover_at
from limit_search import ramp
from qpavoid.compiled import allocating
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.kinematics import arc
from qpavoid.types import Array

GONE = 12.0
"""m; a mover that is farther than this from the start and leaves counts no more."""


class Scene(NamedTuple):
    """All obstacles of an encounter, as the compiled functions take them.

    Attributes:
        points: (N, 2) m.
        walls: (K, 4) m.
        shapes: (M, 3) of movers: radius, half length, half width, m.
        pieces: (M, P, 7) their ways; pieces that are not there begin at ``inf``.
        fastest: Greatest speed of a mover's outline, m/s.
        until: s; from then on no mover comes near any more.
    """

    points: Array
    walls: Array
    shapes: Array
    pieces: Array
    fastest: float
    until: float


def make_scene(
    points: Array, walls: Array, movers: Sequence[Mover], until: float
) -> Scene:
    """Return a scene; see :class:`Scene`."""
    most = max((len(mover.pieces) for mover in movers), default=1)
    pieces = np.full((len(movers), most, PIECE), math.inf)
    fastest = 0.0
    for row, mover in zip(pieces, movers, strict=True):
        row[: len(mover.pieces)] = mover.pieces
        turning = np.abs(mover.pieces[:, 6]).max() * math.hypot(*mover.half)
        fastest = max(fastest, mover.fastest + turning)
    shapes = np.array([(m.radius, *m.half) for m in movers]).reshape(-1, 3)
    return Scene(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(walls, dtype=np.float64),
        shapes,
        pieces,
        float(fastest),
        float(until),
    )


class Case(NamedTuple):
    """What plans are judged by.

    Attributes:
        edges: Of the footprint.
        limits: As :func:`limit_search.limit_numbers` gives them.
        scene: What the robot meets.
        wanted: (M + 1,) distance wanted from every mover, and at last from all that
            stands, m.
        start: (2,) v, ω at time 0.
    """

    edges: Array
    limits: Array
    scene: Scene
    wanted: Array
    start: Array


@allocating
def rectangle_distance(
    edges: Array, x: float, y: float, angle: float, length: float, width: float
) -> float:
    """Return the signed distance of a rectangle to the footprint, m.

    Outside, one of the two nearest points is a corner; two that overlap part soonest
    along a normal.

    Args:
        edges: Of the footprint.
        x: Of its middle, m.
        y: Of its middle, m.
        angle: Where its length points, rad.
        length: Half of it, m.
        width: Half of it, m.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    apart, nearest = -math.inf, math.inf
    for side in range(4):
        along, across = (1.0, -1.0, 0.0, 0.0)[side], (0.0, 0.0, 1.0, -1.0)[side]
        far = length if side < 2 else width
        least = math.inf
        for i in range(edges.shape[0]):
            d_x, d_y = edges[i, 0] - x, edges[i, 1] - y
            a, b = cos * d_x + sin * d_y, cos * d_y - sin * d_x
            least = min(least, along * a + across * b - far)
            if side == 0:
                out_a, out_b = abs(a) - length, abs(b) - width
                if out_a > 0.0 and out_b > 0.0:
                    nearest = min(nearest, math.sqrt(out_a**2 + out_b**2))
                else:
                    nearest = min(nearest, max(out_a, out_b))
        apart = max(apart, least)
    for i in range(edges.shape[0]):
        least = math.inf
        for corner in range(4):
            a = length if corner < 2 else -length
            b = width if corner % 2 == 0 else -width
            c_x, c_y = x + cos * a - sin * b, y + sin * a + cos * b
            s = edges[i, 2] * (c_x - edges[i, 0]) + edges[i, 3] * (c_y - edges[i, 1])
            least = min(least, s)
            if i == 0:
                nearest = min(nearest, point_contact(edges, c_x, c_y).distance)
        apart = max(apart, least)
    return nearest if apart > 0.0 else apart


@allocating
def room(
    edges: Array,
    reach: float,
    scene: Scene,
    wanted: Array,
    x: float,
    y: float,
    heading: float,
    t: float,
) -> float:
    """Return the least distance less what is wanted, over all obstacles, m.

    Args:
        edges: Of the footprint.
        reach: Circumradius of the footprint, m.
        scene: The obstacles.
        wanted: (M + 1,) as in :class:`Case`.
        x: Of the robot, m.
        y: Of the robot, m.
        heading: Of the robot, rad.
        t: When, s.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    least = math.inf
    for m in range(scene.shapes.shape[0]):
        a, b, course, _ = mover_at(scene.pieces[m], t)
        d_x, d_y = a - x, b - y
        p, q = cos * d_x + sin * d_y, cos * d_y - sin * d_x
        radius, length, width = scene.shapes[m]
        if length > 0.0:
            d = rectangle_distance(edges, p, q, course - heading, length, width)
        else:
            d = point_contact(edges, p, q).distance
        least = min(least, d - radius - wanted[m])
    still: float = wanted[len(scene.shapes)]
    for i in range(scene.points.shape[0]):
        d_x, d_y = scene.points[i, 0] - x, scene.points[i, 1] - y
        far = max(least + still + reach, 0.0)
        if d_x * d_x + d_y * d_y < far * far:
            p, q = cos * d_x + sin * d_y, cos * d_y - sin * d_x
            least = min(least, point_contact(edges, p, q).distance - still)
    for i in range(scene.walls.shape[0]):
        d_x, d_y = scene.walls[i, 0] - x, scene.walls[i, 1] - y
        e_x, e_y = scene.walls[i, 2] - x, scene.walls[i, 3] - y
        w_x, w_y = e_x - d_x, e_y - d_y
        square = max(w_x * w_x + w_y * w_y, 1e-18)
        part = min(max(-(d_x * w_x + d_y * w_y) / square, 0.0), 1.0)
        n_x, n_y = d_x + part * w_x, d_y + part * w_y
        far = max(least + still + reach, 0.0)
        if n_x * n_x + n_y * n_y < far * far:
            p, q = cos * d_x + sin * d_y, cos * d_y - sin * d_x
            u, w = cos * e_x + sin * e_y, cos * e_y - sin * e_x
            touch = wall_contact(edges, Segment(p, q, u, w))
            least = min(least, touch.distance - still)
    return least


@allocating
def circumradius(edges: Array) -> float:
    """Return the greatest distance of the footprint from the robot's origin, m."""
    return math.sqrt(np.max(edges[:, 0] ** 2 + edges[:, 1] ** 2))


@allocating
def plan_room(case: Case, plan: Array, floor: float, blur: float) -> float:
    """Return the least room under a plan, m, or any number up to the floor below it.

    The twist ramps from ``start`` towards each target (v, ω, s) of the plan in turn,
    then to rest, where the robot stands until the movers have left. Between two looks
    nothing can come nearer than the greater of the floor and the least so far less
    ``8 blur``, give or take ``blur``: the room shrinks no faster than all can move.
    """
    edges, limits, scene, wanted, start = case
    x, y, heading, t = 0.0, 0.0, 0.0, 0.0
    v, omega, reach = start[0], start[1], circumradius(edges)
    g = room(edges, reach, scene, wanted, x, y, heading, t)
    least = g
    for p in range(len(plan) + 2):
        target, turn, left = 0.0, 0.0, max(abs(v) / limits[4], abs(omega) / limits[5])
        if p < len(plan):
            target, turn, left = plan[p, 0], plan[p, 1], plan[p, 2]
        elif p > len(plan):
            left = scene.until - t
        while left > 1e-9 and least > floor:
            pace = max(abs(v), abs(target)) + reach * max(abs(omega), abs(turn))
            pace = max(pace + scene.fastest, 1e-3)
            h = max(g - max(floor, least - 8.0 * blur), blur) / pace
            h = min(h, left)
            for gap in (abs(target - v) / limits[4], abs(turn - omega) / limits[5]):
                if gap > 1e-9:
                    h = min(h, gap)
            v, v_mean = ramp(v, target, limits[4], h)
            omega, omega_mean = ramp(omega, turn, limits[5], h)
            x, y, heading = arc(x, y, heading, v_mean, omega_mean, h)
            left -= h
            t += h
            g = room(edges, reach, scene, wanted, x, y, heading, t)
            least = min(least, g)
    return least
