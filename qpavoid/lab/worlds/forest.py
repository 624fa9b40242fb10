"""Forests: random static scenes that a robot can cross without reversing.

A scene is valid if the straight reference runs through an obstacle, and if a route to
the goal exists in a corridor about it: breadth-first search of scipy.sparse.csgraph
over a lattice of (x, y, heading) with two motions, one step forwards and one turn on
the spot, each pose of the oriented footprint clear of everything by ``CLEARANCE``.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import compiled_once, entry, entry_if
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import part_at, point_contact, wall_separation
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import wrap_angle
from qpavoid.model.robot import Robot
from qpavoid.settings import Range
from qpavoid.tracking.path import SplinePath
from qpavoid.types import Array, Edges, Matrix, Pose, Sizes, VectorWritten

Poses: TypeAlias = Annotated[Matrix, Sizes(0, 3)]

CELL = 0.1
"""m; pitch of the lattice."""

CLEARANCE = 0.22
"""m; clearance of the route, slightly above r_min = 0.17 m."""

HALF_WIDTH = 2.5
"""m; half-width of the corridor of the obstacles and of the route's axle."""

SPEED = 0.5
"""m/s of the reference."""

PATIENCE = 3.0
"""Time limit relative to the duration of the free reference."""

FIRST_STEPS = ((1, 0), (2, 1), (1, 1), (1, 2))
STEPS = np.array(
    [
        (
            round(math.cos(q) * i - math.sin(q) * j),
            round(math.sin(q) * i + math.cos(q) * j),
        )
        for q in np.arange(4) * math.pi / 2
        for i, j in FIRST_STEPS
    ]
)
"""(16, 2) cells: one step forwards along each heading of the lattice."""

HEADINGS = np.arctan2(STEPS[:, 1], STEPS[:, 0])


@dataclass(frozen=True, eq=False)
class ForestScene:
    """One forest; the start is the origin, the goal lies ahead on the x axis.

    Attributes:
        length: Distance of the goal, m.
        discs: (M, 3) x, y, radius, m.
        walls: (K, 4) x1, y1, x2, y2, m.
    """

    length: float
    discs: Array
    walls: Array

    @property
    def start(self) -> Pose:
        """Initial pose of the robot: the origin, facing the goal."""
        return 0.0, 0.0, 0.0

    @property
    def goal(self) -> Pose:
        """Pose ``length`` m ahead of the start, with its heading."""
        return self.length, 0.0, 0.0

    @property
    def path(self) -> SplinePath:
        """The reference: straight to the goal, from rest to rest."""
        return SplinePath(np.array([self.start[:2], self.goal[:2]]), SPEED)


def make_scene(footprint: Footprint, seed: int, number: int) -> ForestScene:
    """Return scene ``number`` of a seed: the first valid one of its draws."""
    rng = np.random.default_rng([seed, number])
    # A scene depends on its own number only, so that forests can be added to a family
    # without changing the others.
    while True:
        scene = draw(rng)
        if is_in_the_way(footprint, scene) and is_passable(footprint, scene):
            return scene


def draw(rng: np.random.Generator) -> ForestScene:
    """Return a random scene: 8 to 12 m, 6 to 15 discs, 0 to 4 walls."""
    length = rng.uniform(8.0, 12.0)
    low, high = (1.5, -HALF_WIDTH), (length - 1.5, HALF_WIDTH)
    count, wall_count = rng.integers(6, 16), rng.integers(0, 5)
    radius = rng.uniform(0.1, 0.5, (count, 1))
    discs = np.hstack([rng.uniform(low, high, (count, 2)), radius])
    middle = rng.uniform(low, high, (wall_count, 2))
    angle, half = rng.uniform([0.0, 0.25], [math.pi, 1.25], (wall_count, 2)).T
    reach = half[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return ForestScene(length, discs, np.hstack([middle - reach, middle + reach]))


def is_in_the_way(footprint: Footprint, scene: ForestScene) -> bool:
    """Return whether the footprint would touch an obstacle on the reference."""
    poses = np.zeros((round(scene.length / 0.05) + 1, 3))
    poses[:, 0] = np.linspace(0.0, scene.length, len(poses))
    return not clear(footprint.edges, poses, scene.discs, scene.walls, 0.0).all()


def is_passable(footprint: Footprint, scene: ForestScene) -> bool:
    """Return whether a route from start to goal without reversing exists."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order

    columns = round((scene.length + 2.0) / CELL) + 1
    poses, edges = lattice(columns)
    free = clear(footprint.edges, poses, scene.discs, scene.walls, CLEARANCE)
    start, goal = (nearest_node(columns, pose) for pose in (scene.start, scene.goal))
    if not (free[start] and free[goal]):
        return False
    # An edge is free if both its ends are; the excess of CLEARANCE over r_min covers
    # the poses in between.
    source, target = edges[:, free[edges].all(axis=0)]
    links = np.ones(len(source), dtype=np.int8)
    graph = csr_array((links, (source, target)), shape=(len(poses), len(poses)))
    reached = breadth_first_order(graph, start, return_predecessors=False)
    return bool((reached == goal).any())


@lru_cache(maxsize=64)
def lattice(columns: int) -> tuple[Array, np.ndarray]:
    """Return the poses (n, 3) of all nodes, and the edges (2, m) between them.

    The corridor begins 1 m behind the start and ends about 1 m behind the goal.
    """
    rows, turns = round(2.0 * HALF_WIDTH / CELL) + 1, len(HEADINGS)
    k, j, i = np.indices((turns, rows, columns))
    node = (k * rows + j) * columns + i
    x, y = i * CELL - 1.0, j * CELL - HALF_WIDTH
    poses = np.stack([x, y, HEADINGS[k]], axis=-1).reshape(-1, 3)
    i_next, j_next = i + STEPS[k, 0], j + STEPS[k, 1]
    inside = (0 <= i_next) & (i_next < columns) & (0 <= j_next) & (j_next < rows)
    forwards = np.array([node, (k * rows + j_next) * columns + i_next])[:, inside]
    # Turning on the spot, to either side; the last heading is next to the first.
    left = np.array([node, np.roll(node, -1, axis=0)]).reshape(2, -1)
    return poses, np.hstack([forwards, left, left[::-1]])


def nearest_node(columns: int, pose: Pose) -> int:
    """Return the node nearest to a pose."""
    rows = round(2.0 * HALF_WIDTH / CELL) + 1
    i, j = round((pose[0] + 1.0) / CELL), round((pose[1] + HALF_WIDTH) / CELL)
    k = int(np.argmin([abs(wrap_angle(heading - pose[2])) for heading in HEADINGS]))
    return (k * rows + j) * columns + i


def clear(
    edges: Array, poses: Array, discs: Array, walls: Array, clearance: float
) -> npt.NDArray[np.bool_]:
    """Return for each pose whether the footprint keeps a clearance.

    Of walls :func:`wall_separation` is used, which is never more than the distance.

    Args:
        edges: Of the footprint.
        poses: (n, 3).
        discs: (M, 3) x, y, radius, m.
        walls: (K, 4) m.
        clearance: m.
    """
    free = np.ones(len(poses))
    mark_nearer(edges, poses, free, discs, walls, clearance)
    return free > 0.0


@entry
@compiled_once
def _a_mark_a_pose(edges: Edges, poses: Poses, free: VectorWritten) -> bool:
    """Return whether each pose has a number."""
    return bool(free.shape[0] >= poses.shape[0])


@entry_if(_a_mark_a_pose)
@compiled_once
def mark_nearer(
    edges: Edges,
    poses: Poses,
    free: VectorWritten,
    discs: Annotated[Matrix, Sizes(0, 3)],
    walls: Annotated[Matrix, Sizes(0, 4)],
    clearance: float,
) -> None:
    """Set ``free`` to 0 for poses nearer than a clearance; see :func:`clear`."""
    circumradius = 0.0
    for i in range(edges.shape[0]):
        away = math.sqrt(edges[i, 0] ** 2 + edges[i, 1] ** 2)
        circumradius = max(circumradius, away)
    for n in range(poses.shape[0]):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        cos, sin = math.cos(heading), math.sin(heading)
        for k in range(discs.shape[0]):
            d_x, d_y, radius = discs[k, 0] - x, discs[k, 1] - y, discs[k, 2]
            if d_x * d_x + d_y * d_y >= (circumradius + radius + clearance) ** 2:
                continue
            touch = point_contact(edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x)
            if touch.distance - radius < clearance:
                free[n] = 0.0
                break
        for k in range(walls.shape[0]):
            if free[n] == 0.0:
                break
            u_x, u_y = walls[k, 0] - x, walls[k, 1] - y
            w_x, w_y = walls[k, 2] - x, walls[k, 3] - y
            wall = Segment(
                cos * u_x + sin * u_y,
                cos * u_y - sin * u_x,
                cos * w_x + sin * w_y,
                cos * w_y - sin * w_x,
            )
            stop = 0
            while stop < edges.shape[0]:
                part = part_at(edges, stop)
                stop = part.end
                if wall_separation(edges, part, wall).distance < clearance:
                    free[n] = 0.0


def scene_document(scene: ForestScene) -> dict[str, Any]:
    """Return a scene as a scenario file for the MiR100.

    The run ends 1 s after the goal pose is reached, or at three times the time of the
    free reference.
    """
    discs = [
        {"kind": "disc", "position_m": [x, y], "radius_m": radius}
        for x, y, radius in scene.discs.tolist()
    ]
    walls = [
        {"kind": "wall", "start_m": wall[:2], "end_m": wall[2:]}
        for wall in scene.walls.tolist()
    ]
    return {
        "title": "Forest",
        "duration_s": PATIENCE * scene.path.duration,
        "dt_s": 0.02,
        "ends_at_goal": True,
        "tracking": {"station_keeping": True},
        "reference": {
            "kind": "spline",
            "points_m": [scene.start[:2], scene.goal[:2]],
            "speed_mps": SPEED,
        },
        "obstacles": discs + walls,
    }


@dataclass(frozen=True)
class Forest:
    """Random forests as a source of scenes.

    Attributes:
        family: Seed of the whole family.
    """

    family: Annotated[int, Range(ge=0, le=10**15)] = 2

    @property
    def name(self) -> str:
        """Label in tables."""
        return "forest"

    def identity(self, data: str | None) -> str:
        """Return kind and family."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the forest with this number."""
        footprint = Robot.mir100().footprint
        return scene_document(make_scene(footprint, self.family, seed or 0))
