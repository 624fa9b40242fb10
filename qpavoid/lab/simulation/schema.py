"""The scenario file, as strict models: every key, its unit in its name, its default."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from qpavoid.lab.simulation.schema_base import (
    Finite,
    NotNegative,
    Place,
    Point,
    Positive,
    Strict,
)
from qpavoid.lab.simulation.schema_obstacles import ObstacleModel

Preset = Literal["mir100", "mir100_rectangle", "jackal"]


class PoseModel(Strict):
    """A pose in the world frame."""

    x_m: Finite
    y_m: Finite
    heading_rad: Finite = 0.0

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, γ)."""
        return self.x_m, self.y_m, self.heading_rad


class RobotModel(Strict):
    """A preset, with other limits or another footprint where given."""

    preset: Preset = "mir100"
    footprint_m: list[Point] | None = None
    v_min_mps: Annotated[float, Field(le=0)] | None = None
    v_max_mps: Annotated[float, Field(ge=0)] | None = None
    omega_min_radps: Annotated[float, Field(le=0)] | None = None
    omega_max_radps: Annotated[float, Field(ge=0)] | None = None
    acceleration_mps2: Annotated[float, Field(gt=0)] | None = None
    angular_acceleration_radps2: Annotated[float, Field(gt=0)] | None = None
    wheel_speed_mps: Annotated[float, Field(gt=0)] | None = None
    track_m: Positive | None = None


class CubicModel(Strict):
    """The paper's path, Eq. 2 and 3."""

    kind: Literal["cubic"]
    start: PoseModel
    goal: PoseModel
    k_m: Positive
    duration_s: Positive


class StationModel(Strict):
    """Standing at a pose."""

    kind: Literal["station"]
    pose: PoseModel


class SmoothModel(Strict):
    """How a smooth path near a polyline is driven."""

    speed_mps: Positive
    turn_rate_radps: Positive = 1.0
    acceleration_mps2: Positive = 0.5
    smoothing_m: NotNegative = 0.02


class SplineModel(SmoothModel):
    """A smooth path near way-points."""

    kind: Literal["spline"]
    points_m: list[Point]


class BarnPathModel(SmoothModel):
    """The published reference path of a BARN world."""

    kind: Literal["barn"]
    world: Annotated[int, Field(ge=0)]


class TrackingModel(Strict):
    """Gains of Eq. 6, a law at rest of its own, a reference that waits."""

    k_x_per_s: NotNegative = 1.0
    k_y_rad_per_m2: NotNegative = 1.0
    k_gamma_radps: NotNegative = 2.0
    station_keeping: bool = False
    k_rho_per_s: Positive = 1.0
    k_alpha_per_s: Positive = 4.0
    k_theta: Positive = 2.0
    waiting: bool = False
    wait_free_m: NotNegative = 0.1
    wait_wide_m: Positive = 0.4
    wait_least_rate: Annotated[float, Field(ge=0, le=1)] = 0.05


class RadiusModel(Strict):
    """r_min over the obstacle's speed, and r = ratio · r_min."""

    low_m: NotNegative = 0.17
    high_m: NotNegative = 0.23
    speed_low_mps: NotNegative = 0.1
    speed_high_mps: NotNegative = 0.5
    ratio: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 4.0 / 3.0
    closing_s: NotNegative = 0.0


class MarginsModel(Strict):
    """What may be wrong about an obstacle."""

    error_m: NotNegative = 0.0
    acceleration_mps2: NotNegative = 0.0


class ActuationModel(Strict):
    """What the filter expects the base to do to a twist."""

    delay_s: NotNegative = 0.0
    jitter: NotNegative = 0.0
    ramps: bool = False


class AheadModel(Strict):
    """How far ahead the look-ahead rows see."""

    horizon_s: Positive = 3.0
    horizon_still_s: NotNegative = 1.0
    tick_s: Positive = 0.05
    hysteresis: Annotated[float, Field(ge=0, lt=1)] = 0.4
    review_s: NotNegative = 0.4
    closest_m: Annotated[float, Field(ge=0.01)] = 0.02


class RepulsionModel(Strict):
    """ẋ_0 of Eq. 5 and 7."""

    speed_mps: NotNegative = 10.0
    activation: Literal["step", "linear", "smooth"] = "linear"
    damping_m: NotNegative = 0.0


class FilterModel(Strict):
    """The QP filter."""

    weight_v: Positive = 1.0
    weight_omega_m2: Positive = 0.03
    bound: Literal["barrier", "repulsion"] = "barrier"
    gamma_per_s: Positive = 2.0
    reach_m: Annotated[float, Field(gt=0)] = float("inf")
    slack_tolerance_mps: Positive = 1e-3
    braking_room: bool = True
    passive: bool = False


class PublishedModel(Strict):
    """What the paper states of one method, shown beside what is measured."""

    zone_entry_s: Finite | None = None
    zone_exit_s: Finite | None = None
    about: bool = False


class DetourModel(Strict):
    """The stage that leads a stalled robot round what is near."""

    stall_time_s: Positive = 2.0
    progress_m: Positive = 0.15
    blocked_time_s: Positive = 10.0
    tolerance_m: Positive = 0.05
    speed_mps: Positive = 0.7
    turn_rate_radps: Positive = 1.0
    clearance_m: NotNegative = 0.01
    reach_m: Positive = 6.0
    interval_s: Positive = 0.5


class EstimationModel(Strict):
    """Velocities of discs estimated from their positions, instead of given."""

    acceleration_mps2: Positive = 1.0
    noise_m: Positive = 0.02
    speed_mps: Positive = 1.5
    forget_s: Positive = 1.0


class PlannerModel(Strict):
    """The global planner of methods that have one."""

    resolution_m: Positive = 0.1
    inflation_m: NotNegative = 0.0
    soft_m: Positive = 0.6
    weight: NotNegative = 4.0
    margin_m: Positive = 3.0
    sight_m: Positive = 8.0
    memory_s: NotNegative = 10.0
    interval_s: Positive = 0.5
    astray_m: Positive = 1.0


class LidarModel(Strict):
    """Obstacles are seen by a planar LiDAR."""

    field_of_view_rad: Positive = 6.283185307179586
    beams: Annotated[int, Field(ge=1)] = 360
    range_m: Positive = 10.0
    rate_hz: Positive = 10.0
    latency_s: NotNegative = 0.0
    noise_m: NotNegative = 0.01
    dropout: Annotated[float, Field(ge=0, le=1)] = 0.0
    tracks: bool = False


class MotionCaptureModel(Strict):
    """The pose is measured to less than a millimetre."""

    kind: Literal["motion_capture"]
    sigma_m: NotNegative = 0.0005
    heading_sigma_rad: NotNegative = 0.001


class UwbModel(Strict):
    """Positions by radio, fused with odometry by an EKF."""

    kind: Literal["uwb"]
    sigma_m: Positive = 0.1
    rate_hz: Positive = 10.0
    slip: Positive = 0.05


LocalisationModel = MotionCaptureModel | UwbModel


class PlantModel(Strict):
    """Wheels that slip, and motors that lag."""

    slip: NotNegative = 0.0
    lag_v_s: NotNegative = 0.0
    lag_omega_s: NotNegative = 0.0


class OwnModel(Strict):
    """Parts of one's own, each as ``module:Name``."""

    reference: Place | None = None
    sensor: Place | None = None
    plant: Place | None = None


class ScenarioModel(Strict):
    """A whole scenario file."""

    title: str
    duration_s: Positive
    dt_s: Positive = 0.01
    seed: Annotated[int, Field(ge=0)] = 0
    ends_at_goal: bool = False
    settled_s: NotNegative = 1.0
    arrival_m: NotNegative = 0.1
    arrival_rad: NotNegative = 0.1
    frames_s: list[NotNegative] = Field(default_factory=list)
    start: PoseModel | None = None
    robot: RobotModel = RobotModel()
    reference: (
        Annotated[
            CubicModel | StationModel | SplineModel | BarnPathModel,
            Field(discriminator="kind"),
        ]
        | None
    ) = None
    own: OwnModel = OwnModel()
    tracking: TrackingModel = TrackingModel()
    radius: RadiusModel = RadiusModel()
    repulsion: RepulsionModel = RepulsionModel()
    filter: FilterModel = FilterModel()
    margins: MarginsModel = MarginsModel()
    actuation: ActuationModel = ActuationModel()
    ahead: AheadModel = AheadModel()
    estimation: EstimationModel | None = None
    detour: DetourModel | None = None
    planner: PlannerModel = PlannerModel()
    sight_m: Annotated[float, Field(gt=0)] = float("inf")
    lidar: LidarModel | None = None
    localisation: (
        Annotated[MotionCaptureModel | UwbModel, Field(discriminator="kind")] | None
    ) = None
    plant: PlantModel | None = None
    obstacles: list[ObstacleModel] = Field(default_factory=list)
    published: dict[str, PublishedModel] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _once(self) -> Self:
        """A reference there must be, and of nothing two."""
        if (self.reference is None) == (self.own.reference is None):
            raise ValueError("give either reference or own.reference")
        if self.own.plant and self.plant:
            raise ValueError("give either plant or own.plant")
        if self.own.sensor and (self.lidar or self.estimation):
            raise ValueError("give either own.sensor, or lidar or estimation")
        return self
