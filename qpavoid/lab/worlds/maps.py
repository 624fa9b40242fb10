"""Maps: from here to there in a building, past things and people that are not on it.

Drawn from a seed: start and goal on free ground, 8 to 20 m apart by way (3 to 8 m for
the small robot); two discs near the planned way and three anywhere, which no map shows
and which leave a way; and three people (one) who walk back and forth on ways of their
own, and do not yield.
"""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.lab.planning.grid import Grid, cheapest_way, costs_of, length
from qpavoid.lab.worlds.map_server import find_map, map_digest, read_map
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array

PATIENCE = 4.0
"""Time allowed, in times that the way takes at full speed."""


class Rover(NamedTuple):
    """A robot, and what ways it is sent.

    Attributes:
        robot: As a scenario file has it.
        speed: Greatest, m/s.
        shortest: Way, m.
        longest: Way, m.
        room: m that both ends of a way keep from what is not free.
        passage: m that all of it keeps.
        radius: r_min for slow and fast obstacles, m.
        people: How many walk there.
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
"""A TurtleBot3 Waffle, for maps on which a Jackal finds no way."""

ON_WAY, ANYWHERE = 2, 3
FINE, MOST_PLACES, LARGE = 0.1, 500_000, 500_000
"""m, side of the cells in which ways are looked for; that are marked at once; open ones
of a map, from which on ends of ways are drawn more often."""

PERSON = 0.25
"""m; radius of a person."""

AWAY = 1.2
"""m from start and goal within which there is nothing, nor anybody at the start."""


@lru_cache(maxsize=4)
def read_ground(path: Path) -> Grid:
    """Return the grid of what is not free on a map."""
    chart = read_map(path)
    everywhere = chart.middles(np.ones_like(chart.free))
    grid = Grid.around(everywhere, 0.5 * chart.resolution, FINE)
    for part in in_parts(chart.middles(~chart.free, FINE)):
        grid.mark(Obstacles(part), math.inf)
    for part in in_parts(grid.places(np.argwhere(np.ones_like(grid.seen)))):
        grid.mark(Obstacles(part[~chart.covers(part, FINE)]), math.inf)
    return grid


def in_parts(places: Array) -> list[Array]:
    """Return places (n, 2) in arrays of no more than obstacles may have points."""
    return np.array_split(places, 1 + len(places) // MOST_PLACES)


def map_document(path: Path, file: str, seed: int) -> dict[str, Any]:
    """Return a task as a scenario file.

    The robot knows the map and sees 6 m far. The only reference is the goal: a method
    needs a planner before it.

    Raises:
        DataError: The map has no such way.
    """
    ground = read_ground(path)
    # crc32 and not hash(), which Python salts anew in every process.
    rng = np.random.default_rng([seed, zlib.crc32(path.name.encode())])
    try:
        rover, route = JACKAL, draw_way(ground, rng, JACKAL, None)
    except DataError:
        rover, route = WAFFLE, draw_way(ground, rng, WAFFLE, None)
    duration = PATIENCE * length(route) / rover.speed
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
        "radius": {"r_min_slow_m": rover.radius[0], "r_min_fast_m": rover.radius[1]},
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
    """Return a way (n, 2), m, between random open places; the first one near a way."""
    clearance = ground.clearance(0.0)
    cells = np.argwhere(clearance >= rover.room)
    places, costs = ground.places(cells), costs_of(clearance, rover.passage, 0.6, 4.0)
    # Of two places on a large map hardly any are as near to each other, and to a way.
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
    """Return discs near the way and anywhere, that still leave a way."""
    open_places = ground.places(np.argwhere(ground.clearance(0.0) >= 0.3))
    around = np.hypot(*(open_places - route[len(route) // 2]).T) < 0.5 * rover.longest
    for _ in range(1000):
        at = rng.integers(len(route) // 5, 4 * len(route) // 5, size=ON_WAY)
        beside = route[at] + rng.uniform(-0.3, 0.3, (ON_WAY, 2))
        middles = np.vstack([beside, rng.choice(open_places[around], ANYWHERE)])
        discs = np.column_stack([middles, rng.uniform(0.1, 0.3, len(middles))])
        ends = np.hypot(*(middles[:, None] - route[[0, -1]]).transpose(2, 0, 1))
        if ends.min() > AWAY and leaves_way(ground, discs, rover, route):
            return [
                {"kind": "disc", "position_m": place, "radius_m": radius}
                for *place, radius in discs.tolist()
            ]
    return []


def leaves_way(ground: Grid, discs: Array, rover: Rover, route: Array) -> bool:
    """Return whether the ends of a route are joined among discs as well."""
    now = ground.copy()
    now.mark(Obstacles(discs=discs), math.inf)
    costs = costs_of(now.clearance(0.0), rover.passage, 0.6, 4.0)
    start, goal = map(tuple, ground.cells(route[[0, -1]]).tolist())
    return len(cheapest_way("astar", costs, start, goal)) > 0


def draw_people(
    ground: Grid, rng: np.random.Generator, rover: Rover, route: Array, duration: float
) -> list[dict[str, Any]]:
    """Return people who walk, none of them at the start when the robot is.

    Args:
        ground: The map.
        rng: Draws ways, places and speeds.
        rover: How many there are.
        route: (n, 2) of the robot, m.
        duration: For how long they walk, s.
    """
    people: list[dict[str, Any]] = []
    while len(people) < rover.people:
        way = draw_way(ground, rng, rover, route)
        times, positions = draw_walk(way, rng, duration)
        if math.dist(positions[0], route[0]) > AWAY:
            walk = {"times_s": times.tolist(), "positions_m": positions.tolist()}
            people.append({"kind": "waypoints", "radius_m": PERSON, **walk})
    return people


def draw_walk(
    route: Array, rng: np.random.Generator, duration: float
) -> tuple[Array, Array]:
    """Return times (n,), s, and positions (n, 2), m, of walking a way back and forth.

    From a random place on it, at a constant speed.
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
    """Ways through a map as a source of scenes.

    Attributes:
        place: Name of its file without ``.yaml``, or the path of one.
        data: Folder of published data sets.
    """

    place: Annotated[str, ("place",)]
    data: str | None = None

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"map {self.place}"

    @property
    def file(self) -> str:
        """Name of the file."""
        named = Path(self.place).suffix or Path(self.place).is_file()
        return self.place if named else f"{self.place}.yaml"

    @property
    def path(self) -> str:
        """Where it lies."""
        beside = Path(self.file).parent
        return str(find_map(self.file, beside, self.data))

    def identity(self, data: str | None) -> str:
        """Return the name, and the digest of the map."""
        return f"map {self.place} {map_digest(Path(self.path))}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the task with this number."""
        return map_document(Path(self.path), self.file, seed or 0)
