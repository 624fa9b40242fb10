"""The commands for files of a user: schema, init."""

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING

from qpavoid.cli.output import UsageError, give, make_console, show_table
from qpavoid.errors import InvalidInputError, QPAvoidError

if TYPE_CHECKING:
    from qpavoid.lab.study.keys import KeyTable


def schema(options: Namespace) -> None:
    """Say what keys a file may have: all tables, or one with unit, default, effect."""
    from qpavoid.lab.study.keys import FILE_KINDS, json_schema, tables_of

    file, _, rest = options.table.partition(".")
    if file not in FILE_KINDS:
        file, rest = "scenario", options.table
    # Of a file with its name alone: all tables as JSON Schema, its top as text.
    name = options.table and rest
    if options.json and not rest:
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


TRIED = 0.2
"""m/s and m/s²: at these limits the scenario was driven to its end, at half not."""


def init(options: Namespace) -> None:
    """Write a commented scenario for a new robot, which runs as it is."""
    from qpavoid.lab.simulation.scenario import load_scenario
    from qpavoid.lab.study.first_scenario import first_scenario
    from qpavoid.model.robot import Limits

    path = options.file
    if path.suffix != ".toml":
        raise UsageError(f"{path}: the name of a scenario ends in .toml")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}")
    if path.exists() and not options.force:
        raise QPAvoidError(f"{path} is there; --force writes over it")
    try:
        given = options.footprint
        found = corners(given if isinstance(given, str) else " ".join(given))
        turn, acceleration = options.omega_max, options.acceleration
        speeds = options.v_min, options.v_max, -turn, turn
        limits = Limits(*speeds, acceleration, 2.0 * acceleration)
        text = first_scenario(path, found, limits)
    except (ArgumentTypeError, InvalidInputError) as error:
        raise UsageError(str(error)) from None
    before = path.read_bytes() if path.exists() else None
    path.write_text(text, encoding="utf-8")
    try:
        load_scenario(str(path))
    except QPAvoidError as error:
        path.unlink() if before is None else path.write_bytes(before)
        raise UsageError(str(error)) from None
    print(f"{path} is written: qpavoid check {path}, qpavoid run {path}")
    if min(options.v_max, options.acceleration) < TRIED:
        print(
            f"below {TRIED:g} m/s or m/s² the robot may not arrive: "
            "give it slower obstacles, and more time",
            file=sys.stderr,
        )
