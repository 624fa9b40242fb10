"""The scenario file, as strict models: every key, its unit in its name, its default."""

from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.planning.planner import PlannerSettings
from qpavoid.lab.sensing.clusters import ClusterSettings
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.sensing.physics_model import Patch
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation.schema_base import (
    Finite,
    Natural,
    NotNegative,
    Point,
    Positive,
    Strict,
    ordered,
)
from qpavoid.lab.simulation.schema_obstacles import ObstacleModel
from qpavoid.lab.simulation.tables import Table, absent, keyed, with_tables
from qpavoid.model.estimate import EstimatorSettings
from qpavoid.model.robot import Limits
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.path import CubicPath, SplinePath
from qpavoid.tracking.station import StationKeeping

MOST_ROBOTS = 200
"""In an entry; each is a scenario, and sees all others."""

Preset = Literal["mir100", "mir100_rectangle", "jackal"]


class PoseModel(Strict):
    """A pose in the world frame.

    Attributes:
        x_m: Along the x axis of the frame.
        y_m: Along its y axis.
        heading_rad: γ, counter-clockwise from the x axis.
    """

    x_m: Finite
    y_m: Finite
    heading_rad: Finite = 0.0

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, γ)."""
        return self.x_m, self.y_m, self.heading_rad


@keyed(Limits, optional=True)
class RobotModel(Strict):
    """A preset, with other limits or another footprint where given.

    Attributes:
        preset: What is taken where a key below is not given.
        footprint_m: Corners of a convex footprint in the robot frame,
            counter-clockwise, with the middle of the axle at (0, 0).
        track_m: Distance between the wheels; wanted by ``wheel_speed_mps`` and wheel
            slip.
    """

    preset: Preset = "mir100"
    footprint_m: list[Point] | None = None
    track_m: Positive | None = None


@keyed(CubicPath)
class CubicModel(Strict):
    """The paper's path, Eq. 2 and 3.

    Attributes:
        kind: The paper's path.
        start: First pose.
        goal: Last pose.
    """

    kind: Literal["cubic"]
    start: PoseModel
    goal: PoseModel


class StationModel(Strict):
    """Standing at a pose.

    Attributes:
        kind: A pose to keep.
        pose: Where to stand.
    """

    kind: Literal["station"]
    pose: PoseModel


@keyed(SplinePath)
class SmoothModel(Strict):
    """How a smooth path near a polyline is driven."""


class SplineModel(SmoothModel):
    """A smooth path near way-points.

    Attributes:
        kind: A smooth path through way-points.
        points_m: Way-points, at least two.
    """

    kind: Literal["spline"]
    points_m: list[Point]


class BarnPathModel(SmoothModel):
    """The published reference path of a BARN world.

    Attributes:
        kind: A published path.
        world: Number of the BARN world.
    """

    kind: Literal["barn"]
    world: Natural


ReferenceModel = Annotated[
    CubicModel | StationModel | SplineModel | BarnPathModel,
    Field(discriminator="kind"),
]


class MemberModel(Strict):
    """Settings of one of several robots; all others are those at the top.

    Attributes:
        robot: Its footprint and limits, instead of [robot].
        controller: Its method, instead of the one that the command names.
        jitter_m: Its start is drawn from the seed, so far off in x and y.
        jitter_rad: And so far off in heading.
    """

    robot: RobotModel | None = None
    controller: Annotated[str, Field(min_length=1)] | None = None
    jitter_m: NotNegative = 0.0
    jitter_rad: NotNegative = 0.0


class OneModel(MemberModel):
    """A robot with a start or a reference of its own.

    Attributes:
        kind: A single robot.
        start: Its first pose, instead of that of its reference.
        reference: Its reference, instead of [reference].
    """

    kind: Literal["one"]
    start: PoseModel | None = None
    reference: ReferenceModel | None = None


@keyed(SplinePath)
class CircleModel(MemberModel):
    """Robots evenly on a circle, each on its straight way to the place across.

    Attributes:
        kind: Robots on a circle.
        count: How many.
        radius_m: Of the circle about the origin.
    """

    kind: Literal["circle"]
    count: Annotated[int, Field(ge=2, le=MOST_ROBOTS)]
    radius_m: Positive


@keyed(SplinePath)
class ScatteredModel(MemberModel):
    """Robots on straight ways between places of a box, drawn from the seed.

    Attributes:
        kind: Robots at random.
        count: How many.
        low_m: Lower left corner of the box.
        high_m: Upper right corner.
        apart_m: Least distance of starts, and of goals.
    """

    kind: Literal["random"]
    count: Annotated[int, Field(ge=1, le=MOST_ROBOTS)]
    low_m: Point
    high_m: Point
    apart_m: NotNegative = 1.5

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        ordered(self.low_m, self.high_m)
        return self


RobotsModel = Annotated[
    OneModel | CircleModel | ScatteredModel, Field(discriminator="kind")
]


@keyed(Gains)
@keyed(StationKeeping)
@keyed(Waiting, "wait_")
class TrackingModel(Strict):
    """Gains of Eq. 6, a law at rest of its own, a reference that waits.

    Attributes:
        station_keeping: At rest, correct a lateral error too, which Eq. 6 cannot.
        waiting: The reference's clock slows down for a robot that falls behind.
    """

    station_keeping: bool = False
    waiting: bool = False


@keyed(AvoidanceSettings)
class FilterModel(Strict):
    """The QP filter."""


class PublishedModel(Strict):
    """The paper's values of one method, shown beside the measured ones.

    Attributes:
        zone_entry_s: When an obstacle comes within r.
        zone_exit_s: When it has left again.
        about: The paper says about.
    """

    zone_entry_s: Finite | None = None
    zone_exit_s: Finite | None = None
    about: bool = False


@keyed(MotionCapture)
class MotionCaptureModel(Strict):
    """The pose is measured to less than a millimetre.

    Attributes:
        kind: Cameras in the room.
    """

    kind: Literal["motion_capture"]


@keyed(Uwb)
class UwbModel(Strict):
    """Positions by radio, fused with odometry by an EKF.

    Attributes:
        kind: Ultra-wideband radio.
    """

    kind: Literal["uwb"]


LocalisationModel = MotionCaptureModel | UwbModel


@keyed(Plant)
class SlipModel(Strict):
    """Wheels that slip at random, and lag.

    Attributes:
        kind: A unicycle whose wheels slip.
    """

    kind: Literal["slip"] = "slip"


@keyed(Patch)
class PatchModel(Strict):
    """A rectangle of another friction."""


@keyed(Physics)
class PhysicsModel(Strict):
    """Rigid bodies in MuJoCo.

    Attributes:
        kind: Rigid bodies, qpavoid[mujoco].
        patches: Ground of another friction.
    """

    kind: Literal["mujoco"]
    patches: list[PatchModel] = Field(default_factory=list)


def _plant_kind(told: Any) -> str:
    """Return the kind of a plant; one that does not say it slips."""
    return str(told.get("kind", "slip")) if isinstance(told, dict) else "slip"


PlantModel = Annotated[
    Annotated[SlipModel, Tag("slip")] | Annotated[PhysicsModel, Tag("mujoco")],
    Discriminator(_plant_kind),
]


@with_tables(PARTS)
class ScenarioModel(Strict):
    """A whole scenario file.

    Attributes:
        title: What tables and figures call it.
        duration_s: How long it lasts.
        dt_s: Control step: how long a twist is held.
        seed: Of all that is drawn at random.
        ends_at_goal: The run ends when the robot has arrived.
        settled_s: So long it has to be at its goal to have arrived.
        arrival_m: So near its goal.
        arrival_rad: And so near its heading there.
        frames_s: Times of the figure's frames; none: those of the interaction.
        start: First pose of the robot; none: that of the reference.
        robot: Footprint and limits.
        robots: Several robots; all else is as at the top.
        reference: What the robot is to follow, or where to stand.
        tracking: The tracking law, Eq. 6, and what is beside it.
        filter: The QP filter.
        radius: r_min and r.
        repulsion: The repulsive velocity of Eq. 5 and 7.
        margins: What may be wrong about an obstacle.
        ahead: How far ahead the look-ahead sees.
        actuation: What the base does to a twist.
        estimation: Velocities of discs are estimated from their positions, not known.
        guide: A stage that weighs the next seconds; ``+guide`` turns it on too.
        planner: Of ``astar+`` and ``dijkstra+``.
        sight_m: What is farther away is not seen.
        lidar: The robot sees points alone, by a LiDAR.
        clusters: How points of a scan are put together, for methods that want discs.
        localisation: The pose is measured, not known.
        plant: The base is no ideal unicycle.
        obstacles: All that is in the way.
        published: What a paper states, by controller; shown beside what is measured.
    """

    title: str
    duration_s: Positive
    dt_s: Positive = 0.01
    seed: Natural = 0
    ends_at_goal: bool = False
    settled_s: NotNegative = 1.0
    arrival_m: NotNegative = 0.1
    arrival_rad: NotNegative = 0.1
    frames_s: list[NotNegative] = Field(default_factory=list)
    start: PoseModel | None = None
    robot: RobotModel = RobotModel()
    robots: list[RobotsModel] = Field(default_factory=list)
    reference: ReferenceModel | None = None
    tracking: TrackingModel = TrackingModel()
    filter: FilterModel = FilterModel()
    estimation: Table[EstimatorSettings] | None = None
    guide: Table[GuideSettings] | None = None
    planner: Table[PlannerSettings] = absent(PlannerSettings)
    sight_m: Annotated[float, Field(gt=0)] = float("inf")
    lidar: Table[LidarSettings] | None = None
    clusters: Table[ClusterSettings] = absent(ClusterSettings)
    localisation: Annotated[LocalisationModel, Field(discriminator="kind")] | None = (
        None
    )
    plant: PlantModel | None = None
    obstacles: list[ObstacleModel] = Field(default_factory=list)
    published: dict[str, PublishedModel] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _referred(self) -> Self:
        """A reference there must be, of the scenario or of its robots."""
        if self.reference is None and not self.robots:
            raise ValueError("reference: field required, or [[robots]]")
        return self
