"""Reading a scenario file: every error at once, with file, key and a suggestion."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from qpavoid.compiled import PACKAGE
from qpavoid.errors import ConfigError, UnknownNameError, did_you_mean

M = TypeVar("M", bound=BaseModel)


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
        UnknownNameError: Neither a file nor a shipped name; lists the names.
    """
    path = Path(config)
    if path.is_file():
        parts = path.resolve().with_suffix("").parts
        below = parts[-2::-1].index("configs") + 1 if "configs" in parts[:-1] else 1
        return "/".join(parts[-below:]), path
    shipped = builtin_configs(study)
    name = str(config).removeprefix("configs/").removesuffix(".toml")
    if name in shipped:
        return name, shipped[name]
    raise UnknownNameError("study" if study else "scenario", str(config), shipped)


def read_document(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return what a TOML file says, and its bytes.

    Raises:
        ConfigError: It cannot be read, or is no TOML.
    """
    try:
        content = path.read_bytes()
        return tomllib.loads(content.decode("utf-8")), content
    except OSError as error:
        raise ConfigError([f"{path}: cannot be read ({error.strerror})"]) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError([f"{path}: not valid TOML: {error}"]) from None


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
        ConfigError: With one line for every problem.
    """
    try:
        return model.model_validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        items = error.errors(include_url=False)
        raise ConfigError([_problem(path, item, model) for item in items]) from None


def _problem(path: Path, error: Any, model: type[BaseModel]) -> str:
    """Return one error of pydantic as a line: file, key, what is wrong."""
    key = ""
    siblings: set[str] = set(model.model_fields)
    models: tuple[type[BaseModel], ...] = (model,)
    for part in error["loc"]:
        if isinstance(part, int):
            key += f"[{part}]"
            continue
        tagged = [m for m in models if _kind(m) == part]
        if tagged and not any(part in m.model_fields for m in models):
            models = tuple(tagged)
            siblings = set(models[0].model_fields)
            continue
        siblings = {name for m in models for name in m.model_fields}
        key += f".{part}" if key else str(part)
        fields = [m.model_fields[part] for m in models if part in m.model_fields]
        models = tuple(m for f in fields for m in _models(f.annotation))
    message = error["msg"][0].lower() + error["msg"][1:]
    if error["type"] == "extra_forbidden":
        name = str(error["loc"][-1])
        message = "unknown key" + did_you_mean(name, siblings)
    elif error["type"] == "union_tag_invalid":
        tag = str(error["ctx"]["tag"])
        tags = error["ctx"]["expected_tags"].replace("'", "").split(", ")
        message = f"unknown kind {tag!r}{did_you_mean(tag, tags)}"
        message += f" Known: {', '.join(tags)}."
    elif error["type"] == "union_tag_not_found":
        message = "kind: field required"
    elif "input" in error and isinstance(error["input"], str | int | float):
        message += f" (got {error['input']!r})"
    message = message.removeprefix("value error, ")
    return ": ".join([str(path), key, message] if key else [str(path), message])


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models that an annotation mentions."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models(argument)


def _kind(model: type[BaseModel]) -> str:
    """Return the value of a model's ``kind``, or nothing if it has none."""
    if "kind" not in model.model_fields:
        return ""
    return str(get_args(model.model_fields["kind"].annotation)[0])
