"""Broad phase: bodies to be checked along a rollout, and the first violation.

Bodies are skipped by the circles round footprint and body, and in groups. Successive
points, as of a scan, share a wall whose margin is at most that of any of them
(:func:`qpavoid.avoidance.groups.group_of`): if the wall's keeps the threshold, and
:data:`SPARE` at every sample, none of the points is checked.
"""

from typing import NamedTuple

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.body_table import GROUP, OWNER, body_at, comes_first, moves
from qpavoid.avoidance.motion import stays_away
from qpavoid.avoidance.prediction import Rollout
from qpavoid.avoidance.scene import Scene, of_groups, threshold
from qpavoid.compiled import compiled_once
from qpavoid.types import Pair

SPARE = 0.02
"""m; excess of a group's margin below which its points are checked one by one."""


class Meeting(NamedTuple):
    """First violation along a rollout.

    Attributes:
        body: Its number, or −1.
        time: Of the violation, s.
    """

    body: int
    time: float


class Watch(NamedTuple):
    """Time spans and thresholds of a check along a rollout.

    Attributes:
        moving: For moving bodies: end of the check, s (below 0: none), and threshold of
            the margin, m.
        still: For static bodies.
    """

    moving: Pair
    still: Pair


UNWATCHED = (-1.0, 0.0)
"""Entry of a :class:`Watch` without a check."""


@compiled_once
def next_body(scene: Scene, rollout: Rollout, i: int, watch: Watch) -> int:
    """Return the first body from i on that needs a check, or the number of bodies.

    Bodies are skipped by their circles and by their groups.
    """
    count: int = scene.bodies.shape[0]
    while i < count:
        row, wanted = int(scene.bodies[i, GROUP]), watch.still
        if moves(scene, i):
            wanted = watch.moving
        end, level = wanted
        # The owner of a group is the row after its last point.
        if row >= 0 and (end < 0.0 or is_far(scene, rollout, row, wanted)):
            i = int(scene.groups[row, OWNER])
        elif end < 0.0 or stays_away(scene, rollout, i, end, level):
            i += 1
        else:
            return i
    return count


@compiled_once
def is_far(scene: Scene, rollout: Rollout, row: int, wanted: Pair) -> bool:
    """Return whether a group keeps a threshold up to a time; ``wanted``: both."""
    (end, level), near = wanted, False
    groups = of_groups(scene)
    # SPARE at every sample, and a miss of SPARE in between, leave the threshold.
    if not stays_away(groups, rollout, row, end, level):
        near, _ = too_near(groups, rollout, row, (0.0, end), level + SPARE, SPARE)
    return not near


@compiled_once
def is_met(
    scene: Scene, rollout: Rollout, i: int, watch: Watch, slack: float
) -> Meeting:
    """Return the violation of body i along a rollout, if any.

    A static body inside r_min may stay as near: else it could not be left.
    """
    (end, level), now = watch.still, body_at(scene, i).now
    if moves(scene, i):
        end, level = watch.moving
    if now < level:
        level = now
        if level < -slack:
            level, slack = threshold(scene), 0.0
    near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
    return Meeting(i if near else -1, time)


@compiled_once
def keeps_all(scene: Scene, rollout: Rollout, watch: Watch) -> bool:
    """Return whether no body violates its threshold."""
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        if is_met(scene, rollout, i, watch, 0.0).body >= 0:
            return False
        i = next_body(scene, rollout, i + 1, watch)
    return True


@compiled_once
def first_met(scene: Scene, rollout: Rollout, watch: Watch, slack: float) -> Meeting:
    """Return the first body, in the order of rows, that violates, and when.

    ``slack``: see :func:`too_near`.
    """
    met = Meeting(-1, 0.0)
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        if met.body < 0 or comes_first(scene.bodies, i, met.body):
            found = is_met(scene, rollout, i, watch, slack)
            met = found if found.body >= 0 else met
        i = next_body(scene, rollout, i + 1, watch)
    return met
