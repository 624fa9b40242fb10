"""Alignment: the correction of the odometry by the static points of the local map.

Echoes with a known normal are matched to the nearest remembered point, and the distance
along the normal is minimised over a small motion (d_x, d_y, turn about the robot): point
to line [Censi2008]. The step of the odometry is the prior, with its σ; directions of
which the echoes say little (along a corridor) keep the odometry's step.
"""

import math

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.local_map import (
    CELL,
    HALF,
    LIVES,
    LOOSE,
    POINT_X,
    POINT_Y,
    cell_of,
    row_of,
)
from qpavoid.perception.scan import (
    ECHO_X,
    ECHO_Y,
    NORMAL_X,
    NORMAL_Y,
    RANGE,
)
from qpavoid.perception.tracks import TRACK_X, TRACK_Y
from qpavoid.types import Array, Pose

ROUNDS, MOST_MATCHED, LEAST_MATCHED = 4, 180, 20
"""Iterations; echoes that are matched at most, and at least."""

FIRST_REACH, REACH = 0.25, 0.15
"""m; how far matched points may be apart at first, and in the end."""

ROBUST, ECHO_SIGMA = 0.05, 0.1
"""m; residual from which a match counts less (Cauchy), and the σ of a residual."""

WAY_SIGMA, WAY_FLOOR = 0.05, 0.002
TURN_SIGMA, TURN_FLOOR = 0.03, 0.001
"""σ of the odometry's step: share of the way and m; rad per √(rad + m), and rad."""

LITTLE = 0.1
"""Share of the information below which a direction keeps the odometry's step."""

BODY_CLEAR = 0.45
"""m; echoes nearer than this to a track are not matched."""

SMALL = 1e-4
"""m and rad; a smaller correction ends the iteration."""


@compiled
def nearest_point(
    cells: Array, x: float, y: float, centre: tuple[int, int], reach: float
) -> int:
    """Return the row of the cell whose static point is nearest; −1: none in reach."""
    i, j, wide = cell_of(x), cell_of(y), int(math.ceil(reach / CELL))
    inside = HALF - wide - 1
    if abs(i - centre[0]) >= inside or abs(j - centre[1]) >= inside:
        return -1
    best, found = reach * reach, -1
    for a in range(i - wide, i + wide + 1):
        for b in range(j - wide, j + wide + 1):
            row = row_of(a, b)
            if cells[row, LIVES] > 0.0 and cells[row, LOOSE] == 0.0:
                d_x, d_y = cells[row, POINT_X] - x, cells[row, POINT_Y] - y
                square = d_x * d_x + d_y * d_y
                if square < best:
                    best, found = square, row
    return found


@compiled_once
def is_body(tracks: Array, count: int, x: float, y: float) -> bool:
    """Return whether a point is near a track."""
    for k in range(count):
        if math.hypot(x - tracks[k, TRACK_X], y - tracks[k, TRACK_Y]) < BODY_CLEAR:
            return True
    return False


@compiled_once
def normal_equations(
    scan: Array,
    cells: Array,
    centre: tuple[int, int],
    robot: Pose,
    shift: Pose,
    reach: float,
    system: Array,
) -> int:
    """Write AᵀWA (6 numbers) and AᵀWb (3) of the matches; return their number.

    Args:
        scan: With echoes, and normals where they are to be matched.
        cells: Map.
        centre: Indices of its middle.
        robot: About which it turns.
        shift: Correction so far: d_x, d_y, turn.
        reach: m; matched points are nearer.
        system: (9,) written.
    """
    for k in range(9):
        system[k] = 0.0
    cos, sin = math.cos(shift[2]), math.sin(shift[2])
    used, stride = 0, 1 + scan.shape[0] // MOST_MATCHED
    for k in range(0, scan.shape[0], stride):
        one = scan[k]
        if not one[RANGE] < math.inf or (one[NORMAL_X] == 0.0 and one[NORMAL_Y] == 0.0):
            continue
        r_x, r_y = one[ECHO_X] - robot[0], one[ECHO_Y] - robot[1]
        r_x, r_y = cos * r_x - sin * r_y, sin * r_x + cos * r_y
        x, y = robot[0] + shift[0] + r_x, robot[1] + shift[1] + r_y
        n_x = cos * one[NORMAL_X] - sin * one[NORMAL_Y]
        n_y = sin * one[NORMAL_X] + cos * one[NORMAL_Y]
        row = nearest_point(cells, x, y, centre, reach)
        if row < 0:
            continue
        error = n_x * (cells[row, POINT_X] - x) + n_y * (cells[row, POINT_Y] - y)
        lever = n_y * r_x - n_x * r_y
        w = 1.0 / (1.0 + (error / ROBUST) ** 2)
        system[0] += w * n_x * n_x
        system[1] += w * n_x * n_y
        system[2] += w * n_x * lever
        system[3] += w * n_y * n_y
        system[4] += w * n_y * lever
        system[5] += w * lever * lever
        system[6] += w * n_x * error
        system[7] += w * n_y * error
        system[8] += w * lever * error
        used += 1
    return used


@compiled_once
def solve_step(system: Array, used: int, shift: Pose, way: float, turn: float) -> Pose:
    """Return the next part of the correction: d_x, d_y, turn."""
    xx, xy, xt = system[0], system[1], system[2]
    yy, yt, tt = system[3], system[4], system[5]
    prior = (ECHO_SIGMA / (WAY_SIGMA * way + WAY_FLOOR)) ** 2
    prior_turn = (ECHO_SIGMA / (TURN_SIGMA * math.sqrt(turn + way) + TURN_FLOOR)) ** 2
    # The two directions of the information about the position.
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    c, s = math.cos(angle), math.sin(angle)
    if mean + half < LITTLE * used:
        xx, xy, yy = xx + 1e3 * prior * c * c, xy + 1e3 * prior * c * s, yy + 1e3 * prior * s * s
    if mean - half < LITTLE * used:
        xx, xy, yy = xx + 1e3 * prior * s * s, xy - 1e3 * prior * c * s, yy + 1e3 * prior * c * c
    xx, yy, tt = xx + prior, yy + prior, tt + prior_turn
    b_x, b_y = system[6] - prior * shift[0], system[7] - prior * shift[1]
    b_t = system[8] - prior_turn * shift[2]
    # Gaussian elimination; the matrix is positive definite by the prior.
    yy, yt, b_y = yy - xy * xy / xx, yt - xy * xt / xx, b_y - xy * b_x / xx
    tt, b_t = tt - xt * xt / xx, b_t - xt * b_x / xx
    tt, b_t = tt - yt * yt / yy, b_t - yt * b_y / yy
    d_t = b_t / tt
    d_y = (b_y - yt * d_t) / yy
    d_x = (b_x - xy * d_y - xt * d_t) / xx
    return d_x, d_y, d_t


@compiled_once
def align(
    scan: Array,
    cells: Array,
    centre: tuple[int, int],
    robot: Pose,
    step: tuple[float, float],
    system: Array,
) -> Pose:
    """Return the correction d_x, d_y, turn about the robot; 0 where too little matches.

    Args:
        scan: As :func:`normal_equations`.
        cells: Map.
        centre: Indices of its middle.
        robot: Pose by the odometry and the correction so far, map frame.
        step: Distance (m) and turn (rad) since the last scan.
        system: (9,) workspace.
    """
    shift = (0.0, 0.0, 0.0)
    for k in range(ROUNDS):
        reach = FIRST_REACH if k < 2 else REACH
        used = normal_equations(scan, cells, centre, robot, shift, reach, system)
        if used < LEAST_MATCHED:
            return (0.0, 0.0, 0.0) if k == 0 else shift
        more = solve_step(system, used, shift, step[0], step[1])
        shift = (shift[0] + more[0], shift[1] + more[1], shift[2] + more[2])
        if abs(more[0]) + abs(more[1]) + abs(more[2]) < SMALL:
            break
    return shift
