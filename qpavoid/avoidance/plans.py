"""Plans of two twists, by search: for where no constant one keeps its distance."""

import math
from typing import TypeAlias

from qpavoid.avoidance.prediction import TICKS, Scene, drive, least_room, look
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.footprint import Array
from qpavoid.qp.exact import Box, Pair

SWITCHES = (1.6, 1.1, 0.7, 0.4, 0.2, 0.1)
"""s; when a plan of two twists may go over to its second."""

BETTER = 3e-3
"""m by which another plan must be better to be taken up."""

SHARES = 3
"""Steps over which the search is spread once it has been done in full."""

FOREVER = 1e9
"""s, or m"""

Hold: TypeAlias = tuple[int, int]
"""Group and tick of the least room."""


@compiled
def extreme(box: Box, number: int) -> Pair:
    """Return one of the nine twists of which either part is least, 0 or greatest."""
    v = (box[0], 0.0, box[1])[number // 3]
    return v, (box[2], 0.0, box[3])[number % 3]


@compiled
def set_plan(plan: Array, first: Pair, time: float, second: Pair) -> None:
    """Write a plan: v, ω, for how many s, and v, ω from then on."""
    plan[0], plan[1], plan[2] = first[0], first[1], time
    plan[3], plan[4] = second[0], second[1]


@compiled_once
def plan_room(
    scene: Scene, middle: int, twist: Pair, wanted: float, hold: Hold
) -> tuple[float, Hold]:
    """Return the room of a plan that has been driven up to tick ``middle``, m.

    On towards the twist. Exact where it is at least ``wanted``, else −``FOREVER``; and
    what holds it from more, where the next plan is looked at first.
    """
    n = scene[5].shape[0] - 1
    where, when = hold
    if when > middle:
        drive(scene, middle, when, *twist)
        room, which = look(scene, where, when, wanted)
        if which >= 0 and room < wanted:
            return -FOREVER, hold
    drive(scene, max(middle, when), n, *twist)
    for part in range(2):
        begin, end = (middle, n) if part == 0 else (0, middle)
        _, g, body, k = least_room(scene, begin, end, wanted, True, where)
        if body >= 0:
            return -FOREVER, (g, k)
    room, where, _, when = least_room(scene, 0, middle, FOREVER, False, where)
    room, where, body, k = least_room(scene, middle, n, room, False, where)
    return room, (where, k if body >= 0 else when)


@compiled_once
def best_plan(scene: Scene, box: Box, plan: Array, share: int) -> float:
    """Put the plan of two extreme twists with the most room in ``plan``; return it, m.

    The plan last followed is kept unless another is better by :data:`BETTER`. Share 0:
    all first twists are looked at, else the third of them whose turn it is; all
    constant twists in any case.
    """
    groups, n = scene[4], scene[5].shape[0] - 1
    tick = scene[2][0].tick
    for g in range(groups.shape[0]):
        groups[g, TICKS] = n
    middle = n if plan[2] >= n * tick else math.ceil(plan[2] / tick - 1e-6)
    drive(scene, 0, middle, plan[0], plan[1])
    most, hold = plan_room(scene, middle, (plan[3], plan[4]), -FOREVER, (0, 0))
    for i in range(9):
        twist = extreme(box, i)
        room, hold = plan_room(scene, 0, twist, most + BETTER, hold)
        if room > most:
            most = room
            set_plan(plan, twist, FOREVER, twist)
    for i in range(9):
        if share > 0 and i % SHARES != share - 1:
            continue
        twist, latest = extreme(box, i), 0
        drive(scene, 0, n, *twist)
        while latest < len(SWITCHES):
            middle = min(round(SWITCHES[latest] / tick), n)
            _, _, body, _ = least_room(scene, 0, middle, most + BETTER, True, hold[0])
            if body < 0:
                break
            latest += 1
        for j in range(9 if latest < len(SWITCHES) else 0):
            second = extreme(box, j)
            drive(scene, 0, min(round(SWITCHES[latest] / tick), n), *twist)
            for number in range(latest, len(SWITCHES)):
                middle = min(round(SWITCHES[number] / tick), n)
                room, hold = plan_room(scene, middle, second, most + BETTER, hold)
                if room > most:
                    most = room
                    set_plan(plan, twist, SWITCHES[number], second)
    return most
