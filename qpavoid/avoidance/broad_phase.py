"""Broad phase: which bodies need a look along a rollout, and which come too near.

What keeps away by the circles round footprint and body is left out, and so is a whole
group at once. Points that follow one another, as those of a scan do, share a wall that
has no more room than any of them (:func:`qpavoid.avoidance.groups.group_of`): where
that is found to keep the level, and :data:`SPARE` at every look, none of them is looked
at.
"""

from typing import NamedTuple

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.body_table import GROUP, OWNER, comes_first, moves
from qpavoid.avoidance.motion import stays_away
from qpavoid.avoidance.prediction import Rollout
from qpavoid.avoidance.scene import Scene, altered
from qpavoid.compiled import compiled_once
from qpavoid.types import Pair

SPARE = 0.02
"""m; with so little more room than matters a group counts as near."""


class Meeting(NamedTuple):
    """First violation along a rollout.

    Attributes:
        body: Its number; −1: nothing does.
        time: When it does first, s.
    """

    body: int
    time: float


class Watch(NamedTuple):
    """What is looked at along a rollout.

    Attributes:
        moving: Up to when what moves is, s (below 0: it is not), and the room that it
            has to leave, m.
        still: The same for what stands.
    """

    moving: Pair
    still: Pair


UNWATCHED = (-1.0, 0.0)
"""Of a :class:`Watch`: not looked at."""


@compiled_once
def next_body(scene: Scene, rollout: Rollout, i: int, watch: Watch) -> int:
    """Return the first body from i on that may come too near; their number: none.

    Left out is what keeps away by its circle, and together with its group.
    """
    count: int = scene.bodies.shape[0]
    while i < count:
        row, wanted = int(scene.bodies[i, GROUP]), watch.still
        if moves(scene, i):
            wanted = watch.moving
        end, level = wanted
        # A group is far as a whole: its owner is the row after its last point.
        if row >= 0 and (end < 0.0 or is_far(scene, rollout, row, wanted)):
            i = int(scene.groups[row, OWNER])
        elif end < 0.0 or stays_away(scene, rollout, i, end, level):
            i += 1
        else:
            return i
    return count


@compiled_once
def is_far(scene: Scene, rollout: Rollout, row: int, wanted: Pair) -> bool:
    """Return whether a group keeps a level of room up to a time, and more at a look."""
    (end, level), near = wanted, False
    groups = altered(scene, scene.groups, scene.drift, scene.closest)
    # SPARE at every look, and a miss of SPARE in between, leave the level itself.
    if not stays_away(groups, rollout, row, end, level):
        near, _ = too_near(groups, rollout, row, (0.0, end), level + SPARE, SPARE)
    return not near


@compiled_once
def keeps_all(scene: Scene, rollout: Rollout, watch: Watch) -> bool:
    """Return whether no body comes too near."""
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        end, level = watch.moving if moves(scene, i) else watch.still
        near, _ = too_near(scene, rollout, i, (0.0, end), level, 0.0)
        if near:
            return False
        i = next_body(scene, rollout, i + 1, watch)
    return True


@compiled_once
def first_met(scene: Scene, rollout: Rollout, watch: Watch, slack: float) -> Meeting:
    """Return when the first body that comes too near does, in the order of their rows.

    ``slack``: see :func:`too_near`.
    """
    met = Meeting(-1, 0.0)
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        if met.body < 0 or comes_first(scene.bodies, i, met.body):
            end, level = watch.moving if moves(scene, i) else watch.still
            near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
            if near:
                met = Meeting(i, time)
        i = next_body(scene, rollout, i + 1, watch)
    return met
