"""The filter for one robot as C99 source, header and example."""

from dataclasses import asdict, dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.decision import INVALID, Status
from qpavoid.avoidance.settings import RECORD, AvoidanceSettings
from qpavoid.avoidance.state import fresh_state, set_driven
from qpavoid.avoidance.step import filter_outcome
from qpavoid.avoidance.validation import OLDEST
from qpavoid.avoidance.workspace import memory_size
from qpavoid.errors import InvalidInputError
from qpavoid.export.translate import Translation
from qpavoid.export.values import Value, c_number, constant, wrapped
from qpavoid.model.capsules import CAPSULE_WIDTH, fill_capsules
from qpavoid.model.footprint import Array
from qpavoid.model.robot import Robot, braking_twist, driven_twist

TEMPLATES = Path(__file__).with_name("templates")
FILES = ("qpavoid_filter.h", "qpavoid_filter.c", "main.c")
STATUSES = (
    Status.TRACKING,
    Status.FILTERED,
    Status.RELAXED,
    Status.PLANNED,
    Status.STOPPED,
    Status.BRAKING,
    Status.HOLDING,
)
"""What the filter can answer, beside that the data are not valid."""


GIVEN = ("discs", "disc_velocities", "walls", "at_rest", "corners", "polygons")
"""What the table of the capsules is made of, in C."""


@dataclass(frozen=True)
class Capacity:
    """How many obstacles the exported filter takes at once.

    Attributes:
        discs: Discs with velocities, at least 1.
        points: Sensed points.
        walls: Segments.
        polygons: Convex polygons with velocities and rates of turn.
        corners: Of all polygons together, at least three for each.

    Raises:
        InvalidInputError: No discs, too few corners, or a negative number.
    """

    discs: int
    points: int = 0
    walls: int = 0
    polygons: int = 0
    corners: int = 0

    def __post_init__(self) -> None:
        if self.discs < 1 or min(self.points, self.walls, self.polygons) < 0:
            raise InvalidInputError("an export wants discs >= 1, and no number below 0")
        if self.corners < 3 * self.polygons:
            raise InvalidInputError("an export wants corners >= 3 for each polygon")

    @property
    def capsules(self) -> int:
        """How many rows the table of the obstacles other than points has."""
        return self.discs + self.walls + self.corners


def export_c(
    folder: str | PathLike[str],
    robot: Robot,
    settings: AvoidanceSettings,
    capacity: Capacity,
    ahead: bool = True,
) -> list[Path]:
    """Write the filter as C99 source and header with an example; return the files.

    Besides them only libm is needed. The functions are translated from those that the
    package itself runs, so that both compute the same; robot and settings are
    constants.

    Args:
        folder: Where to; made if it is not there.
        robot: Footprint and limits.
        settings: As for :class:`qpavoid.SafetyFilter`.
        capacity: How many obstacles at most.
        ahead: Look ahead, as :class:`qpavoid.SafetyFilter` does by default.

    Raises:
        TranslationError: A compiled function does what cannot be written as C.
    """
    texts = {
        "version": version("qpavoid"),
        "robot": f"{robot.name}, a polygon of {len(robot.footprint.edges)} corners",
        "filter": "ahead" if ahead else "at the present only",
        "dt": c_number(settings.dt),
        "oldest": c_number(OLDEST),
        **asdict(capacity),
        **translated(robot, settings, capacity, ahead),
        **status_texts(),
    }
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        template = Template((TEMPLATES / name).read_text(encoding="utf-8"))
        (target / name).write_text(template.substitute(texts), encoding="utf-8")
    return [target / name for name in FILES]


def translated(
    robot: Robot, settings: AvoidanceSettings, capacity: Capacity, ahead: bool
) -> dict[str, Any]:
    """Return the functions as C, how they are called, and their constants."""
    edges, numbers, record = robot.footprint.edges, robot.numbers, settings.record()
    most = capacity.points + capacity.discs + capacity.walls * (2 + len(edges))
    most += capacity.corners * (1 + len(edges))
    translation = Translation()
    known = [
        Value("", name, known=data)
        for name, data in (("edges", edges), ("robot", numbers), ("settings", record))
    ]
    arrays = [Value("matrix", name) for name in ("points", "capsules")]
    given = [Value("matrix", name) for name in GIVEN]
    age, v, omega = (Value("double", name) for name in ("age", "v", "omega"))
    how = Value("", c_number(ahead), known=ahead)
    size, state = memory_size(most, record), len(fresh_state())
    run = Value("vector", f"(vector){{filter->state, {state}}}")
    memory = Value("vector", f"(vector){{filter->memory, {size}}}")
    setup, obstacles = translation.packed(known, Setup), translation.packed(arrays)
    asked = [obstacles, age, how, translation.packed([v, omega])]
    request = translation.packed(asked, Request)
    step = translation.call(filter_outcome, [setup, request, run, memory])
    fill = translation.call(fill_capsules, [Value("int", "n"), *given, arrays[1]])
    last = [Value("double", f"filter->state[{i}]") for i in range(2)]
    dt = constant(settings.dt, "settings.dt")
    braking = translation.call(braking_twist, [known[1], *last, dt])
    driven = translation.call(driven_twist, [known[1], v, omega])
    twist = [translation.part(Value(driven.kind, "twist"), i) for i in range(2)]
    return {
        "twist": braking.kind,
        "braking": braking.text,
        "driven": driven.text,
        "set_driven": translation.call(set_driven, [run, *twist]).text,
        "fill": wrapped(fill.text, 1).lstrip(),
        "capsules": capacity.capsules,
        "capsule_width": CAPSULE_WIDTH,
        "step": wrapped(step.text, 1).lstrip(),
        "answer": step.kind,
        "functions": translation.text,
        "constants": constants(edges, numbers, record),
        "state": state,
        "fresh": braced(fresh_state()),
        "memory": size,
    }


def braced(array: npt.NDArray[Any]) -> str:
    """Return a C initialiser."""
    if array.ndim:
        return f"{{{', '.join(braced(part) for part in array)}}}"
    return c_number(array.item())


def constants(edges: Array, numbers: Array, record: npt.NDArray[np.void]) -> str:
    """Return footprint, limits and settings as constants."""
    rows = ",\n".join(f"    {braced(edge)}" for edge in edges)
    values = {name: constant(record[0][name].item()) for name in RECORD.names or ()}
    fields = "\n".join(f"    {value.kind} {name};" for name, value in values.items())
    given = "\n".join(f"    {value.text}, /* {n} */" for n, value in values.items())
    return f"""\
/* Edges of the footprint: start (m), outward unit normal, length (m). */
static const double edges[{len(edges)}][5] = {{
{rows}
}};

/* v_min, v_max, omega_min, omega_max, acceleration, angular_acceleration, wheel_speed,
 * track, and the footprint's circumradius; m/s, rad/s and m. */
static const double robot[{len(numbers)}] = {braced(numbers)};

static const struct {{
{fields}
}} settings = {{
{given}
}};"""


def status_texts() -> dict[str, str]:
    """Return the statuses with their numbers, and their sentences."""
    names = {"INVALID": INVALID} | {status.name: status.number for status in STATUSES}
    return {
        "statuses": ",\n".join(
            f"    QPAVOID_{n} = {code}" for n, code in names.items()
        ),
        "sentences": "\n".join(
            f'    case QPAVOID_{status.name}:\n        return "{status.sentence}";'
            for status in STATUSES
        ),
    }
