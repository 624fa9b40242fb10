"""A scenario: robot, path, world and settings, built from a file and ready to run."""

import hashlib
import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.errors import ConfigError, InvalidInputError
from qpavoid.files import below
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.scenario import schema
from qpavoid.lab.scenario.config import find_config, read_document, validated
from qpavoid.lab.scenario.keys import read, values
from qpavoid.lab.scenario.world import Pushed, Track, World
from qpavoid.lab.sensing.lidar import AnySensor, LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.worlds.barn import START, find_folder, read_path, read_world
from qpavoid.lab.worlds.map_server import find_map, read_map
from qpavoid.lab.worlds.source import data_roots, read_points
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.tracking import path as motion
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.station import StationKeeping, Tracker
from qpavoid.types import Array, Pose

Folder: TypeAlias = str | os.PathLike[str] | None
"""Folder of published data sets; none: the environment's ``QPAVOID_DATA``."""

MOST_STEPS, MOST_PLACES = 1_000_000, 30_000_000
"""Of a run: steps, and places of all its obstacles; its log has 300 MB and 700 MB."""

SEED_STRIDE, DRAWS = 1_000_003, 1
"""Between the seeds of two robots; what is drawn for them is apart from the world."""

AT_LAST: Array = np.array([1e9])
"""s; by then every path has come to its goal."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that a run depends on, except the controller.

    Attributes:
        name: Of the file, or its shipped name.
        title: What figures call it.
        robot: Footprint and limits.
        settings: Of every controller.
        tracker: The tracking law.
        path: The planned motion.
        world: The obstacles.
        start: Pose at time 0.
        duration: s.
        dt: Control step, s.
        sight: m; what is farther away is not known.
        lidar: The sensor; None: obstacles are known.
        perception: What is known about moving bodies in its scans.
        localisation: How the robot knows where it is; None: exactly.
        sensor: Sees the obstacles in place of the LiDAR; has ``start()``, as a LiDAR.
        plant: What its wheels make of a twist; None: just that.
        guide: Of the stage after tracking; None: there is none.
        waiting: When the reference waits for a robot that is held up.
        seed: Of everything random.
        ends_at_goal: End the run when the robot has arrived and been there.
        settled: How long it is to have been there, s.
        arrival: Position (m) and heading (rad) error at the end that count as arrived.
        frames: Times of the frames in figures, s.
        digest: SHA-256 of the scenario file.
        robots: Each of several robots, in the same world; empty: there is this one.
        controller: Of this robot, whatever drives the others; empty: the same.
    """

    name: str
    title: str
    robot: Robot
    settings: AvoidanceSettings
    tracker: Tracker
    path: motion.Path
    world: World
    start: Pose
    duration: float
    dt: float
    waiting: Waiting = NEVER
    sight: float = math.inf
    lidar: LidarSettings | None = None
    perception: PerceptionSettings = field(default_factory=PerceptionSettings)
    localisation: MotionCapture | Uwb | None = None
    sensor: AnySensor | None = None
    plant: Plant | Physics | None = None
    guide: GuideSettings | None = None
    seed: int = 0
    ends_at_goal: bool = False
    settled: float = 1.0
    arrival: tuple[float, float] = (0.1, 0.1)
    frames: tuple[float, ...] = ()
    digest: str = ""
    robots: "tuple[Scenario, ...]" = ()
    controller: str = ""

    @property
    def steps(self) -> int:
        """Number of control steps."""
        return round(self.duration / self.dt)

    @property
    def times(self) -> Array:
        """When the control steps begin and the last one ends, s."""
        return self.dt * np.arange(self.steps + 1, dtype=np.float64)


def load_scenario(config: str | os.PathLike[str], data: Folder = None) -> Scenario:
    """Read a scenario from a file or by its shipped name.

    Args:
        config: Path of a TOML file, or a name such as ``paper/test_case_1``.
        data: Folder of published data sets, where a scenario needs one; without it the
            environment's ``QPAVOID_DATA``.

    Raises:
        UnknownNameError: Neither a file nor a shipped name.
        ConfigError: Something in the file is wrong; lists everything that is.
        DataError: A data file that it names is missing or damaged.
    """
    name, path = find_config(os.fspath(config))
    document, content = read_document(path)
    digest = hashlib.sha256(content).hexdigest()
    return make_scenario(document, name, path, data, digest)


def make_scenario(
    document: dict[str, Any],
    name: str,
    path: Path,
    data: Folder = None,
    digest: str = "",
) -> Scenario:
    """Return the scenario that a document describes.

    Args:
        document: What a scenario file says.
        name: Of the scenario.
        path: Of its file: what it names lies beside it, and errors name it.
        data: As :func:`load_scenario` takes it.
        digest: SHA-256 of the file.

    Raises:
        ConfigError: Something in the document is wrong; lists everything that is.
        DataError: A data file that it names is missing or damaged.
    """
    model = validated(schema.ScenarioModel, document, path)
    if not model.robots:
        return replace(_single(model, path, data), name=name, digest=digest)
    robots: list[Scenario] = []
    problems: list[str] = []
    rng = np.random.default_rng((model.seed, DRAWS))
    for i, item in enumerate(model.robots):
        try:
            for own in make_members(item, rng):
                seed = {"seed": model.seed + SEED_STRIDE * len(robots), "robots": []}
                told = validated(schema.ScenarioModel, document | own | seed, path)
                one = _single(told, path, data, robots[0].world if robots else None)
                off = np.array((item.jitter_m, item.jitter_m, item.jitter_rad))
                x, y, heading = np.add(one.start, off * rng.uniform(-1, 1, 3)).tolist()
                controller = item.controller or ""
                start = x, y, heading
                robots.append(replace(one, start=start, controller=controller))
        except (ConfigError, InvalidInputError) as error:
            where = f"{path}: robots[{i}]: "
            lines = str(error).splitlines()
            problems += [where + line.removeprefix(f"{path}: ") for line in lines]
    if problems:
        raise ConfigError(problems)
    robots = [replace(one, name=name, digest=digest) for one in robots]
    return replace(robots[0], seed=model.seed, robots=tuple(robots))


def _single(
    model: schema.ScenarioModel, path: Path, data: Folder, world: World | None = None
) -> Scenario:
    """Return the scenario of one robot, if given in a world that there is already.

    Raises:
        ConfigError: Lists every part that is wrong.
        DataError: A data file is missing or damaged.
    """
    told, plant = model.localisation, model.plant
    given: dict[str, Any] = {"seed": model.seed}
    if (track := values(Limits, model.robot).get("track")) is not None:
        given["track"] = track
    makers: dict[str, tuple[str, Callable[[], Any]]] = {
        "robot": ("robot", lambda: make_robot(model.robot)),
        "settings": ("filter", lambda: make_settings(model)),
        "guide": ("guide", lambda: model.guide and model.guide.make()),
        "lidar": ("lidar", lambda: model.lidar and model.lidar.make(**given)),
        "perception": ("perception", model.perception.make),
        "localisation": ("localisation", lambda: told and told.make(**given)),
        "plant": ("plant", lambda: plant and plant.make(**given)),
        "waiting": ("tracking.wait_wide_m", lambda: make_waiting(model.tracking)),
        "path": ("reference", lambda: make_reference(model, data)),
        "world": ("obstacles", lambda: world or make_world(model, path.parent, data)),
    }
    parts: dict[str, Any] = {}
    problems: list[str] = []
    for name, (key, make) in makers.items():
        try:
            parts[name] = make()
        except InvalidInputError as error:
            problems.append(f"{path}: {key}: {error}")
    if problem := _too_long(model, parts.get("world")):
        problems.append(f"{path}: duration_s: {problem}")
    if problems:
        raise ConfigError(problems)
    law = model.tracking
    station = read(StationKeeping, law) if law.station_keeping else None
    return Scenario(
        name="",
        title=model.title,
        tracker=Tracker(read(Gains, law), station, parts["robot"].limits),
        start=_start(model, parts["path"]),
        duration=model.duration_s,
        dt=model.dt_s,
        sight=model.sight_m,
        seed=model.seed,
        ends_at_goal=model.ends_at_goal,
        settled=model.settled_s,
        arrival=(model.arrival_m, model.arrival_rad),
        frames=tuple(model.frames_s),
        **parts,
    )


def _too_long(model: schema.ScenarioModel, world: World | None) -> str:
    """Return what is wrong with how many steps a run has; empty: nothing."""
    steps = model.duration_s / model.dt_s
    if not 1.5 < steps < MOST_STEPS + 0.5:
        return f"makes {steps:g} steps of dt_s; a run has 2 to {MOST_STEPS:,}"
    if world is None:
        return ""
    corners = sum(map(len, world.polygons.polygons))
    places = steps * (len(world.discs) + len(world.tracks) + corners)
    most = f"a run has {MOST_PLACES:,} at most"
    return "" if places <= MOST_PLACES else f"makes {places:g} places of discs; {most}"


def _start(model: schema.ScenarioModel, path: motion.Path) -> Pose:
    """Return the pose at time 0: as given, BARN's, or where the reference begins."""
    if model.start is not None:
        return model.start.pose
    if isinstance(model.reference, schema.BarnPathModel):
        return START
    x, y, heading = path.sample(np.zeros(1))[0, :3].tolist()
    return x, y, heading


PLACE_TRIES = 1000
"""How often a place is drawn for a robot, on average, before none is found."""


def make_robot(model: schema.RobotModel) -> Robot:
    """Return the preset, with limits and footprint of its own where given."""
    preset: Robot = getattr(Robot, model.preset)()
    chosen = replace(preset.limits, **values(Limits, model))
    if model.footprint_m is None:
        return Robot(preset.name, preset.footprint, chosen)
    polygons: list[Any] = model.footprint_m
    if not any(isinstance(x, list) for x in polygons):
        polygons = [polygons]
    return Robot("custom", Footprint.union(polygons), chosen)


def make_waiting(model: schema.TrackingModel) -> Waiting:
    """Return the reference's clock."""
    given = read(Waiting, model, "wait_")
    return given if model.waiting else NEVER


def make_settings(model: schema.ScenarioModel) -> AvoidanceSettings:
    """Return the settings of all controllers."""
    return AvoidanceSettings(
        dt=model.dt_s,
        **{name: getattr(model, name).make() for name in PARTS},
        **values(AvoidanceSettings, model.filter),
    )


def make_reference(scenario: schema.ScenarioModel, data: Folder) -> motion.Path | None:
    """Return the planned motion; none: each robot has its own."""
    model = scenario.reference
    if model is None:
        return None
    if isinstance(model, schema.CubicModel):
        ends = model.start.pose, model.goal.pose
        return motion.CubicPath(*ends, **values(motion.CubicPath, model))
    if isinstance(model, schema.StationModel):
        return motion.Station(model.pose.pose)
    if isinstance(model, schema.BarnPathModel):
        folder = find_folder(data, model.world)
        file = folder / "path_files" / f"path_{model.world}.npy"
        points = read_path(below(file, folder))
    else:
        points = np.array(model.points_m).reshape(-1, 2)
    return motion.SplinePath(points, **values(motion.SplinePath, model))


def make_members(
    item: schema.OneModel | schema.CircleModel | schema.ScatteredModel,
    rng: np.random.Generator,
) -> Iterator[dict[str, Any]]:
    """Yield what each robot of an entry has of its own, as a scenario file says it.

    Raises:
        InvalidInputError: No places were found that are so far apart.
    """
    own = {"start", "robot", "reference"}
    common = item.model_dump(mode="json", include=own, exclude_none=True)
    if isinstance(item, schema.OneModel):
        yield common
        return
    smooth = item.model_dump(include=set(schema.SmoothModel.model_fields))
    for way in _across(item) if item.kind == "circle" else _scattered(item, rng):
        yield common | {"reference": {"kind": "spline", "points_m": way} | smooth}


def _across(item: schema.CircleModel) -> Iterator[list[list[float]]]:
    """Yield start and end of every robot on a circle, m."""
    for k in range(item.count):
        angle = 2.0 * math.pi * k / item.count
        x, y = item.radius_m * math.cos(angle), item.radius_m * math.sin(angle)
        yield [[x, y], [-x, -y]]


def _scattered(
    item: schema.ScatteredModel, rng: np.random.Generator
) -> Iterator[list[list[float]]]:
    """Yield start and end of every robot, m; starts are far apart, and so are ends."""
    starts: list[Array] = []
    ends: list[Array] = []
    # Drawn until it fits: starts that are packed densely may not, and then the whole
    # scenario is refused, rather than a robot left out.
    for _ in range(PLACE_TRIES * item.count):
        way = rng.uniform(item.low_m, item.high_m, (2, 2))
        others = zip((starts, ends), way, strict=True)
        if all(np.hypot(*(p - q)) >= item.apart_m for them, q in others for p in them):
            starts.append(way[0])
            ends.append(way[1])
            yield way.tolist()
        if len(starts) == item.count:
            return
    raise InvalidInputError(f"no places for {item.count} robots were found")


def make_world(model: schema.ScenarioModel, folder: Path, data: Folder) -> World:
    """Return the obstacles; files lie in ``folder``, published data in ``data``.

    Raises:
        InvalidInputError: There are too many.
        DataError: A file is missing, damaged, or leads out of both folders.
    """
    count = sum(getattr(item, "count", 1) for item in model.obstacles)
    if count > schema.MOST_OBSTACLES:
        most = schema.MOST_OBSTACLES
        raise InvalidInputError(f"{count:,} obstacles, where {most:,} are most")
    rng = np.random.default_rng(model.seed)
    discs: list[tuple[float, float, float]] = []
    tracks: list[Track] = []
    points, walls = [np.empty((0, 2))], [np.empty((0, 4))]
    polygons: list[list[tuple[float, float]]] = []
    motions: list[tuple[float, float, float]] = []
    pushed: list[Pushed] = []
    for item in model.obstacles:
        match item:
            case schema.DiscModel(velocity_mps=(0.0, 0.0)):
                discs.append((*item.position_m, item.radius_m))
            case schema.DiscModel():
                position, velocity = np.array([item.position_m, item.velocity_mps])
                tracks.append(Track.straight(position, velocity, item.radius_m))
            case schema.WaypointsModel():
                times, positions = np.array(item.times_s), np.array(item.positions_m)
                track = Track(times, positions, item.radius_m, fleeting=item.fleeting)
                tracks.append(track)
            case schema.WallModel():
                walls.append(np.array([[*item.start_m, *item.end_m]]))
            case schema.PolygonModel(times_s=[_, *_]):
                shifts = Track(np.array(item.times_s), np.array(item.shifts_m), 0.0)
                pushed.append(Pushed(np.array(item.vertices_m), shifts))
            case schema.PolygonModel():
                polygons.append(item.vertices_m)
                motions.append((*item.velocity_mps, item.turn_rate_radps))
            case schema.PointsModel():
                file = below(folder / item.file, folder, *data_roots(data))
                points.append(read_points(file))
            case schema.BarnModel():
                path = find_folder(data, item.world) / f"world_{item.world}.world"
                discs.extend(map(tuple, read_world(path).tolist()))
            case schema.MapModel():
                walls.append(read_map(find_map(item.file, folder, data)).walls())
            case schema.RandomModel():
                tracks.extend(_random_tracks(item, rng))
    return World(
        discs=np.array(discs).reshape(-1, 3),
        tracks=tuple(tracks),
        points=np.vstack(points),
        walls=np.vstack(walls),
        polygons=Obstacles(polygons=polygons, polygon_velocities=motions),
        pushed=tuple(pushed),
    )


def _random_tracks(
    model: schema.RandomModel, rng: np.random.Generator
) -> Iterator[Track]:
    for _ in range(model.count):
        position = rng.uniform(model.low_m, model.high_m)
        radius = float(rng.uniform(model.radius_low_m, model.radius_high_m))
        course = rng.uniform(-np.pi, np.pi)
        speed = rng.uniform(0.0, model.speed_high_mps)
        velocity = speed * np.array([np.cos(course), np.sin(course)])
        yield Track.straight(position, velocity, radius)
