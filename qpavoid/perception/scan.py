"""A scan: echoes in the map frame, normals of surfaces, and beams that lost their echo.

Positions and directions are those at the time of each beam, so that a scan taken while
the robot moves is not distorted.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import CELL, Cell, is_ever_free
from qpavoid.types import Array, Pose, Table, layout


class Ray(NamedTuple):
    """A beam of a scan, map frame.

    Attributes:
        range: m; inf: no echo; NaN: unknown.
        from_x: Of the sensor at the time of the beam, m.
        from_y: Of it, m.
        cos: Of the direction of the beam.
        sin: Of it.
        x: Of the echo, m.
        y: Of the echo, m.
        after: s from the time of the scan to that of the beam.
        n_x: Unit normal of the surface at the echo; 0, 0: unknown.
        n_y: Of it.
        open: 1: the echo is in ever-free space.
        track: Row of the confirmed track that it is near; −1: none.
        segment: Number of its segment; −1: none.
        claimed: 1: the echo belongs to a confirmed track.
        echo: Of row k: the beam of the k-th echo.
    """

    range: float
    from_x: float
    from_y: float
    cos: float
    sin: float
    x: float
    y: float
    after: float
    n_x: float
    n_y: float
    open: int
    track: int
    segment: int
    claimed: int
    echo: int


RAY = layout(Ray)
RAY_SIZE = RAY.itemsize // 8
"""Layout of a scan, and numbers of memory per beam."""

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

TRIPLE_ALIKE, LEAST_TRIPLES, LOST, TRIPLES_KEPT = 0.3, 100.0, 0.01, 0.998
"""m by which two neighbours of a lost echo differ at most; number of such triples from
which their share of lost echoes counts; the share from which no echo is unknown; share
of the counts that is kept from scan to scan."""

FAR_ECHO, OPEN_SPACE = 0.5, 0.5
"""No echo is unknown unless an echo is beyond this share of the greatest range, or more
than this share of the beams has none."""


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
def judge_no_echo(scan: Table, sensor: Sensor, counts: Array) -> None:
    """Make beams without an echo unknown (NaN) where they cannot be taken for free.

    Between two echoes at about one range there is a surface; a beam there without an
    echo lost it. ``counts`` (2,) are such triples, and those that lost an echo. In a
    place much smaller than the range of the sensor all beams meet a surface.
    """
    n, far, none = scan.shape[0], False, 0
    for k in range(n):
        far = far or FAR_ECHO * sensor.range_max < scan[k].range < math.inf
        none += 1 if scan[k].range == math.inf else 0
    far = far or none > OPEN_SPACE * n
    counts[0], counts[1] = TRIPLES_KEPT * counts[0], TRIPLES_KEPT * counts[1]
    for k in range(1, n - 1):
        left, right = scan[k - 1].range, scan[k + 1].range
        if left < math.inf and right < math.inf and abs(left - right) < TRIPLE_ALIKE:
            counts[0] += 1.0
            counts[1] += 1.0 if scan[k].range == math.inf else 0.0
    trusted = far and counts[0] >= LEAST_TRIPLES and counts[1] <= LOST * counts[0]
    if sensor.no_echo == NO_ECHO_FREE or (sensor.no_echo == 0.0 and trusted):
        return
    for k in range(n):
        if scan[k].range == math.inf:
            scan[k].range = math.nan


@compiled_once
def place_echoes(
    scan: Table, beams: Array, sensor: Sensor, begin: Pose, motion: Pose
) -> int:
    """Bring the beams into the map frame; return the number of echoes.

    Args:
        scan: Its ranges are given.
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
        one.from_x = begin[0] + share * motion[0] + cos * ahead - sin * left
        one.from_y = begin[1] + share * motion[1] + sin * ahead + cos * left
        cos, sin = math.cos(heading + turned), math.sin(heading + turned)
        one.cos = cos * beams[k, BEAM_COS] - sin * beams[k, BEAM_SIN]
        one.sin = sin * beams[k, BEAM_COS] + cos * beams[k, BEAM_SIN]
        one.claimed, one.open, one.segment, one.track = 0, 0, -1, -1
        one.after = beams[k, BEAM_AFTER]
        if one.range < math.inf:
            one.x = one.from_x + one.range * one.cos
            one.y = one.from_y + one.range * one.sin
            scan[count].echo = k
            count += 1
    return count


@compiled_once
def mark_open(
    scan: Table, echoes: int, cells: Table, centre: Cell, angle_error: float
) -> None:
    """Mark the echoes in ever-free space; the tolerance grows with the range."""
    for k in range(echoes):
        one = scan[scan[k].echo]
        border = 1 + int(min(one.range * angle_error / CELL, MOST_BORDER))
        is_open = is_ever_free(cells, one.x, one.y, centre, border)
        one.open = 1 if is_open else 0


@compiled_once
def find_normals(scan: Table, sensor: Sensor) -> None:
    """Write the unit normal of the surface at each echo, from a chord around it."""
    n = scan.shape[0]
    for k in range(n):
        one = scan[k]
        one.n_x, one.n_y = 0.0, 0.0
        if not one.range < math.inf:
            continue
        space = max(one.range * sensor.step, 1e-3)
        wide = int(min(max(math.ceil(CHORD / space), 1.0), MOST_CHORD))
        if sensor.round == 0.0 and (k - wide < 0 or k + wide >= n):
            continue
        a, b = scan[(k - wide) % n], scan[(k + wide) % n]
        if not (a.range < math.inf and b.range < math.inf):
            continue
        d_x, d_y = b.x - a.x, b.y - a.y
        size = math.hypot(d_x, d_y)
        if not LEAST_CHORD < size < CHORD_GAP + 4.0 * space:
            continue
        n_x, n_y = -d_y / size, d_x / size
        off = n_x * (one.x - a.x) + n_y * (one.y - a.y)
        if abs(off) < FLAT:
            one.n_x, one.n_y = n_x, n_y


@compiled
def beam_towards(scan: Table, sensor: Sensor, x: float, y: float) -> int:
    """Return the beam that points to a place (m); −1: it is out of view."""
    n, first = scan.shape[0], scan[0]
    angle = math.atan2(y - first.from_y, x - first.from_x)
    angle += 0.5 * sensor.step - math.atan2(first.sin, first.cos)
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi))
    k = math.floor(angle / sensor.step)
    return k if k < n else -1


@compiled
def sees_through(scan: Table, sensor: Sensor, x: float, y: float, more: float) -> bool:
    """Return whether the beam towards a place is free for ``more`` m beyond it."""
    k = beam_towards(scan, sensor, x, y)
    if k < 0:
        return False
    far = math.hypot(x - scan[0].from_x, y - scan[0].from_y) + more
    return bool(scan[k].range > far and sensor.range_max > far)
