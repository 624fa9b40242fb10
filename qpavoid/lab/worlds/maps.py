"""Maps: tasks in a building, among discs and people that are not on the map.

Drawn from a seed: start and goal on free ground, with a path of 8 to 20 m (3 to 8 m for
the small robot); two discs near the planned path and three anywhere, which are not on
the map and leave a path; and three people (one) who walk back and forth on paths of
their own, and do not yield.
"""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.errors import DataError
from qpavoid.lab.planning.grid import Grid, cheapest_way, costs_of, length
from qpavoid.lab.worlds.map_server import find_map, map_digest, read_map
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array

PATH_PATIENCE = 4.0
"""Time limit relative to that of the path at full speed."""


class Rover(NamedTuple):
    """A robot, and its tasks.

    Attributes:
        robot: Table of a scenario file.
        speed: Greatest, m/s.
        shortest: Length of a path, m.
        longest: Length of a path, m.
        room: Clearance of both ends of a path, m.
        passage: Clearance of all of it, m.
        radius: r_min for slow and fast obstacles, m.
        people: Number of people.
    """

    robot: Mapping[str, Any]
    speed: float
    shortest: float
    longest: float
    room: float
    passage: float
    radius: tuple[float, float]
    people: int


JACKAL = Rover({"preset": "jackal"}, 0.8, 8.0, 20.0, 0.7, 0.45, (0.1, 0.2), 3)
WAFFLE = Rover(
    {
        "footprint_m": [[0.08, 0.15], [-0.2, 0.15], [-0.2, -0.15], [0.08, -0.15]],
        "omega_min_radps": -1.8,
        "omega_max_radps": 1.8,
    },
    0.26,
    3.0,
    8.0,
    0.35,
    0.3,
    (0.05, 0.1),
    1,
)
"""A TurtleBot3 Waffle, for maps on which a Jackal finds no path."""

ON_WAY, ANYWHERE = 2, 3
CELL_SIDE, MOST_MARKED, LARGE = 0.1, 500_000, 500_000
"""m, side of the cells of the path search; number marked at once; number of open cells
of a map from which on ends of paths are drawn more often."""

PERSON = 0.25
"""m; radius of a person."""

FREE_RADIUS = 1.2
"""m; radius about start and goal without obstacles, at the start without people."""


@lru_cache(maxsize=4)
def read_ground(path: Path) -> Grid:
    """Return the grid of the cells of a map that are not free."""
    chart = read_map(path)
    everywhere = chart.middles(np.ones_like(chart.free))
    grid = Grid.around(everywhere, 0.5 * chart.resolution, CELL_SIDE)
    for part in in_parts(chart.middles(~chart.free, CELL_SIDE)):
        grid.mark(Obstacles(part), math.inf)
    for part in in_parts(grid.places(np.argwhere(np.ones_like(grid.seen)))):
        grid.mark(Obstacles(part[~chart.covers(part, CELL_SIDE)]), math.inf)
    return grid


def in_parts(places: Array) -> list[Array]:
    """Return positions (n, 2) in arrays of at most :data:`MOST_MARKED`."""
    return np.array_split(places, 1 + len(places) // MOST_MARKED)


def map_document(path: Path, file: str, seed: int) -> dict[str, Any]:
    """Return a task as a scenario file.

    The robot has the map, and a range of 6 m. The only reference is the goal: a method
    needs a planner.

    Raises:
        DataError: The map has no such path.
    """
    ground = read_ground(path)
    # crc32 and not hash(), which Python salts anew in every process.
    rng = np.random.default_rng([seed, zlib.crc32(path.name.encode())])
    try:
        rover, route = JACKAL, draw_way(ground, rng, JACKAL, None)
    except DataError:
        rover, route = WAFFLE, draw_way(ground, rng, WAFFLE, None)
    duration = PATH_PATIENCE * length(route) / rover.speed
    (x, y), (goal_x, goal_y) = route[0].tolist(), route[-1].tolist()
    return {
        "title": f"{path.stem}, task {seed}",
        "duration_s": duration,
        "dt_s": 0.05,
        "seed": seed,
        "ends_at_goal": True,
        "arrival_m": 0.3,
        "arrival_rad": 3.2,
        "start": {"x_m": x, "y_m": y, "heading_rad": course(route[0], route[5])},
        "robot": {
            **rover.robot,
            "v_min_mps": -rover.speed,
            "v_max_mps": rover.speed,
        },
        "reference": {
            "kind": "station",
            "pose": {
                "x_m": goal_x,
                "y_m": goal_y,
                "heading_rad": course(route[-6], route[-1]),
            },
        },
        "tracking": {"waiting": True, "k_y_rad_per_m2": 4.0},
        "radius": SafetyRadius.keys_of(*rover.radius),
        "sight_m": 6.0,
        "obstacles": [
            {"kind": "map", "file": file},
            *draw_things(ground, rng, rover, route),
            *draw_people(ground, rng, rover, route, duration),
        ],
    }


def draw_way(
    ground: Grid, rng: np.random.Generator, rover: Rover, near: Array | None
) -> Array:
    """Return a path (n, 2), m, between random open cells, the first near ``near``."""
    clearance = ground.clearance(0.0)
    cells = np.argwhere(clearance >= rover.room)
    places, costs = ground.places(cells), costs_of(clearance, rover.passage, 0.6, 4.0)
    # On a large map hardly any two cells are near enough to each other, and to a path.
    draws = round(1000 * max(1.0, len(cells) / LARGE) ** 2)
    for _ in range(draws if len(cells) else 0):
        i, j = rng.integers(len(cells), size=2)
        if not 0.5 * rover.shortest < math.dist(places[i], places[j]) < rover.longest:
            continue
        if near is not None and np.hypot(*(near - places[i]).T).min() > 4.0:
            continue
        start, goal = map(tuple, cells[[i, j]].tolist())
        route = ground.places(cheapest_way("astar", costs, start, goal))
        if rover.shortest <= length(route) <= rover.longest:
            return route
    raise DataError("the map has no way that is long enough with room at its ends")


def draw_things(
    ground: Grid, rng: np.random.Generator, rover: Rover, route: Array
) -> list[dict[str, Any]]:
    """Return discs near the path and anywhere that leave a path."""
    open_places = ground.places(np.argwhere(ground.clearance(0.0) >= 0.3))
    around = np.hypot(*(open_places - route[len(route) // 2]).T) < 0.5 * rover.longest
    for _ in range(1000):
        at = rng.integers(len(route) // 5, 4 * len(route) // 5, size=ON_WAY)
        beside = route[at] + rng.uniform(-0.3, 0.3, (ON_WAY, 2))
        middles = np.vstack([beside, rng.choice(open_places[around], ANYWHERE)])
        discs = np.column_stack([middles, rng.uniform(0.1, 0.3, len(middles))])
        ends = np.hypot(*(middles[:, None] - route[[0, -1]]).transpose(2, 0, 1))
        if ends.min() <= FREE_RADIUS:
            continue
        now = ground.copy()
        now.mark(Obstacles(discs=discs), math.inf)
        costs = costs_of(now.clearance(0.0), rover.passage, 0.6, 4.0)
        start, goal = map(tuple, ground.cells(route[[0, -1]]).tolist())
        if len(cheapest_way("astar", costs, start, goal)):
            return [
                {"kind": "disc", "position_m": place, "radius_m": radius}
                for *place, radius in discs.tolist()
            ]
    return []


def draw_people(
    ground: Grid, rng: np.random.Generator, rover: Rover, route: Array, duration: float
) -> list[dict[str, Any]]:
    """Return walking people, initially away from the start of the robot.

    Args:
        ground: The map.
        rng: Draws paths, positions and speeds.
        rover: Their number.
        route: (n, 2) of the robot, m.
        duration: Of their walks, s.
    """
    people: list[dict[str, Any]] = []
    while len(people) < rover.people:
        way = draw_way(ground, rng, rover, route)
        times, positions = draw_walk(way, rng, duration)
        if math.dist(positions[0], route[0]) > FREE_RADIUS:
            walk = {"times_s": times.tolist(), "positions_m": positions.tolist()}
            people.append({"kind": "waypoints", "radius_m": PERSON, **walk})
    return people


def draw_walk(
    route: Array, rng: np.random.Generator, duration: float
) -> tuple[Array, Array]:
    """Return times (n,), s, and positions (n, 2), m, of walking a path back and forth.

    From a random position on it, at a constant speed.
    """
    corners = np.vstack([route[:-1:5], route[-1:]])
    there = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    speed = rng.uniform(0.4, 1.0)
    begun = rng.uniform(0.0, 2.0 * there[-1])
    laps = range(math.ceil((speed * duration + begun) / there[-1]) + 1)
    along = [
        lap * there[-1] + (there if lap % 2 == 0 else there[-1] - there[::-1])
        for lap in laps
    ]
    places = [corners if lap % 2 == 0 else corners[::-1] for lap in laps]
    times = (np.concatenate([[0.0], *(part[1:] for part in along)]) - begun) / speed
    positions = np.vstack([corners[:1], *(part[1:] for part in places)])
    first = int(np.searchsorted(times, 0.0))
    return times[max(0, first - 1) :], positions[max(0, first - 1) :]


def course(here: Array, there: Array) -> float:
    """Return the direction from here to there, rad."""
    return math.atan2(there[1] - here[1], there[0] - here[0])


@dataclass(frozen=True)
class Maps:
    """Tasks on a map as a source of scenes.

    Attributes:
        place: Name of its file without ``.yaml``, or the path of one.
        data: Folder of published data sets.
    """

    place: Annotated[str, ("place",)]
    data: str | None = None

    @property
    def name(self) -> str:
        """Label in tables."""
        return f"map {self.place}"

    @property
    def file(self) -> str:
        """Name of the file."""
        named = Path(self.place).suffix or Path(self.place).is_file()
        return self.place if named else f"{self.place}.yaml"

    @property
    def path(self) -> str:
        """Path of the file."""
        beside = Path(self.file).parent
        return str(find_map(self.file, beside, self.data))

    def identity(self, data: str | None) -> str:
        """Return the name, and the digest of the map."""
        return f"map {self.place} {map_digest(Path(self.path))}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the task with this number."""
        return map_document(Path(self.path), self.file, seed or 0)
