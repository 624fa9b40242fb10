"""The commands for files of a user: schema, init."""

import json
import math
import sys
from argparse import ArgumentTypeError, Namespace
from typing import TYPE_CHECKING, Any

from qpavoid.cli.output import UsageError
from qpavoid.errors import InvalidInputError, QPAvoidError

if TYPE_CHECKING:
    from qpavoid.lab.scenario.keys import Strict


FILE_KINDS = ("scenario", "study")
"""Kinds of file that have a schema."""


def schema(options: Namespace) -> None:
    """Print the JSON Schema of a kind of file, for editors and other programs."""
    from qpavoid.lab.scenario.schema import ScenarioModel

    model: type[Strict] = ScenarioModel
    if options.file == "study":
        from qpavoid.lab.study.sweep.study import StudyModel

        model = StudyModel
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    found: dict[str, Any] = _finite(model.model_json_schema())
    found = head | found | {"title": f"qpavoid {options.file}"}
    print(json.dumps(found, indent=1, ensure_ascii=False, allow_nan=False))


def _finite(told: Any) -> Any:
    """Return a schema without defaults that JSON cannot write."""
    if isinstance(told, dict):
        infinite = told.get("default") in (math.inf, -math.inf)
        keys = [key for key in told if not (key == "default" and infinite)]
        return {key: _finite(told[key]) for key in keys}
    if isinstance(told, list):
        return [_finite(x) for x in told]
    return None if isinstance(told, float) and math.isinf(told) else told


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
    from qpavoid.lab.scenario.scenario import load_scenario
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
