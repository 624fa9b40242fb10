"""Hybrid A* of the oriented footprint on a local grid.

In the robot frame at the time of planning. The search [Dolgov2010] expands short arcs
from the robot's exact pose, keeps the best one per grid cell and heading, and uses the
geodesic distance of the axle to the target as heuristic.
"""

import math
from typing import NamedTuple

from qpavoid.compiled import compiled_once, entry
from qpavoid.guide.geodesic import CELL, Goal, cells_of, geodesic
from qpavoid.guide.heap import HEAP_WIDTH, Item, drop_first, item_at, push
from qpavoid.guide.room import AMPLE, Field, grid_size, pose_room
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

LEAVING = 0.8
"""m of cost within which a robot that is too near may lose a little more margin."""

CLOSE, ALIGNED = 0.2, 1.5 * TURN
"""m and rad from the target at which a path ends."""

SAME_COST = 1e-5
"""m; tolerance of equal costs."""


class Search(NamedTuple):
    """Problem of a search.

    Attributes:
        inner: From :attr:`qpavoid.model.footprint.Footprint.inner_radius`, m.
        reverse: Whether the robot can drive backwards.
        clearance: Required margin, m; poses with less may only be left.
        loss: Margin, m, that may be lost first when leaving; negative: must be gained.
        target: Robot frame, m, m, rad.
        turned: Whether the path must end with that heading.
        walls: Capsules, robot frame, for detours outside the grid.
    """

    inner: float
    reverse: bool
    clearance: float
    loss: float
    target: Pose
    turned: bool
    walls: Array


class Tree(NamedTuple):
    """Search tree of hybrid A*, and its memory.

    Attributes:
        nodes: (:data:`MOST_NODES`, 5) x, y, cost so far, margin (m), direction.
        links: (:data:`MOST_NODES`, 3) heading in TURNs, wrapped, parent, action.
        best: (n², HEADINGS) least cost so far of every cell, row by row.
        remaining: (n, n) from :func:`qpavoid.guide.geodesic.geodesic`, m.
        heap: Open list.
    """

    nodes: Array
    links: Array
    best: Array
    remaining: Array
    heap: Array


NODE, LINK = 5, 3
"""Columns of nodes and of links."""


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
    return size + MOST_NODES * (NODE + LINK) + most_waiting(half) * HEAP_WIDTH


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
    c = b + MOST_NODES * LINK
    d = c + cells * cells * HEADINGS
    e = d + cells * cells
    f = e + waiting * HEAP_WIDTH
    return Tree(
        memory[a:b].reshape(MOST_NODES, NODE),
        memory[b:c].reshape(MOST_NODES, LINK),
        memory[c:d].reshape(cells * cells, HEADINGS),
        memory[d:e].reshape(cells, cells),
        memory[e:f].reshape(waiting, HEAP_WIDTH),
    )


@compiled_once
def find_way(field: Field, search: Search, memory: Array, way: Array) -> int:
    """Return the number of actions of a path from the robot to a target.

    0 if none was found, −1 if there is none, not even for the axle alone. It ends near
    the target, or where it leaves the grid towards one outside.

    Args:
        field: Margins, at least to max(inner, 0) + AMPLE.
        search: The problem.
        memory: :func:`search_size` numbers.
        way: (MOST_ACTIONS,) filled with the numbers of the actions.
    """
    tree, floor = tree_in(memory, field.half), search.inner + search.clearance
    nodes, best, remaining, heap = tree.nodes, tree.best, tree.remaining, tree.heap
    goal = Goal(search.target[0], search.target[1], search.walls)
    geodesic(field, floor - 0.75 * CELL, goal, remaining, heap)
    n, middle = remaining.shape[0], remaining.shape[0] // 2
    if remaining[middle, middle] == math.inf:
        return -1
    for place in range(n * n):
        for heading in range(HEADINGS):
            best[place, heading] = math.inf
    node, link = nodes[0], tree.links[0]
    node[0], node[1], node[2], node[4] = 0.0, 0.0, 0.0, 0.0
    node[3] = pose_room(field, 0.0, 0.0, 0.0)
    link[0], link[1], link[2] = 0.0, -1.0, -1.0
    best[middle * n + middle, 0] = 0.0
    waiting, count = push(heap, 0, Item(remaining[middle, middle], 0, 0)), 1
    kinds = len(ACTIONS) if search.reverse else len(ACTIONS) - len(BACK_ARCS)
    greed = GREED if search.inner >= 0.0 else GREED_OUTSIDE
    while waiting > 0 and count < MOST_NODES - kinds:
        parent = item_at(heap, 0).i
        waiting = drop_first(heap, waiting)
        i, j, k = _bin(field.half, tree, parent)
        if nodes[parent, 2] > best[i * n + j, k] + SAME_COST:
            continue
        if parent > 0 and _arrives(field.half, search, tree, parent):
            return _trace(tree.links, parent, way)
        least = _least_room(search, tree, parent)
        for action in range(kinds):
            if _drive(field, tree, parent, action, count, least):
                i, j, k = _bin(field.half, tree, count)
                best[i * n + j, k] = nodes[count, 2]
                total = nodes[count, 2] + greed * remaining[i, j]
                waiting = push(heap, waiting, Item(total, count, 0))
                count += 1
    return 0


@compiled_once
def _bin(half: float, tree: Tree, node: int) -> tuple[int, int, int]:
    """Return the cell and heading that identify a node."""
    x, y = tree.nodes[node, 0], tree.nodes[node, 1]
    return round((x + half) / CELL), round((y + half) / CELL), int(tree.links[node, 0])


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
def _least_room(search: Search, tree: Tree, parent: int) -> float:
    """Return the required margin of a child, m: less while the robot leaves."""
    floor = tree.nodes[parent, 3] - 0.15 * search.loss
    if tree.nodes[parent, 2] < LEAVING:
        floor = min(floor, tree.nodes[0, 3] - search.loss)
    return float(min(search.clearance, floor))


@compiled_once
def _drive(
    field: Field, tree: Tree, parent: int, action: int, child: int, least: float
) -> bool:
    """Fill in the node that an action leads to; return whether it is the best there."""
    drive, turn = ACTIONS[action]
    node, from_, heading = tree.nodes[child], tree.nodes[parent], tree.links[parent, 0]
    link, n = tree.links[child], tree.remaining.shape[0]
    start, length, bend = heading * TURN, drive * ARC_LENGTH, turn * TURN
    x, y, end = arc(from_[0], from_[1], start, length, bend, 1.0)
    node[0], node[1], node[2] = x, y, from_[2] + _cost(drive, turn, from_[4], AMPLE)
    node[4] = drive if drive != 0.0 else from_[4]
    link[0], link[1], link[2] = (int(heading) + int(turn)) % HEADINGS, parent, action
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
def _trace(links: Array, node: int, way: Array) -> int:
    """Write the actions that lead to a node, first to last; return their number."""
    count, step = 0, node
    while links[step, 1] >= 0.0:
        count += 1
        step = int(links[step, 1])
    place = count
    while links[node, 1] >= 0.0:
        place -= 1
        if place < way.shape[0]:
            way[place] = links[node, 2]
        node = int(links[node, 1])
    return int(min(count, way.shape[0]))
