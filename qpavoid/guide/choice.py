"""Choice of the candidate with the least cost over the coming seconds.

A fixed list of candidates covers the passing side, the offset from the reference,
waiting, turning and backing off. The candidate driven so far is replaced only by one
that is cheaper by more than the hysteresis. Of two mirror images of equal cost the one
to the right is taken.
"""

import math

from qpavoid.avoidance.bodies import any_moves, moves
from qpavoid.compiled import compiled, compiled_once
from qpavoid.guide.rollout import (
    FOLLOW,
    HOLD,
    PARK,
    ROWS,
    TOP_TWIST,
    TRACK,
    Candidate,
    Course,
    V,
    X,
    Y,
    arrival,
    follow_twist,
    nearest_row,
    parking,
    roll_on,
)
from qpavoid.model.kinematics import Frame
from qpavoid.model.robot import GREATEST, limits_of
from qpavoid.types import Array, Twist

OFFSETS = (0.0, -0.35, 0.35, -0.7, 0.7, -1.1, 1.1, -1.6, 1.6, -2.2, 2.2)
"""m to the left of the reference."""

PACES = (1.0, 0.7, 0.4, 0.15)
"""Speeds relative to the reference's."""

SPEEDS, TURNS = (0.0, -0.4, 0.45, 0.9), (0.0, -1.0, 1.0)
"""Held twists: v relative to the greatest speed, and ω, rad/s."""

HELD_TICKS = (5.0, 10.0, 20.0)
"""Ticks for which they are held."""

STANDING = 2
"""Index of the "stand still" candidate, which a stalled robot prefers to oscillating
before a blocked path."""

TRACKED_TICKS = 20.0
"""Ticks of tracking without a comparison when the straight path is free after a stall:
for a slow robot the cost of proximity exceeds that of standing."""

LESS = 1.0 - 1e-6
"""Relative tolerance of equal costs: mirror images differ by rounding."""

FIRST = STANDING + 1
FOLLOWS = len(OFFSETS) * len(PACES)
HOLDS = len(SPEEDS) * len(TURNS) * len(HELD_TICKS)

GOAL_SPEED, LEFT_TO_GO = 0.05, 0.05
"""m/s and m; speed and remaining length of a reference that has reached its goal. There
the robot parks as soon as possible, since a turn or backing off seldom pays within a
horizon."""

PARK_LATEST, SOONER = 60, 10
"""Ticks: latest arrival of parking; gain in time required of another candidate, and of
holding a twist first."""

BESIDE = 0.5
"""m; distance from the goal within which the robot continues to park although it is not
clear there; the filter evades no farther than necessary, and a slow obstacle by
itself."""

GENTLE, GENTLE_LEAST, PARKED = 3.0, 0.25, 2.0
"""Greatest speed of axle and corners of a parked robot that evades and returns,
relative to the fastest obstacle in reach, and its least value, m/s; m from the goal
within which it counts as parked. The filter evades as fast as necessary."""

KIND, A, B, LEFT, PACE = range(5)
"""Layout of the memory: driven candidate, its remaining ticks, and pace."""

NOT_CHOSEN = -1.0
"""Kind: no candidate chosen yet."""

NONE = Candidate(NOT_CHOSEN, 0.0, 0.0, 0.0)


@compiled
def listed(fastest: float, number: int) -> Candidate:
    """Return a candidate of the list."""
    if number == 0:
        return Candidate(PARK, 0.0, 0.0, 0.0)
    if number == 1:
        return Candidate(TRACK, 0.0, 1.0, 0.0)
    if number == STANDING:
        return Candidate(HOLD, 0.0, 0.0, float(ROWS))
    i = number - FIRST
    if i < FOLLOWS:
        return Candidate(FOLLOW, OFFSETS[i // len(PACES)], PACES[i % len(PACES)], 0.0)
    i -= FOLLOWS
    each, ticks = len(TURNS) * len(HELD_TICKS), len(HELD_TICKS)
    v, i = SPEEDS[i // each], i % each
    return Candidate(HOLD, v * fastest, TURNS[i // ticks], HELD_TICKS[i % ticks])


@compiled
def driven_candidate(chosen: Array) -> Candidate:
    """Return the candidate in memory."""
    return Candidate(chosen[KIND], chosen[A], chosen[B], chosen[LEFT])


@compiled
def stand_still(chosen: Array) -> None:
    """Choose standing still for a tick."""
    chosen[KIND], chosen[A], chosen[B], chosen[LEFT] = HOLD, 0.0, 0.0, 1.0


@compiled
def track_on(chosen: Array) -> None:
    """Choose tracking for :data:`TRACKED_TICKS`, until something moves."""
    chosen[KIND], chosen[A], chosen[B], chosen[LEFT] = TRACK, 0.0, 1.0, TRACKED_TICKS


@compiled_once
def choose(course: Course, chosen: Array, waits: bool) -> None:
    """Choose the candidate to drive, and store it.

    Args:
        course: Rollout context.
        chosen: The candidate driven so far; updated.
        waits: Whether the robot makes no progress, so that standing is preferred.
    """
    still = not any_moves(course.scene)
    if chosen[KIND] == TRACK and chosen[LEFT] > 0.5:
        chosen[LEFT] -= 1.0
        if still:
            return
    if chosen[KIND] == HOLD:
        chosen[LEFT] -= 1.0
        if chosen[LEFT] < 0.5:
            chosen[KIND] = PARK if ends(course.ahead) else TRACK
    best, chosen[PACE] = NONE, gentle_pace(course)
    scene, ahead, law, settings, _ = course
    course = Course(scene, ahead, law, settings, chosen[PACE])
    if has_come(course):
        best = soonest_parked(course, chosen)
        x, y = course.ahead[0, X], course.ahead[0, Y]
        if best.kind == NOT_CHOSEN and x * x + y * y < BESIDE * BESIDE:
            fast = Course(scene, ahead, law, settings, GREATEST)
            clears = arrival(fast, listed(0.0, 0), PARK_LATEST) < PARK_LATEST
            if chosen[PACE] == GREATEST or clears:
                best = listed(0.0, 0)
    if best.kind == NOT_CHOSEN:
        best = cheapest(course, chosen, waits)
    chosen[KIND], chosen[A], chosen[B], chosen[LEFT] = best


@compiled_once
def gentle_pace(course: Course) -> float:
    """Return the greatest speed, m/s, of a parked robot that evades and returns.

    :data:`GREATEST` for a robot that is not parked, or among static obstacles.
    """
    x, y, fastest = course.ahead[0, X], course.ahead[0, Y], 0.0
    for i in range(course.scene.bodies.shape[0]):
        if moves(course.scene, i):
            fastest = max(fastest, course.scene.bodies[i].speed)
    pace, limits = max(GENTLE * fastest, GENTLE_LEAST), limits_of(course.scene.robot)
    near = x * x + y * y < PARKED * PARKED and has_come(course)
    slow = 0.0 < fastest and pace < min(limits.v_max, TOP_TWIST)
    return pace if near and slow else GREATEST


@compiled
def has_come(course: Course) -> bool:
    """Return whether the reference rests at its end."""
    begin, end = course.ahead[0], course.ahead[-1]
    way = math.sqrt((end[X] - begin[X]) ** 2 + (end[Y] - begin[Y]) ** 2)
    return bool(begin[V] < GOAL_SPEED and way < LEFT_TO_GO)


@compiled
def ends(ahead: Array) -> bool:
    """Return whether the reference ahead ends."""
    return bool(ahead[-1, V] < GOAL_SPEED)


@compiled_once
def soonest_parked(course: Course, chosen: Array) -> Candidate:
    """Return the candidate that parks soonest, at once or after a hold, or NONE."""
    fastest, best = min(limits_of(course.scene.robot).v_max, TOP_TWIST), NONE
    soonest, kept = PARK_LATEST, driven_candidate(chosen)
    for first in (kept, listed(fastest, 0)):
        if first.kind == PARK or first.kind == HOLD:
            found = arrival(course, first, soonest)
            if found < soonest:
                best, soonest = first, max(found - SOONER, 0)
    for number in range(FIRST + FOLLOWS, FIRST + FOLLOWS + HOLDS):
        candidate = listed(fastest, number)
        found = arrival(course, candidate, soonest)
        if found < soonest:
            best, soonest = candidate, found
    return best


@compiled_once
def cheapest(course: Course, chosen: Array, waits: bool) -> Candidate:
    """Return the cheapest candidate."""
    s, fastest = course.settings[0], min(limits_of(course.scene.robot).v_max, TOP_TWIST)
    best, cost = Candidate(TRACK, 0.0, 1.0, 0.0), math.inf
    if chosen[KIND] >= 0.0:
        best = driven_candidate(chosen)
        cost = (1.0 - s.hysteresis) * roll_on(course, best, math.inf)
    for number in range(0 if ends(course.ahead) else 1, FIRST + FOLLOWS + HOLDS):
        if number == STANDING and not waits:
            continue
        candidate = listed(fastest, number)
        share = 1.0 - s.hysteresis if number == STANDING else 1.0
        found = share * roll_on(course, candidate, cost / share)
        if found < LESS * cost:
            best, cost = candidate, found
    return best


@compiled_once
def twist_of(course: Course, candidate: Candidate, desired: Twist) -> Twist:
    """Return the twist of a candidate now; ``desired`` is that of tracking."""
    if candidate.kind == HOLD:
        return candidate.a, candidate.b
    if candidate.kind == PARK:
        return parking(course, (0.0, 0.0, 0.0))
    if candidate.kind != FOLLOW:
        return desired
    at = Frame(0.0, 0.0, 1.0, 0.0)
    row = nearest_row(course.ahead, 0, at)
    robot, ahead = course.scene.robot, course.ahead
    return follow_twist(robot, ahead, at, row, candidate.b, candidate.a)
