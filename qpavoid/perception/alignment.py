"""Alignment: correction of the odometry by the static points of the local map.

Echoes with a normal are matched to the nearest point of the map. The distances along
the normals are minimised over a small motion d_x, d_y, turn about the robot: point to
line [Censi2008]. The odometry's step is the prior, with its σ; a direction about which
the matches tell little (along a corridor) keeps the odometry's step.
"""

import math

from qpavoid.compiled import compiled_once
from qpavoid.perception.local_map import CELL, Cell, cell_of, holds, row_of
from qpavoid.types import Array, Pose, Table

ALIGN_ROUNDS, MOST_MATCHED, LEAST_MATCHED = 4, 180, 20
"""Iterations; echoes that are matched at most, and at least."""

FIRST_REACH, REACH = 0.25, 0.15
"""m between matched points in the first two iterations, and later."""

ROBUST, RESIDUAL = 0.05, 0.1
"""m; a greater residual counts less (Cauchy's weight); σ of a residual."""

WAY_SIGMA, WAY_LEAST, TURN_SIGMA, TURN_LEAST = 0.05, 0.002, 0.03, 0.001
"""σ of the odometry's step: a share of the way, at least m; rad/√(rad + m), at least
rad."""

LITTLE, HOLD_FACTOR = 0.1, 1e3
"""Share of the matches' information below which a direction keeps the odometry's step,
and the factor of the prior by which it is kept."""

BODY = 0.45
"""m; echoes nearer to a track are not matched."""

SMALL_SHIFT = 1e-4
"""m, rad; a smaller correction ends the iteration."""

SYSTEM = 9
"""Numbers of the normal equations: xx, xy, xt, yy, yt, tt, and the right-hand side."""


@compiled_once
def drop_bodies(scan: Table, tracks: Table, count: int) -> None:
    """Clear the normals of echoes near tracks: they are not matched."""
    for k in range(scan.shape[0]):
        one = scan[k]
        for a in range(count):
            t = tracks[a]
            if math.hypot(one.x - t.x, one.y - t.y) < BODY:
                one.n_x, one.n_y = 0.0, 0.0


@compiled_once
def nearest_point(cells: Table, x: float, y: float, centre: Cell, reach: float) -> int:
    """Return the row of the cell with the nearest static point; −1: none in reach."""
    i, j, wide = cell_of(x), cell_of(y), math.ceil(reach / CELL)
    if not holds(centre, i, j, wide + 1):
        return -1
    best, found = reach * reach, -1
    for a in range(i - wide, i + wide + 1):
        for b in range(j - wide, j + wide + 1):
            cell = cells[row_of(a, b)]
            d_x, d_y = cell.x - x, cell.y - y
            square = d_x * d_x + d_y * d_y
            if cell.lives > 0 and cell.loose == 0 and square < best:
                best, found = square, row_of(a, b)
    return found


@compiled_once
def match(
    scan: Table, cells: Table, centre: Cell, robot: Pose, reach: float, system: Array
) -> int:
    """Write the normal equations of the matches; return their number.

    Args:
        scan: Echoes, with the normals of those to be matched.
        cells: Map.
        centre: Cell in its middle.
        robot: Pose about which the motion turns.
        reach: Of matched points, m.
        system: (SYSTEM,) written.
    """
    for k in range(SYSTEM):
        system[k] = 0.0
    used, stride = 0, 1 + scan.shape[0] // MOST_MATCHED
    for place in range(scan.shape[0] // stride):
        one = scan[place * stride]
        n_x, n_y, x, y = one.n_x, one.n_y, one.x, one.y
        if not one.range < math.inf or (n_x == 0.0 and n_y == 0.0):
            continue
        row = nearest_point(cells, x, y, centre, reach)
        if row < 0:
            continue
        e = n_x * (cells[row].x - x) + n_y * (cells[row].y - y)
        lever = n_y * (x - robot[0]) - n_x * (y - robot[1])
        w = 1.0 / (1.0 + (e / ROBUST) ** 2)
        system[0] += w * n_x * n_x
        system[1] += w * n_x * n_y
        system[2] += w * n_x * lever
        system[3] += w * n_y * n_y
        system[4] += w * n_y * lever
        system[5] += w * lever * lever
        system[6] += w * n_x * e
        system[7] += w * n_y * e
        system[8] += w * lever * e
        used += 1
    return used


@compiled_once
def solve_step(
    system: Array, used: int, shift: Pose, step: tuple[float, float]
) -> Pose:
    """Return what to add to a correction: d_x, d_y (m) and turn (rad).

    Args:
        system: Of :func:`match`.
        used: Matches.
        shift: The correction so far, which the prior draws to zero.
        step: Of the odometry: m driven, rad turned.
    """
    xx, xy, xt = system[0], system[1], system[2]
    yy, yt, tt = system[3], system[4], system[5]
    prior = (RESIDUAL / (WAY_SIGMA * step[0] + WAY_LEAST)) ** 2
    turn = TURN_SIGMA * math.sqrt(step[0] + step[1]) + TURN_LEAST
    prior_t = (RESIDUAL / turn) ** 2
    # The principal directions of the information about the position.
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    c, s = math.cos(angle), math.sin(angle)
    most = HOLD_FACTOR * prior if mean + half < LITTLE * used else 0.0
    least = HOLD_FACTOR * prior if mean - half < LITTLE * used else 0.0
    xx += prior + most * c * c + least * s * s
    xy += (most - least) * c * s
    yy += prior + most * s * s + least * c * c
    tt += prior_t
    b_x, b_y = system[6] - prior * shift[0], system[7] - prior * shift[1]
    b_t = system[8] - prior_t * shift[2]
    # Gaussian elimination; the prior makes the matrix positive definite.
    yy, yt, b_y = yy - xy * xy / xx, yt - xy * xt / xx, b_y - xy * b_x / xx
    tt, b_t = tt - xt * xt / xx, b_t - xt * b_x / xx
    d_t = (b_t - yt * b_y / yy) / (tt - yt * yt / yy)
    d_y = (b_y - yt * d_t) / yy
    return (b_x - xy * d_y - xt * d_t) / xx, d_y, d_t


@compiled_once
def move_scan(scan: Table, robot: Pose, shift: Pose) -> None:
    """Move the scan by d_x, d_y (m) and a turn (rad) about the robot."""
    cos, sin = math.cos(shift[2]), math.sin(shift[2])
    for k in range(scan.shape[0]):
        one = scan[k]
        x, y = one.from_x - robot[0], one.from_y - robot[1]
        one.from_x = robot[0] + shift[0] + cos * x - sin * y
        one.from_y = robot[1] + shift[1] + sin * x + cos * y
        x, y = one.x - robot[0], one.y - robot[1]
        one.x = robot[0] + shift[0] + cos * x - sin * y
        one.y = robot[1] + shift[1] + sin * x + cos * y
        x, y = one.cos, one.sin
        one.cos, one.sin = cos * x - sin * y, sin * x + cos * y
        x, y = one.n_x, one.n_y
        one.n_x, one.n_y = cos * x - sin * y, sin * x + cos * y


@compiled_once
def align(
    scan: Table,
    cells: Table,
    centre: Cell,
    robot: Pose,
    step: tuple[float, float],
    system: Array,
) -> Pose:
    """Move a scan onto the map; return the motion d_x, d_y, turn about the robot.

    Args:
        scan: As :func:`match`; moved. With too few matches it stays where it is.
        cells: Map.
        centre: Cell in its middle.
        robot: Its pose by the odometry as corrected so far.
        step: Of the odometry: m driven, rad turned.
        system: (SYSTEM,) workspace.
    """
    shift = (0.0, 0.0, 0.0)
    for k in range(ALIGN_ROUNDS):
        reach = FIRST_REACH if k < 2 else REACH
        used = match(scan, cells, centre, robot, reach, system)
        if used < LEAST_MATCHED:
            break
        more = solve_step(system, used, shift, step)
        move_scan(scan, robot, more)
        robot = (robot[0] + more[0], robot[1] + more[1], robot[2] + more[2])
        shift = (shift[0] + more[0], shift[1] + more[1], shift[2] + more[2])
        if abs(more[0]) + abs(more[1]) + abs(more[2]) < SMALL_SHIFT:
            break
    return shift
