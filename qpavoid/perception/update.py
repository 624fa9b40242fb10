"""One scan: alignment, echoes in ever-free space, tracks, and the map after it."""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once
from qpavoid.perception.alignment import align, is_body
from qpavoid.perception.local_map import (
    CELL,
    EVER,
    HALF,
    LIVES,
    LOOSE,
    POINT_X,
    POINT_Y,
    SIDE,
    WAY,
    cell_of,
    hit,
    roll,
    row_of,
    see_through,
    trace,
)
from qpavoid.perception.local_map import SEEN as POINT_SEEN
from qpavoid.perception.local_map import SCORE, clear_cell
from qpavoid.perception.scan import (
    ALONG_X,
    ALONG_Y,
    CLAIMED,
    ECHO_X,
    ECHO_Y,
    FROM_X,
    FROM_Y,
    NORMAL_X,
    NORMAL_Y,
    OPEN,
    ORDER,
    RANGE,
    WIDTH,
    Sensor,
    find_normals,
    find_segments,
    mark_open,
    place_echoes,
)
from qpavoid.perception.tracks import (
    CONFIRMED,
    PARTS,
    associate,
    beam_towards,
    begin_tracks,
    body_centre,
    claim,
    confirm,
    cover,
    drop_doubles,
    drop_tracks,
    mark_beside,
    measure,
    predict,
)
from qpavoid.model.kinematics import wrap_angle
from qpavoid.types import Array, Pose

(
    SCANS,  # taken so far
    TIME,  # s, of the last one
    FIX_X,  # correction of the odometry frame: p_map = R(γ) p_odometry + (x, y)
    FIX_Y,
    FIX_TURN,
    CENTRE_X,  # cell in the middle of the map
    CENTRE_Y,
    TRAVELLED,  # m driven
    LAST_X,  # odometry of the last scan
    LAST_Y,
    LAST_TURN,
    TRACK_COUNT,
    NAMED,  # tracks so far
) = range(13)
STATE_WIDTH = 13

MARGIN = 0.2
"""m before an echo that a beam does not free."""

THROUGH = 0.15
"""m by which a beam passes a remembered point that it sees through."""

LOOSE_TIME, OLD = 2.0, 20.0
"""s for which a point in ever-free space is remembered; times of the memory after which
a point is dropped in any case."""


class Memory(NamedTuple):
    """What is known from scan to scan, and the workspace of one.

    Attributes:
        state: (:data:`STATE_WIDTH`,).
        cells: (SIDE², CELL_WIDTH) local map.
        tracks: (MOST_TRACKS, TRACK_WIDTH).
        scan: (beams, SCAN_WIDTH).
        segments: (MOST_SEGMENTS, SEGMENT_WIDTH).
        centres: (MOST_SEGMENTS, 4).
        system: (9,).
    """

    state: Array
    cells: Array
    tracks: Array
    scan: Array
    segments: Array
    centres: Array
    system: Array


class Model(NamedTuple):
    """Settings, as compiled functions take them.

    Attributes:
        inner: m; the robot covers a disc of this radius about its axle's middle.
        radius: Of a person, m.
        acceleration: Of the Kalman filter, m/s².
        memory: s for which a static point out of view is remembered …
        memory_way: … or m that are driven, whichever is later.
    """

    inner: float
    radius: float
    acceleration: float
    memory: float
    memory_way: float


@compiled
def corrected(state: Array, pose: Pose) -> Pose:
    """Return a pose of the odometry in the map frame."""
    c, s = math.cos(state[FIX_TURN]), math.sin(state[FIX_TURN])
    x, y = c * pose[0] - s * pose[1], s * pose[0] + c * pose[1]
    return state[FIX_X] + x, state[FIX_Y] + y, state[FIX_TURN] + pose[2]


@compiled
def correct_by(state: Array, robot: Pose, shift: Pose) -> None:
    """Add a small motion about the robot to the correction."""
    c, s = math.cos(shift[2]), math.sin(shift[2])
    x, y = state[FIX_X] - robot[0], state[FIX_Y] - robot[1]
    state[FIX_X] = robot[0] + shift[0] + c * x - s * y
    state[FIX_Y] = robot[1] + shift[1] + s * x + c * y
    state[FIX_TURN] += shift[2]


@compiled_once
def perceive(
    memory: Memory, beams: Array, sensor: Sensor, model: Model, time: float, pose: Pose, motion: Pose
) -> int:
    """Take a scan, whose ranges are in ``memory.scan``; return the number of tracks.

    Args:
        memory: Changed.
        beams: As :func:`~qpavoid.perception.scan.place_echoes`.
        sensor: LiDAR.
        model: Settings.
        time: Of the scan, s.
        pose: Of the robot at share 0, by odometry.
        motion: Its change until share 1 (map axes are those of the odometry but for
            the correction, which is small).
    """
    state, cells, scan = memory.state, memory.cells, memory.scan
    first = state[SCANS] == 0.0
    dt = 0.1 if first else time - state[TIME]
    way = math.hypot(pose[0] - state[LAST_X], pose[1] - state[LAST_Y])
    turn = abs(wrap_angle(pose[2] - state[LAST_TURN]))
    robot = corrected(state, pose)
    echoes = place_echoes(scan, beams, sensor, robot, motion)
    if first:
        state[CENTRE_X], state[CENTRE_Y] = cell_of(robot[0]), cell_of(robot[1])
    else:
        state[TRAVELLED] += way
        robot = aligned(memory, sensor, robot, (way, turn))
        echoes = place_echoes(scan, beams, sensor, robot, motion)
    centre = follow(state, cells, robot)
    mark_open(scan, echoes, cells, centre, sensor)
    count = int(state[TRACK_COUNT])
    for a in range(count):
        predict(memory.tracks[a], dt, model.acceleration)
        memory.tracks[a, PARTS] = 0.0
    count = drop_doubles(memory.tracks, count)
    state[TRACK_COUNT] = count
    mark_beside(scan, echoes, memory.tracks, count)
    found = find_segments(scan, echoes, sensor, memory.segments)
    track(memory, echoes, found, model, time, dt)
    claim(
        scan, echoes, memory.tracks, int(state[TRACK_COUNT]), memory.centres, cells,
        centre, time, model.radius,
    )
    heading = robot[2] + sensor.mount[2]
    first_angle = heading + math.atan2(beams[0, 1], beams[0, 0])
    origin = (scan[0, FROM_X], scan[0, FROM_Y])
    count = drop_tracks(memory.tracks, int(state[TRACK_COUNT]), scan, origin, first_angle, sensor.step, time)
    named = state[NAMED]
    more = begin_tracks(memory.tracks, count, memory.segments, found, memory.centres, time, named)
    state[NAMED], state[TRACK_COUNT] = named + more - count, more
    state[SCANS] += 1.0
    enter(memory, sensor, model, echoes, centre, time, dt)
    forget(memory, sensor, model, origin, first_angle, time)
    state[TIME] = time
    state[LAST_X], state[LAST_Y], state[LAST_TURN] = pose
    return more


@compiled_once
def aligned(memory: Memory, sensor: Sensor, robot: Pose, step: tuple[float, float]) -> Pose:
    """Correct the odometry by a scan that is in the map frame; return the robot's pose."""
    state, scan = memory.state, memory.scan
    find_normals(scan, sensor)
    count = int(state[TRACK_COUNT])
    for k in range(scan.shape[0]):
        if is_body(memory.tracks, count, scan[k, ECHO_X], scan[k, ECHO_Y]):
            scan[k, NORMAL_X], scan[k, NORMAL_Y] = 0.0, 0.0
    centre = (int(state[CENTRE_X]), int(state[CENTRE_Y]))
    shift = align(scan, memory.cells, centre, robot, step, memory.system)
    correct_by(state, robot, shift)
    return robot[0] + shift[0], robot[1] + shift[1], robot[2] + shift[2]


@compiled_once
def follow(state: Array, cells: Array, robot: Pose) -> tuple[int, int]:
    """Move the map's middle to the robot; return the cell."""
    i, j = cell_of(robot[0]), cell_of(robot[1])
    old_i, old_j = int(state[CENTRE_X]), int(state[CENTRE_Y])
    if i != old_i:
        roll(cells, old_i, i, False)
    if j != old_j:
        roll(cells, old_j, j, True)
    state[CENTRE_X], state[CENTRE_Y] = i, j
    return i, j


@compiled_once
def track(memory: Memory, echoes: int, found: int, model: Model, time: float, dt: float) -> None:
    """Predict the tracks and correct them by the segments."""
    tracks, segments, centres = memory.tracks, memory.segments, memory.centres
    count, scan = int(memory.state[TRACK_COUNT]), memory.scan
    for b in range(found):
        width = segments[b, WIDTH]
        x, y, sigma = body_centre(scan, segments[b], b, echoes, width, model.radius)
        centres[b, 0], centres[b, 1], centres[b, 2] = x, y, sigma
    associate(tracks, count, segments, found, centres, dt)
    for a in range(count):
        if tracks[a, PARTS] > 0.0:
            total = measure(scan, echoes, segments, found, centres, tracks[a], a, model.radius, dt)
            confirm(tracks[a], total, memory.cells, time, dt)
            cover(scan, echoes, centres, tracks[a], a, model.radius)


@compiled_once
def enter(
    memory: Memory, sensor: Sensor, model: Model, echoes: int, centre: tuple[int, int], time: float, dt: float
) -> None:
    """Enter a scan into the map: echoes of no track, then what the beams see through.

    A beam frees no more than its neighbours, and stops short of its echo.
    """
    scan, cells, state = memory.scan, memory.cells, memory.state
    now = memory.system
    now[0], now[1], now[2], now[3] = state[SCANS], time, dt, state[TRAVELLED]
    n = scan.shape[0]
    for k in range(echoes):
        one = scan[int(scan[k, ORDER])]
        i, j = cell_of(one[ECHO_X]), cell_of(one[ECHO_Y])
        if abs(i - centre[0]) >= HALF or abs(j - centre[1]) >= HALF:
            continue
        cell = cells[row_of(i, j)]
        if one[CLAIMED] == 0.0:
            hit(cell, one[ECHO_X], one[ECHO_Y], one[OPEN] > 0.0, now)
    for k in range(echoes):
        one = scan[int(scan[k, ORDER])]
        i, j = cell_of(one[ECHO_X]), cell_of(one[ECHO_Y])
        if abs(i - centre[0]) >= HALF or abs(j - centre[1]) >= HALF:
            continue
        cell = cells[row_of(i, j)]
        if one[CLAIMED] > 0.0 and cell[10] != now[0]:
            cell[10], cell[LIVES], cell[SCORE] = now[0], 0.0, 0.0
    clear_robot(cells, centre, model.inner, now)
    for k in range(n):
        left = k - 1 if k > 0 else (n - 1 if sensor.round else 0)
        right = k + 1 if k + 1 < n else (0 if sensor.round else n - 1)
        length = min(
            free_length(scan[k, RANGE], sensor),
            min(free_length(scan[left, RANGE], sensor), free_length(scan[right, RANGE], sensor)),
        )
        if length > MARGIN:
            one = scan[k]
            trace(
                cells, (one[FROM_X], one[FROM_Y]), (one[ALONG_X], one[ALONG_Y]),
                length - MARGIN, centre, now,
            )


@compiled_once
def clear_robot(cells: Array, centre: tuple[int, int], inner: float, now: Array) -> None:
    """Enter that there is nothing but the robot where it is."""
    wide = int(inner / CELL)
    for i in range(-wide, wide + 1):
        for j in range(-wide, wide + 1):
            if (i * i + j * j) * CELL * CELL <= inner * inner:
                cell = cells[row_of(centre[0] + i, centre[1] + j)]
                cell[SCORE], cell[LIVES] = 0.0, 0.0
                see_through(cell, now)


@compiled
def free_length(r: float, sensor: Sensor) -> float:
    """Return how far a beam is free, m: not at all where the range is unknown."""
    return min(r, sensor.range_max) if r > 0.0 else 0.0


@compiled_once
def forget(
    memory: Memory, sensor: Sensor, model: Model, origin: tuple[float, float], first_angle: float, time: float
) -> None:
    """Drop remembered points that are old, far, or seen through."""
    cells, scan, way = memory.cells, memory.scan, memory.state[TRAVELLED]
    for row in range(cells.shape[0]):
        cell = cells[row]
        if cell[LIVES] <= 0.0 or cell[POINT_SEEN] >= time:
            continue
        age, driven = time - cell[POINT_SEEN], way - cell[WAY]
        old = age > model.memory and driven > model.memory_way
        if old or age > OLD * model.memory or (cell[LOOSE] > 0.0 and age > LOOSE_TIME):
            cell[LIVES] = 0.0
            continue
        x, y = cell[POINT_X] - origin[0], cell[POINT_Y] - origin[1]
        beam = beam_towards(x, y, scan, first_angle, sensor.step)
        r = scan[beam, RANGE] if beam >= 0 else math.nan
        if r > math.hypot(x, y) + THROUGH:
            at_once = cell[LOOSE] > 0.0 or cell[EVER] > 0.0
            cell[LIVES] = 0.0 if at_once else cell[LIVES] - 1.0
