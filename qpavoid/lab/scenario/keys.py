"""Tables of a scenario file, made of the settings that they set.

Keys, ranges and defaults are those that the settings' dataclass declares; see
:mod:`qpavoid.settings`.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from inspect import cleandoc
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, create_model
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from qpavoid.settings import declared

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Natural = Annotated[int, Field(ge=0, le=10**15)]
Point = tuple[Finite, Finite]
Place = Annotated[str, Field(pattern=r"^[\w.]+:[\w.]+$")]

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
"""Units by the suffix of a key, longest first."""


def ordered(lows: Sequence[float], highs: Sequence[float]) -> None:
    """Raise ValueError unless numbers can be drawn between these bounds."""
    gaps = [high - low for low, high in zip(lows, highs, strict=True)]
    if min(gaps) < 0.0:
        raise ValueError("a low bound lies above its high bound")
    if not math.isfinite(max(gaps)):
        raise ValueError("a low bound lies too far below its high bound")


def attributes_of(kind: type) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        text = cleandoc(each.__doc__ or "").partition("Attributes:\n")[2]
        for name, said in re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", text, re.M):
            found[name] = plain(said)
    return found


def plain(text: str) -> str:
    """Return a docstring's text on one line, with code in backticks."""
    words = " ".join(text.split()).replace("``", "`")
    return re.sub(r":\w+:`[~.]*([^`]*)`", r"`\1`", words)


class Strict(BaseModel):
    """No unknown keys, no guessing of types, no change afterwards."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)
    describes: ClassVar[type[Any]]

    def make(self, **given: Any) -> Any:
        """Return the settings that the table describes, as :func:`read` does."""
        return read(self.describes, self, **given)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema, with what the docstrings say of the keys."""
        found: dict[str, Any] = handler(core)
        body = handler.resolve_ref_schema(found)
        body["description"] = plain((cls.__doc__ or "").partition("\n\n")[0])
        said = attributes_of(cls)
        for key, value in body.get("properties", {}).items():
            value.pop("title", None)
            if key in said:
                value["description"] = said[key]
        return found


T = TypeVar("T")
M = TypeVar("M", bound=Strict)


def keys_of(kind: type, prefix: str = "") -> dict[str, Any]:
    """Return annotation and default of every key, as ``create_model`` takes them.

    Args:
        kind: The settings.
        prefix: What all keys begin with.
    """
    found: dict[str, Any] = {}
    said = attributes_of(kind)
    for setting in declared(kind):
        required = (...,) * len(setting.keys)
        known = setting.default is not ...
        defaults = setting.of(setting.default) if known else required
        told: Any = setting.kind
        if setting.range is not None:
            told = Annotated[setting.kind, Field(**setting.range._asdict())]
        described = Annotated[told, Field(description=said.get(setting.name))]
        for key, value in zip(setting.keys, defaults, strict=False):
            found[prefix + key] = described, value
    return found


def model_of(settings: type, base: type[M], **keys: Any) -> type[M]:
    """Return the model of a table of settings, with other keys before theirs."""
    keys |= keys_of(settings)
    name = f"{settings.__name__}Table"
    made = create_model(name, __base__=base, __doc__=settings.__doc__, **keys)
    made.describes = settings
    return made


def keyed(
    kind: type, prefix: str = "", optional: bool = False
) -> Callable[[type[M]], type[M]]:
    """Return a decorator that adds the keys of some settings to a model.

    Args:
        kind: The settings.
        prefix: What all keys begin with.
        optional: Without a default of their own: what is not given is ``None``.
    """

    def extend(model: type[M]) -> type[M]:
        keys = keys_of(kind, prefix)
        if optional:
            said = {key: told.__metadata__[-1] for key, (told, _) in keys.items()}
            keys = {
                key: (Annotated[told | None, said[key]], None)
                for key, (told, _) in keys.items()
            }
        for key in model.model_fields:
            keys.pop(key, None)
        made = create_model(
            model.__name__, __base__=model, __doc__=model.__doc__, **keys
        )
        made.describes = kind
        return made

    return extend


def tagged(kind: str, settings: type, base: type[M]) -> type[M]:
    """Return the model of a table that is settings with a ``kind``."""
    only: Any = Literal
    told: Any = Annotated[only[kind], Field(description="Kind of table.")]
    return model_of(settings, base, kind=(told, ...))


def with_tables(tables: Mapping[str, type]) -> Callable[[type[M]], type[M]]:
    """Return a decorator that adds a table of each of these settings to a model."""

    def extend(model: type[M]) -> type[M]:
        models = {name: model_of(kind, Strict) for name, kind in tables.items()}
        keys: dict[str, Any] = {
            name: (one, Field(default_factory=one)) for name, one in models.items()
        }
        return create_model(
            model.__name__, __base__=model, __doc__=model.__doc__, **keys
        )

    return extend


def values(kind: type, table: Strict, prefix: str = "") -> dict[str, Any]:
    """Return what a table says of some settings, by field; not what is ``None``."""
    found = {}
    for setting in declared(kind):
        told = tuple(getattr(table, prefix + key) for key in setting.keys)
        if told and told[0] is not None:
            found[setting.name] = told if setting.many else told[0]
    return found


def read(kind: type[T], table: Strict, prefix: str = "", **given: Any) -> T:
    """Return the settings that a table describes.

    Args:
        kind: The settings.
        table: Their keys.
        prefix: What all keys begin with.
        given: Fields without a key; those that the settings lack are left out.

    Raises:
        InvalidInputError: They do not fit together.
    """
    known: Any = kind
    fields = {k: x for k, x in given.items() if k in known.__dataclass_fields__}
    return kind(**values(kind, table, prefix), **fields)


def branches(annotation: Any) -> list[Any]:
    """Return what a value may be: the members of a union."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return branches(parts[0])
    if origin in (Union, UnionType):
        return [one for p in parts if p is not NoneType for one in branches(p)]
    return [annotation]
