"""Reading a scenario file: every error at once, with file, key and a suggestion."""

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from qpavoid.errors import ConfigError, DataError, UnknownNameError, did_you_mean
from qpavoid.files import read_bytes, reading, shallow
from qpavoid.lab.scenario.keys import branches
from qpavoid.stamps import PACKAGE

M = TypeVar("M", bound=BaseModel)

MOST_TOML = 2_000_000
"""Bytes of a file, which is parsed in a second or two."""

CHAIN = re.compile(
    r"""(?:(?:"[^"\n]*"|'[^'\n]*'|(?<![\w-])[\w-]++)[ \t]*+\.[ \t]*+){12}"""
)
"""The beginning of a key of more parts than anybody means; tomllib's time is cubic."""

MOST_PROBLEMS = 1_000
"""Problems of a document that are told one by one."""

MOST_SHOWN = 80
"""Characters of a wrong value that a message repeats."""


def config_folder() -> Path:
    """Return the folder of the scenarios that travel with qpavoid."""
    installed = PACKAGE / "configs"
    return installed if installed.is_dir() else PACKAGE.parent / "configs"


def builtin_configs(studies: bool = False) -> dict[str, Path]:
    """Return the shipped scenarios by name, such as ``paper/test_case_1``.

    Or the shipped studies, such as ``studies/smoke``.
    """
    folder = config_folder()
    named = {
        path.relative_to(folder).with_suffix("").as_posix(): path
        for path in sorted(folder.rglob("*.toml"))
    }
    return {k: v for k, v in named.items() if k.startswith("studies/") == studies}


def find_config(config: str | Path, study: bool = False) -> tuple[str, Path]:
    """Return name and path of a scenario, or a study: a file, or its shipped name.

    A file is named after its place below a folder ``configs``, if it lies in one.

    Raises:
        ConfigError: The name is one of a file, which is missing.
        UnknownNameError: Neither a file nor a shipped name; lists the names.
    """
    path = Path(config)
    if os.path.isfile(path):
        parts = path.resolve().with_suffix("").parts
        # Counted from the end: folders above a checkout may be called ``configs`` too.
        below = parts[-2::-1].index("configs") + 1 if "configs" in parts[:-1] else 1
        return "/".join(parts[-below:]), path
    shipped = builtin_configs(study)
    name = str(config).removeprefix("configs/").removesuffix(".toml")
    if name in shipped:
        return name, shipped[name]
    if os.path.isdir(path):
        raise ConfigError([f"{path}: a folder, not a file"])
    if path.suffix == ".toml":
        there = os.path.lexists(path)
        what = "not a regular file" if there else "no such file"
        raise ConfigError([f"{path}: {what}"])
    raise UnknownNameError("study" if study else "scenario", str(config), shipped)


def read_document(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return what a TOML file says, and its bytes.

    Raises:
        ConfigError: It cannot be read, or is no TOML.
    """
    try:
        with reading(path, "cannot be read"):
            content = read_bytes(path, MOST_TOML)
        with reading(path, "not valid TOML"):
            text = content.decode("utf-8")
            if CHAIN.search(text):
                raise DataError(f"{path}: not valid TOML (a key of many parts)")
            return shallow(tomllib.loads(text)), content
    except DataError as error:
        raise ConfigError([str(error)]) from None


def changed(document: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document with values at dotted keys, such as ``filter.gamma_per_s``."""
    result = dict(document)
    for key, value in changes.items():
        head, _, rest = key.partition(".")
        below = result.get(head, {})
        if rest and isinstance(below, dict):
            value = changed(below, {rest: value})
        result[head] = value
    return result


def validated(model: type[M], document: dict[str, Any], path: Path) -> M:
    """Return a document as a strict model.

    Raises:
        ConfigError: With a line for every problem; above :data:`MOST_PROBLEMS` one.
    """
    try:
        # By way of JSON, where strict pydantic takes a list for a tuple; dates, which
        # TOML knows, become text and are refused.
        return model.model_validate_json(json.dumps(document, default=str))
    except ValueError as error:
        if not isinstance(error, ValidationError):  # of json: an integer's digits
            raise ConfigError([f"{path}: {error}"]) from None
        if (count := error.error_count()) > MOST_PROBLEMS:
            raise ConfigError([f"{path}: {count} problems, too many to tell"]) from None
        lines = problems_of(error, model)
        raise ConfigError(f"{path}: {line}" for line in lines) from None


def problems_of(error: ValidationError, model: Any) -> Iterator[str]:
    """Yield a line for every error of pydantic in reading a model."""
    items: list[Any] = error.errors(include_url=False)
    for item in items:
        key, siblings = place_of(item["loc"], model)
        yield ": ".join(filter(None, [key, _message(item, siblings)]))


def place_of(location: Sequence[str | int], model: Any) -> tuple[str, tuple[str, ...]]:
    """Return the key of an error, as a file writes it, and the keys of its table.

    Without the names that pydantic gives to types.
    """
    key, siblings, now = "", tuple[str, ...](), model
    for part in location:
        options = branches(now)
        if len(options) > 1:
            tagged = [option for option in options if _kind(option) == part]
            near = tagged or [o for o in options if _name(o) in str(part)]
            now = near[0] if near else Any
        elif isinstance(part, int):
            key += f"[{part}]"
            now = next(iter(get_args(options[0])), Any)
        elif part != "[key]":
            key += f".{part}" if key else part
            fields = getattr(options[0], "model_fields", {})
            siblings, now = tuple(fields), Any
            if part in fields:
                now = fields[part].rebuild_annotation()
            elif get_origin(options[0]) is dict:
                now = get_args(options[0])[1]
    return key, siblings


def _message(error: Any, siblings: tuple[str, ...]) -> str:
    """Return what is wrong."""
    message = str(error["msg"][0].lower() + error["msg"][1:])
    if error["type"] == "extra_forbidden":
        hint = did_you_mean(str(error["loc"][-1]), siblings)
        return f"unknown key{hint} Known: {', '.join(siblings)}."
    if error["type"] == "union_tag_invalid":
        tag = str(error["ctx"]["tag"])
        tags = error["ctx"]["expected_tags"].replace("'", "").split(", ")
        hint = did_you_mean(tag, tags)
        return f"unknown kind {tag!r}{hint} Known: {', '.join(tags)}."
    if error["type"] == "union_tag_not_found":
        return "kind: field required"
    if error["type"] == "json_invalid":
        return message
    if "input" in error and isinstance(error["input"], str | int | float):
        message += f" (got {error['input']!r:.{MOST_SHOWN}})"
    if error["type"] == "literal_error":
        choices = re.findall(r"'(.*?)'", error["ctx"]["expected"])
        message += did_you_mean(str(error["input"]), choices).rstrip(".")
    return message.removeprefix("value error, ")


def _name(kind: Any) -> str:
    """Return the name of a type, which pydantic's names of it hold."""
    return str(getattr(get_origin(kind) or kind, "__name__", kind))


def _kind(model: Any) -> str:
    """Return the value of a model's ``kind``, or nothing if it has none."""
    field = getattr(model, "model_fields", {}).get("kind")
    return str(get_args(field.annotation)[0]) if field else ""
