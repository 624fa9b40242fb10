"""From the models of a scenario file to the objects that run."""

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.files import below
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.sensing.physics_model import Patch
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation import schema
from qpavoid.lab.simulation import schema_obstacles as kinds
from qpavoid.lab.simulation.tables import read, values
from qpavoid.lab.simulation.world import Pushed, Track, World
from qpavoid.lab.worlds.barn import find_folder, read_path, read_world
from qpavoid.lab.worlds.map_server import find_map, read_map
from qpavoid.lab.worlds.points import read_points
from qpavoid.lab.worlds.source import data_roots
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.tracking import path as motion
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Gains, KanayamaTracker, Tracker
from qpavoid.tracking.station import StationKeeping, StationTracker
from qpavoid.types import Array

PLACE_TRIES = 1000
"""How often a place is drawn for a robot, on average, before none is found."""


def make_robot(model: schema.RobotModel) -> Robot:
    """Return the preset, with limits and footprint of its own where given."""
    preset: Robot = getattr(Robot, model.preset)()
    chosen = replace(preset.limits, **values(Limits, model))
    if model.footprint_m is None:
        return Robot(preset.name, preset.footprint, chosen)
    return Robot("custom", Footprint.polygon(model.footprint_m), chosen)


def make_tracker(model: schema.TrackingModel, limits: Limits) -> Tracker:
    """Return the tracking law."""
    gains = read(Gains, model)
    if not model.station_keeping:
        return KanayamaTracker(gains)
    return StationTracker(gains, read(StationKeeping, model), limits)


def make_localisation(model: schema.ScenarioModel) -> MotionCapture | Uwb | None:
    """Return how the robot knows where it is, or none: exactly."""
    told = model.localisation
    if told is None:
        return None
    if isinstance(told, schema.MotionCaptureModel):
        return read(MotionCapture, told, seed=model.seed)
    return read(Uwb, told, seed=model.seed, **track_of(model))


def make_plant(model: schema.ScenarioModel) -> Plant | Physics | None:
    """Return what the wheels make of a twist, or none: just that."""
    told = model.plant
    if isinstance(told, schema.PhysicsModel):
        ground: dict[str, Any] = {
            "patches": tuple(read(Patch, one) for one in told.patches),
        }
        return read(Physics, told, **ground)
    given = {"seed": model.seed, **track_of(model)}
    return None if told is None else read(Plant, told, **given)


def track_of(model: schema.ScenarioModel) -> dict[str, Any]:
    """Return the robot's distance between its wheels by name, where it says one."""
    return {k: v for k, v in values(Limits, model.robot).items() if k == "track"}


def make_waiting(model: schema.TrackingModel) -> Waiting:
    """Return the reference's clock."""
    given = read(Waiting, model, "wait_")
    return given if model.waiting else NEVER


def make_settings(model: schema.ScenarioModel) -> AvoidanceSettings:
    """Return the settings of all controllers."""
    return AvoidanceSettings(
        dt=model.dt_s,
        **{name: getattr(model, name)() for name in PARTS},
        **values(AvoidanceSettings, model.filter),
    )


def make_reference(
    scenario: schema.ScenarioModel, data: str | os.PathLike[str] | None
) -> motion.Path | None:
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


def make_world(
    model: schema.ScenarioModel, folder: Path, data: str | os.PathLike[str] | None
) -> World:
    """Return the obstacles; files lie in ``folder``, published data in ``data``.

    Raises:
        InvalidInputError: There are too many.
        DataError: A file is missing, damaged, or leads out of both folders.
    """
    count = sum(getattr(item, "count", 1) for item in model.obstacles)
    if count > kinds.MOST_OBSTACLES:
        most = kinds.MOST_OBSTACLES
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
            case kinds.DiscModel(velocity_mps=(0.0, 0.0)):
                discs.append((*item.position_m, item.radius_m))
            case kinds.DiscModel():
                position, velocity = np.array([item.position_m, item.velocity_mps])
                tracks.append(Track.straight(position, velocity, item.radius_m))
            case kinds.WaypointsModel():
                times, positions = np.array(item.times_s), np.array(item.positions_m)
                track = Track(times, positions, item.radius_m, fleeting=item.fleeting)
                tracks.append(track)
            case kinds.WallModel():
                walls.append(np.array([[*item.start_m, *item.end_m]]))
            case kinds.PolygonModel(times_s=[_, *_]):
                shifts = Track(np.array(item.times_s), np.array(item.shifts_m), 0.0)
                pushed.append(Pushed(np.array(item.vertices_m), shifts))
            case kinds.PolygonModel():
                polygons.append(item.vertices_m)
                motions.append((*item.velocity_mps, item.turn_rate_radps))
            case kinds.PointsModel():
                file = below(folder / item.file, folder, *data_roots(data))
                points.append(read_points(file))
            case kinds.BarnModel():
                path = find_folder(data, item.world) / f"world_{item.world}.world"
                discs.extend(map(tuple, read_world(path).tolist()))
            case kinds.MapModel():
                walls.append(read_map(find_map(item.file, folder, data)).walls())
            case kinds.RandomModel():
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
    model: kinds.RandomModel, rng: np.random.Generator
) -> Iterator[Track]:
    for _ in range(model.count):
        position = rng.uniform(model.low_m, model.high_m)
        radius = float(rng.uniform(model.radius_low_m, model.radius_high_m))
        course = rng.uniform(-np.pi, np.pi)
        speed = rng.uniform(0.0, model.speed_high_mps)
        velocity = speed * np.array([np.cos(course), np.sin(course)])
        yield Track.straight(position, velocity, radius)
