"""Reading a scenario file: every error at once, with file, key and a suggestion."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from qpavoid.errors import ConfigError, UnknownNameError, did_you_mean
from qpavoid.simulation.schema import ScenarioModel


def config_folder() -> Path:
    """Return the folder of the scenarios that travel with qpavoid."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "configs"
    return installed if installed.is_dir() else package.parent / "configs"


def builtin_configs() -> dict[str, Path]:
    """Return the shipped scenarios by name, such as ``paper/test_case_1``."""
    folder = config_folder()
    return {
        path.relative_to(folder).with_suffix("").as_posix(): path
        for path in sorted(folder.rglob("*.toml"))
    }


def find_config(config: str | Path) -> tuple[str, Path]:
    """Return name and path of a scenario given as a file or by its shipped name.

    A file is named after its place below a folder ``configs``, if it lies in one.

    Raises:
        UnknownNameError: Neither a file nor a shipped name; lists the names.
    """
    path = Path(config)
    if path.is_file():
        parts = path.resolve().with_suffix("").parts
        below = parts[-2::-1].index("configs") + 1 if "configs" in parts[:-1] else 1
        return "/".join(parts[-below:]), path
    shipped = builtin_configs()
    name = str(config).removeprefix("configs/").removesuffix(".toml")
    if name in shipped:
        return name, shipped[name]
    raise UnknownNameError("scenario", str(config), shipped)


def read_config(path: Path) -> tuple[ScenarioModel, bytes]:
    """Return the validated model of a scenario file, and the file's bytes.

    Raises:
        ConfigError: With one line for every problem.
    """
    try:
        content = path.read_bytes()
        data = tomllib.loads(content.decode("utf-8"))
    except OSError as error:
        raise ConfigError([f"{path}: cannot be read ({error.strerror})"]) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError([f"{path}: not valid TOML: {error}"]) from None
    try:
        document = json.dumps(data, default=str)
        return ScenarioModel.model_validate_json(document), content
    except ValidationError as error:
        problems = [_problem(path, item) for item in error.errors(include_url=False)]
        raise ConfigError(problems) from None


def _problem(path: Path, error: Any) -> str:
    """Return one error of pydantic as a line: file, key, what is wrong."""
    key, model = "", ScenarioModel
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
    return f"{path}: {key}: {message}"


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
