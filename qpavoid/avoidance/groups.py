"""Groups: successive neighbouring points that share one wall.

Most points of a scan lie on a few surfaces: one check of the wall clears a whole group,
see :mod:`qpavoid.avoidance.broad_phase`.
"""

import math

from qpavoid.avoidance.body_table import GROUP, STANDS, Body, body_at, set_body
from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled_once
from qpavoid.model.capsules import Segment, from_segment
from qpavoid.model.kinematics import TINY

FEW, MOST_GROUPED, WIDEST_GROUP = 4, 32, 0.3
"""Least and greatest number of points of a group; greatest distance of its last point
from the first, as a share of their range."""


@compiled_once
def group_points(scene: Scene, count: int) -> None:
    """Group successive neighbouring points, as those of a scan."""
    bodies, begin, made = scene.bodies, 0, 0
    for i in range(1, count + 1):
        a, b = bodies[begin], bodies[min(i, count - 1)]
        square = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
        # In proportion to the range: a distant wall may be longer.
        near = square < WIDEST_GROUP * WIDEST_GROUP * (a[0] ** 2 + a[1] ** 2)
        if i < count and i - begin < MOST_GROUPED and near:
            continue
        if i - begin >= FEW and made < scene.groups.shape[0]:
            set_body(scene.groups, made, group_of(scene, begin, i))
            bodies[begin, GROUP] = made
            made += 1
        begin = i


@compiled_once
def group_of(scene: Scene, begin: int, end: int) -> Body:
    """Return a wall whose margin is at most that of any of these points."""
    one, other = body_at(scene, begin), body_at(scene, end - 1)
    axis = Segment(one.x, one.y, other.x, other.y)
    keep, r_min, z = 0.0, math.inf, 0.0
    for i in range(begin, end):
        body = body_at(scene, i)
        d_x, d_y = from_segment(axis, body.x, body.y)
        # The axis joins the first and the last point; the required distance includes
        # the greatest deviation from it. TINY covers rounding.
        keep = max(keep, body.keep + math.sqrt(d_x * d_x + d_y * d_y) + TINY)
        r_min = min(r_min, body.keep - body.inflation)
    x, y = 0.5 * (one.x + other.x), 0.5 * (one.y + other.y)
    x1, y1, x2, y2 = one.x - x, one.y - y, other.x - x, other.y - y
    spread = keep + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, z, z, z, keep, keep - r_min, spread, z, z,
                STANDS, float(end), math.inf, -1.0, z)
