"""A scan: echoes in the map frame, normals of surfaces, and beams that lost their echo.

Positions and directions are those at the time of each beam, so that a scan taken while
the robot moves is not distorted.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import CELL, Cell, is_ever_free
from qpavoid.types import Array, Pose

(
    RANGE,  # m; inf: no echo; NaN: unknown
    FROM_X,  # of the sensor at the time of the beam, m
    FROM_Y,
    COS,  # of the direction of the beam
    SIN,
    ECHO_X,  # of the echo, m
    ECHO_Y,
    AFTER,  # s from the time of the scan to that of the beam
    OPEN,  # 1: the echo is in ever-free space
    BEAM_TRACK,  # row of the confirmed track that it is near; −1: none
    BEAM_SEGMENT,  # number of its segment; −1: none
    CLAIMED,  # 1: the echo belongs to a confirmed track
    ECHO_BEAM,  # of row k: the beam of the k-th echo
    SURFACE_X,  # of the surface; 0, 0: unknown
    SURFACE_Y,
) = range(15)
SCAN_WIDTH = 15

BEAM_COS, BEAM_SIN, BEAM_SHARE, BEAM_AFTER = range(4)
"""Columns of beams: direction in the sensor frame; when a beam is taken, as a share of
the motion during a scan and in s after the time of the scan."""
BEAM_WIDTH = 4

CHORD, MOST_CHORD, FLAT = 0.15, 12, 0.05
"""m on each side over which a normal is taken, and the most beams; how far (m) the
middle may be off the chord."""

LEAST_CHORD, CHORD_GAP = 0.05, 0.5
"""m; a chord is longer than the one, and than the other at most by four beams."""

MOST_BORDER = 3
"""Cells; the most by which the tolerance of ever-free space grows with the range."""

NO_ECHO_FREE, NO_ECHO_UNKNOWN = 1.0, 2.0
"""Meaning of a beam without an echo; 0: it is found out."""

TRIPLE_ALIKE, LEAST_TRIPLES, LOST, TRIPLES_KEPT, FAR_ECHO = 0.3, 300.0, 0.01, 0.998, 0.5
"""m by which two neighbours of a lost echo differ at most; number of such triples from
which their share of lost echoes counts; the share from which no echo is unknown; share
of the counts that is kept from scan to scan; share of the greatest range beyond which
a scan has an echo, or else no echo is unknown."""


class Sensor(NamedTuple):
    """A LiDAR, as compiled functions take it.

    Attributes:
        mount: x, y (m), γ (rad) in the robot frame.
        step: Angle between neighbouring beams, rad.
        range_max: m; a beam without an echo is free to there.
        round: 1: the last beam is beside the first.
        angle_error: rad; σ of a beam's direction in the map.
        no_echo: :data:`NO_ECHO_FREE`, :data:`NO_ECHO_UNKNOWN`, or 0.
    """

    mount: Pose
    step: float
    range_max: float
    round: float
    angle_error: float
    no_echo: float


@compiled_once
def judge_no_echo(scan: Array, sensor: Sensor, counts: Array) -> None:
    """Make beams without an echo unknown (NaN) where they cannot be taken for free.

    Between two echoes at about one range there is a surface; a beam there without an
    echo lost it. ``counts`` (2,) are such triples, and those that lost an echo. In a
    place much smaller than the range of the sensor all beams meet a surface.
    """
    n, far = scan.shape[0], False
    for k in range(n):
        far = far or FAR_ECHO * sensor.range_max < scan[k, RANGE] < math.inf
    counts[0], counts[1] = TRIPLES_KEPT * counts[0], TRIPLES_KEPT * counts[1]
    for k in range(1, n - 1):
        left, right = scan[k - 1, RANGE], scan[k + 1, RANGE]
        if left < math.inf and right < math.inf and abs(left - right) < TRIPLE_ALIKE:
            counts[0] += 1.0
            counts[1] += 1.0 if scan[k, RANGE] == math.inf else 0.0
    trusted = far and counts[0] >= LEAST_TRIPLES and counts[1] <= LOST * counts[0]
    if sensor.no_echo == NO_ECHO_FREE or (sensor.no_echo == 0.0 and trusted):
        return
    for k in range(n):
        if scan[k, RANGE] == math.inf:
            scan[k, RANGE] = math.nan


@compiled_once
def place_echoes(
    scan: Array, beams: Array, sensor: Sensor, begin: Pose, motion: Pose
) -> int:
    """Bring the beams into the map frame; return the number of echoes.

    Args:
        scan: Its column RANGE is given.
        beams: (n, BEAM_WIDTH).
        sensor: LiDAR.
        begin: Pose of the robot at share 0.
        motion: Change of x, y (m) and γ (rad) until share 1.
    """
    count = 0
    for k in range(beams.shape[0]):
        one, share = scan[k], beams[k, BEAM_SHARE]
        heading = begin[2] + share * motion[2]
        cos, sin = math.cos(heading), math.sin(heading)
        ahead, left, turned = sensor.mount
        one[FROM_X] = begin[0] + share * motion[0] + cos * ahead - sin * left
        one[FROM_Y] = begin[1] + share * motion[1] + sin * ahead + cos * left
        cos, sin = math.cos(heading + turned), math.sin(heading + turned)
        one[COS] = cos * beams[k, BEAM_COS] - sin * beams[k, BEAM_SIN]
        one[SIN] = sin * beams[k, BEAM_COS] + cos * beams[k, BEAM_SIN]
        one[CLAIMED], one[OPEN] = 0.0, 0.0
        one[BEAM_SEGMENT], one[BEAM_TRACK] = -1.0, -1.0
        one[AFTER] = beams[k, BEAM_AFTER]
        if one[RANGE] < math.inf:
            one[ECHO_X] = one[FROM_X] + one[RANGE] * one[COS]
            one[ECHO_Y] = one[FROM_Y] + one[RANGE] * one[SIN]
            scan[count, ECHO_BEAM] = k
            count += 1
    return count


@compiled_once
def mark_open(
    scan: Array, echoes: int, cells: Array, centre: Cell, angle_error: float
) -> None:
    """Mark the echoes in ever-free space; the tolerance grows with the range."""
    for k in range(echoes):
        one = scan[int(scan[k, ECHO_BEAM])]
        border = 1 + int(min(one[RANGE] * angle_error / CELL, MOST_BORDER))
        is_open = is_ever_free(cells, one[ECHO_X], one[ECHO_Y], centre, border)
        one[OPEN] = 1.0 if is_open else 0.0


@compiled_once
def find_normals(scan: Array, sensor: Sensor) -> None:
    """Write the unit normal of the surface at each echo, from a chord around it."""
    n = scan.shape[0]
    for k in range(n):
        one = scan[k]
        one[SURFACE_X], one[SURFACE_Y] = 0.0, 0.0
        if not one[RANGE] < math.inf:
            continue
        space = max(one[RANGE] * sensor.step, 1e-3)
        wide = int(min(max(math.ceil(CHORD / space), 1.0), MOST_CHORD))
        if sensor.round == 0.0 and (k - wide < 0 or k + wide >= n):
            continue
        a, b = scan[(k - wide) % n], scan[(k + wide) % n]
        if not (a[RANGE] < math.inf and b[RANGE] < math.inf):
            continue
        d_x, d_y = b[ECHO_X] - a[ECHO_X], b[ECHO_Y] - a[ECHO_Y]
        size = math.hypot(d_x, d_y)
        if not LEAST_CHORD < size < CHORD_GAP + 4.0 * space:
            continue
        n_x, n_y = -d_y / size, d_x / size
        off = n_x * (one[ECHO_X] - a[ECHO_X]) + n_y * (one[ECHO_Y] - a[ECHO_Y])
        if abs(off) < FLAT:
            one[SURFACE_X], one[SURFACE_Y] = n_x, n_y


@compiled
def beam_towards(scan: Array, sensor: Sensor, x: float, y: float) -> int:
    """Return the beam that points to a place (m); −1: it is out of view."""
    n, first = scan.shape[0], scan[0]
    angle = math.atan2(y - first[FROM_Y], x - first[FROM_X])
    angle += 0.5 * sensor.step - math.atan2(first[SIN], first[COS])
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    k = math.floor(angle / sensor.step)
    return k if k < n else -1


@compiled
def sees_through(scan: Array, sensor: Sensor, x: float, y: float, more: float) -> bool:
    """Return whether the beam towards a place is free for ``more`` m beyond it."""
    k = beam_towards(scan, sensor, x, y)
    if k < 0:
        return False
    far = math.hypot(x - scan[0, FROM_X], y - scan[0, FROM_Y]) + more
    return bool(scan[k, RANGE] > far and sensor.range_max > far)
