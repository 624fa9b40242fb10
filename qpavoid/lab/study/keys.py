"""Every key of a file, as its strict models declare it: tables, text, JSON Schema."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from qpavoid.errors import UnknownNameError
from qpavoid.lab.simulation.schema import ScenarioModel
from qpavoid.lab.simulation.schema_base import Strict

UNITS = {
    "rad_per_m2": "rad/m²",
    "per_s": "1/s",
    "mps2": "m/s²",
    "radps2": "rad/s²",
    "mps3": "m/s³",
    "mps": "m/s",
    "radps": "rad/s",
    "rad": "rad",
    "hz": "Hz",
    "nm": "N m",
    "m2": "m²",
    "kg": "kg",
    "m": "m",
    "s": "s",
}
"""What the ending of a key says, longest first."""

BOUNDS = {
    "exclusiveMinimum": ">",
    "minimum": "≥",
    "exclusiveMaximum": "<",
    "maximum": "≤",
}


FILE_KINDS = ("scenario", "study")
"""Kinds of file."""


class Key(NamedTuple):
    """A key of a table.

    Attributes:
        name: As a file writes it.
        kind: What its value may be.
        unit: Of its numbers.
        default: Its value where it is not given; ``required``: it must be; empty:
            nothing.
        effect: What it does.
    """

    name: str
    kind: str
    unit: str
    default: str
    effect: str


class KeyTable(NamedTuple):
    """A table of a file.

    Attributes:
        name: Dotted, empty at the top of a file.
        head: As a file writes it.
        what: What it is.
        keys: In order.
    """

    name: str
    head: str
    what: str
    keys: tuple[Key, ...]


def model_of(file: str) -> type[Strict]:
    """Return the model of a ``scenario`` or a ``study``.

    Raises:
        UnknownNameError: Of anything else.
    """
    if file == "scenario":
        return ScenarioModel
    if file == "study":
        from qpavoid.lab.study.sweep.study import StudyModel

        return StudyModel
    raise UnknownNameError("kind of file", file, FILE_KINDS)


def json_schema(file: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, for editors and other programs."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    found: dict[str, Any] = _finite(model_of(file).model_json_schema())
    return head | found | {"title": f"qpavoid {file}"}


def _finite(told: Any) -> Any:
    """Return a schema without defaults that JSON cannot write."""
    if isinstance(told, dict):
        infinite = told.get("default") in (math.inf, -math.inf)
        keys = [key for key in told if not (key == "default" and infinite)]
        return {key: _finite(told[key]) for key in keys}
    if isinstance(told, list):
        return [_finite(x) for x in told]
    return None if isinstance(told, float) and math.isinf(told) else told


def tables_of(file: str, name: str | None) -> list[KeyTable]:
    """Return the tables of that name (of each kind one), or every table of a file.

    Raises:
        UnknownNameError: There is none.
    """
    tables = key_tables(file)
    found = [table for table in tables if name in (None, table.name)]
    if not found:
        known = dict.fromkeys(table.name for table in tables if table.name)
        raise UnknownNameError("table", str(name), (*known, *FILE_KINDS))
    return found


def key_tables(file: str) -> list[KeyTable]:
    """Return every table of a kind of file once, in the order of its keys."""
    schema = model_of(file).model_json_schema()
    return list(_walk(schema, schema.get("$defs", {}), "", "", {}))


def _walk(
    body: Mapping[str, Any],
    models: Mapping[str, Any],
    name: str,
    head: str,
    seen: dict[str, str],
) -> Iterator[KeyTable]:
    """Yield a table and those below it.

    Args:
        body: Schema of the table.
        models: Those that it may refer to, by name.
        name: Of the table.
        head: As a file writes it.
        seen: Head of each model that has been shown.
    """
    required, keys, below = body.get("required", ()), [], []
    for key, told in body["properties"].items():
        path = f"{name}.{key}" if name else key
        many, found = _models(told)
        for model in found:
            if model not in seen:
                named = ".NAME" if "additionalProperties" in told else ""
                seen[model] = _head(path + named, many, models[model])
                below.append((models[model], models, path, seen[model], seen))
        heads = [seen[model].partition(" kind")[0] for model in found]
        kind = " or ".join(dict.fromkeys(heads))
        default = "required" if key in required else _default(told, bool(found))
        effect = str(told.get("description", ""))
        keys.append(Key(key, kind or _kind(told), _unit(key), default, effect))
    yield KeyTable(name, head, str(body.get("description", "")), tuple(keys))
    for one in below:
        yield from _walk(*one)


def _models(told: Mapping[str, Any]) -> tuple[bool, list[str]]:
    """Return whether a key is an array of tables, and the models of its tables."""
    if "items" in told:
        return True, _models(told["items"])[1]
    one = [told["$ref"].rsplit("/", 1)[1]] if "$ref" in told else []
    every = [*told.get("anyOf", ()), *told.get("oneOf", ())]
    if isinstance(told.get("additionalProperties"), dict):
        every.append(told["additionalProperties"])
    return False, one + [model for each in every for model in _models(each)[1]]


def _head(path: str, many: bool, model: Mapping[str, Any]) -> str:
    kind = model["properties"].get("kind", {})
    said = f' kind = "{kind["const"]}"' if "const" in kind else ""
    return (f"[[{path}]]" if many else f"[{path}]") + said


def _default(told: Mapping[str, Any], is_table: bool) -> str:
    value = told.get("default")
    if value is None or is_table:
        return ""
    return literal(value)


def literal(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(literal, value))}]"
    return f'"{value}"' if isinstance(value, str) else str(value)


def _unit(key: str) -> str:
    return next((u for end, u in UNITS.items() if re.search(f"_{end}$", key)), "")


def _kind(told: Mapping[str, Any]) -> str:
    """Return what a value may be, with its bounds."""
    if "const" in told:
        return literal(told["const"])
    if "enum" in told:
        return ", ".join(map(literal, told["enum"]))
    if "prefixItems" in told:
        return f"[{', '.join(_kind(one) for one in told['prefixItems'])}]"
    if "anyOf" in told:
        kinds = [_kind(one) for one in told["anyOf"] if one != {"type": "null"}]
        return " or ".join(dict.fromkeys(kinds))
    if "items" in told:
        return f"list of {_kind(told['items'])}"
    word = {"boolean": "true, false", "object": "table"}.get(
        told.get("type", ""), told.get("type", "any value")
    )
    bounds = [f"{sign} {told[key]:g}" for key, sign in BOUNDS.items() if key in told]
    return " ".join([word, ", ".join(bounds)]).strip()
