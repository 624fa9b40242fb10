"""The obstacles of a scenario file, as strict models."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.schema_base import (
    Finite,
    Natural,
    NotNegative,
    Point,
    Strict,
)
from qpavoid.model.obstacles import Obstacles

MOST_OBSTACLES = 10_000
"""In a scenario, but for points and the walls of maps."""


class DiscModel(Strict):
    """A disc at rest or with a constant velocity; radius 0 is a point.

    Attributes:
        kind: A disc.
        position_m: Centre at the start.
        radius_m: Of the disc.
        velocity_mps: Constant.
    """

    kind: Literal["disc"]
    position_m: Point
    radius_m: NotNegative = 0.0
    velocity_mps: Point = (0.0, 0.0)


class WaypointsModel(Strict):
    """A disc that moves along straight lines, and stands before and after.

    Or, fleeting, is not there before and after.

    Attributes:
        kind: A disc under way.
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


class WallModel(Strict):
    """A straight wall.

    Attributes:
        kind: A wall.
        start_m: One end.
        end_m: The other.
    """

    kind: Literal["wall"]
    start_m: Point
    end_m: Point


class PolygonModel(Strict):
    """A convex polygon, counter-clockwise, at rest or moving and turning steadily.

    The velocity is that of the centroid of its area, about which it turns. Or it is
    pushed about without turning, along straight lines between way-points.

    Attributes:
        kind: A convex polygon.
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


class PointsModel(Strict):
    """Points at rest from a CSV or NPY file beside the scenario file.

    Attributes:
        kind: Points.
        file: CSV with columns x, y, or NPY (N, 2), in m.
    """

    kind: Literal["points"]
    file: str


class RandomModel(Strict):
    """Discs drawn from the scenario's seed, uniformly in a box.

    Attributes:
        kind: Discs at random.
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
        pairs = zip(
            (*self.low_m, self.radius_low_m),
            (*self.high_m, self.radius_high_m),
            strict=True,
        )
        if any(low > high for low, high in pairs):
            raise ValueError("a low bound lies above its high bound")
        return self


class BarnModel(Strict):
    """All cylinders of a BARN world.

    Attributes:
        kind: A BARN world.
        world: Its number.
    """

    kind: Literal["barn"]
    world: Natural


class MapModel(Strict):
    """All walls of a map_server map, beside the scenario file or in the data folder.

    Attributes:
        kind: An occupancy map.
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
