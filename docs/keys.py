"""Every key of a file, as its strict models declare it, in tables."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from qpavoid.lab.scenario.keys import UNITS

BOUNDS = {
    "exclusiveMinimum": ">",
    "minimum": "≥",
    "exclusiveMaximum": "<",
    "maximum": "≤",
}


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


def key_tables(model):
    """Return every table of a kind of file once, in the order of its keys."""
    schema = model.model_json_schema()
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
