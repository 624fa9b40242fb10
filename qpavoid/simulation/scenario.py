"""A scenario: robot, path, world and settings, built from a file and ready to run."""

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from qpavoid.avoidance.settings import (
    AvoidanceSettings,
    LookAhead,
    Margins,
    Repulsion,
    SafetyRadius,
)
from qpavoid.datasets.barn import START, find_folder, read_path, read_world
from qpavoid.datasets.tables import read_points
from qpavoid.detour.settings import DetourSettings
from qpavoid.errors import ConfigError, InvalidInputError
from qpavoid.model.estimate import EstimatorSettings
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot
from qpavoid.motion import path as motion
from qpavoid.motion.path import Pose
from qpavoid.motion.station import StationKeeping, StationTracker
from qpavoid.motion.tracking import Gains, KanayamaTracker, Tracker
from qpavoid.motion.waiting import NEVER, Waiting
from qpavoid.simulation import schema
from qpavoid.simulation.config import find_config, read_config
from qpavoid.simulation.world import Track, World

MOST_STEPS = 10_000_000
"""A longer run would not fit into memory."""


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
        estimation: How velocities of discs are estimated; None: they are given.
        detour: The stage that leads round what is near; None: there is none.
        waiting: When the reference waits for a robot that is held up.
        seed: Of everything random.
        ends_at_goal: End the run 1 s after the robot has arrived.
        arrival: Position (m) and heading (rad) error at the end that count as arrived.
        frames: Times of the frames in figures, s.
        published: Numbers of the paper by controller.
        digest: SHA-256 of the scenario file.
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
    estimation: EstimatorSettings | None = None
    detour: DetourSettings | None = None
    seed: int = 0
    ends_at_goal: bool = False
    arrival: tuple[float, float] = (0.1, 0.1)
    frames: tuple[float, ...] = ()
    published: Mapping[str, schema.PublishedModel] = field(default_factory=dict)
    digest: str = ""

    @property
    def steps(self) -> int:
        """Number of control steps."""
        return round(self.duration / self.dt)


def load_scenario(
    config: str | os.PathLike[str], data: str | os.PathLike[str] | None = None
) -> Scenario:
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
    model, content = read_config(path)
    problems: list[str] = []

    @contextmanager
    def section(key: str) -> Iterator[None]:
        try:
            yield
        except InvalidInputError as error:
            problems.append(f"{path}: {key}: {error}")

    with section("robot"):
        robot = _robot(model.robot)
    with section("filter"):
        settings = _settings(model)
    with section("detour"):
        detour = _detour(model.detour)
    with section("estimation"):
        estimation = _estimation(model.estimation)
    with section("tracking.wait_wide_m"):
        waiting = _waiting(model.tracking)
    with section("reference"):
        reference = _reference(model.reference, data)
    with section("obstacles"):
        world = _world(model, path.parent, data)
    if not 2 <= round(model.duration_s / model.dt_s) <= MOST_STEPS:
        problems.append(
            f"{path}: duration_s: makes {model.duration_s / model.dt_s:g} steps of "
            f"dt_s; a run has 2 to {MOST_STEPS:,}"
        )
    if problems:
        raise ConfigError(problems)
    if model.start is not None:
        start = model.start.pose
    elif isinstance(model.reference, schema.BarnPathModel):
        start = START
    else:
        x, y, heading = reference.sample(np.zeros(1))[0, :3].tolist()
        start = (x, y, heading)
    return Scenario(
        name=name,
        title=model.title,
        robot=robot,
        settings=settings,
        tracker=_tracker(model.tracking, robot.limits),
        path=reference,
        world=world,
        start=start,
        duration=model.duration_s,
        dt=model.dt_s,
        waiting=waiting,
        estimation=estimation,
        detour=detour,
        seed=model.seed,
        ends_at_goal=model.ends_at_goal,
        arrival=(model.arrival_m, model.arrival_rad),
        frames=tuple(model.frames_s),
        published=model.published,
        digest=hashlib.sha256(content).hexdigest(),
    )


def _robot(model: schema.RobotModel) -> Robot:
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


def _tracker(model: schema.TrackingModel, limits: Limits) -> Tracker:
    gains = Gains(model.k_x_per_s, model.k_y_rad_per_m2, model.k_gamma_radps)
    if not model.station_keeping:
        return KanayamaTracker(gains)
    law = StationKeeping(model.k_rho_per_s, model.k_alpha_per_s, model.k_theta)
    return StationTracker(gains, law, limits)


def _detour(model: schema.DetourModel | None) -> DetourSettings | None:
    return None if model is None else DetourSettings(*model.model_dump().values())


def _estimation(model: schema.EstimationModel | None) -> EstimatorSettings | None:
    if model is None:
        return None
    return EstimatorSettings(
        model.acceleration_mps2, model.noise_m, model.speed_mps, model.forget_s
    )


def _waiting(model: schema.TrackingModel) -> Waiting:
    given = Waiting(model.wait_free_m, model.wait_wide_m, model.wait_least_rate)
    return given if model.waiting else NEVER


def _settings(model: schema.ScenarioModel) -> AvoidanceSettings:
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
        ),
        dt=model.dt_s,
        braking_room=qp.braking_room,
    )


def _reference(
    model: (
        schema.CubicModel
        | schema.StationModel
        | schema.SplineModel
        | schema.BarnPathModel
    ),
    data: str | os.PathLike[str] | None,
) -> motion.Path:
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


def _world(
    model: schema.ScenarioModel, folder: Path, data: str | os.PathLike[str] | None
) -> World:
    rng = np.random.default_rng(model.seed)
    discs: list[tuple[float, float, float]] = []
    tracks: list[Track] = []
    points, walls = [np.empty((0, 2))], [np.empty((0, 4))]
    for item in model.obstacles:
        match item:
            case schema.DiscModel(velocity_mps=(0.0, 0.0)):
                discs.append((*item.position_m, item.radius_m))
            case schema.DiscModel():
                position, velocity = np.array([item.position_m, item.velocity_mps])
                tracks.append(Track.straight(position, velocity, item.radius_m))
            case schema.WaypointsModel():
                times, positions = np.array(item.times_s), np.array(item.positions_m)
                tracks.append(Track(times, positions, item.radius_m))
            case schema.WallModel():
                walls.append(np.array([[*item.start_m, *item.end_m]]))
            case schema.PointsModel():
                points.append(read_points(folder / item.file))
            case schema.BarnModel():
                path = find_folder(data, item.world) / f"world_{item.world}.world"
                discs.extend(map(tuple, read_world(path).tolist()))
            case schema.RandomModel():
                tracks.extend(_random_tracks(item, rng))
    return World(
        discs=np.array(discs).reshape(-1, 3),
        tracks=tuple(tracks),
        points=np.vstack(points),
        walls=np.vstack(walls),
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
