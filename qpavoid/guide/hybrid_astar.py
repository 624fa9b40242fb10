"""Hybrid A* of the oriented footprint on a local grid.

In the robot frame at the time of planning. The search [Dolgov2010] expands short arcs
from the robot's exact pose, keeps the best one per grid cell and heading, and uses the
geodesic distance of the axle to the target as heuristic.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.guide.local_grid import AMPLE, CELL, Field, grid_size, pose_room
from qpavoid.model.capsules import Segment, axis_of
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.types import Array, Pose

HEADINGS = 24
TURN = 2.0 * math.pi / HEADINGS
ARC_LENGTH = 0.2
"""m; length of one arc."""

AHEAD_ARCS = tuple((1.0, turn) for turn in (0.0, 1.0, -1.0, 2.0, -2.0))
ON_THE_SPOT = ((0.0, 1.0), (0.0, -1.0))
BACK_ARCS = tuple((-1.0, turn) for turn in (0.0, 1.0, -1.0))
ACTIONS = AHEAD_ARCS + ON_THE_SPOT + BACK_ARCS
"""Arcs as multiples of ARC_LENGTH and TURN; backward ones last."""

MOST_ACTIONS = 120
MOST_NODES = 20_000
"""Number of arcs after which the search fails."""

TURN_COST, CHANGE_COST = 0.08, 0.4
"""m; cost of one TURN, and of a change between forwards and backwards."""

NEAR_COST, REVERSE_COST = 1.5, 2.0
"""Greatest relative cost added near obstacles; factor for reversing."""

GREED, GREED_OUTSIDE = 2.0, 5.0
"""Weights of the heuristic: slightly longer paths, found much sooner. The second one is
for an axle outside of the footprint, whose distances lead through walls."""

CLOSE, ALIGNED = 0.2, 1.5 * TURN
"""m and rad from the target at which a path ends."""

SAME_COST = 1e-5
"""m; tolerance of equal costs."""

TIGHT_COST = 5.0
"""Greatest relative cost added for small margins, which may not allow a turn."""


class Search(NamedTuple):
    """Problem of a search.

    Attributes:
        inner: From :attr:`qpavoid.model.footprint.Footprint.inner_radius`, m.
        reverse: Whether the robot can drive backwards.
        clearance: Required margin, m; poses with less may only be left.
        target: Robot frame, m, m, rad.
        turned: Whether the path must end with that heading.
        walls: Capsules, robot frame, for detours outside the grid.
    """

    inner: float
    reverse: bool
    clearance: float
    target: Pose
    turned: bool
    walls: Array


class Tree(NamedTuple):
    """Search tree of hybrid A*, and its memory.

    Attributes:
        nodes: (:data:`MOST_NODES`, NODE) x, y, cost so far, margin (m), direction;
            heading in TURNs, wrapped, parent, action.
        best: (n², HEADINGS) least cost so far of every cell, row by row.
        remaining: (n, n) from :func:`geodesic`, m.
        heap: Open list.
    """

    nodes: Array
    best: Array
    remaining: Array
    heap: Array


NODE = 8
"""Columns of a node."""


HEAP_WIDTH = 2
"""Columns of a binary heap, the open list of a search: cost and number."""


@compiled
def is_before(heap: Array, one: int, other: int) -> bool:
    """Return whether a row of a heap is before another one, as tuples are ordered."""
    if heap[one, 0] != heap[other, 0]:
        return bool(heap[one, 0] < heap[other, 0])
    return bool(heap[one, 1] < heap[other, 1])


@compiled
def swap(heap: Array, one: int, other: int) -> None:
    """Exchange two rows of a heap."""
    cost, number = heap[one, 0], heap[one, 1]
    heap[one, 0], heap[one, 1] = heap[other, 0], heap[other, 1]
    heap[other, 0], heap[other, 1] = cost, number


@compiled_once
def push(heap: Array, count: int, cost: float, number: int) -> int:
    """Add an entry to ``count`` entries; return their new number."""
    heap[count, 0], heap[count, 1], row = cost, number, count
    while row > 0 and is_before(heap, row, (row - 1) // 2):
        swap(heap, row, (row - 1) // 2)
        row = (row - 1) // 2
    return count + 1


@compiled_once
def drop_first(heap: Array, count: int) -> int:
    """Remove the first of ``count`` entries; return their new number."""
    count, row, below = count - 1, 0, 1
    swap(heap, 0, count)
    while below < count:
        if below + 1 < count and is_before(heap, below + 1, below):
            below += 1
        if not is_before(heap, below, row):
            break
        swap(heap, row, below)
        row, below = below, 2 * below + 1
    return count


@compiled
def cells_of(half: float) -> int:
    """Return the number of cells per side of the grid."""
    return (grid_size(half) + 1) // 2


@compiled_once
def most_waiting(half: float) -> int:
    """Return the greatest size of the open list: each cell has eight neighbours."""
    n = cells_of(half)
    return max(8 * n * n + 4 * n, MOST_NODES)


@entry
@compiled_once
def search_size(half: float) -> int:
    """Return the size of the memory of a search, in numbers."""
    fine, cells = grid_size(half), cells_of(half)
    size = fine * fine + cells * cells * (HEADINGS + 1)
    return size + MOST_NODES * NODE + most_waiting(half) * HEAP_WIDTH


@compiled_once
def field_in(memory: Array, half: float, body: Array) -> Field:
    """Return the field, not filled in, at the start of a search's memory."""
    n = grid_size(half)
    return Field(memory[: n * n].reshape(n, n), half, body)


@compiled_once
def tree_in(memory: Array, half: float) -> Tree:
    """Return the tree, not filled in, behind the field in a search's memory."""
    n, cells, waiting = grid_size(half), cells_of(half), most_waiting(half)
    a = n * n
    b = a + MOST_NODES * NODE
    c = b + cells * cells * HEADINGS
    d = c + cells * cells
    e = d + waiting * HEAP_WIDTH
    return Tree(
        memory[a:b].reshape(MOST_NODES, NODE),
        memory[b:c].reshape(cells * cells, HEADINGS),
        memory[c:d].reshape(cells, cells),
        memory[d:e].reshape(waiting, HEAP_WIDTH),
    )


@compiled
def _cross(wall: Segment, x: float, y: float) -> float:
    """Return a number whose sign is the side of a wall's line on which (x, y) is."""
    d_x, d_y = wall.x2 - wall.x1, wall.y2 - wall.y1
    return d_x * (y - wall.y1) - d_y * (x - wall.x1)


@compiled
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@compiled_once
def way_beyond(walls: Array, way: Segment) -> float:
    """Return a lower bound of the path length from one end of a way to the other, m.

    Straight, or around the nearer end of the worst wall alone.
    """
    x, y, goal_x, goal_y = way
    least = _length(goal_x - x, goal_y - y)
    for i in range(walls.shape[0]):
        wall = axis_of(walls, i)
        apart = _cross(wall, x, y) * _cross(wall, goal_x, goal_y)
        beside = _cross(way, wall.x1, wall.y1) * _cross(way, wall.x2, wall.y2)
        if apart < 0.0 and beside < 0.0:
            first = _length(wall.x1 - x, wall.y1 - y)
            first += _length(goal_x - wall.x1, goal_y - wall.y1)
            second = _length(wall.x2 - x, wall.y2 - y)
            second += _length(goal_x - wall.x2, goal_y - wall.y2)
            least = max(least, min(first, second))
    return least


@compiled_once
def geodesic(field: Field, search: Search, cost: Array, heap: Array) -> None:
    """Fill in the distance, m, from the grid's cells to the target through free ones.

    Dijkstra over eight neighbours; free cells have margin for the axle, whatever the
    heading. Paths to a target outside the grid cross its border, and continue around
    the walls.

    Args:
        field: Margins.
        search: The problem.
        cost: (n, n) filled in.
        heap: Memory for the open cells.
    """
    nodes, half, n, count = field.nodes, field.half, cost.shape[0], 0
    least, (x, y, _) = search.inner + search.clearance - 0.75 * CELL, search.target
    for i in range(n):
        for j in range(n):
            cost[i, j] = math.inf
    if max(abs(x), abs(y)) <= half:
        i, j = round((x + half) / CELL), round((y + half) / CELL)
        cost[i, j] = 0.0
        count = push(heap, count, 0.0, i * n + j)
    else:
        for k in range(n):
            for i, j in ((k, 0), (k, n - 1), (0, k), (n - 1, k)):
                if nodes[2 * i, 2 * j] >= least:
                    way = Segment(i * CELL - half, j * CELL - half, x, y)
                    cost[i, j] = way_beyond(search.walls, way)
                    count = push(heap, count, cost[i, j], i * n + j)
    while count > 0:
        known, place = heap[0, 0], int(heap[0, 1])
        i, j = place // n, place % n
        count = drop_first(heap, count)
        if known > cost[i, j]:
            continue
        for d_i in range(-1, 2):
            for d_j in range(-1, 2):
                k, m = i + d_i, j + d_j
                if not (0 <= k < n and 0 <= m < n) or nodes[2 * k, 2 * m] < least:
                    continue
                tight = 1.0 - min((nodes[2 * k, 2 * m] - least) / AMPLE, 1.0)
                step = CELL * math.sqrt(d_i * d_i + d_j * d_j)
                longer = known + step * (1.0 + TIGHT_COST * tight * tight)
                if longer < cost[k, m]:
                    cost[k, m] = longer
                    count = push(heap, count, longer, k * n + m)


@compiled_once
def find_way(field: Field, search: Search, memory: Array, way: Array) -> int:
    """Return the number of actions of a path from the robot to a target.

    0 if none was found. It ends near the target, or where it leaves the grid towards
    one outside.

    Args:
        field: Margins, at least to max(inner, 0) + AMPLE.
        search: The problem.
        memory: :func:`search_size` numbers.
        way: (MOST_ACTIONS,) filled with the numbers of the actions.
    """
    tree = tree_in(memory, field.half)
    nodes, best, remaining, heap = tree.nodes, tree.best, tree.remaining, tree.heap
    geodesic(field, search, remaining, heap)
    n, middle = remaining.shape[0], remaining.shape[0] // 2
    if remaining[middle, middle] == math.inf:
        return 0
    for place in range(n * n):
        for heading in range(HEADINGS):
            best[place, heading] = math.inf
    for k in range(NODE):
        nodes[0, k] = 0.0
    nodes[0, 3], nodes[0, 6] = pose_room(field, 0.0, 0.0, 0.0), -1.0
    best[middle * n + middle, 0] = 0.0
    waiting, count = push(heap, 0, remaining[middle, middle], 0), 1
    kinds = len(ACTIONS) if search.reverse else len(ACTIONS) - len(BACK_ARCS)
    greed = GREED if search.inner >= 0.0 else GREED_OUTSIDE
    while waiting > 0 and count < MOST_NODES - kinds:
        parent = int(heap[0, 1])
        waiting = drop_first(heap, waiting)
        i, j, k = _bin(field.half, tree, parent)
        if nodes[parent, 2] > best[i * n + j, k] + SAME_COST:
            continue
        if parent > 0 and _arrives(field.half, search, tree, parent):
            return _trace(nodes, parent, way)
        least = min(search.clearance, nodes[parent, 3])
        for action in range(kinds):
            if _drive(field, tree, parent, action, count, least):
                i, j, k = _bin(field.half, tree, count)
                best[i * n + j, k] = nodes[count, 2]
                total = nodes[count, 2] + greed * remaining[i, j]
                waiting = push(heap, waiting, total, count)
                count += 1
    return 0


@compiled_once
def _bin(half: float, tree: Tree, node: int) -> tuple[int, int, int]:
    """Return the cell and heading that identify a node."""
    x, y = tree.nodes[node, 0], tree.nodes[node, 1]
    return round((x + half) / CELL), round((y + half) / CELL), int(tree.nodes[node, 5])


@compiled_once
def _arrives(half: float, search: Search, tree: Tree, node: int) -> bool:
    """Return whether a path may end at a node: near the target, or outside the grid."""
    x, y, heading = search.target
    i, j, k = _bin(half, tree, node)
    off = abs(wrap_angle(heading - k * TURN)) if search.turned else 0.0
    away = math.sqrt((tree.nodes[node, 0] - x) ** 2 + (tree.nodes[node, 1] - y) ** 2)
    n = tree.remaining.shape[0]
    inside = 0 < i < n - 1 and 0 < j < n - 1
    beyond = max(abs(x), abs(y)) > half
    return (away <= CLOSE and off <= ALIGNED) or (beyond and not inside)


@compiled_once
def _drive(
    field: Field, tree: Tree, parent: int, action: int, child: int, least: float
) -> bool:
    """Fill in the node that an action leads to; return whether it is the best there."""
    drive, turn = ACTIONS[action]
    node, from_, n = tree.nodes[child], tree.nodes[parent], tree.remaining.shape[0]
    heading = from_[5]
    start, length, bend = heading * TURN, drive * ARC_LENGTH, turn * TURN
    x, y, end = arc(from_[0], from_[1], start, length, bend, 1.0)
    node[0], node[1], node[2] = x, y, from_[2] + _cost(drive, turn, from_[4], AMPLE)
    node[4] = drive if drive != 0.0 else from_[4]
    node[5], node[6], node[7] = (int(heading) + int(turn)) % HEADINGS, parent, action
    i, j, k = _bin(field.half, tree, child)
    if not (0 <= i < n and 0 <= j < n) or tree.remaining[i, j] == math.inf:
        return False
    known = tree.best[i * n + j, k] - SAME_COST
    if node[2] >= known:
        return False
    m_x, m_y, middle = arc(from_[0], from_[1], start, length, bend, 0.5)
    node[3] = min(pose_room(field, m_x, m_y, middle), pose_room(field, x, y, end))
    node[2] = from_[2] + _cost(drive, turn, from_[4], node[3])
    return bool(node[3] >= least and node[2] < known)


@compiled_once
def _cost(drive: float, turn: float, direction: float, room: float) -> float:
    """Return the cost of one action, m."""
    cost = TURN_COST * abs(turn)
    if drive != 0.0:
        near = 1.0 - max(min(room, AMPLE), 0.0) / AMPLE
        cost += ARC_LENGTH * (1.0 + NEAR_COST * near * near)
    if drive < 0.0:
        cost *= REVERSE_COST
    if drive * direction < 0.0:
        cost += CHANGE_COST
    return cost


@compiled_once
def _trace(nodes: Array, node: int, way: Array) -> int:
    """Write the actions that lead to a node, first to last; return their number."""
    count, step = 0, node
    while nodes[step, 6] >= 0.0:
        count += 1
        step = int(nodes[step, 6])
    place = count
    while nodes[node, 6] >= 0.0:
        place -= 1
        if place < way.shape[0]:
            way[place] = nodes[node, 7]
        node = int(nodes[node, 6])
    return int(min(count, way.shape[0]))
