"""Choice: the candidate that comes nearest to the reference over the coming seconds.

Which side to take, how far to keep beside the reference, when to wait, to turn away or
to back off: the least cost of a fixed list of candidates says it, and what was chosen
before is left only for what is cheaper by more than the hysteresis. Of a pair of mirror
images the one to the right comes first, and stays where both cost the same.
"""

import math

from qpavoid.compiled import compiled, compiled_once
from qpavoid.guide.rollout import (
    FOLLOW,
    HOLD,
    MOST,
    TRACK,
    Candidate,
    Course,
    V,
    follow_twist,
    nearest_row,
    roll_on,
)
from qpavoid.model.kinematics import Frame
from qpavoid.model.robot import limits_of
from qpavoid.types import Array, Twist

OFFSETS = (0.0, -0.35, 0.35, -0.7, 0.7, -1.1, 1.1, -1.6, 1.6, -2.2, 2.2)
"""m to the left of the reference."""

PACES = (1.0, 0.7, 0.4, 0.15)
"""Shares of the reference's pace."""

SPEEDS, TURNS = (0.0, -0.4, 0.45, 0.9), (0.0, -1.0, 1.0)
"""Twists that are held: shares of the greatest speed, and rad/s."""

HELD = (5.0, 10.0, 20.0)
"""Ticks for which they are."""

FINER = ((0.15, 0.0), (-0.15, 0.0), (0.0, 0.15), (0.0, -0.15))
"""Changes of offset and pace that are looked at about the best."""

FOLLOWS = len(OFFSETS) * len(PACES)
HOLDS = len(SPEEDS) * len(TURNS) * len(HELD)

SLOW = 0.05
"""m/s; a reference so slow has come to its goal: it is tracked as soon as that is
free, since the law at rest needs more than the horizon to pay."""

KIND, A, B, LEFT = range(4)
"""Where the memory has the candidate that is driven, and for how many ticks more."""

NOTHING = -1.0
"""A kind: none has been chosen yet."""


@compiled
def listed(fastest: float, number: int) -> Candidate:
    """Return a candidate of the list."""
    if number == 0:
        return Candidate(TRACK, 0.0, 1.0, 0.0)
    i = number - 1
    if i < FOLLOWS:
        return Candidate(FOLLOW, OFFSETS[i // len(PACES)], PACES[i % len(PACES)], 0.0)
    i -= FOLLOWS
    v, i = SPEEDS[i // (len(TURNS) * len(HELD))], i % (len(TURNS) * len(HELD))
    return Candidate(HOLD, v * fastest, TURNS[i // len(HELD)], HELD[i % len(HELD)])


@compiled
def driven_candidate(chosen: Array) -> Candidate:
    """Return the candidate that is remembered."""
    return Candidate(chosen[KIND], chosen[A], chosen[B], chosen[LEFT])


@compiled_once
def choose(course: Course, chosen: Array) -> None:
    """Choose the candidate to drive, and remember it in place of the last one."""
    s, fastest = course.settings[0], min(limits_of(course.scene.robot).v_max, MOST)
    best, cost = Candidate(TRACK, 0.0, 1.0, 0.0), math.inf
    if chosen[KIND] == HOLD:
        chosen[LEFT] -= 1.0
        if chosen[LEFT] < 0.5:
            chosen[KIND] = TRACK
    if chosen[KIND] >= 0.0:
        best = driven_candidate(chosen)
        cost = (1.0 - s.hysteresis) * roll_on(course, best, math.inf).cost
    for number in range(1 + FOLLOWS + HOLDS):
        candidate = listed(fastest, number)
        share = 1.0 - s.preference if number == 0 else 1.0
        limit = math.inf if number == 0 else cost
        found = roll_on(course, candidate, limit)
        if number == 0 and course.ahead[0, V] < SLOW and found.room >= s.clear:
            best = candidate
            break
        if share * found.cost < cost:
            best, cost = candidate, share * found.cost
    if best.kind == FOLLOW:
        about = best
        for change in FINER:
            pace = min(max(about.b + change[1], 0.0), 1.0)
            candidate = Candidate(FOLLOW, about.a + change[0], pace, 0.0)
            found = roll_on(course, candidate, cost)
            if found.cost < cost:
                best, cost = candidate, found.cost
    chosen[KIND], chosen[A], chosen[B], chosen[LEFT] = best


@compiled_once
def twist_of(course: Course, candidate: Candidate, desired: Twist) -> Twist:
    """Return what a candidate drives now; ``desired`` is that of tracking."""
    if candidate.kind == HOLD:
        return candidate.a, candidate.b
    if candidate.kind != FOLLOW:
        return desired
    at = Frame(0.0, 0.0, 1.0, 0.0)
    row = nearest_row(course.ahead, 0, at)
    return follow_twist(course, at, row, candidate.b, candidate.a)
