"""The commands for files of one's own: schema, init."""

import math
import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from qpavoid.cli.output import UsageError, give, make_console, show_table, told_by
from qpavoid.errors import ConfigError, InvalidInputError, QPAvoidError

if TYPE_CHECKING:
    from qpavoid.lab.study.keys import KeyTable

SHELLS = ("bash", "zsh", "tcsh")


def schema(options: Namespace) -> None:
    """Say what keys a file may have: all tables, or one with unit, default, effect."""
    from qpavoid.lab.study.keys import FILES, json_schema, tables_of

    file, _, rest = options.table.partition(".")
    if file not in FILES:
        file, rest = "scenario", options.table
    # Of a file with its name alone: all tables as JSON Schema, its top as text.
    name = options.table and rest
    if options.toml:
        if file != "scenario":
            raise UsageError("--toml: of a scenario alone")
        from qpavoid.lab.study.every_key import every_key

        print(every_key(name or None), end="")
    elif options.json and not rest:
        give(options, json_schema(file), lambda: None)
    else:
        found = tables_of(file, name if options.table else None)
        rows = [table._asdict() | {"keys": _rows(table)} for table in found]
        show = _show_table if options.table else _show_heads
        give(options, rows, lambda: show(found, file))


def _rows(table: "KeyTable") -> list[dict[str, str]]:
    return [key._asdict() for key in table.keys]


def _show_heads(tables: Sequence["KeyTable"], file: str) -> None:
    lines = [(t.head or "(top of the file)", len(t.keys), t.what) for t in tables]
    show_table(["table", "keys", ""], lines)


def _show_table(tables: Sequence["KeyTable"], file: str) -> None:
    for table in tables:
        make_console().print(f"{table.head or file}  {table.what}", markup=False)
        show_table(["key", "value", "unit", "default", "effect"], table.keys)


def corners(text: str) -> list[tuple[float, float]]:
    """Return the corners of ``LENGTH,WIDTH`` in m, or of ``x,y x,y x,y …``.

    They are counter-clockwise, in whichever order they were given.
    """
    try:
        pairs = [tuple(map(float, pair.split(","))) for pair in text.split()]
    except ValueError:
        pairs = []
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise ArgumentTypeError(f"{text!r} is no LENGTH,WIDTH and no corners x,y x,y …")
    if len(pairs) > 1:
        found = [(x, y) for x, y in pairs]
        turned = zip(found, [*found[1:], found[0]], strict=True)
        area = sum(a * d - b * c for (a, b), (c, d) in turned)
        return found if area >= 0.0 else found[::-1]
    length, width = pairs[0]
    if not (length > 0.0 and width > 0.0):
        raise ArgumentTypeError(f"{text!r}: LENGTH,WIDTH are above 0")
    x, y = 0.5 * length, 0.5 * width
    return [(-x, -y), (x, -y), (x, y), (-x, y)]


def above_zero(text: str) -> float:
    """Return a number above 0 and below a million."""
    return _within(text, float(text) > 0.0, "above 0")


def below_zero(text: str) -> float:
    """Return a number of 0 or less, and above minus a million."""
    return _within(text, float(text) <= 0.0, "0 or less")


def _within(text: str, fits: bool, what: str) -> float:
    from qpavoid.lab.study.first_scenario import MOST

    if not (fits and abs(float(text)) < MOST):
        raise ArgumentTypeError(f"{text} is not {what}, or beyond {MOST:g}")
    return float(text)


def beams(text: str) -> int:
    """Return how many beams a LiDAR has; none: there is no LiDAR."""
    from qpavoid.lab.study.first_scenario import MOST

    if not 0 <= int(text) <= MOST or 0 < int(text) < LEAST_BEAMS:
        raise ArgumentTypeError(f"{text} beams: wanted are 0, or {LEAST_BEAMS} or more")
    return int(text)


def angular(text: str) -> float | None:
    """Return an angular acceleration above 0; None for the default."""
    return None if text == TWICE else above_zero(text)


def view(text: str) -> float:
    """Return the view of a LiDAR in rad."""
    return math.radians(_within(text, 0.0 < float(text) <= 360.0, "above 0, up to 360"))


def mount(text: str) -> tuple[float, float, float]:
    """Return x, y (m) and heading (rad) of a LiDAR on the robot."""
    try:
        x, y, heading = map(float, text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{text!r} is no X,Y,HEADING") from None
    if not (max(abs(x), abs(y)) <= LONGEST and abs(heading) <= 360.0):
        said = f"X, Y are in m, at most {LONGEST:g}, HEADING in degrees, not {text}"
        raise ArgumentTypeError(said)
    return x, y, math.radians(heading)


TWICE = "twice the acceleration"

LONGEST = 20.0
"""m of a robot."""

LEAST_BEAMS = 36
"""Between fewer somebody at 3 m who is 0.6 m wide is missed."""

TRIED = 0.2
"""m/s and m/s² from which on all that were tried arrive; at half of it none did."""

QUESTIONS: dict[str, tuple[str, str, Callable[[str], Any]]] = {
    "footprint": ("LENGTH,WIDTH in m, or corners x,y x,y …", "0.9,0.6", corners),
    "v_max": ("greatest speed, m/s", "1.0", above_zero),
    "v_min": ("least speed, m/s: 0 never backs up", "-0.5", below_zero),
    "omega_max": ("greatest yaw rate, rad/s", "1.5", above_zero),
    "acceleration": ("greatest acceleration, m/s²", "1.5", above_zero),
    "angular_acceleration": ("greatest angular acceleration, rad/s²", TWICE, angular),
    "beams": ("beams of its LiDAR, 0: all is known exactly", "0", beams),
    "view": ("field of view of the LiDAR, degrees", "360", view),
    "mount": ("mount of the LiDAR: X,Y in m, HEADING in degrees", "0,0,0", mount),
}
"""What ``init`` asks for: the question, its default, and how it is read."""

OF_LIDAR, BEAMS = ("view", "mount"), [*QUESTIONS].index("beams")


def init(options: Namespace) -> None:
    """Write a commented scenario for a robot of one's own, which runs as it is."""
    from qpavoid.lab.simulation.scenario import load_scenario
    from qpavoid.lab.study.first_scenario import Told, first_scenario

    path = options.file
    if path.suffix != ".toml":
        raise UsageError(f"{path}: the name of a scenario ends in .toml")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}")
    if path.exists() and not options.force:
        raise QPAvoidError(f"{path} is there; --force writes over it")
    told = Told(*_answers(options))
    with told_by("--footprint", InvalidInputError):
        text = first_scenario(path, told)
    before = path.read_bytes() if path.exists() else None
    path.write_text(text, encoding="utf-8")
    try:
        with told_by("--footprint", ConfigError):
            load_scenario(str(path))
    except QPAvoidError:
        path.unlink() if before is None else path.write_bytes(before)
        raise
    print(f"{path} is written: qpavoid check {path}, qpavoid run {path}")
    if min(told.v_max, told.acceleration) < TRIED:
        print(
            f"below {TRIED:g} m/s or m/s² it may well not arrive: give it obstacles "
            "as slow, and time",
            file=sys.stderr,
        )


def _answers(options: Namespace) -> list[Any]:
    """Return the answers to all questions; of a LiDAR only where there is one."""
    found: list[Any] = []
    for key, (what, default, read) in QUESTIONS.items():
        given = getattr(options, key)
        if key in OF_LIDAR and not found[BEAMS]:
            if given is not None:
                raise UsageError(f"--{key}: of a LiDAR; give --beams, too")
            given = read(default)
        if isinstance(given, list):
            try:
                given = corners(" ".join(given).strip())
            except ArgumentTypeError as error:
                raise UsageError(f"--{key}: {error}") from None
        found.append(_asked(given, what, default, read))
    return found


def _asked(given: Any, what: str, default: str, read: Callable[[str], Any]) -> Any:
    """Return what was given, or what the user of a terminal says, or the default."""
    if given is not None:
        return given
    while True:
        asked = sys.stdin.isatty()
        text = input(f"{what} [{default}]: ").strip() if asked else ""
        try:
            return read(text or default)
        except (ValueError, ArgumentTypeError) as error:
            print(error, file=sys.stderr)


def completion(options: Namespace) -> None:
    """Print what a shell needs to complete commands and options."""
    from shtab import complete

    print(complete(options.parser, shell=options.shell))
