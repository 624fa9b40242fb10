"""The scenario file, as strict models: every key, its unit in its name, its default."""

from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, Tag, model_validator

from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.scenario.keys import (
    Finite,
    Natural,
    NotNegative,
    Point,
    Positive,
    Strict,
    keyed,
    model_of,
    ordered,
    tagged,
    with_tables,
)
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.sensing.localisation import MotionCapture, Uwb
from qpavoid.lab.sensing.physics import Patch, Physics
from qpavoid.lab.sensing.plant import Plant
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.path import CubicPath, SplinePath
from qpavoid.tracking.station import StationKeeping

MOST_OBSTACLES = 10_000
"""In a scenario, but for points and the walls of maps."""


class OfKind(Strict):
    """A table of a kind.

    Attributes:
        kind: Kind of table.
    """


class DiscModel(OfKind):
    """A disc at rest or with a constant velocity; radius 0 is a point.

    Attributes:
        position_m: Centre at the start.
        radius_m: Of the disc.
        velocity_mps: Constant.
    """

    kind: Literal["disc"]
    position_m: Point
    radius_m: NotNegative = 0.0
    velocity_mps: Point = (0.0, 0.0)


class WaypointsModel(OfKind):
    """A disc that moves along straight lines, and stands before and after.

    Or, fleeting, is not there before and after.

    Attributes:
        times_s: When it is at each position; they increase.
        positions_m: Where.
        radius_m: Of the disc.
        fleeting: It is there from the first time to the last only.
    """

    kind: Literal["waypoints"]
    times_s: list[Finite]
    positions_m: list[Point]
    radius_m: NotNegative = 0.0
    fleeting: bool = False


class WallModel(OfKind):
    """A straight wall.

    Attributes:
        start_m: One end.
        end_m: The other.
    """

    kind: Literal["wall"]
    start_m: Point
    end_m: Point


class PolygonModel(OfKind):
    """A convex polygon, counter-clockwise, at rest or moving and turning steadily.

    The velocity is that of the centroid of its area, about which it turns. Or it is
    pushed about without turning, along straight lines between way-points.

    Attributes:
        vertices_m: Corners at the start, counter-clockwise.
        velocity_mps: Of its centroid.
        turn_rate_radps: Counter-clockwise.
        times_s: Of a pushed one, when it is at each shift; they increase.
        shifts_m: How far it then is from its corners given.
    """

    kind: Literal["polygon"]
    vertices_m: list[Point]
    velocity_mps: Point = (0.0, 0.0)
    turn_rate_radps: Finite = 0.0
    times_s: list[Finite] = Field(default_factory=list)
    shifts_m: list[Point] = Field(default_factory=list)

    @model_validator(mode="after")
    def _pushed(self) -> "PolygonModel":
        if len(self.times_s) != len(self.shifts_m):
            raise ValueError("as many shifts_m as times_s are wanted")
        if self.times_s and (any(self.velocity_mps) or self.turn_rate_radps):
            raise ValueError("what is pushed has no velocity_mps or turn_rate_radps")
        return self

    @model_validator(mode="after")
    def _convex(self) -> "PolygonModel":
        try:
            Obstacles(polygons=[self.vertices_m])
        except InvalidInputError as error:
            raise ValueError(str(error).replace("polygons[0]", "vertices_m")) from None
        return self


class PointsModel(OfKind):
    """Points at rest from a CSV or NPY file beside the scenario file.

    Attributes:
        file: CSV with columns x, y, or NPY (N, 2), in m.
    """

    kind: Literal["points"]
    file: str


class RandomModel(OfKind):
    """Discs drawn from the scenario's seed, uniformly in a box.

    Attributes:
        count: How many.
        low_m: Lower left corner of the box of centres.
        high_m: Upper right corner.
        radius_low_m: Least radius.
        radius_high_m: Greatest radius.
        speed_high_mps: Greatest speed; directions are drawn too.
    """

    kind: Literal["random"]
    count: Annotated[int, Field(ge=1, le=MOST_OBSTACLES)]
    low_m: Point
    high_m: Point
    radius_low_m: NotNegative = 0.0
    radius_high_m: NotNegative = 0.3
    speed_high_mps: NotNegative = 0.0

    @model_validator(mode="after")
    def _ordered(self) -> "RandomModel":
        lows, highs = (*self.low_m, self.radius_low_m), self.high_m
        ordered(lows, (*highs, self.radius_high_m))
        return self


class BarnModel(OfKind):
    """All cylinders of a BARN world.

    Attributes:
        world: Its number.
    """

    kind: Literal["barn"]
    world: Natural


class MapModel(OfKind):
    """All walls of a map_server map, beside the scenario file or in the data folder.

    Attributes:
        file: The map's YAML.
    """

    kind: Literal["map"]
    file: str


ObstacleModel = Annotated[
    DiscModel
    | WaypointsModel
    | WallModel
    | PolygonModel
    | PointsModel
    | RandomModel
    | BarnModel
    | MapModel,
    Field(discriminator="kind"),
]

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
        footprint_m: Corners of a polygon in the robot frame, counter-clockwise, with
            the middle of the axle at (0, 0); or a list of polygons, whose union it is.
        track_m: Distance between the wheels; wanted by ``wheel_speed_mps`` and wheel
            slip.
    """

    preset: Preset = "mir100"
    footprint_m: list[Point] | list[list[Point]] | None = None
    track_m: Positive | None = None


@keyed(CubicPath)
class CubicModel(OfKind):
    """The paper's path, Eq. 2 and 3.

    Attributes:
        start: First pose.
        goal: Last pose.
    """

    kind: Literal["cubic"]
    start: PoseModel
    goal: PoseModel


class StationModel(OfKind):
    """Standing at a pose.

    Attributes:
        pose: Where to stand.
    """

    kind: Literal["station"]
    pose: PoseModel


@keyed(SplinePath)
class SmoothModel(OfKind):
    """How a smooth path near a polyline is driven."""


class SplineModel(SmoothModel):
    """A smooth path near way-points.

    Attributes:
        points_m: Way-points, at least two.
    """

    kind: Literal["spline"]
    points_m: list[Point]


class BarnPathModel(SmoothModel):
    """The published reference path of a BARN world.

    Attributes:
        world: Number of the BARN world.
    """

    kind: Literal["barn"]
    world: Natural


ReferenceModel = Annotated[
    CubicModel | StationModel | SplineModel | BarnPathModel,
    Field(discriminator="kind"),
]


class MemberModel(OfKind):
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


LocalisationModel: Any = Annotated[
    tagged("motion_capture", MotionCapture, Strict) | tagged("uwb", Uwb, Strict),
    Field(discriminator="kind"),
]


@keyed(Plant)
class SlipModel(OfKind):
    """Wheels that slip at random, and lag."""

    kind: Literal["slip"] = "slip"


PatchModel: Any = model_of(Patch, Strict)


@keyed(Physics)
class PhysicsModel(OfKind):
    """Rigid bodies in MuJoCo.

    Attributes:
        patches: Ground of another friction.
    """

    kind: Literal["mujoco"]
    patches: list[PatchModel] = Field(default_factory=list)

    def make(self, **given: Any) -> Any:
        """Return the settings."""
        return super().make(patches=tuple(one.make() for one in self.patches))


def _plant_kind(told: Any) -> str:
    """Return the kind of a plant; one that does not say it slips."""
    return str(told.get("kind", "slip")) if isinstance(told, dict) else "slip"


PlantModel = Annotated[
    Annotated[SlipModel, Tag("slip")] | Annotated[PhysicsModel, Tag("mujoco")],
    Discriminator(_plant_kind),
]


GuideModel: Any = model_of(GuideSettings, Strict)
LidarModel: Any = model_of(LidarSettings, Strict)
PerceptionModel: Any = model_of(PerceptionSettings, Strict)


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
        frames_s: Times of the figure's frames; none: it shows whole paths.
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
        guide: A stage that weighs the next seconds; ``+guide`` turns it on too.
        sight_m: What is farther away is not seen.
        lidar: The robot sees points alone, by a LiDAR.
        perception: What is known about moving bodies, for LiDARs.
        localisation: The pose is measured, not known.
        plant: The base is no ideal unicycle.
        obstacles: All that is in the way.
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
    guide: GuideModel | None = None
    sight_m: Annotated[float, Field(gt=0)] = float("inf")
    lidar: LidarModel | None = None
    perception: PerceptionModel = Field(default_factory=PerceptionModel)
    localisation: LocalisationModel | None = None
    plant: PlantModel | None = None
    obstacles: list[ObstacleModel] = Field(default_factory=list)

    @model_validator(mode="after")
    def _referred(self) -> Self:
        """A reference there must be, of the scenario or of its robots."""
        if self.reference is None and not self.robots:
            raise ValueError("reference: field required, or [[robots]]")
        return self
