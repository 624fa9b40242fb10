"""From the models of a scenario file to the objects that run."""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from qpavoid.avoidance.settings import (
    Actuation,
    AvoidanceSettings,
    LookAhead,
    Margins,
    Repulsion,
    SafetyRadius,
)
from qpavoid.guide.settings import DetourSettings
from qpavoid.lab.planning.planner import PlannerSettings
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation import schema
from qpavoid.lab.simulation import schema_obstacles as kinds
from qpavoid.lab.simulation.world import Track, World
from qpavoid.lab.worlds.barn import find_folder, read_path, read_world
from qpavoid.lab.worlds.map_server import find_map, read_map
from qpavoid.lab.worlds.points import read_points
from qpavoid.model.estimate import EstimatorSettings
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
    limits = preset.limits
    given = {
        "v_min": model.v_min_mps,
        "v_max": model.v_max_mps,
        "omega_min": model.omega_min_radps,
        "omega_max": model.omega_max_radps,
        "acceleration": model.acceleration_mps2,
        "angular_acceleration": model.angular_acceleration_radps2,
        "wheel_speed": model.wheel_speed_mps,
        "track": model.track_m,
    }
    chosen = replace(limits, **{k: v for k, v in given.items() if v is not None})
    if model.footprint_m is None:
        return Robot(preset.name, preset.footprint, chosen)
    return Robot("custom", Footprint.polygon(model.footprint_m), chosen)


def make_tracker(model: schema.TrackingModel, limits: Limits) -> Tracker:
    """Return the tracking law."""
    gains = Gains(model.k_x_per_s, model.k_y_rad_per_m2, model.k_gamma_radps)
    if not model.station_keeping:
        return KanayamaTracker(gains)
    law = StationKeeping(model.k_rho_per_s, model.k_alpha_per_s, model.k_theta)
    return StationTracker(gains, law, limits)


def make_detour(model: schema.DetourModel | None) -> DetourSettings | None:
    """Return the stage against stalls, or none."""
    return None if model is None else DetourSettings(*model.model_dump().values())


def make_planner(model: schema.PlannerModel) -> PlannerSettings:
    """Return the settings of the global planner."""
    return PlannerSettings(*model.model_dump().values())


def make_estimation(model: schema.EstimationModel | None) -> EstimatorSettings | None:
    """Return how velocities are estimated; none: they are given."""
    if model is None:
        return None
    return EstimatorSettings(
        model.acceleration_mps2, model.noise_m, model.speed_mps, model.forget_s
    )


def make_lidar(model: schema.LidarModel | None, seed: int) -> LidarSettings | None:
    """Return the sensor, or none: obstacles are known."""
    if model is None:
        return None
    return LidarSettings(
        field_of_view=model.field_of_view_rad,
        beams=model.beams,
        range=model.range_m,
        rate=model.rate_hz,
        latency=model.latency_s,
        noise=model.noise_m,
        dropout=model.dropout,
        seed=seed,
    )


def make_localisation(
    model: schema.LocalisationModel | None, seed: int
) -> MotionCapture | Uwb | None:
    """Return how the robot knows where it is, or none: exactly."""
    if model is None:
        return None
    if model.kind == "motion_capture":
        return MotionCapture(model.sigma_m, model.heading_sigma_rad, seed)
    return Uwb(model.sigma_m, model.rate_hz, model.slip, seed=seed)


def make_plant(model: schema.PlantModel | None, seed: int) -> Plant | None:
    """Return what the wheels make of a twist, or none: just that."""
    if model is None:
        return None
    return Plant(model.slip, (model.lag_v_s, model.lag_omega_s), seed=seed)


def make_waiting(model: schema.TrackingModel) -> Waiting:
    """Return the reference's clock."""
    given = Waiting(model.wait_free_m, model.wait_wide_m, model.wait_least_rate)
    return given if model.waiting else NEVER


def make_settings(model: schema.ScenarioModel) -> AvoidanceSettings:
    """Return the settings of all controllers."""
    radius, repulsion, qp = model.radius, model.repulsion, model.filter
    ahead = model.ahead
    return AvoidanceSettings(
        radius=SafetyRadius(
            radius.low_m,
            radius.high_m,
            radius.speed_low_mps,
            radius.speed_high_mps,
            radius.ratio,
            radius.closing_s,
        ),
        repulsion=Repulsion(
            repulsion.speed_mps, repulsion.activation, repulsion.damping_m
        ),
        weights=(qp.weight_v, qp.weight_omega_m2),
        bound=qp.bound,
        gamma=qp.gamma_per_s,
        reach=qp.reach_m,
        slack_tolerance=qp.slack_tolerance_mps,
        margins=Margins(model.margins.error_m, model.margins.acceleration_mps2),
        ahead=LookAhead(
            ahead.horizon_s,
            ahead.horizon_still_s,
            ahead.tick_s,
            ahead.hysteresis,
            ahead.review_s,
            ahead.closest_m,
        ),
        actuation=Actuation(
            model.actuation.delay_s, model.actuation.jitter, model.actuation.ramps
        ),
        dt=model.dt_s,
        braking_room=qp.braking_room,
        passive=qp.passive,
    )


def make_reference(
    scenario: schema.ScenarioModel, data: str | os.PathLike[str] | None
) -> motion.Path | None:
    """Return the planned motion; none: it is one's own."""
    model = scenario.reference
    if model is None:
        return None
    if isinstance(model, schema.CubicModel):
        return motion.CubicPath(
            model.start.pose, model.goal.pose, model.k_m, model.duration_s
        )
    if isinstance(model, schema.StationModel):
        return motion.Station(model.pose.pose)
    if isinstance(model, schema.BarnPathModel):
        folder = find_folder(data, model.world)
        points = read_path(folder / "path_files" / f"path_{model.world}.npy")
    else:
        points = np.array(model.points_m).reshape(-1, 2)
    return motion.SplinePath(
        points,
        model.speed_mps,
        model.turn_rate_radps,
        model.acceleration_mps2,
        model.smoothing_m,
    )


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
