"""From the models of a scenario file to the objects that run."""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.simulation import schema
from qpavoid.lab.simulation import schema_obstacles as kinds
from qpavoid.lab.simulation.tables import read, values
from qpavoid.lab.simulation.world import Track, World
from qpavoid.lab.worlds.barn import find_folder, read_path, read_world
from qpavoid.lab.worlds.map_server import find_map, read_map
from qpavoid.lab.worlds.points import read_points
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.tracking import path as motion
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Gains, KanayamaTracker, Tracker
from qpavoid.tracking.station import StationKeeping, StationTracker


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
        radius=model.radius(),
        repulsion=model.repulsion(),
        margins=model.margins(),
        ahead=model.ahead(),
        actuation=model.actuation(),
        dt=model.dt_s,
        **values(AvoidanceSettings, model.filter),
    )


def make_reference(
    scenario: schema.ScenarioModel, data: str | os.PathLike[str] | None
) -> motion.Path | None:
    """Return the planned motion; none: it is one's own."""
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
        points = read_path(folder / "path_files" / f"path_{model.world}.npy")
    else:
        points = np.array(model.points_m).reshape(-1, 2)
    return motion.SplinePath(points, **values(motion.SplinePath, model))


def make_world(
    model: schema.ScenarioModel, folder: Path, data: str | os.PathLike[str] | None
) -> World:
    """Return the obstacles; files lie in ``folder``, published data in ``data``."""
    rng = np.random.default_rng(model.seed)
    discs: list[tuple[float, float, float]] = []
    tracks: list[Track] = []
    points, walls = [np.empty((0, 2))], [np.empty((0, 4))]
    polygons: list[list[tuple[float, float]]] = []
    motions: list[tuple[float, float, float]] = []
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
            case kinds.PolygonModel():
                polygons.append(item.vertices_m)
                motions.append((*item.velocity_mps, item.turn_rate_radps))
            case kinds.PointsModel():
                points.append(read_points(folder / item.file))
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
