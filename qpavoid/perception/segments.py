"""Segments of a scan that may be bodies: neighbouring echoes near to each other.

Two neighbouring echoes are of one segment while they are nearer to each other than
gap + r Δα [Borges2004], r the range and Δα the angle between beams. A body is either
a segment that stands before its background, or a run of echoes in ever-free space.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.scan import Sensor
from qpavoid.types import Row, Table, layout


class Group(NamedTuple):
    """A segment.

    Attributes:
        open_share: Share of its echoes that are in ever-free space.
        mean_x: Mean of the echoes, m.
        mean_y: Of it, m.
        away_x: Unit vector from the sensor to the mean.
        away_y: Of it.
        right: Extent across the view from the mean, m.
        left: To the other side, m.
        extent: The greater one of across and along the view, m.
        space: Between neighbouring beams, m.
        later: s from the time of the scan until it was measured.
        centre_x: Centre of its body, m.
        centre_y: Of it, m.
        sigma: σ of the centre, m.
        echoes: Their number.
        hidden: 1: its first side is hidden by something nearer; 2: its last; 3: both.
        track: Row of its track; −1: none.
        cut: 1: an end of the view cuts it.
    """

    open_share: float
    mean_x: float
    mean_y: float
    away_x: float
    away_y: float
    right: float
    left: float
    extent: float
    space: float
    later: float
    centre_x: float
    centre_y: float
    sigma: float
    echoes: int
    hidden: int
    track: int
    cut: int


GROUP = layout(Group)
GROUP_SIZE = GROUP.itemsize // 8
"""Layout of the table of segments, and numbers of memory per segment."""

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
        scan: (n,) of :class:`~qpavoid.perception.scan.Ray`.
        echoes: Their number.
        sensor: LiDAR.
    """

    scan: Table
    echoes: int
    sensor: Sensor


@compiled
def beam_at(view: View, place: int) -> int:
    """Return the beam of the echo at a place in the order, which goes round."""
    return int(view.scan[place % view.echoes].echo)


@compiled
def is_break(view: View, before: int, after: int) -> bool:
    """Return whether the echoes at two places belong to two segments."""
    a, b = view.scan[beam_at(view, before)], view.scan[beam_at(view, after)]
    gap = SEGMENT_GAP + max(a.range, b.range) * view.sensor.step
    two = a.track >= 0 and b.track >= 0 and a.track != b.track
    apart = math.hypot(b.x - a.x, b.y - a.y)
    return bool(two or apart > gap)


@compiled_once
def find_segments(view: View, segments: Table) -> int:
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
def add_bodies(view: View, segments: Table, found: int, first: int, last: int) -> int:
    """Add the bodies among the echoes at places first … last; return the number."""
    if found >= MOST_SEGMENTS:
        return found
    set_segment(view, segments[found], first, last, False)
    share, width = segments[found].open_share, segments[found].extent
    slim = last - first >= 2 and SLIM < width < STOUT
    if slim and share < 1.0 and stands_before(view, first, last):
        number_echoes(view, found, first, last, False)
        return found + 1
    begin, end = -1, -1
    for place in range(first, last + 1):
        if view.scan[beam_at(view, place)].open > 0:
            if begin >= 0 and is_break(view, end, place):
                found = add_run(view, segments, found, begin, end)
                begin = -1
            begin, end = place if begin < 0 else begin, place
    return add_run(view, segments, found, begin, end) if begin >= 0 else found


@compiled_once
def add_run(view: View, segments: Table, found: int, first: int, last: int) -> int:
    """Add a run of echoes in ever-free space, cut where it is wide."""
    if found >= MOST_SEGMENTS:
        return found
    one = segments[found]
    set_segment(view, one, first, last, True)
    if one.echoes < 2 and one.space < LEAST_SINGLE:
        return found
    if one.extent <= WIDE_SEGMENT:
        number_echoes(view, found, first, last, True)
        return found + 1
    pieces = max(int(one.extent / APART + 0.5), 1)
    a, b = view.scan[beam_at(view, first)], view.scan[beam_at(view, last)]
    x, y = a.x, a.y
    d_x, d_y = b.x - x, b.y - y
    square, begin, piece = max(d_x * d_x + d_y * d_y, 1e-12), first, 1
    for place in range(first, last + 2):
        e = view.scan[beam_at(view, min(place, last))]
        along = ((e.x - x) * d_x + (e.y - y) * d_y) / square * pieces
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
        if one.open > 0 or not only_open:
            one.segment = group


@compiled_once
def set_segment(
    view: View, segment: Row, first: int, last: int, only_open: bool
) -> None:
    """Write the segment of the echoes at places first … last, or of the open ones."""
    s, count, opened, x, y, later = segment, 0, 0, 0.0, 0.0, 0.0
    for place in range(first, last + 1):
        one = view.scan[beam_at(view, place)]
        opened += one.open
        if one.open > 0 or not only_open:
            x, y, later = x + one.x, y + one.y, later + one.after
            count += 1
    share = max(count, 1)
    x, y, later = x / share, y / share, later / share
    one = view.scan[beam_at(view, first)]
    u_x, u_y = x - one.from_x, y - one.from_y
    far = max(math.hypot(u_x, u_y), 1e-9)
    u_x, u_y = u_x / far, u_y / far
    right, left, near, deep = math.inf, -math.inf, math.inf, -math.inf
    for place in range(first, last + 1):
        one = view.scan[beam_at(view, place)]
        if one.open > 0 or not only_open:
            d_x, d_y = one.x - x, one.y - y
            across, along = d_y * u_x - d_x * u_y, d_x * u_x + d_y * u_y
            right, left = min(right, across), max(left, across)
            near, deep = min(near, along), max(deep, along)
    s.echoes, s.open_share = count, 1.0 if only_open else opened / share
    s.mean_x, s.mean_y, s.away_x, s.away_y = x, y, u_x, u_y
    s.right, s.left = right, left
    s.extent = max(left - right, deep - near)
    starts, ends = is_cut(view, first, -1), is_cut(view, last, 1)
    s.cut = 1 if starts or ends else 0
    s.hidden = 1 if starts else is_hidden(view, first, -1)
    s.hidden += 2 if ends else 2 * is_hidden(view, last, 1)
    s.space, s.later, s.track = far * view.sensor.step, later, -1


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
def is_hidden(view: View, place: int, side: int) -> int:
    """Return 1 where the next echo is nearer."""
    here, beam = beam_at(view, place), beam_at(view, place + side)
    close = abs(beam - here) <= HIDING_BEAMS
    nearer = view.scan[beam].range < view.scan[here].range - HIDES
    return 1 if close and nearer else 0


@compiled_once
def stands_before(view: View, first: int, last: int) -> bool:
    """Return whether the scan sees past both sides of the echoes at first … last."""
    for side in range(-1, 2, 2):
        end = first if side < 0 else last
        if view.sensor.round == 0.0 and not 0 <= end + side < view.echoes:
            return False
        here, beam = beam_at(view, end), beam_at(view, end + side)
        one, other = view.scan[here], view.scan[beam]
        apart = math.hypot(other.x - one.x, other.y - one.y)
        lone = abs(beam - here) > 1 and apart > LONE and other.range >= one.range
        if not (lone or other.range >= one.range + BACKGROUND):
            return False
    return True
