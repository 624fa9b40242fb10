"""A scenario: robot, path, world and settings, built from a file and ready to run."""

import hashlib
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import ConfigError, InvalidInputError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.planning.planner import PlannerSettings
from qpavoid.lab.sensing.clusters import ClusterSettings
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation import schema
from qpavoid.lab.simulation.config import find_config, read_document, validated
from qpavoid.lab.simulation.outcome import SETTLED
from qpavoid.lab.simulation.parts import (
    make_localisation,
    make_members,
    make_plant,
    make_reference,
    make_robot,
    make_settings,
    make_tracker,
    make_waiting,
    make_world,
)
from qpavoid.lab.simulation.world import World
from qpavoid.lab.worlds.barn import START
from qpavoid.model.estimate import EstimatorSettings
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.tracking import path as motion
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Tracker
from qpavoid.types import Array, Pose

MOST_STEPS, MOST_PLACES = 1_000_000, 30_000_000
"""Of a run: steps, and places of all its obstacles; its log has 300 MB and 700 MB."""


SEED_STRIDE, DRAWS = 1_000_003, 1
"""Between the seeds of two robots; what is drawn for them is apart from the world."""

AT_LAST: Array = np.array([1e9])
"""s; by then every path has come to its goal."""


class Sensor(Protocol):
    """A sensor that is given from Python."""

    def start(self) -> Callable[[float, Obstacles, Pose], Obstacles]:
        """Return the function of a new run.

        From time (s), obstacles in the world frame and the robot's true pose to the
        obstacles that are seen, robot frame.
        """
        ...


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
        clusters: How moving discs are found in its scans, where it tracks them.
        localisation: How the robot knows where it is; None: exactly.
        sensor: Sees the obstacles in place of the LiDAR; has ``start()``, as a LiDAR.
        plant: What its wheels make of a twist; None: just that.
        estimation: How velocities of discs are estimated; None: they are given.
        guide: Of the stage after tracking; None: there is none.
        planner: Settings of the global planner, for methods that have one.
        waiting: When the reference waits for a robot that is held up.
        seed: Of everything random.
        ends_at_goal: End the run when the robot has arrived and been there.
        settled: How long it is to have been there, s.
        arrival: Position (m) and heading (rad) error at the end that count as arrived.
        frames: Times of the frames in figures, s.
        published: Numbers of the paper by controller.
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
    estimation: EstimatorSettings | None = None
    sight: float = math.inf
    lidar: LidarSettings | None = None
    clusters: ClusterSettings = field(default_factory=ClusterSettings)
    localisation: MotionCapture | Uwb | None = None
    sensor: Sensor | None = None
    plant: Plant | Physics | None = None
    guide: GuideSettings | None = None
    planner: PlannerSettings = field(default_factory=PlannerSettings)
    seed: int = 0
    ends_at_goal: bool = False
    settled: float = SETTLED
    arrival: tuple[float, float] = (0.1, 0.1)
    frames: tuple[float, ...] = ()
    published: Mapping[str, schema.PublishedModel] = field(default_factory=dict)
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
    document, content = read_document(path)
    digest = hashlib.sha256(content).hexdigest()
    return make_scenario(document, name, path, data, digest)


def make_scenario(
    document: dict[str, Any],
    name: str,
    path: Path,
    data: str | os.PathLike[str] | None = None,
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
        return _single(model, name, path, data, digest)
    robots: list[Scenario] = []
    problems: list[str] = []
    rng = np.random.default_rng((model.seed, DRAWS))
    for i, item in enumerate(model.robots):
        try:
            for own in make_members(item, rng):
                seed = {"seed": model.seed + SEED_STRIDE * len(robots), "robots": []}
                told = validated(schema.ScenarioModel, document | own | seed, path)
                world = robots[0].world if robots else None
                one = _single(told, name, path, data, digest, world)
                start = _jittered(one.start, item, rng)
                controller = item.controller or ""
                robots.append(replace(one, start=start, controller=controller))
        except (ConfigError, InvalidInputError) as error:
            where = f"{path}: robots[{i}]: "
            lines = str(error).splitlines()
            problems += [where + line.removeprefix(f"{path}: ") for line in lines]
    if problems:
        raise ConfigError(problems)
    return replace(robots[0], seed=model.seed, robots=tuple(robots))


def _jittered(start: Pose, item: schema.MemberModel, rng: np.random.Generator) -> Pose:
    x, y, heading = start
    a, b, c = rng.uniform(-1.0, 1.0, 3).tolist()
    shift, turn = item.jitter_m, item.jitter_rad
    return x + shift * a, y + shift * b, heading + turn * c


def _single(
    model: schema.ScenarioModel,
    name: str,
    path: Path,
    data: str | os.PathLike[str] | None,
    digest: str,
    world: World | None = None,
) -> Scenario:
    """Return the scenario of one robot, in a world that there is already."""
    parts = _parts(model, path, data, world)
    return Scenario(
        name=name,
        title=model.title,
        tracker=make_tracker(model.tracking, parts["robot"].limits),
        start=_start(model, parts["path"]),
        duration=model.duration_s,
        dt=model.dt_s,
        sight=model.sight_m,
        seed=model.seed,
        ends_at_goal=model.ends_at_goal,
        settled=model.settled_s,
        arrival=(model.arrival_m, model.arrival_rad),
        frames=tuple(model.frames_s),
        published=model.published,
        digest=digest,
        **parts,
    )


def _parts(
    model: schema.ScenarioModel,
    path: Path,
    data: str | os.PathLike[str] | None,
    world: World | None,
) -> dict[str, Any]:
    """Return every part that can be wrong, by its field.

    Raises:
        ConfigError: Lists every part that is wrong.
        DataError: A data file is missing or damaged.
    """
    makers: dict[str, tuple[str, Callable[[], Any]]] = {
        "robot": ("robot", lambda: make_robot(model.robot)),
        "settings": ("filter", lambda: make_settings(model)),
        "guide": ("guide", lambda: model.guide and model.guide()),
        "planner": ("planner", model.planner),
        "estimation": ("estimation", lambda: model.estimation and model.estimation()),
        "lidar": ("lidar", lambda: model.lidar and model.lidar(seed=model.seed)),
        "clusters": ("clusters", model.clusters),
        "localisation": ("localisation", lambda: make_localisation(model)),
        "plant": ("plant", lambda: make_plant(model)),
        "waiting": ("tracking.wait_wide_m", lambda: make_waiting(model.tracking)),
        "path": ("reference", lambda: make_reference(model, data)),
        "world": (
            "obstacles",
            lambda: world or make_world(model, path.parent, data),
        ),
    }
    parts, problems = {}, []
    for name, (key, make) in makers.items():
        try:
            parts[name] = make()
        except InvalidInputError as error:
            problems.append(f"{path}: {key}: {error}")
    if problem := _too_long(model, parts.get("world")):
        problems.append(f"{path}: duration_s: {problem}")
    if problems:
        raise ConfigError(problems)
    return parts


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
