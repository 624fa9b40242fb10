"""A scan: its echoes in the map frame, and their segments in the order of the beams.

Neighbouring echoes belong to one segment while they are nearer to each other than
gap + r Δα [Borges2004], with r the range and Δα the angle between beams.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import CELL, is_ever_free
from qpavoid.types import Array, Pose

(
    RANGE,  # m; inf: free to the sensor's range; NaN: unknown
    FROM_X,  # of the sensor at the time of the beam, m
    FROM_Y,
    ALONG_X,  # unit direction of the beam
    ALONG_Y,
    ECHO_X,  # of the echo, m
    ECHO_Y,
    OPEN,  # 1: the echo is in ever-free space
    CLAIMED,  # 1: it belongs to a confirmed track
    GROUP,  # number of its segment; −1: none
    ORDER,  # beams with an echo, one after another; row k holds the k-th
    NORMAL_X,  # of the surface; 0, 0: unknown
    NORMAL_Y,
    AFTER,  # s from the time of the scan until the beam
    BESIDE,  # row of the confirmed track that it is near; −1: none
) = range(15)
SCAN_WIDTH = 15

GAP = 0.12
"""m; breakpoint between neighbouring echoes, to which r Δα is added."""

WIDE, APART = 0.8, 0.6
"""m; a wider segment is cut into pieces about so far apart: people side by side."""

LEAST_SINGLE = 0.04
"""m; a single echo is a segment where neighbouring beams are farther apart than this."""

BEHIND = 0.2
"""m; a segment is free-standing where its neighbours on both sides are so much behind."""

HIDES = 0.1
"""m by which a neighbour is nearer where it may hide a part of a segment."""

LONE = 0.4
"""m; or where there is no echo in between and the next one is so far away."""

SLIM, STOUT = 0.1, 0.75
"""m; widths between which a free-standing segment may be a body."""

(
    FIRST,  # place of its first echo in the order of the beams
    LAST,
    COUNT,  # of its echoes
    SHARE,  # of them in ever-free space
    MIDDLE_X,  # mean of its echoes, m
    MIDDLE_Y,
    AWAY_X,  # unit vector from the sensor to it
    AWAY_Y,
    WIDTH,  # m, the greater of across and along the view
    USED,  # 1: given to a track
    SPACE,  # m between neighbouring beams at it
    LATER,  # s from the time of the scan until it was measured
    LEAST,  # m, extent across the view from the mean, to the right and to the left
    MOST,
    HIDDEN,  # 1: its right side is hidden by something nearer; 2: its left; 3: both
) = range(15)
SEGMENT_WIDTH = 15
MOST_SEGMENTS = 128

CHORD, MOST_CHORD, FLAT = 0.15, 12, 0.05
"""m on each side over which a normal is taken, the most beams, and how far (m) the
middle may be off the chord."""


class Sensor(NamedTuple):
    """A LiDAR, as compiled functions take it.

    Attributes:
        mount: x, y (m), γ (rad) in the robot frame.
        step: Angle between neighbouring beams, rad.
        range_max: m; free to there where there is no echo.
        round: Whether the last beam is beside the first.
        angle_error: rad; σ of a beam's direction with the pose's.
    """

    mount: Pose
    step: float
    range_max: float
    round: bool
    angle_error: float


@compiled_once
def place_echoes(
    scan: Array, beams: Array, sensor: Sensor, begin: Pose, motion: Pose
) -> int:
    """Bring the beams into the map frame; return how many have an echo.

    Args:
        scan: (n, :data:`SCAN_WIDTH`); column RANGE is given.
        beams: (n, 4) cos and sin of each in the sensor frame; when it was taken, as a
            share of ``motion`` and in s after the time of the scan.
        sensor: It.
        begin: Pose of the robot at share 0, map frame.
        motion: Change of x, y and heading until share 1.
    """
    count = 0
    for k in range(beams.shape[0]):
        share = beams[k, 2]
        heading = begin[2] + share * motion[2]
        cos, sin = math.cos(heading), math.sin(heading)
        x = begin[0] + share * motion[0] + cos * sensor.mount[0] - sin * sensor.mount[1]
        y = begin[1] + share * motion[1] + sin * sensor.mount[0] + cos * sensor.mount[1]
        turned = heading + sensor.mount[2]
        cos, sin = math.cos(turned), math.sin(turned)
        one, r = scan[k], scan[k, RANGE]
        one[FROM_X], one[FROM_Y] = x, y
        one[ALONG_X] = cos * beams[k, 0] - sin * beams[k, 1]
        one[ALONG_Y] = sin * beams[k, 0] + cos * beams[k, 1]
        one[CLAIMED], one[GROUP], one[OPEN] = 0.0, -1.0, 0.0
        one[AFTER] = beams[k, 3]
        if r < math.inf:
            one[ECHO_X], one[ECHO_Y] = x + r * one[ALONG_X], y + r * one[ALONG_Y]
            scan[count, ORDER] = k
            count += 1
    return count


@compiled_once
def mark_open(scan: Array, count: int, cells: Array, centre: tuple[int, int], sensor: Sensor) -> None:
    """Mark the echoes in ever-free space; the tolerance grows with the range."""
    for k in range(count):
        one = scan[int(scan[k, ORDER])]
        tolerance = 1 + int(min(one[RANGE] * sensor.angle_error / CELL, 3.0))
        is_open = is_ever_free(cells, one[ECHO_X], one[ECHO_Y], centre, tolerance)
        one[OPEN] = 1.0 if is_open else 0.0


@compiled
def is_break(scan: Array, i: int, j: int, step: float) -> bool:
    """Return whether the echoes of beams i and j, i before j, are of two segments."""
    a, b = scan[i], scan[j]
    gap = GAP + max(a[RANGE], b[RANGE]) * step
    d_x, d_y = b[ECHO_X] - a[ECHO_X], b[ECHO_Y] - a[ECHO_Y]
    two = a[BESIDE] >= 0.0 and b[BESIDE] >= 0.0 and a[BESIDE] != b[BESIDE]
    return bool(two or d_x * d_x + d_y * d_y > gap * gap)


@compiled_once
def find_segments(scan: Array, count: int, sensor: Sensor, segments: Array) -> int:
    """Write the segments that may be bodies; return their number."""
    if count == 0:
        return 0
    begin = first_break(scan, count, sensor) if sensor.round else 0
    found, k = 0, 0
    while k < count:
        last = k
        while last + 1 < count:
            here, after = echo_at(scan, begin + last, count), echo_at(scan, begin + last + 1, count)
            if is_break(scan, here, after, sensor.step):
                break
            last += 1
        found = add_bodies(scan, count, sensor, segments, found, begin + k, begin + last)
        k = last + 1
    return found


@compiled
def echo_at(scan: Array, place: int, count: int) -> int:
    """Return the beam of an echo at a place in the order, which wraps round."""
    return int(scan[place % count, ORDER])


@compiled
def first_break(scan: Array, count: int, sensor: Sensor) -> int:
    """Return a place at which a segment begins, for a scan that goes all round."""
    for k in range(count):
        before = echo_at(scan, k + count - 1, count)
        if is_break(scan, before, echo_at(scan, k, count), sensor.step):
            return k
    return 0


@compiled_once
def add_bodies(
    scan: Array,
    count: int,
    sensor: Sensor,
    segments: Array,
    found: int,
    first: int,
    last: int,
) -> int:
    """Add what may be bodies among the echoes at places first … last; return how many.

    It is the whole where it stands free, else each run of echoes in ever-free space.
    """
    if found >= MOST_SEGMENTS:
        return found
    share = set_segment(scan, count, segments[found], first, last, False, sensor.step)
    slim = SLIM < segments[found, WIDTH] < STOUT
    if last - first >= 2 and slim and share < 1.0 and stands_free(scan, count, sensor, first, last):
        take(scan, count, found, first, last, False)
        return found + 1
    k = first
    while k <= last:
        begin = -1
        end = k
        while k <= last:
            beam = echo_at(scan, k, count)
            if scan[beam, OPEN] > 0.0:
                if begin >= 0 and is_break(scan, echo_at(scan, end, count), beam, sensor.step):
                    break
                begin = k if begin < 0 else begin
                end = k
            k += 1
        if begin >= 0:
            found = add_run(scan, count, sensor, segments, found, begin, end)
    return found


@compiled_once
def add_run(
    scan: Array,
    count: int,
    sensor: Sensor,
    segments: Array,
    found: int,
    first: int,
    last: int,
) -> int:
    """Add the echoes in ever-free space at places first … last: cut where it is wide."""
    if found >= MOST_SEGMENTS:
        return found
    set_segment(scan, count, segments[found], first, last, True, sensor.step)
    one = segments[found]
    near = scan[echo_at(scan, first, count), RANGE] * sensor.step < LEAST_SINGLE
    if one[COUNT] < 2.0 and near:
        return found
    if one[WIDTH] <= WIDE:
        take(scan, count, found, first, last, True)
        return found + 1
    pieces = max(int(one[WIDTH] / APART + 0.5), 1)
    a, b = scan[echo_at(scan, first, count)], scan[echo_at(scan, last, count)]
    x, y = a[ECHO_X], a[ECHO_Y]
    d_x, d_y = b[ECHO_X] - x, b[ECHO_Y] - y
    square = max(d_x * d_x + d_y * d_y, 1e-12)
    begin = first
    for piece in range(pieces):
        end = begin
        while end < last:
            e = scan[echo_at(scan, end + 1, count)]
            along = ((e[ECHO_X] - x) * d_x + (e[ECHO_Y] - y) * d_y) / square
            if piece + 1 < pieces and along * pieces > piece + 1:
                break
            end += 1
        if found < MOST_SEGMENTS and end > begin:
            set_segment(scan, count, segments[found], begin, end, True, sensor.step)
            if segments[found, COUNT] >= 2.0:
                take(scan, count, found, begin, end, True)
                found += 1
        begin = end + 1
        if begin > last:
            break
    return found


@compiled
def take(scan: Array, count: int, group: int, first: int, last: int, open_only: bool) -> None:
    """Give the echoes at places first … last to a segment."""
    for k in range(first, last + 1):
        one = scan[echo_at(scan, k, count)]
        if one[OPEN] > 0.0 or not open_only:
            one[GROUP] = group


@compiled_once
def set_segment(
    scan: Array, count: int, segment: Array, first: int, last: int, open_only: bool, step: float
) -> float:
    """Write the segment of the echoes at places first … last; return its open share."""
    number, n_open, x, y, from_x, from_y = 0, 0, 0.0, 0.0, 0.0, 0.0
    later = 0.0
    for k in range(first, last + 1):
        one = scan[echo_at(scan, k, count)]
        n_open += 1 if one[OPEN] > 0.0 else 0
        if one[OPEN] > 0.0 or not open_only:
            x, y, number = x + one[ECHO_X], y + one[ECHO_Y], number + 1
            from_x, from_y = one[FROM_X], one[FROM_Y]
            later += one[AFTER]
    x, y = x / max(number, 1), y / max(number, 1)
    u_x, u_y = x - from_x, y - from_y
    size = max(math.hypot(u_x, u_y), 1e-9)
    u_x, u_y = u_x / size, u_y / size
    least, most, nearest, farthest = math.inf, -math.inf, math.inf, -math.inf
    for k in range(first, last + 1):
        one = scan[echo_at(scan, k, count)]
        if one[OPEN] > 0.0 or not open_only:
            across = (one[ECHO_Y] - y) * u_x - (one[ECHO_X] - x) * u_y
            along = (one[ECHO_X] - x) * u_x + (one[ECHO_Y] - y) * u_y
            least, most = min(least, across), max(most, across)
            nearest, farthest = min(nearest, along), max(farthest, along)
    share = n_open / max(last - first + 1, 1)
    s = segment
    s[FIRST], s[LAST], s[COUNT], s[USED] = first, last, number, 0.0
    s[SHARE] = 1.0 if open_only else share
    s[MIDDLE_X], s[MIDDLE_Y], s[AWAY_X], s[AWAY_Y] = x, y, u_x, u_y
    s[WIDTH] = max(most - least, farthest - nearest)
    s[LEAST], s[MOST] = least, most
    s[HIDDEN] = is_hidden(scan, count, first, -1) + 2.0 * is_hidden(scan, count, last, 1)
    s[SPACE], s[LATER] = size * step, later / max(number, 1)
    return float(share)


@compiled
def is_hidden(scan: Array, count: int, place: int, side: int) -> float:
    """Return 1 where the next echo on a side, a neighbour, is nearer to the sensor."""
    here, beam = echo_at(scan, place + count, count), echo_at(scan, place + side + count, count)
    close = abs(beam - here) <= 3
    nearer = scan[beam, RANGE] < scan[here, RANGE] - HIDES
    return 1.0 if close and nearer else 0.0


@compiled_once
def stands_free(scan: Array, count: int, sensor: Sensor, first: int, last: int) -> bool:
    """Return whether the scan sees past both sides of the echoes at first … last.

    The next echo on a side is farther away, or lies apart with no echo in between.
    """
    for side in range(2):
        end = first if side == 0 else last
        place = first - 1 if side == 0 else last + 1
        if not sensor.round and not 0 <= place < count:
            return False
        here, beam = echo_at(scan, end, count), echo_at(scan, place + count, count)
        one, other = scan[here], scan[beam]
        apart = math.hypot(other[ECHO_X] - one[ECHO_X], other[ECHO_Y] - one[ECHO_Y])
        lone = abs(beam - here) > 1 and apart > LONE
        lone = lone and other[RANGE] >= one[RANGE]
        if not (lone or other[RANGE] >= one[RANGE] + BEHIND):
            return False
    return True


@compiled_once
def find_normals(scan: Array, sensor: Sensor) -> None:
    """Write the normal of the surface at each echo, from a chord of 0.3 m and more."""
    n = scan.shape[0]
    for k in range(n):
        one = scan[k]
        one[NORMAL_X], one[NORMAL_Y] = 0.0, 0.0
        if not one[RANGE] < math.inf:
            continue
        wide = max(one[RANGE] * sensor.step, 1e-3)
        m = int(min(max(math.ceil(CHORD / wide), 1.0), float(MOST_CHORD)))
        if not sensor.round and (k - m < 0 or k + m >= n):
            continue
        a, b = scan[(k - m + n) % n], scan[(k + m) % n]
        if not (a[RANGE] < math.inf and b[RANGE] < math.inf):
            continue
        d_x, d_y = b[ECHO_X] - a[ECHO_X], b[ECHO_Y] - a[ECHO_Y]
        size = math.hypot(d_x, d_y)
        if not 0.05 < size < 0.5 + 4.0 * wide:
            continue
        n_x, n_y = -d_y / size, d_x / size
        m_x, m_y = 0.5 * (a[ECHO_X] + b[ECHO_X]), 0.5 * (a[ECHO_Y] + b[ECHO_Y])
        off = n_x * (one[ECHO_X] - m_x) + n_y * (one[ECHO_Y] - m_y)
        if abs(off) < FLAT:
            one[NORMAL_X], one[NORMAL_Y] = n_x, n_y
