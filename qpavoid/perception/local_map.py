"""Local map: a rolling grid of cells around the robot, in the corrected odometry frame.

A cell is *ever-free* [Schmid2023] when it has been seen through for long enough and is
not hit persistently; only points in ever-free space can belong to a moving obstacle.
Each cell keeps one exact point of a static obstacle, which stays when it leaves the
view. Scores are in seconds, so that the map does not depend on the rate of the scans.

A point of the map at x, y (m) is in cell (⌊x/c⌋, ⌊y/c⌋) with c = :data:`CELL`; the row
of a cell in the table is that of its indices modulo :data:`SIDE`.
"""

import math

from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Array

CELL, HALF = 0.1, 80
"""Side of a cell, m; cells on each side of the robot's."""

SIDE = 2 * HALF

(
    FREE_SINCE,  # s, since when the cell has been seen through without a hit
    FREE_COUNT,  # scans that saw through it since then
    SCORE,  # s, hits less seeing through
    EVER,  # 1: ever-free
    POINT_X,  # a point of a static obstacle in it, m
    POINT_Y,
    SEEN,  # s, when the point was hit last
    WAY,  # m, distance driven when it was hit last
    LIVES,  # sights through it that the point survives; 0: there is no point
    LOOSE,  # 1: the point is in ever-free space and no confirmed track's
    SCAN,  # number of the scan that touched the cell last
) = range(11)
CELL_WIDTH = 11

FREE_SCANS, FREE_TIME = 3, 0.3
"""A cell is ever-free after so many scans and s of being seen through."""

HIT_GAIN, REVOKED, MOST_SCORE = 3.0, 4.0, 6.0
"""s a second of hits; score (s) from which a cell is no longer ever-free; the most."""

SIGHTS = 3
"""Sights through a remembered point outside of ever-free space before it is dropped."""

FOLLOW = 0.05
"""Share by which a remembered point follows a new hit: the map must not follow the
scan that is aligned to it."""

FOLLOW_TIME = 20.0
"""s; a point that was not hit for longer is replaced."""


@compiled
def cell_of(x: float) -> int:
    """Return the index of the cell of a coordinate."""
    return int(math.floor(x / CELL))


@compiled
def row_of(i: int, j: int) -> int:
    """Return the row of a cell in the table."""
    return (i % SIDE) * SIDE + j % SIDE


@compiled
def clear_cell(cell: Array) -> None:
    """Make a cell unknown."""
    cell[FREE_SINCE], cell[FREE_COUNT], cell[SCORE], cell[EVER] = math.inf, 0.0, 0.0, 0.0
    cell[SEEN], cell[WAY], cell[LIVES], cell[LOOSE] = -math.inf, 0.0, 0.0, 0.0
    cell[SCAN] = -1.0


@compiled_once
def roll(cells: Array, old: int, new: int, along_y: bool) -> None:
    """Clear the cells that come into the map as its centre moves along one axis."""
    begin, end = (old + HALF, new + HALF) if new > old else (new - HALF, old - HALF)
    if end - begin > SIDE:
        begin = end - SIDE
    for i in range(begin, end):
        for j in range(SIDE):
            clear_cell(cells[row_of(j, i) if along_y else row_of(i, j)])


@compiled_once
def is_ever_free(
    cells: Array, x: float, y: float, centre: tuple[int, int], tolerance: int
) -> bool:
    """Return whether all cells within a tolerance (cells) of a point are ever-free."""
    i, j, inside = cell_of(x), cell_of(y), HALF - tolerance - 1
    if abs(i - centre[0]) >= inside or abs(j - centre[1]) >= inside:
        return False
    for a in range(i - tolerance, i + tolerance + 1):
        for b in range(j - tolerance, j + tolerance + 1):
            if cells[row_of(a, b), EVER] == 0.0:
                return False
    return True


@compiled
def hit(cell: Array, x: float, y: float, loose: bool, now: Array) -> None:
    """Enter a point. ``now``: number of the scan, time, interval (s), way (m)."""
    age = now[1] - cell[SEEN]
    known = cell[LIVES] > 0.0 and cell[LOOSE] == 0.0 and age < FOLLOW_TIME
    share = FOLLOW if known else 1.0
    if known:
        cell[POINT_X] += share * (x - cell[POINT_X])
        cell[POINT_Y] += share * (y - cell[POINT_Y])
    else:
        cell[POINT_X], cell[POINT_Y] = x, y
    cell[SEEN], cell[WAY], cell[LIVES] = now[1], now[3], SIGHTS
    cell[LOOSE] = 1.0 if loose else 0.0
    if cell[SCAN] != now[0]:
        cell[SCAN], cell[FREE_COUNT] = now[0], 0.0
        cell[SCORE] = min(cell[SCORE] + HIT_GAIN * now[2], MOST_SCORE)
        if cell[SCORE] >= REVOKED:
            cell[EVER] = 0.0


@compiled
def see_through(cell: Array, now: Array) -> None:
    """Enter a beam that passes a cell, once a scan. ``now``: as :func:`hit`."""
    if cell[SCAN] == now[0]:
        return
    cell[SCAN] = now[0]
    if cell[FREE_COUNT] == 0.0:
        cell[FREE_SINCE] = now[1]
    cell[FREE_COUNT] += 1.0
    cell[SCORE] = max(cell[SCORE] - now[2], 0.0)
    long = now[1] - cell[FREE_SINCE] >= FREE_TIME - 1e-6
    if cell[SCORE] <= 0.0 and cell[FREE_COUNT] >= FREE_SCANS and long:
        cell[EVER] = 1.0


@compiled_once
def trace(
    cells: Array,
    begin: tuple[float, float],
    along: tuple[float, float],
    length: float,
    centre: tuple[int, int],
    now: Array,
) -> None:
    """Enter a free beam: every cell that it crosses, from one to the next [Amanatides1987].

    Args:
        cells: Map.
        begin: x, y of the sensor, m.
        along: Unit direction.
        length: m that are free.
        centre: Indices of the map's middle.
        now: As :func:`hit`.
    """
    x, y = begin[0] / CELL, begin[1] / CELL
    cos, sin, limit = along[0], along[1], length / CELL
    i, j = int(math.floor(x)), int(math.floor(y))
    right, up = 1 if cos > 0.0 else -1, 1 if sin > 0.0 else -1
    per_x = abs(1.0 / cos) if cos != 0.0 else math.inf
    per_y = abs(1.0 / sin) if sin != 0.0 else math.inf
    next_x = ((i + (1 if cos > 0.0 else 0)) - x) / cos if cos != 0.0 else math.inf
    next_y = ((j + (1 if sin > 0.0 else 0)) - y) / sin if sin != 0.0 else math.inf
    at = 0.0
    while at <= limit:
        if abs(i - centre[0]) >= HALF or abs(j - centre[1]) >= HALF:
            return
        see_through(cells[row_of(i, j)], now)
        if next_x < next_y:
            at = next_x
            next_x += per_x
            i += right
        else:
            at = next_y
            next_y += per_y
            j += up
