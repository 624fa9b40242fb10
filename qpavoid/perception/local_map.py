"""Local map: a rolling grid of cells around the robot, in the corrected odometry frame.

A cell is *ever-free* [Schmid2023] once it has been seen through for a while without a
hit; only there a new echo can belong to a moving obstacle. Each cell keeps one exact
point of a static obstacle, which stays when it leaves the view. Scores are in seconds,
so that the map does not depend on the rate of the scans.

A point at x, y (m) is in cell (⌊x/c⌋, ⌊y/c⌋), c = :data:`CELL`; the row of a cell is
that of its indices modulo :data:`SIDE`.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Row, Table, layout

CELL, HALF = 0.1, 80
"""Side of a cell, m; cells on each side of the robot's."""

SIDE = 2 * HALF
"""Cells of a row of the map."""


class CellState(NamedTuple):
    """A cell of the map, and a point of an obstacle in it.

    Attributes:
        free_since: s, since when it has been seen through without a hit.
        score: s, of hits less that of seeing through.
        x: Of the point, m.
        y: Of the point, m.
        hit_time: s, of the last hit.
        hit_way: m, distance driven at the last hit.
        free_count: Scans that saw through it since then.
        ever_free: 1: ever-free.
        lives: Sights through it that the point survives; 0: there is no point.
        loose: 1: the point was in ever-free space when it was hit.
        last_scan: Number of the scan that touched the cell last.
    """

    free_since: float
    score: float
    x: float
    y: float
    hit_time: float
    hit_way: float
    free_count: int
    ever_free: int
    lives: int
    loose: int
    last_scan: int


CELL_STATE = layout(CellState)
CELL_SIZE = CELL_STATE.itemsize // 8
"""Layout of the map, and numbers of memory per cell."""

FREE_SCANS, FREE_TIME = 3, 0.3
"""A cell is ever-free after so many scans, and s, of being seen through."""

HIT_GAIN, REVOKED, MOST_SCORE = 3.0, 2.0, 4.0
"""s a second of hits; the score from which a cell is not ever-free, and the most, s."""

MOST_LIVES = 3
"""Sights through a point that it survives outside of ever-free space."""

POINT_GAIN, POINT_TIME = 0.05, 20.0
"""Share by which a point follows a new hit, since a map that follows the scans cannot
correct them; after so many s without a hit it is replaced."""

Cell = tuple[int, int]
"""Indices of a cell."""


class Moment(NamedTuple):
    """Of a scan.

    Attributes:
        number: Counted from 0.
        time: s.
        dt: s since the scan before.
        way: m driven so far.
    """

    number: int
    time: float
    dt: float
    way: float


@compiled
def cell_of(x: float) -> int:
    """Return the index of the cell of a coordinate."""
    return math.floor(x / CELL)


@compiled
def row_of(i: int, j: int) -> int:
    """Return the row of a cell in the table."""
    return (i % SIDE) * SIDE + j % SIDE


@compiled
def holds(centre: Cell, i: int, j: int, border: int) -> bool:
    """Return whether a cell is in the map, at least ``border`` cells from its edge."""
    inside = HALF - border
    return abs(i - centre[0]) < inside and abs(j - centre[1]) < inside


@compiled
def clear_cell(cell: Row) -> None:
    """Make a cell unknown."""
    cell.free_since, cell.free_count, cell.score = math.inf, 0, 0.0
    cell.ever_free, cell.lives, cell.loose = 0, 0, 0
    cell.hit_time, cell.hit_way, cell.last_scan = -math.inf, 0.0, -1


@compiled_once
def clear_map(cells: Table) -> None:
    """Make all cells unknown."""
    for row in range(cells.shape[0]):
        clear_cell(cells[row])


@compiled_once
def roll(cells: Table, old: int, new: int, along_y: bool) -> None:
    """Clear the cells that enter the map as its centre moves along an axis."""
    begin, end = (old + HALF, new + HALF) if new > old else (new - HALF, old - HALF)
    begin = max(begin, end - SIDE)
    for i in range(begin, end):
        for j in range(SIDE):
            clear_cell(cells[row_of(j, i) if along_y else row_of(i, j)])


@compiled_once
def is_ever_free(cells: Table, x: float, y: float, centre: Cell, border: int) -> bool:
    """Return whether all cells within ``border`` cells of a point are ever-free."""
    i, j = cell_of(x), cell_of(y)
    if not holds(centre, i, j, border + 1):
        return False
    for a in range(i - border, i + border + 1):
        for b in range(j - border, j + border + 1):
            if cells[row_of(a, b)].ever_free == 0:
                return False
    return True


@compiled
def hit(cell: Row, x: float, y: float, loose: bool, now: Moment) -> None:
    """Enter the echo of a static obstacle, ``loose`` in ever-free space."""
    recent = now.time - cell.hit_time < POINT_TIME
    if cell.lives > 0 and cell.loose == 0 and recent:
        cell.x += POINT_GAIN * (x - cell.x)
        cell.y += POINT_GAIN * (y - cell.y)
    else:
        cell.x, cell.y = x, y
    cell.hit_time, cell.hit_way, cell.lives = now.time, now.way, MOST_LIVES
    cell.loose = 1 if loose else 0
    if cell.last_scan != now.number:
        cell.last_scan, cell.free_count = now.number, 0
        cell.score = min(cell.score + HIT_GAIN * now.dt, MOST_SCORE)
        if cell.score >= REVOKED:
            cell.ever_free = 0


@compiled
def was_hit(cell: Row, time: float, number: int) -> bool:
    """Return whether a cell was hit in the scan of a time (s) and number."""
    return bool(cell.hit_time >= time and cell.last_scan == number)


@compiled
def occupy(cell: Row, now: Moment) -> None:
    """Enter the echo of a moving obstacle: neither a hit nor free."""
    if cell.last_scan != now.number:
        cell.last_scan, cell.lives, cell.score = now.number, 0, 0.0


@compiled
def see_through(cell: Row, now: Moment) -> None:
    """Enter a beam that passes a cell, once a scan."""
    if cell.last_scan == now.number:
        return
    cell.last_scan = now.number
    if cell.free_count == 0:
        cell.free_since = now.time
    cell.free_count += 1
    cell.score = max(cell.score - now.dt, 0.0)
    long = now.time - cell.free_since >= FREE_TIME - 1e-6
    if cell.score <= 0.0 and cell.free_count >= FREE_SCANS and long:
        cell.ever_free = 1


@compiled_once
def clear_robot(cells: Table, centre: Cell, radius: float, now: Moment) -> None:
    """Enter that nothing but the robot is within a radius (m) of the centre."""
    wide = int(radius / CELL)
    for i in range(-wide, wide + 1):
        for j in range(-wide, wide + 1):
            if (i * i + j * j) * CELL * CELL <= radius * radius:
                cell = cells[row_of(centre[0] + i, centre[1] + j)]
                cell.score, cell.lives = 0.0, 0
                see_through(cell, now)


@compiled_once
def trace(cells: Table, beam: Row, length: float, centre: Cell, now: Moment) -> None:
    """See through the cells along a length (m) of a beam [Amanatides1987]."""
    x, y, limit = beam.from_x / CELL, beam.from_y / CELL, length / CELL
    i, j = math.floor(x), math.floor(y)
    right, up = 1 if beam.cos > 0.0 else -1, 1 if beam.sin > 0.0 else -1
    per_x = abs(1.0 / beam.cos) if beam.cos != 0.0 else math.inf
    per_y = abs(1.0 / beam.sin) if beam.sin != 0.0 else math.inf
    next_x = (i + 1 - x if right > 0 else x - i) * per_x if per_x < math.inf else per_x
    next_y = (j + 1 - y if up > 0 else y - j) * per_y if per_y < math.inf else per_y
    at = 0.0
    while at <= limit and holds(centre, i, j, 0):
        see_through(cells[row_of(i, j)], now)
        if next_x < next_y:
            at, next_x, i = next_x, next_x + per_x, i + right
        else:
            at, next_y, j = next_y, next_y + per_y, j + up
