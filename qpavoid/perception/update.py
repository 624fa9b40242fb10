"""A scan: alignment, bodies in ever-free space, their tracks, and the map after it.

The order matters: echoes are compared with the map before they are entered into it, and
those of confirmed tracks are entered neither as hits nor as free, else a person who
stands becomes furniture and leaves a trail.
"""

import math
from typing import Annotated, NamedTuple

from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.capsules import CAPSULE_WIDTH, Rigid, Segment, set_capsule
from qpavoid.model.contact import point_contact
from qpavoid.model.kinematics import wrap_angle
from qpavoid.perception.alignment import SYSTEM, align, drop_bodies
from qpavoid.perception.local_map import (
    CELL_SIZE,
    CELL_STATE,
    SIDE,
    Cell,
    Moment,
    cell_of,
    clear_map,
    clear_robot,
    hit,
    holds,
    occupy,
    roll,
    row_of,
    trace,
    was_hit,
)
from qpavoid.perception.scan import (
    BEAM_WIDTH,
    RAY,
    RAY_SIZE,
    Sensor,
    find_normals,
    judge_no_echo,
    mark_open,
    place_echoes,
    sees_through,
)
from qpavoid.perception.segments import (
    GROUP,
    GROUP_SIZE,
    MOST_SEGMENTS,
    View,
    find_segments,
)
from qpavoid.perception.tracks import (
    FOLLOWED,
    MOST_TRACKS,
    TRACK_SIZE,
    associate,
    begin_tracks,
    claim,
    claim_around,
    confirm,
    drop_doubles,
    drop_lost,
    find_centre,
    mark_beside,
    measure,
    predict,
)
from qpavoid.types import (
    Array,
    Edges,
    Matrix,
    MatrixWritten,
    Pose,
    Row,
    Sizes,
    Table,
    VectorWritten,
    layout,
)


class MapState(NamedTuple):
    """State of perception besides map and tracks.

    Attributes:
        time: s, of the last scan.
        fix_x: Correction of the odometry: p_map = R(γ) p_odometry + (x, y), m.
        fix_y: Of it, m.
        fix_turn: Its γ, rad.
        driven: m.
        last_x: Odometry at the last scan, m.
        last_y: Of it, m.
        last_turn: Of it, rad.
        scans: Taken so far.
        middle_i: Cell in the middle of the map.
        middle_j: Of it.
        tracks: Number of tracks.
        names: Tracks named so far.
    """

    time: float
    fix_x: float
    fix_y: float
    fix_turn: float
    driven: float
    last_x: float
    last_y: float
    last_turn: float
    scans: int
    middle_i: int
    middle_j: int
    tracks: int
    names: int


MAP_STATE = layout(MapState)
STATE_SIZE = MAP_STATE.itemsize // 8
"""Layout of the state, and its numbers of memory."""

FIRST_DT = 0.1
"""s; stands for the time before the first scan."""

ECHO_MARGIN = 0.2
"""m before its echo that a beam does not free."""

POINT_PASSED = 0.15
"""m by which a beam passes a point that it sees through."""

LOOSE_TIME, OLD = 2.0, 20.0
"""s for which a point in ever-free space is remembered; times of the memory after which
a point is dropped in any case."""


class Memory(NamedTuple):
    """State from scan to scan, and workspace.

    Attributes:
        state: Of :data:`MAP_STATE`.
        cells: SIDE² of :data:`~qpavoid.perception.local_map.CELL_STATE`.
        tracks: MOST_TRACKS of :data:`~qpavoid.perception.tracks.FOLLOWED`.
        segments: MOST_SEGMENTS of :data:`~qpavoid.perception.segments.GROUP`.
        system: (SYSTEM,).
    """

    state: Annotated[VectorWritten, Sizes(STATE_SIZE)]
    cells: Annotated[VectorWritten, Sizes(SIDE * SIDE * CELL_SIZE)]
    tracks: Annotated[VectorWritten, Sizes(MOST_TRACKS * TRACK_SIZE)]
    segments: Annotated[VectorWritten, Sizes(MOST_SEGMENTS * GROUP_SIZE)]
    system: Annotated[VectorWritten, Sizes(SYSTEM)]


class Scan(NamedTuple):
    """A scan as it is given.

    Attributes:
        rows: n of :data:`~qpavoid.perception.scan.RAY`, with the ranges.
        beams: (n, BEAM_WIDTH).
        sensor: LiDAR.
        counts: (2,) of :func:`~qpavoid.perception.scan.judge_no_echo`.
        time: s.
        pose: Of the robot at share 0 of the scan, by odometry.
        motion: Its change until share 1: m, m, rad.
    """

    rows: Annotated[VectorWritten, Sizes(RAY_SIZE)]
    beams: Annotated[Matrix, Sizes(1, BEAM_WIDTH)]
    sensor: Sensor
    counts: Annotated[VectorWritten, Sizes(2)]
    time: float
    pose: Pose
    motion: Pose


class Model(NamedTuple):
    """Settings, as compiled functions take them.

    Attributes:
        inner: m; nothing but the robot is so near to its axle's middle.
        radius: Of a person, m.
        acceleration: Of bodies, m/s².
        memory: s for which a point out of view is remembered …
        memory_way: … or m driven, whichever is later.
    """

    inner: float
    radius: float
    acceleration: float
    memory: float
    memory_way: float


@entry
@compiled
def corrected(memory: Annotated[VectorWritten, Sizes(STATE_SIZE)], pose: Pose) -> Pose:
    """Return a pose by odometry in the map frame; ``memory``: the state."""
    state = memory.view(MAP_STATE)[0]
    c, s = math.cos(state.fix_turn), math.sin(state.fix_turn)
    x, y = c * pose[0] - s * pose[1], s * pose[0] + c * pose[1]
    return state.fix_x + x, state.fix_y + y, state.fix_turn + pose[2]


@compiled
def correct_by(state: Row, robot: Pose, shift: Pose) -> None:
    """Add a motion about the robot to the correction of the odometry."""
    c, s = math.cos(shift[2]), math.sin(shift[2])
    x, y = state.fix_x - robot[0], state.fix_y - robot[1]
    state.fix_x = robot[0] + shift[0] + c * x - s * y
    state.fix_y = robot[1] + shift[1] + s * x + c * y
    state.fix_turn += shift[2]


@entry
@compiled_once
def _is_scan(memory: Memory, scan: Scan, model: Model) -> bool:
    """Return whether the rows fit the beams, the state is valid and time goes on."""
    state, n = memory.state.view(MAP_STATE)[0], scan.beams.shape[0]
    valid = 0 <= state.tracks <= MOST_TRACKS and state.scans >= 0
    later = state.scans == 0 or scan.time >= state.time
    small = abs(state.middle_i) < 1e9 and abs(state.middle_j) < 1e9
    near = abs(scan.pose[0]) < 1e7 and abs(scan.pose[1]) < 1e7
    fits = scan.rows.shape[0] == n * RAY_SIZE and scan.sensor.step > 0.0
    usable: bool = valid and later and small and near and fits and model.radius > 0.0
    return usable


@entry_if(_is_scan)
@compiled_once
def perceive(memory: Memory, scan: Scan, model: Model) -> int:
    """Take a scan; return the number of tracks.

    Args:
        memory: Zeros at first; changed.
        scan: Not older than the one before, of any of the robot's sensors.
        model: Settings.
    """
    state, cells = memory.state.view(MAP_STATE)[0], memory.cells.view(CELL_STATE)
    rows = scan.rows.view(RAY)
    first = state.scans == 0
    if first:
        clear_map(cells)
        state.last_x, state.last_y, state.last_turn = scan.pose
    robot = corrected(memory.state, scan.pose)
    if first:
        state.middle_i, state.middle_j = cell_of(robot[0]), cell_of(robot[1])
    judge_no_echo(rows, scan.sensor, scan.counts)
    c, s = math.cos(state.fix_turn), math.sin(state.fix_turn)
    m_x, m_y = scan.motion[0], scan.motion[1]
    motion = (c * m_x - s * m_y, s * m_x + c * m_y, scan.motion[2])
    echoes = place_echoes(rows, scan.beams, scan.sensor, robot, motion)
    robot = aligned_pose(memory, scan, robot)
    centre = follow(state, cells, robot)
    dt = FIRST_DT if first else scan.time - state.time
    now = Moment(state.scans, scan.time, dt, state.driven)
    mark_open(rows, echoes, cells, centre, scan.sensor.angle_error)
    view = View(rows, echoes, scan.sensor)
    track(memory, view, centre, now, model)
    enter_scan(view, cells, centre, now, model.inner)
    forget(view, cells, now, model)
    state.scans += 1
    state.time = scan.time
    state.last_x, state.last_y, state.last_turn = scan.pose
    return int(state.tracks)


@compiled_once
def aligned_pose(memory: Memory, scan: Scan, robot: Pose) -> Pose:
    """Move the scan onto the map; return the corrected pose of the robot."""
    state, pose = memory.state.view(MAP_STATE)[0], scan.pose
    rows, cells = scan.rows.view(RAY), memory.cells.view(CELL_STATE)
    way = math.hypot(pose[0] - state.last_x, pose[1] - state.last_y)
    turn = abs(wrap_angle(pose[2] - state.last_turn))
    state.driven += way
    find_normals(rows, scan.sensor)
    drop_bodies(rows, memory.tracks.view(FOLLOWED), state.tracks)
    centre = (state.middle_i, state.middle_j)
    shift = align(rows, cells, centre, robot, (way, turn), memory.system)
    correct_by(state, robot, shift)
    return robot[0] + shift[0], robot[1] + shift[1], robot[2] + shift[2]


@compiled_once
def follow(state: Row, cells: Table, robot: Pose) -> Cell:
    """Move the middle of the map to the robot; return its cell."""
    i, j = cell_of(robot[0]), cell_of(robot[1])
    old_i, old_j = state.middle_i, state.middle_j
    if i != old_i:
        roll(cells, old_i, i, False)
    if j != old_j:
        roll(cells, old_j, j, True)
    state.middle_i, state.middle_j = i, j
    return i, j


@compiled_once
def track(memory: Memory, view: View, centre: Cell, now: Moment, model: Model) -> None:
    """Bring the tracks up to a scan, and mark the echoes of confirmed ones."""
    state, cells = memory.state.view(MAP_STATE)[0], memory.cells.view(CELL_STATE)
    tracks, segments = memory.tracks.view(FOLLOWED), memory.segments.view(GROUP)
    count = state.tracks
    for a in range(count):
        predict(tracks[a], now.dt, model.acceleration)
    count = drop_doubles(tracks, count)
    mark_beside(view, tracks, count)
    found = find_segments(view, segments)
    for b in range(found):
        find_centre(view, segments[b], b, segments[b].extent, model.radius)
    associate(tracks, count, segments, found, now.dt)
    for a in range(count):
        if tracks[a].parts > 0:
            seen = measure(view, segments, found, tracks[a], a, model.radius)
            confirm(tracks[a], seen[0], seen[1], cells, now)
    claim(view, segments, tracks, count, model.radius)
    claim_around(view, tracks, count, cells, centre, now.time)
    count = drop_lost(view, tracks, count, now.time)
    state.tracks = begin_tracks(tracks, count, segments, found, now.time)
    for a in range(count, state.tracks):
        tracks[a].name = state.names
        state.names += 1


@compiled_once
def enter_scan(
    view: View, cells: Table, centre: Cell, now: Moment, inner: float
) -> None:
    """Enter a scan into the map: echoes first, then what its beams see through.

    A beam frees no more than its neighbours do, and stops short of its echo.
    """
    rows, sensor = view.scan, view.sensor
    for claimed in range(2):
        for k in range(view.echoes):
            one = rows[rows[k].echo]
            i, j = cell_of(one.x), cell_of(one.y)
            if one.claimed != claimed or not holds(centre, i, j, 0):
                continue
            if claimed == 0:
                opened = one.open > 0
                hit(cells[row_of(i, j)], one.x, one.y, opened, now)
            else:
                occupy(cells[row_of(i, j)], now)
    clear_robot(cells, centre, inner, now)
    n = rows.shape[0]
    for k in range(n):
        ends = sensor.round == 0.0
        left = k if ends and k == 0 else (k - 1) % n
        right = k if ends and k == n - 1 else (k + 1) % n
        free = min(free_length(rows[left], sensor), free_length(rows[right], sensor))
        free = min(free, free_length(rows[k], sensor)) - ECHO_MARGIN
        if free > 0.0:
            trace(cells, rows[k], free, centre, now)


@compiled
def free_length(one: Row, sensor: Sensor) -> float:
    """Return how far a beam is free, m: not at all where its range is unknown."""
    return min(one.range, sensor.range_max) if one.range > 0.0 else 0.0


@compiled_once
def forget(view: View, cells: Table, now: Moment, model: Model) -> None:
    """Drop points out of view that are old, and those that the scan sees through."""
    for row in range(cells.shape[0]):
        cell = cells[row]
        if cell.lives <= 0 or was_hit(cell, now.time, now.number):
            continue
        age, way = now.time - cell.hit_time, now.way - cell.hit_way
        old = age > model.memory and way > model.memory_way
        loose = cell.loose > 0
        if old or age > OLD * model.memory or (loose and age > LOOSE_TIME):
            cell.lives = 0
        elif sees_through(view.scan, view.sensor, cell.x, cell.y, POINT_PASSED):
            at_once = loose or cell.ever_free > 0
            cell.lives = 0 if at_once else cell.lives - 1


class Found(NamedTuple):
    """Where obstacles are written, robot frame.

    Attributes:
        points: (n, 2) x, y, m.
        capsules: (m, CAPSULE_WIDTH) discs that move.
    """

    points: Annotated[MatrixWritten, Sizes(0, 2)]
    capsules: Annotated[MatrixWritten, Sizes(0, CAPSULE_WIDTH)]


@entry
@compiled_once
def _holds_found(
    memory: Memory, scan: Scan, edges: Edges, pose: Pose, time: float, found: Found
) -> bool:
    """Return whether the state is valid and all that is written has a row."""
    state, n = memory.state.view(MAP_STATE)[0], scan.beams.shape[0]
    count = n + SIDE * SIDE
    valid = 0 <= state.tracks <= MOST_TRACKS
    fits = found.points.shape[0] >= count and found.capsules.shape[0] >= MOST_TRACKS
    holds_all: bool = valid and fits and scan.rows.shape[0] == n * RAY_SIZE
    return holds_all


@entry_if(_holds_found)
@compiled_once
def obstacles_at(
    memory: Memory, scan: Scan, edges: Edges, pose: Pose, time: float, found: Found
) -> tuple[int, int]:
    """Write the obstacles in the robot frame; return the numbers of points and discs.

    Args:
        memory: After :func:`perceive`.
        scan: The last one.
        edges: Footprint; points in it are the robot's, and dropped.
        pose: Of the robot at ``time``, by odometry.
        time: s, to which moving obstacles are predicted.
        found: Written.
    """
    state, cells = memory.state.view(MAP_STATE)[0], memory.cells.view(CELL_STATE)
    rows, tracks = scan.rows.view(RAY), memory.tracks.view(FOLLOWED)
    robot, points, count = corrected(memory.state, pose), found.points, 0
    for k in range(rows.shape[0]):
        one = rows[k]
        if one.range < math.inf and one.claimed == 0:
            count = add_point(points, count, robot, edges, one.x, one.y)
    for row in range(cells.shape[0]):
        cell = cells[row]
        if cell.lives > 0 and not was_hit(cell, state.time, state.scans - 1):
            known = count
            count = add_point(points, count, robot, edges, cell.x, cell.y)
            if count == known:
                cell.lives = 0
    discs = 0
    c, s = math.cos(robot[2]), math.sin(robot[2])
    for a in range(state.tracks):
        t = tracks[a]
        if t.confirmed > 0:
            ahead = time - state.time
            w_x, w_y = t.v_x, t.v_y
            d_x = t.x + ahead * w_x - robot[0]
            d_y = t.y + ahead * w_y - robot[1]
            x, y = c * d_x + s * d_y, c * d_y - s * d_x
            v_x, v_y = c * w_x + s * w_y, c * w_y - s * w_x
            body = Rigid(
                t.cover, v_x, v_y, 0.0, (x, y), count + discs, math.sqrt(t.p_vv)
            )
            set_capsule(found.capsules, discs, Segment(x, y, x, y), body)
            discs += 1
    return count, discs


@compiled
def add_point(
    points: Array, count: int, robot: Pose, edges: Edges, x: float, y: float
) -> int:
    """Write a point of the map in the robot frame unless it lies in the footprint."""
    c, s = math.cos(robot[2]), math.sin(robot[2])
    d_x, d_y = x - robot[0], y - robot[1]
    p_x, p_y = c * d_x + s * d_y, c * d_y - s * d_x
    if point_contact(edges, p_x, p_y).distance <= 0.0:
        return count
    points[count, 0], points[count, 1] = p_x, p_y
    return count + 1
