"""Settings are declared once: type, unit, range and default of every field.

    low: Annotated[float, "m", NOT_NEGATIVE] = 0.17

The unit ends the field's key in files, ``low_m``; :func:`check` holds the field to its
range. A tuple names the key of each of its numbers; choices (``Literal``) and switches
(``bool``) need no more than their type. What is plain otherwise is no setting.
"""

import math
from dataclasses import MISSING, Field, fields
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    get_args,
    get_origin,
    get_type_hints,
)

from qpavoid.errors import InvalidInputError

NO_KEY = "no key"
"""Of a field whose value is not a file's: it comes with the robot or the scenario."""

TABLE = ()
"""Of a field that is settings of its own: in files a table in the table."""

SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class Range(NamedTuple):
    """The numbers that are allowed; ``None``: no such bound.

    Attributes:
        gt: Greater than this.
        ge: At least this.
        lt: Less than this.
        le: At most this.
        allow_inf_nan: False: only finite numbers. NaN is in no range with a bound.
    """

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    allow_inf_nan: bool | None = None

    def holds(self, value: float) -> bool:
        """Return whether a number is allowed."""
        return (
            (self.allow_inf_nan is None or math.isfinite(value))
            and (self.gt is None or value > self.gt)
            and (self.ge is None or value >= self.ge)
            and (self.lt is None or value < self.lt)
            and (self.le is None or value <= self.le)
        )

    def __str__(self) -> str:
        bounds = zip(SIGNS.values(), self, strict=False)
        words = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        bounded = self.lt is not None or self.le is not None
        ends = [] if bounded or self.allow_inf_nan is None else ["finite"]
        return " and ".join([*words, *ends])


FINITE = Range(allow_inf_nan=False)
POSITIVE = Range(gt=0.0, allow_inf_nan=False)
NOT_NEGATIVE = Range(ge=0.0, allow_inf_nan=False)
SHARE = Range(ge=0.0, le=1.0)


class Setting(NamedTuple):
    """A field of some settings.

    Attributes:
        name: Of the field.
        kind: Type of its value, or of each number of a tuple.
        keys: In files; one a number of a tuple, none where it is not a file's.
        range: Of its numbers; None: it has none.
        default: Its default, or ``...``: there is none.
        many: Whether it is a tuple of numbers.
    """

    name: str
    kind: Any
    keys: tuple[str, ...]
    range: Range | None
    default: Any
    many: bool

    @property
    def choices(self) -> tuple[str, ...]:
        """The words that it may be; none where it is no choice."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    def of(self, value: Any) -> tuple[Any, ...]:
        """Return the values of its keys."""
        return tuple(value) if self.many else (value,)


def declared(kind: type[Any]) -> tuple[Setting, ...]:
    """Return the fields of a dataclass that are declared as settings, in order."""
    if kind not in _KNOWN:
        hints = get_type_hints(kind, include_extras=True)
        found = (_setting(item, hints[item.name]) for item in fields(kind))
        _KNOWN[kind] = tuple(setting for setting in found if setting)
    return _KNOWN[kind]


_KNOWN: dict[type[Any], tuple[Setting, ...]] = {}


def _setting(item: "Field[Any]", hint: Any) -> Setting | None:
    """Return what a field is declared to be; None: it is no setting."""
    kind, *told = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if not told and kind is not bool and get_origin(kind) is not Literal:
        return None
    many = get_origin(kind) is tuple
    units = [word for word in told if isinstance(word, str) and word != NO_KEY]
    keys: tuple[str, ...] = ("_".join([item.name, *units]),)
    if NO_KEY in told:
        keys = ()
    elif many:
        keys = next(part for part in told if type(part) is tuple)
    return Setting(
        item.name,
        get_args(kind)[0] if many else kind,
        keys,
        next((part for part in told if isinstance(part, Range)), None),
        _default(item),
        many,
    )


def _default(item: "Field[Any]") -> Any:
    if item.default_factory is not MISSING:
        return item.default_factory()
    return ... if item.default is MISSING else item.default


def want(holds: bool, what: str) -> None:
    """Raise InvalidInputError unless something holds."""
    if not holds:
        raise InvalidInputError(what)


def check(settings: Any, wants: str) -> None:
    """Hold settings to their declared ranges and choices.

    Args:
        settings: A dataclass; see :func:`declared`.
        wants: How the message begins, such as ``"a detour wants"``.

    Raises:
        InvalidInputError: For the first field that is not as declared, by name.
    """
    for setting in declared(type(settings)):
        value = getattr(settings, setting.name)
        values, allowed = setting.of(value), setting.range
        if setting.choices and value not in setting.choices:
            message = f"as one of {', '.join(setting.choices)}, not {value!r}"
        elif setting.many and len(values) != len(setting.default):
            message = f"as {len(setting.default)} numbers, not {value}"
        elif allowed and not all(map(allowed.holds, values)):
            message = f"{allowed}, not {value}"
        else:
            continue
        raise InvalidInputError(f"{wants} {setting.name} {message}")


def numbers_of(settings: Any) -> dict[str, float]:
    """Return every setting that is one number, by name; a choice as its place."""
    found = {}
    for setting in declared(type(settings)):
        value, choices = getattr(settings, setting.name), setting.choices
        if not setting.many:
            found[setting.name] = choices.index(value) if choices else value
    return found
