"""Groups: points given one after the other that lie together share one wall.

Of 360 points of a scan most lie on a few surfaces: one look at the wall tells a whole
group clear, see :mod:`qpavoid.avoidance.broad_phase`.
"""

import math

from qpavoid.avoidance.body_table import GROUP, STANDS, Body, body_at, set_body
from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled_once
from qpavoid.model.capsules import Segment, from_segment
from qpavoid.model.kinematics import TINY

FEW, MANY, WIDE = 4, 32, 0.3
"""Points that make a group, at least and at most; and how far the last may be from the
first, as a share of its distance."""


@compiled_once
def group_points(scene: Scene, count: int) -> None:
    """Gather points given one after the other that lie together, as those of a scan."""
    bodies, begin, made = scene.bodies, 0, 0
    for i in range(1, count + 1):
        a, b = bodies[begin], bodies[min(i, count - 1)]
        square = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
        # As seen from the robot: a wall far away may be longer and still tell as much.
        near = square < WIDE * WIDE * (a[0] ** 2 + a[1] ** 2)
        if i < count and i - begin < MANY and near:
            continue
        if i - begin >= FEW and made < scene.groups.shape[0]:
            set_body(scene.groups, made, group_of(scene, begin, i))
            bodies[begin, GROUP] = made
            made += 1
        begin = i


@compiled_once
def group_of(scene: Scene, begin: int, end: int) -> Body:
    """Return the wall that has no more room than any of these points."""
    one, other = body_at(scene, begin), body_at(scene, end - 1)
    axis = Segment(one.x, one.y, other.x, other.y)
    keep, r_min, z = 0.0, math.inf, 0.0
    for i in range(begin, end):
        body = body_at(scene, i)
        d_x, d_y = from_segment(axis, body.x, body.y)
        # The axis joins the first and the last point; whatever lies off it is held by
        # the greater distance to keep. TINY stands for rounding.
        keep = max(keep, body.keep + math.sqrt(d_x * d_x + d_y * d_y) + TINY)
        r_min = min(r_min, body.keep - body.inflation)
    x, y = 0.5 * (one.x + other.x), 0.5 * (one.y + other.y)
    x1, y1, x2, y2 = one.x - x, one.y - y, other.x - x, other.y - y
    spread = keep + math.sqrt(max(x1**2 + y1**2, x2**2 + y2**2))
    # fmt: off
    return Body(x, y, x1, y1, x2, y2, z, z, z, keep, keep - r_min, spread, z, z,
                STANDS, float(end), math.inf, -1.0)
