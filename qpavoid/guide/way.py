"""A way round what is near: hybrid A* of the oriented footprint on a local grid.

Everything is in the robot frame of the moment of planning. The search [Dolgov2010]
expands short arcs from the robot's very pose, keeps the best one per grid cell and
heading, and is guided by the geodesic distance of the axle to the target.
"""

import math
from heapq import heappop, heappush

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import allocating
from qpavoid.guide.room import AMPLE, FINE, pose_room
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc, wrap_angle

CELL = 2 * FINE
"""m; pitch of the grid of places that the search tells apart."""

HEADINGS = 24
TURN = 2.0 * math.pi / HEADINGS
STEP = 0.2
"""m; length of one arc."""

FORWARDS = tuple((1.0, turn) for turn in (0.0, 1.0, -1.0, 2.0, -2.0))
ON_THE_SPOT = ((0.0, 1.0), (0.0, -1.0))
BACKWARDS = tuple((-1.0, turn) for turn in (0.0, 1.0, -1.0))
ACTIONS = np.array(FORWARDS + ON_THE_SPOT + BACKWARDS)
"""Arcs as multiples of STEP and TURN; those backwards stand last."""

MOST_ACTIONS = 120
MOST_NODES = 20_000
"""With that many arcs without a way the search gives up."""

TURN_COST, CHANGE_COST = 0.08, 0.4
"""m that one TURN, and a change between forwards and backwards, cost."""

NEAR_COST, REVERSE_COST = 1.5, 2.0
"""Greatest share added for driving near obstacles; factor for backing up."""

TIGHT_COST = 5.0
"""The same share for the geodesic: what is tight for the axle may not let a turn."""

GREED = 2.0
"""Weight of the distance that remains: ways a little longer, found much sooner."""

LEAVING = 0.8
"""m of cost within which a robot that stands too near may lose a little room more."""

CLOSE, ALIGNED = 0.2, 1.5 * TURN
"""m and rad from the target at which a way ends."""


@allocating
def geodesic(field: Array, half: float, least: float, x: float, y: float) -> Array:
    """Return the distance (n, n), m, from the grid's nodes to (x, y) by passable ones.

    Dijkstra over eight neighbours; passable is where the room is ``least`` or more. To
    a target beyond the grid the way leads over its edge, and straight on.
    """
    n = (field.shape[0] + 1) // 2
    cost = np.full((n, n), math.inf)
    queue = [(0.0, 0, 0)]
    queue.pop()
    if max(abs(x), abs(y)) <= half:
        i, j = round((x + half) / CELL), round((y + half) / CELL)
        cost[i, j] = 0.0
        queue.append((0.0, i, j))
    else:
        for k in range(n):
            for i, j in ((k, 0), (k, n - 1), (0, k), (n - 1, k)):
                d_x, d_y = i * CELL - half - x, j * CELL - half - y
                cost[i, j] = math.sqrt(d_x * d_x + d_y * d_y)
                heappush(queue, (cost[i, j], i, j))
    while len(queue) > 0:
        known, i, j = heappop(queue)
        if known > cost[i, j]:
            continue
        for d_i in range(-1, 2):
            for d_j in range(-1, 2):
                k, m = i + d_i, j + d_j
                if not (0 <= k < n and 0 <= m < n) or field[2 * k, 2 * m] < least:
                    continue
                tight = 1.0 - min((field[2 * k, 2 * m] - least) / AMPLE, 1.0)
                step = CELL * math.sqrt(d_i * d_i + d_j * d_j)
                longer = known + step * (1.0 + TIGHT_COST * tight * tight)
                if longer < cost[k, m]:
                    cost[k, m] = longer
                    heappush(queue, (longer, k, m))
    return cost


@allocating
def find_way(
    field: Array,
    half: float,
    body: Array,
    inner: float,
    reverse: bool,
    clearance: float,
    loss: float,
    x: float,
    y: float,
    heading: float,
    turned: bool,
    way: Array,
) -> int:
    """Return the number of actions of a way from the robot to (x, y).

    0 says that none was found, −1 that there is none, not even for the axle alone.
    It ends near the target, or where it leaves the grid on the way to one beyond.

    Args:
        field: Room, from :func:`room_field`, at least to inner + AMPLE.
        half: Half the side of its grid, m.
        body: Points of the footprint, from :func:`outline`.
        inner: From :func:`inner_radius`, m.
        reverse: Whether the robot can back up.
        clearance: Room, m, that every pose keeps; with less it may only be left.
        loss: Room, m, that may be lost first when leaving; negative: must be gained.
        x: Target in the robot frame, m.
        y: The same.
        heading: Target's heading less the robot's, rad.
        turned: Whether the way must end with that heading.
        way: (MOST_ACTIONS,) filled with the numbers of the actions.
    """
    remaining = geodesic(field, half, inner + clearance - 0.75 * CELL, x, y)
    beyond = max(abs(x), abs(y)) > half
    n = remaining.shape[0]
    middle = n // 2
    if remaining[middle, middle] == math.inf:
        return -1
    best = np.full((n, n, HEADINGS), np.float32(math.inf), dtype=np.float32)
    nodes = np.zeros((MOST_NODES, 5))  # x, y, cost so far, room, direction
    links = np.full((MOST_NODES, 3), -1, dtype=np.int64)  # heading, parent, action
    nodes[0, 3] = pose_room(field, half, body, 0.0, 0.0, 0.0)
    links[0, 0] = 0
    best[middle, middle, 0] = 0.0
    queue = [(remaining[middle, middle], 0)]
    count, kinds = 1, len(ACTIONS) if reverse else len(ACTIONS) - len(BACKWARDS)
    while len(queue) > 0 and count < MOST_NODES - kinds:
        _, parent = heappop(queue)
        p_x, p_y, cost, room, _ = nodes[parent]
        i, j, k = _bin(half, p_x, p_y, links[parent, 0])
        if cost > best[i, j, k] + 1e-5:
            continue
        off = abs(wrap_angle(heading - k * TURN)) if turned else 0.0
        near = math.sqrt((p_x - x) ** 2 + (p_y - y) ** 2) <= CLOSE and off <= ALIGNED
        inside = 0 < i < n - 1 and 0 < j < n - 1
        if parent > 0 and (near or (beyond and not inside)):
            return _trace(links, parent, way)
        floor = room - 0.15 * loss
        if cost < LEAVING:
            floor = min(floor, nodes[0, 3] - loss)
        for action in range(kinds):
            child = nodes[count]
            k = _drive(
                field, half, body, nodes[parent], links[parent, 0], action, child
            )
            i, j, k = _bin(half, child[0], child[1], k)
            if not (0 <= i < n and 0 <= j < n) or remaining[i, j] == math.inf:
                continue
            if child[3] < min(clearance, floor) or child[2] >= best[i, j, k] - 1e-5:
                continue
            best[i, j, k] = child[2]
            links[count] = (k, parent, action)
            heappush(queue, (child[2] + GREED * remaining[i, j], count))
            count += 1
    return 0


@allocating
def _bin(half: float, x: float, y: float, heading: int) -> tuple[int, int, int]:
    """Return the cell and heading that tell places apart."""
    return round((x + half) / CELL), round((y + half) / CELL), heading % HEADINGS


@allocating
def _drive(
    field: Array,
    half: float,
    body: Array,
    parent: Array,
    heading: int,
    action: int,
    child: Array,
) -> int:
    """Fill in the node that an action leads to; return its heading in TURNs."""
    drive, turn = ACTIONS[action]
    start, length, bend = heading * TURN, drive * STEP, turn * TURN
    m_x, m_y, middle = arc(parent[0], parent[1], start, length, bend, 0.5)
    x, y, end = arc(parent[0], parent[1], start, length, bend, 1.0)
    room = min(
        pose_room(field, half, body, m_x, m_y, middle),
        pose_room(field, half, body, x, y, end),
    )
    child[0], child[1], child[3] = x, y, room
    child[2] = parent[2] + _cost(drive, turn, parent[4], room)
    child[4] = drive if drive != 0.0 else parent[4]
    return heading + int(turn)


@allocating
def _cost(drive: float, turn: float, direction: float, room: float) -> float:
    """Return the cost of one action, m."""
    cost = TURN_COST * abs(turn)
    if drive != 0.0:
        near = 1.0 - max(min(room, AMPLE), 0.0) / AMPLE
        cost += STEP * (1.0 + NEAR_COST * near * near)
    if drive < 0.0:
        cost *= REVERSE_COST
    if drive * direction < 0.0:
        cost += CHANGE_COST
    return cost


@allocating
def _trace(links: npt.NDArray[np.int64], node: int, way: Array) -> int:
    """Write the actions that lead to a node, first to last; return their number."""
    count, step = 0, node
    while links[step, 1] >= 0:
        count += 1
        step = links[step, 1]
    place = count
    while links[node, 1] >= 0:
        place -= 1
        if place < way.shape[0]:
            way[place] = links[node, 2]
        node = links[node, 1]
    return int(min(count, way.shape[0]))
