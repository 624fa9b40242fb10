"""Segments of a scan that may be bodies: neighbouring echoes near to each other.

Two neighbouring echoes are of one segment while they are nearer to each other than
gap + r Δα [Borges2004], r the range and Δα the angle between beams. A body is either
a segment that stands before its background, or a run of echoes in ever-free space.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.scan import (
    AFTER,
    BEAM_SEGMENT,
    BEAM_TRACK,
    ECHO_BEAM,
    ECHO_X,
    ECHO_Y,
    FROM_X,
    FROM_Y,
    OPEN,
    RANGE,
    Sensor,
)
from qpavoid.types import Array

(
    ECHO_COUNT,  # echoes
    OPEN_SHARE,  # of them in ever-free space
    MIDDLE_X,  # mean of the echoes, m
    MIDDLE_Y,
    AWAY_X,  # unit vector from the sensor to the mean
    AWAY_Y,
    RIGHTMOST,  # extent across the view from the mean, m
    LEFTMOST,
    SEGMENT_EXTENT,  # m, the greater extent of across and along the view
    HIDDEN,  # 1: its first side is hidden by something nearer; 2: its last; 3: both
    SPACE,  # m between neighbouring beams
    LATER,  # s from the time of the scan until it was measured
    CENTRE_X,  # centre of its body, m
    CENTRE_Y,
    CENTRE_SIGMA,  # σ of the centre, m
    SEGMENT_TRACK,  # row of its track; −1: none
    CUT,  # 1: an end of the view cuts it
) = range(17)
SEGMENT_WIDTH = 17

MOST_SEGMENTS = 128
"""More are not looked for; their echoes stay points."""

SEGMENT_GAP = 0.12
"""m; breakpoint between neighbouring echoes, to which r Δα is added."""

WIDE_SEGMENT, APART = 0.8, 0.6
"""m; a wider segment is cut into pieces of about this width: people side by side, or a
larger body, which is then several discs."""

LEAST_SINGLE = 0.04
"""m; a single echo is a segment where neighbouring beams are farther apart."""

BACKGROUND, LONE = 0.2, 0.4
"""m; a segment stands before its background where the next echoes on both sides are so
much behind, or so far away with no echo in between."""

SLIM, STOUT = 0.1, 0.75
"""m; widths between which such a segment may be a body."""

HIDES, HIDING_BEAMS = 0.1, 3
"""m by which an echo, and beams from it, hides a part of what is behind it."""


class View(NamedTuple):
    """A scan with its echoes in order.

    Attributes:
        scan: (n, SCAN_WIDTH).
        echoes: Their number.
        sensor: LiDAR.
    """

    scan: Array
    echoes: int
    sensor: Sensor


@compiled
def beam_at(view: View, place: int) -> int:
    """Return the beam of the echo at a place in the order, which goes round."""
    return int(view.scan[place % view.echoes, ECHO_BEAM])


@compiled
def is_break(view: View, before: int, after: int) -> bool:
    """Return whether the echoes at two places belong to two segments."""
    a, b = view.scan[beam_at(view, before)], view.scan[beam_at(view, after)]
    gap = SEGMENT_GAP + max(a[RANGE], b[RANGE]) * view.sensor.step
    two = (
        a[BEAM_TRACK] >= 0.0 and b[BEAM_TRACK] >= 0.0 and a[BEAM_TRACK] != b[BEAM_TRACK]
    )
    apart = math.hypot(b[ECHO_X] - a[ECHO_X], b[ECHO_Y] - a[ECHO_Y])
    return bool(two or apart > gap)


@compiled_once
def find_segments(view: View, segments: Array) -> int:
    """Write the segments that may be bodies; return their number."""
    count, begin = view.echoes, 0
    if view.sensor.round > 0.0:
        while begin < count and not is_break(view, begin + count - 1, begin):
            begin += 1
    found, first, end = 0, begin, begin + count
    while first < end:
        last = first
        while last + 1 < end and not is_break(view, last, last + 1):
            last += 1
        found = add_bodies(view, segments, found, first, last)
        first = last + 1
    return found


@compiled_once
def add_bodies(view: View, segments: Array, found: int, first: int, last: int) -> int:
    """Add the bodies among the echoes at places first … last; return the number."""
    if found >= MOST_SEGMENTS:
        return found
    set_segment(view, segments[found], first, last, False)
    share, width = segments[found, OPEN_SHARE], segments[found, SEGMENT_EXTENT]
    slim = last - first >= 2 and SLIM < width < STOUT
    if slim and share < 1.0 and stands_before(view, first, last):
        number_echoes(view, found, first, last, False)
        return found + 1
    begin, end = -1, -1
    for place in range(first, last + 1):
        if view.scan[beam_at(view, place), OPEN] > 0.0:
            if begin >= 0 and is_break(view, end, place):
                found = add_run(view, segments, found, begin, end)
                begin = -1
            begin, end = place if begin < 0 else begin, place
    return add_run(view, segments, found, begin, end) if begin >= 0 else found


@compiled_once
def add_run(view: View, segments: Array, found: int, first: int, last: int) -> int:
    """Add a run of echoes in ever-free space, cut where it is wide."""
    if found >= MOST_SEGMENTS:
        return found
    one = segments[found]
    set_segment(view, one, first, last, True)
    if one[ECHO_COUNT] < 2.0 and one[SPACE] < LEAST_SINGLE:
        return found
    if one[SEGMENT_EXTENT] <= WIDE_SEGMENT:
        number_echoes(view, found, first, last, True)
        return found + 1
    pieces = max(int(one[SEGMENT_EXTENT] / APART + 0.5), 1)
    a, b = view.scan[beam_at(view, first)], view.scan[beam_at(view, last)]
    x, y = a[ECHO_X], a[ECHO_Y]
    d_x, d_y = b[ECHO_X] - x, b[ECHO_Y] - y
    square, begin, piece = max(d_x * d_x + d_y * d_y, 1e-12), first, 1
    for place in range(first, last + 2):
        e = view.scan[beam_at(view, min(place, last))]
        along = ((e[ECHO_X] - x) * d_x + (e[ECHO_Y] - y) * d_y) / square * pieces
        if place > last or (piece < pieces and along > piece):
            if place - begin >= 2 and found < MOST_SEGMENTS:
                set_segment(view, segments[found], begin, place - 1, True)
                number_echoes(view, found, begin, place - 1, True)
                found += 1
            begin, piece = place, piece + 1
    return found


@compiled
def number_echoes(
    view: View, group: int, first: int, last: int, only_open: bool
) -> None:
    """Write the number of a segment to its echoes."""
    for place in range(first, last + 1):
        one = view.scan[beam_at(view, place)]
        if one[OPEN] > 0.0 or not only_open:
            one[BEAM_SEGMENT] = group


@compiled_once
def set_segment(
    view: View, segment: Array, first: int, last: int, only_open: bool
) -> None:
    """Write the segment of the echoes at places first … last, or of the open ones."""
    s, count, opened, x, y, later = segment, 0.0, 0.0, 0.0, 0.0, 0.0
    for place in range(first, last + 1):
        one = view.scan[beam_at(view, place)]
        opened += one[OPEN]
        if one[OPEN] > 0.0 or not only_open:
            x, y, later = x + one[ECHO_X], y + one[ECHO_Y], later + one[AFTER]
            count += 1.0
    share = max(count, 1.0)
    x, y, later = x / share, y / share, later / share
    one = view.scan[beam_at(view, first)]
    u_x, u_y = x - one[FROM_X], y - one[FROM_Y]
    far = max(math.hypot(u_x, u_y), 1e-9)
    u_x, u_y = u_x / far, u_y / far
    right, left, near, deep = math.inf, -math.inf, math.inf, -math.inf
    for place in range(first, last + 1):
        one = view.scan[beam_at(view, place)]
        if one[OPEN] > 0.0 or not only_open:
            d_x, d_y = one[ECHO_X] - x, one[ECHO_Y] - y
            across, along = d_y * u_x - d_x * u_y, d_x * u_x + d_y * u_y
            right, left = min(right, across), max(left, across)
            near, deep = min(near, along), max(deep, along)
    s[ECHO_COUNT], s[OPEN_SHARE] = count, 1.0 if only_open else opened / share
    s[MIDDLE_X], s[MIDDLE_Y], s[AWAY_X], s[AWAY_Y] = x, y, u_x, u_y
    s[RIGHTMOST], s[LEFTMOST] = right, left
    s[SEGMENT_EXTENT] = max(left - right, deep - near)
    starts, ends = is_cut(view, first, -1), is_cut(view, last, 1)
    s[CUT] = 1.0 if starts or ends else 0.0
    s[HIDDEN] = 1.0 if starts else is_hidden(view, first, -1)
    s[HIDDEN] += 2.0 if ends else 2.0 * is_hidden(view, last, 1)
    s[SPACE], s[LATER], s[SEGMENT_TRACK] = far * view.sensor.step, later, -1.0


@compiled_once
def is_cut(view: View, place: int, side: int) -> bool:
    """Return whether a surface goes on to an end of the view, free or not.

    Near the ends of the view no space is ever-free.
    """
    end = place
    if view.sensor.round > 0.0:
        return False
    while 0 <= end + side < view.echoes and not is_break(
        view, min(end, end + side), max(end, end + side)
    ):
        end += side
    beam = beam_at(view, end) + side * HIDING_BEAMS
    return not 0 <= beam < view.scan.shape[0]


@compiled
def is_hidden(view: View, place: int, side: int) -> float:
    """Return 1 where the next echo is nearer."""
    here, beam = beam_at(view, place), beam_at(view, place + side)
    close = abs(beam - here) <= HIDING_BEAMS
    nearer = view.scan[beam, RANGE] < view.scan[here, RANGE] - HIDES
    return 1.0 if close and nearer else 0.0


@compiled_once
def stands_before(view: View, first: int, last: int) -> bool:
    """Return whether the scan sees past both sides of the echoes at first … last."""
    for side in range(-1, 2, 2):
        end = first if side < 0 else last
        if view.sensor.round == 0.0 and not 0 <= end + side < view.echoes:
            return False
        here, beam = beam_at(view, end), beam_at(view, end + side)
        one, other = view.scan[here], view.scan[beam]
        apart = math.hypot(other[ECHO_X] - one[ECHO_X], other[ECHO_Y] - one[ECHO_Y])
        lone = abs(beam - here) > 1 and apart > LONE and other[RANGE] >= one[RANGE]
        if not (lone or other[RANGE] >= one[RANGE] + BACKGROUND):
            return False
    return True
