"""Conservative advancement: the margin of a body along a rollout, in continuous time.

The *margin* of a body is its distance from the footprint minus the required distance.
After a sample at time t the next one is where a bound of the margin reaches the
threshold [Mirtich1996]; a margin found above a threshold is so between samples, too.

The bound is that of :mod:`qpavoid.avoidance.time_bounds`; beyond an arc, and far away,
that of the circles round footprint and body.

Where the margin stays at the threshold the steps would vanish: ``slack`` is the part of
the threshold that may be missed between samples.

**Complexity.** A body or group is sampled at most :data:`LOOKS` times along a rollout,
and once per arc; if that does not decide, it counts as too near. A call of the filter
rolls out fewer than 1,400 plans for any input, typically fewer than twenty.
"""

import math

from qpavoid.avoidance.body_table import body_at
from qpavoid.avoidance.motion import (
    circle_room,
    closing_speed,
    ends_at,
    growth_of,
    line_contact,
    passing_speed,
)
from qpavoid.avoidance.prediction import (
    Rollout,
    arc_at,
    arc_index,
    frame_at,
)
from qpavoid.avoidance.scene import Scene
from qpavoid.avoidance.time_bounds import BOUND_ROUNDING, arc_twist, line_time
from qpavoid.compiled import compiled_once
from qpavoid.types import Pair

LOOKS = 80
"""Samples of one body along a rollout, in addition to one per arc."""

AFAR = 0.1
"""m; excess of the margin above which the bound of the circles is used."""

STEP = 0.05
"""s; sampling period of the search for the least margin."""

MOST_SKIPPED = 1e6
"""Greatest number of skipped steps: compiled, a floor is an integer of 64 bits."""

REFINEMENTS = 6
"""Bisections about the time of the least margin."""


@compiled_once
def room_at(scene: Scene, rollout: Rollout, i: int, time: float) -> float:
    """Return the margin of body i at a time, m."""
    body = body_at(scene, i)
    arc = arc_at(rollout.arcs, arc_index(rollout.arcs, 0, time))
    ends = ends_at(body, time, frame_at(arc, time, scene.longest))
    distance = line_contact(scene.edges, body, ends).distance
    return float(distance - body.keep - growth_of(scene, body) * time)


@compiled_once
def too_near(
    scene: Scene, rollout: Rollout, i: int, span: Pair, level: float, slack: float
) -> tuple[bool, float]:
    """Return whether the margin of body i falls below a threshold, and when first.

    Args:
        scene: With the body.
        rollout: Of the robot.
        i: Number of the body.
        span: Begin and end of the check, s.
        level: Threshold, m.
        slack: False only if the margin is at least level − slack, m, at all times.
    """
    arcs, dt, (time, end) = rollout.arcs, scene.longest, span
    body, count, row = body_at(scene, i), arcs.shape[0], 0
    growth, passing = growth_of(scene, body), passing_speed(scene, rollout, body)
    pace = closing_speed(scene, rollout, body)
    for _ in range(LOOKS + count):
        row = arc_index(arcs, row, time)
        arc = arc_at(arcs, row)
        at = frame_at(arc, time, dt)
        # A distance of two circles costs one root, a contact all edges.
        spare = circle_room(scene, body, time, at) - growth * time - level
        if spare > AFAR:
            wait = spare / passing if passing > 0.0 else math.inf
        else:
            ends = ends_at(body, time, at)
            contact = line_contact(scene.edges, body, ends)
            keep = body.keep + growth * time + level
            if contact.distance < keep:
                return True, time
            driven, least = arc_twist(arc, time, dt), keep - slack
            wait = line_time(body, contact, ends, driven, (least, growth))
            if row + 1 < count:
                # The bound holds for this arc's twist; the next one is sampled at its
                # start.
                wait = min(wait, arc_at(arcs, row + 1).begin - time)
            if pace > 0.0:
                # The bound by the greatest speed [Mirtich1996] holds across arcs, and
                # may be the longer one.
                wait = max(wait, (contact.distance - least - BOUND_ROUNDING) / pace)
        time += wait
        if time >= end:
            return False, end
    # Undecided after all samples: too near, which is conservative.
    return True, time


@compiled_once
def least_room(
    scene: Scene, rollout: Rollout, i: int, span: Pair, enough: float
) -> tuple[float, float]:
    """Return the least sampled margin of body i, m, and its time, s.

    Sampled every :data:`STEP`, at most :data:`LOOKS` times, then bisected about the
    least.

    Args:
        scene: With the body.
        rollout: Of the robot.
        i: Number of the body.
        span: Begin and end of the search, s.
        enough: Upper bound of the result, m.
    """
    arcs, dt, (time, end) = rollout.arcs, scene.longest, span
    body, least, when, row = body_at(scene, i), enough, -1.0, 0
    passing = passing_speed(scene, rollout, body)
    pace = closing_speed(scene, rollout, body)
    step = max(STEP, (end - time) / LOOKS)
    for _ in range(LOOKS + 1):
        row = arc_index(arcs, row, time)
        at = frame_at(arc_at(arcs, row), time, dt)
        growth = growth_of(scene, body) * time
        room, speed = circle_room(scene, body, time, at) - growth, passing
        if room < least + AFAR:
            contact = line_contact(scene.edges, body, ends_at(body, time, at))
            room, speed = contact.distance - body.keep - growth, pace
            if room < least:
                least, when = room, time
        if time >= end:
            break
        # Within so many steps the margin cannot fall below the least so far.
        steps, way = 1.0, speed * step
        if way > 0.0:
            steps = max(math.floor(min((room - least) / way, MOST_SKIPPED)), 1.0)
        time = min(time + steps * step, end)
    for _ in range(REFINEMENTS if when >= 0.0 else 0):
        step *= 0.5
        for side in range(2):
            time = min(max(when + (2 * side - 1) * step, span[0]), end)
            room = room_at(scene, rollout, i, time)
            if room < least:
                least, when = room, time
    return least, when
