"""Export of the filter for one robot: C99 source, header and example."""

from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from string import Template
from typing import Any

from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.decision import INVALID, Status
from qpavoid.avoidance.inputs import OLDEST
from qpavoid.avoidance.plan import fresh_state, set_driven
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import NO_ANSWER, filter_outcome, memory_size
from qpavoid.errors import InvalidInputError
from qpavoid.export.perception import PERCEPTION_FILES, perception_texts
from qpavoid.export.translate import Translation
from qpavoid.export.values import TEMPLATES, Value, braced, c_number, constant, wrapped
from qpavoid.model.capsules import CAPSULE_WIDTH, fill_capsules, is_convex
from qpavoid.model.footprint import Footprint, fill_edges
from qpavoid.model.robot import Robot, braking_twist, driven_twist
from qpavoid.perception.settings import Lidar, PerceptionSettings

C_FILES = ("qpavoid_filter.h", "qpavoid_filter.c", "main.c")
STATUSES = (
    *(Status.TRACKING, Status.FILTERED, Status.RELAXED, Status.PLANNED),
    *(Status.STOPPED, Status.BRAKING, Status.HOLDING),
)
"""Statuses of the exported filter, without that of invalid data."""

OBSTACLES = ("discs", "disc_velocities", "walls", "at_rest", "corners", "polygons")
"""Arguments of the table of capsules in C."""


@dataclass(frozen=True)
class Capacity:
    """Greatest numbers of obstacles of the exported filter.

    Attributes:
        discs: Discs with velocities, at least 1.
        points: Sensed points.
        walls: Segments.
        polygons: Convex polygons with velocities and rates of turn.
        corners: Of all polygons together, at least three for each.
        beams: Of a scan; 0: no perception is exported.
        parts: Convex parts of the footprint; at least those of the exported one.
        edges: Of all parts together; at least those of the exported footprint.

    Raises:
        InvalidInputError: No discs, too few corners, or a negative number.
    """

    discs: int
    points: int = 0
    walls: int = 0
    polygons: int = 0
    corners: int = 0
    beams: int = 0
    parts: int = 0
    edges: int = 0

    def __post_init__(self) -> None:
        if self.discs < 1 or min(asdict(self).values()) < 0:
            raise InvalidInputError("an export needs discs >= 1, and no number below 0")
        if self.corners < 3 * self.polygons:
            raise InvalidInputError("an export needs corners >= 3 for each polygon")

    @property
    def capsules(self) -> int:
        """Rows of the table of obstacles other than points."""
        return self.discs + self.walls + self.corners

    @property
    def rows(self) -> int:
        """Greatest number of rows of the QP."""
        edges, parts = self.edges, self.parts
        most = (self.points + self.discs) * parts + self.walls * (2 * parts + edges)
        return most + self.corners * (parts + edges)

    def fitting(self, footprint: Footprint) -> "Capacity":
        """Return a capacity that is large enough for a footprint."""
        parts, edges = len(footprint.parts), len(footprint.edges)
        most = {"parts": max(self.parts, parts), "edges": max(self.edges, edges)}
        return replace(self, **most)


def export_c(
    folder: str | PathLike[str],
    robot: Robot,
    settings: AvoidanceSettings,
    capacity: Capacity,
    ahead: bool = True,
    lidar: Lidar | None = None,
    bodies: PerceptionSettings | None = None,
) -> list[Path]:
    """Write the filter as C99 source and header with an example; return the files.

    With beams in the capacity, perception as well. They need only libm. The functions
    are translated from the package's own, so that both compute the same; robot and
    settings are constants.

    Args:
        folder: Target; created if missing.
        robot: Footprint and limits.
        settings: As for :class:`qpavoid.SafetyFilter`.
        capacity: Greatest numbers of obstacles.
        ahead: Look ahead, as :class:`qpavoid.SafetyFilter` does by default.
        lidar: Geometry of the scanner whose scans are perceived; default all round, at
            the middle of the axle.
        bodies: Model of moving bodies, and memory.

    Raises:
        TranslationError: A compiled function cannot be written as C.
    """
    capacity = capacity.fitting(robot.footprint)
    texts = {
        "version": version("qpavoid"),
        "robot": f"{robot.name}, of {len(robot.footprint.edges)} edges",
        "filter": "ahead" if ahead else "at the present only",
        "dt": c_number(settings.dt),
        "oldest": c_number(OLDEST),
        "capsules": capacity.capsules,
        "capsule_width": CAPSULE_WIDTH,
        **asdict(capacity),
        **functions(robot, settings, capacity, ahead),
        **constants(robot, settings),
        **statuses(),
    }
    files = [*C_FILES]
    if capacity.beams:
        scanner = Lidar() if lidar is None else lidar
        texts |= perception_texts(robot, scanner, capacity.beams, bodies)
        files += PERCEPTION_FILES
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for name in files:
        template = Template((TEMPLATES / name).read_text(encoding="utf-8"))
        (target / name).write_text(template.substitute(texts), encoding="utf-8")
    return [target / name for name in files]


def functions(
    robot: Robot, settings: AvoidanceSettings, capacity: Capacity, ahead: bool
) -> dict[str, Any]:
    """Return the functions as C, their calls, and the sizes of their arrays."""
    translation, record = Translation(), settings.record()
    call, packed = translation.call, translation.structs.packed
    size, state = memory_size(capacity.rows, record), len(fresh_state())
    limits = f"(vector){{filter->robot, {len(robot.limit_vector)}}}"
    edges = "(matrix){filter->edges[0], filter->n_edges, 6}"
    given = Value("matrix", edges), Value("vector", limits)
    setup = packed([*given, Value("", "settings", known=record)], Setup)
    points, capsules = Value("matrix", "points"), Value("matrix", "capsules")
    age, v, omega = (Value("double", name) for name in ("age", "v", "omega"))
    look_ahead = Value("", c_number(ahead), known=ahead)
    run = Value("vector", f"(vector){{filter->state, {state}}}")
    memory = Value("vector", f"(vector){{filter->memory, {size}}}")
    asked = [packed([points, capsules]), age, look_ahead, packed([v, omega])]
    none = packed([Value("double", c_number(x)) for x in NO_ANSWER])
    step = call(filter_outcome, [setup, packed(asked, Request), none, run, memory])
    arrays = [Value("matrix", name) for name in OBSTACLES]
    fill = call(fill_capsules, [Value("int", "n"), *arrays, capsules])
    last = [Value("double", f"filter->state[{i}]") for i in range(2)]
    dt = constant(settings.dt, "settings.dt")
    braking = call(braking_twist, [setup.parts[1], *last, dt])
    driven = call(driven_twist, [setup.parts[1], v, omega])
    twist = translation.structs.parts(Value(driven.kind, "twist"))
    part = [Value("matrix", "given"), Value("int", "begin"), Value("int", "end")]
    return {
        "is_convex": call(is_convex, part).text,
        "fill_edges": call(fill_edges, [*part, given[0]]).text,
        "twist": braking.kind,
        "braking": braking.text,
        "driven": driven.text,
        "set_driven": call(set_driven, [run, *twist]).text,
        "fill": wrapped(fill.text, 1).lstrip(),
        "step": wrapped(step.text, 1).lstrip(),
        "answer": step.kind,
        "functions": translation.text,
        "state": state,
        "fresh": braced(fresh_state()),
        "memory": size,
    }


def constants(robot: Robot, settings: AvoidanceSettings) -> dict[str, Any]:
    """Return footprint, limits and settings as initialisers."""
    edges, record = robot.footprint.edges, settings.record()[0]
    values = {name: constant(record[name].item()) for name in record.dtype.names or ()}
    return {
        "n_edges": len(edges),
        "own_edges": ",\n".join(f"    {braced(edge)}" for edge in edges),
        "n_limits": len(robot.limit_vector),
        "limits": braced(robot.limit_vector),
        "fields": "\n".join(f"    {v.kind} {name};" for name, v in values.items()),
        "values": "\n".join(f"    {v.text}, /* {n} */" for n, v in values.items()),
    }


def statuses() -> dict[str, str]:
    """Return the statuses with their numbers and sentences, in C."""
    numbers = {"INVALID": INVALID} | {status.name: status.number for status in STATUSES}
    return {
        "statuses": ",\n".join(f"    QPAVOID_{n} = {i}" for n, i in numbers.items()),
        "sentences": "\n".join(
            f'    case QPAVOID_{status.name}:\n        return "{status.sentence}";'
            for status in STATUSES
        ),
    }
