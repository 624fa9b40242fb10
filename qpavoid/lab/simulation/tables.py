"""Tables of a scenario file, made of the settings that they set.

Keys, ranges and defaults are those that the settings' dataclass declares; see
:mod:`qpavoid.settings`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, is_dataclass, replace
from functools import partial
from types import NoneType, UnionType
from typing import Annotated, Any, TypeAlias, TypeVar, Union, get_args, get_origin

from pydantic import Field, GetCoreSchemaHandler, create_model
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_after_validator_function

from qpavoid.lab.simulation.schema_base import Strict, attributes_of
from qpavoid.settings import declared

T = TypeVar("T")
M = TypeVar("M", bound=Strict)


def keys_of(kind: type, prefix: str = "", like: Any = None) -> dict[str, Any]:
    """Return annotation and default of every key, as ``create_model`` takes them.

    Args:
        kind: The settings.
        prefix: What all keys begin with.
        like: Settings whose values are the defaults, instead of those declared.
    """
    found: dict[str, Any] = {}
    said = attributes_of(kind)
    for setting in declared(kind):
        default = setting.default if like is None else getattr(like, setting.name)
        required = (...,) * len(setting.keys)
        defaults = required if default is ... else setting.of(default)
        for key, value in zip(setting.keys, defaults, strict=False):
            told: Any = setting.kind
            if is_dataclass(told):
                told = Annotated[Callable[[], setting.kind], Made(value)]
                value = absent(partial(replace, value))
            elif setting.range is not None:
                told = Annotated[setting.kind, Field(**setting.range._asdict())]
            described = Field(description=said.get(setting.name))
            found[prefix + key] = Annotated[told, described], value
    return found


def absent(maker: "Maker[T]") -> Any:
    """Return the default of a table: it is as if this had read it."""
    return Field(default_factory=lambda: maker)


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
        return create_model(
            model.__name__, __base__=model, __doc__=model.__doc__, **keys
        )

    return extend


def with_tables(tables: Mapping[str, type]) -> Callable[[type[M]], type[M]]:
    """Return a decorator that adds a table of each of these settings to a model."""

    def extend(model: type[M]) -> type[M]:
        table: Any = Table
        found: dict[str, Any] = {
            name: (table[kind], absent(kind)) for name, kind in tables.items()
        }
        return create_model(
            model.__name__, __base__=model, __doc__=model.__doc__, **found
        )

    return extend


def values(kind: type, table: Strict, prefix: str = "") -> dict[str, Any]:
    """Return what a table says of some settings, by field; not what is ``None``."""
    found = {}
    for setting in declared(kind):
        told = tuple(getattr(table, prefix + key) for key in setting.keys)
        if told and told[0] is not None:
            single = told[0]() if is_dataclass(setting.kind) else told[0]
            found[setting.name] = told if setting.many else single
    return found


def read(kind: type[T], table: Strict, prefix: str = "", **given: Any) -> T:
    """Return the settings that a table describes; what is no key of it is given.

    Raises:
        InvalidInputError: They do not fit together.
    """
    return kind(**values(kind, table, prefix), **given)


@dataclass(frozen=True)
class Made:
    """Of a key: its value makes the settings of its table.

    They are made with all other parts, so that all that is wrong is said at once.

    Attributes:
        like: As :func:`keys_of` takes it.
    """

    like: Any = None

    def model(self, kind: Any) -> type[Strict]:
        """Return the strict model of a table that is nothing but some settings."""
        keys = keys_of(kind, like=self.like)
        return create_model(
            kind.__name__, __base__=Strict, __doc__=kind.__doc__, **keys
        )

    def __get_pydantic_core_schema__(
        self, maker: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema of the table's model, and of what makes the settings."""
        kind = get_args(maker)[1]
        make = partial(partial, read, kind)
        schema = handler.generate_schema(self.model(kind))
        return no_info_after_validator_function(make, schema)


Maker: TypeAlias = Callable[..., T]
Table: TypeAlias = Annotated[Maker[T], Made()]
"""A table that is nothing but the settings T; its value makes them."""


def branches(annotation: Any) -> list[Any]:
    """Return what a value may be: the members of a union; of a table its model."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        made = [part for part in parts if isinstance(part, Made)]
        return [made[0].model(get_args(parts[0])[1])] if made else branches(parts[0])
    if origin in (Union, UnionType):
        return [one for p in parts if p is not NoneType for one in branches(p)]
    return [annotation]
