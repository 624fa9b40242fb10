"""The filter for one robot as C99 source, header and example."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid import __version__
from qpavoid.avoidance.ahead import fresh_state
from qpavoid.avoidance.decision import INVALID, Status
from qpavoid.avoidance.settings import RECORD, AvoidanceSettings
from qpavoid.avoidance.step import filter_step, tables_in, work_size
from qpavoid.errors import InvalidInputError
from qpavoid.export.statements import wrapped
from qpavoid.export.translate import Translation
from qpavoid.export.values import Grid, Scalar, Value, c_number, c_type, constant
from qpavoid.model.footprint import Array
from qpavoid.model.robot import Robot, braking_twist

TEMPLATES = Path(__file__).with_name("templates")
FILES = ("qpavoid_filter.h", "qpavoid_filter.c", "main.c")


@dataclass(frozen=True)
class Capacity:
    """How many obstacles the exported filter takes at once.

    Attributes:
        discs: Discs with velocities, at least 1.
        points: Sensed points.
        walls: Segments.

    Raises:
        InvalidInputError: No discs, or a negative number.
    """

    discs: int
    points: int = 0
    walls: int = 0

    def __post_init__(self) -> None:
        if self.discs < 1 or self.points < 0 or self.walls < 0:
            raise InvalidInputError("an export wants discs >= 1, points and walls >= 0")

    @property
    def fields(self) -> tuple[tuple[str, int, int], ...]:
        """Name, capacity and columns of every array, in the filter's order."""
        return (
            ("points", self.points, 2),
            ("discs", self.discs, 3),
            ("disc_velocities", self.discs, 2),
            ("walls", self.walls, 4),
        )


def export_c(
    folder: str | PathLike[str],
    robot: Robot,
    settings: AvoidanceSettings,
    capacity: Capacity,
    ahead: bool = True,
) -> list[Path]:
    """Write the filter as C99 source and header with an example, and return the files.

    Source, header and libm are all that is needed. The functions are translated from
    the package's own, so that both compute the same; robot and settings are constants.

    Args:
        folder: Where to; made if it is not there.
        robot: Footprint and limits.
        settings: As for :class:`qpavoid.SafetyFilter`.
        capacity: How many obstacles at most.
        ahead: Look ahead, as :class:`qpavoid.SafetyFilter` does by default.

    Raises:
        TranslationError: A compiled function does what cannot be written as C.
    """
    texts = c_texts(robot, settings, capacity, ahead)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        template = Template((TEMPLATES / name).read_text(encoding="utf-8"))
        (target / name).write_text(template.substitute(texts), encoding="utf-8")
    return [target / name for name in FILES]


def c_texts(
    robot: Robot, settings: AvoidanceSettings, capacity: Capacity, ahead: bool
) -> dict[str, Any]:
    """Return what the templates have to be filled with."""
    record, numbers = settings.record(), robot.numbers
    edges, state = robot.footprint.edges, fresh_state()
    most = capacity.points + capacity.discs + capacity.walls * (2 + len(edges))
    translation = Translation()
    known = [
        Value(None, name, known=data)
        for name, data in (("edges", edges), ("robot", numbers), ("settings", record))
    ]
    arrays = [Value(Grid(2), name) for name, _, _ in capacity.fields]
    tables = translation.call(tables_in, [Value(Grid(1), "work"), constant(most)])
    step = translation.call(
        filter_step,
        [
            *known,
            translation.packed(arrays),
            number("age"),
            Value(None, c_number(ahead), known=ahead),
            number("v"),
            number("omega"),
            Value(Grid(1), "state"),
            tables,
        ],
    )
    last = [number(f"filter->state[{i}]") for i in range(2)]
    dt = constant(settings.dt, "settings.dt")
    braking = translation.call(braking_twist, [known[1], *last, dt])
    assert step.kind is not None
    return {
        "version": __version__,
        "robot": f"Robot: {robot.name}, a polygon of {len(edges)} corners.",
        "filter": f"It looks {'ahead' if ahead else 'at the present only'}.",
        "dt": c_number(settings.dt),
        "state": len(state),
        "fresh": braced(state),
        "work": work_size(most),
        "constants": constants(edges, numbers, record),
        "functions": translation.text,
        "answer": c_type(step.kind),
        "step": wrapped(step.text, "    ").lstrip(),
        "braking": braking.text,
        **obstacle_texts(capacity),
        **status_texts(),
    }


def number(text: str) -> Value:
    """Return a C variable that is a number."""
    return Value(Scalar.DOUBLE, text)


def braced(array: npt.NDArray[Any]) -> str:
    """Return a C initialiser."""
    if array.ndim:
        return f"{{{', '.join(braced(part) for part in array)}}}"
    return c_number(array.item())


def constants(edges: Array, numbers: Array, record: npt.NDArray[np.void]) -> str:
    """Return footprint, limits and settings as constants."""
    rows = ",\n".join(f"    {braced(edge)}" for edge in edges)
    fields = []
    for name in RECORD.names or ():
        kind = constant(record[0][name].item()).kind
        assert kind is not None
        fields.append((c_type(kind), name, c_number(record[0][name].item())))
    named = "\n".join(f"    {kind} {name};" for kind, name, _ in fields)
    values = "\n".join(f"    {value}, /* {name} */" for _, name, value in fields)
    return f"""\
/* Edges of the footprint: start (m), outward unit normal, length (m). */
static const double edges[{len(edges)}][5] = {{
{rows}
}};

/* v_min, v_max, omega_min, omega_max, acceleration, angular_acceleration, wheel_speed,
 * track, and the footprint's circumradius; m/s, rad/s and m. */
static const double robot[{len(numbers)}] = {braced(numbers)};

static const struct {{
{named}
}} settings = {{
{values}
}};"""


def obstacle_texts(capacity: Capacity) -> dict[str, str]:
    """Return what depends on the obstacles: their fields, counts and views."""
    what = {
        "points": "x, y, m: sensed points at rest",
        "discs": "x, y, radius, m",
        "disc_velocities": "over ground, in robot axes, m/s",
        "walls": "x1, y1, x2, y2, m: segments at rest",
    }
    defines, fields, counted, views = [], [], [], []
    for name, size, columns in capacity.fields:
        count = "n_discs" if name == "disc_velocities" else f"n_{name}"
        bound = f"QPAVOID_{count[2:].upper()}"
        if size and count[2:] == name:
            defines.append(f"#define {bound} {size}")
            fields.append(f"    int {count};")
            counted.append(
                f"\n          && obstacles->{count} >= 0 && obstacles->{count} <= {bound}"
            )
        view = "0, 0"
        if size:
            fields.append(f"    double {name}[{bound}][{columns}]; /* {what[name]} */")
            view = f"(double *)obstacles->{name}, obstacles->{count}"
        views.append(f"    const array {name} = {{{view}, {columns}, 1}};")
    return {
        "capacities": "\n".join(defines),
        "obstacles": "\n".join(fields),
        "counted": "".join(counted),
        "views": "\n".join(views),
    }


def status_texts() -> dict[str, str]:
    """Return the statuses that the filter can give, with their sentences."""
    statuses = [Status.TRACKING, Status.FILTERED, Status.RELAXED, Status.STOPPED]
    statuses += [Status.BRAKING, Status.HOLDING]
    names = [("INVALID", INVALID)] + [(s.name, s.number) for s in statuses]
    return {
        "statuses": ",\n".join(f"    QPAVOID_{name} = {code}" for name, code in names),
        "sentences": "\n".join(
            f'    case QPAVOID_{s.name}:\n        return "{s.sentence}";'
            for s in statuses
        ),
    }
