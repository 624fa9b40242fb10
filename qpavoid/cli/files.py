"""The commands for files of one's own: schema, init."""

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable
from typing import Any

from qpavoid.cli.output import give, make_console, show_table
from qpavoid.errors import QPAvoidError, UnknownNameError

SHELLS = ("bash", "zsh", "tcsh")

FILES = ("scenario", "study", "tuning")


def schema(options: Namespace) -> None:
    """Say what keys a file may have: all tables, or one with unit, default, effect."""
    from qpavoid.lab.study.keys import json_schema, key_tables

    if options.toml:
        from qpavoid.lab.study.every_key import every_key

        print(every_key(), end="")
        return
    file, _, name = options.table.partition(".")
    if file not in FILES:
        file, name = "scenario", options.table
    if options.json:
        give(options, json_schema(file), lambda: None)
        return
    tables = key_tables(file)
    if not options.table:
        heads = [table.head or "(top of the file)" for table in tables]
        rows = zip(heads, map(len, (t.keys for t in tables)), tables, strict=True)
        show_table(["table", "keys", ""], [(h, n, t.what) for h, n, t in rows])
        return
    found = [table for table in tables if table.name == name]
    if not found:
        raise UnknownNameError("table", options.table, _names(tables))
    for table in found:
        make_console().print(f"{table.head or file}  {table.what}", markup=False)
        show_table(["key", "value", "unit", "default", "effect"], table.keys)


def _names(tables: Any) -> list[str]:
    return [*dict.fromkeys(table.name for table in tables if table.name), *FILES]


def corners(text: str) -> list[tuple[float, float]]:
    """Return the corners of ``LENGTH,WIDTH`` in m, or of ``x,y x,y x,y …``."""
    try:
        pairs = [tuple(map(float, pair.split(","))) for pair in text.split()]
    except ValueError:
        pairs = []
    if not pairs or any(len(pair) != 2 for pair in pairs):
        raise ArgumentTypeError(f"{text!r} is no LENGTH,WIDTH and no corners x,y x,y …")
    if len(pairs) > 1:
        return [(x, y) for x, y in pairs]
    length, width = pairs[0]
    x, y = 0.5 * length, 0.5 * width
    return [(-x, -y), (x, -y), (x, y), (-x, y)]


QUESTIONS: dict[str, tuple[str, str, Callable[[str], Any]]] = {
    "footprint": ("LENGTH,WIDTH in m, or corners x,y x,y …", "0.9,0.6", corners),
    "v_max": ("greatest speed, m/s", "1.0", float),
    "v_min": ("least speed, m/s: 0 never backs up", "-0.5", float),
    "omega_max": ("greatest yaw rate, rad/s", "1.5", float),
    "acceleration": ("greatest acceleration, m/s²", "1.5", float),
    "beams": ("beams of its LiDAR, 0: all is known exactly", "0", int),
}
"""What ``init`` wants to know: the question, its default, and how it is read."""


def init(options: Namespace) -> None:
    """Write a commented scenario for a robot of one's own, which runs as it is."""
    from qpavoid.lab.simulation.scenario import load_scenario
    from qpavoid.lab.study.first_scenario import Told, first_scenario

    path = options.file
    if path.suffix != ".toml":
        raise QPAvoidError(f"{path}: the name of a scenario ends in .toml")
    if path.exists() and not options.force:
        raise QPAvoidError(f"{path} is there; --force writes over it")
    told = Told(
        *(_asked(getattr(options, key), *how) for key, how in QUESTIONS.items())
    )
    before = path.read_bytes() if path.exists() else None
    path.write_text(first_scenario(path, told), encoding="utf-8")
    try:
        load_scenario(str(path))
    except QPAvoidError:
        path.unlink() if before is None else path.write_bytes(before)
        raise
    print(f"{path} is written: qpavoid check {path}, qpavoid run {path}")


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
