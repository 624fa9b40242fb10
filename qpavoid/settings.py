"""Settings are declared once: type, unit, range and default of every field.

    low: Annotated[float, "m", NOT_NEGATIVE] = 0.17

The unit ends the field's key in files, ``low_m``; :func:`check` holds the field to its
range. A tuple names the key of each of its numbers; choices (``Literal``) and switches
(``bool``) need no more than their type. What is plain otherwise is no setting.
"""

import math
import operator
from collections.abc import Sized
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Rational, Real
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

from qpavoid.errors import InvalidInputError

NO_KEY = "no key"
"""Of a field whose value is not a file's: it comes with the robot or the scenario."""

TABLE = "table"
"""Of a field that is settings of its own: in files a table in the table."""

BOUNDS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


class Range(NamedTuple):
    """The numbers that are allowed: greater than, at least, less than, at most.

    ``None``: no such bound. NaN is in no range with a bound; without
    ``allow_inf_nan=False`` infinite numbers may be.
    """

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    allow_inf_nan: bool | None = None

    def holds(self, value: float) -> bool:
        """Return whether a number is allowed."""
        return (self.allow_inf_nan is None or math.isfinite(value)) and all(
            bound is None or holds(value, bound)
            for holds, bound in zip(BOUNDS.values(), self, strict=False)
        )

    def __str__(self) -> str:
        bounds = zip(BOUNDS, self, strict=False)
        words = [f"{sign} {bound:g}" for sign, bound in bounds if bound is not None]
        finite = [] if self.allow_inf_nan is None else ["finite"]
        return " and ".join(words + finite)


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

    def wish(self, value: Any) -> str:
        """Return what a value should be instead; empty: it is all right."""
        if self.choices:
            known = ", ".join(self.choices)
            return "" if value in self.choices else f"to be one of {known}"
        if self.kind is bool:
            return "" if type(value).__name__ in ("bool", "bool_") else "as a bool"
        if self.range is None:
            return ""
        sized = isinstance(value, Sized) and not isinstance(value, str)
        if self.many and not (sized and len(value) == len(self.keys)):
            return f"as {len(self.keys)} numbers"
        if not all(map(is_number, self.of(value))):
            return "as a number"
        return "" if all(map(self.range.holds, self.of(value))) else str(self.range)


def is_number(value: Any) -> bool:
    """Return whether a value is an integer or a float, numpy's included."""
    if isinstance(value, Integral):
        return abs(int(value)) < 1 << 63
    return isinstance(value, Real) and not isinstance(value, Rational)


_KNOWN: dict[type[Any], tuple[Setting, ...]] = {}


def declared(kind: type[Any]) -> tuple[Setting, ...]:
    """Return the fields of a dataclass that are declared as settings, in order."""
    if kind not in _KNOWN:
        _KNOWN[kind] = tuple(filter(None, map(_setting, fields(kind))))
    return _KNOWN[kind]


def _setting(item: Any) -> Setting | None:
    """Return what a field is declared to be; None: it is no setting."""
    hint, default = item.type, item.default
    kind, *told = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if not told and kind is not bool and get_origin(kind) is not Literal:
        return None
    many = get_origin(kind) is tuple
    units = [x for x in told if isinstance(x, str) and x not in (NO_KEY, TABLE)]
    keys = next((x for x in told if type(x) is tuple), ("_".join([item.name, *units]),))
    return Setting(
        item.name,
        get_args(kind)[0] if many else kind,
        () if NO_KEY in told else keys,
        next((x for x in told if isinstance(x, Range)), None),
        ... if default is MISSING else default,
        many,
    )


def want(holds: bool, what: str) -> None:
    """Raise InvalidInputError unless something holds."""
    if not holds:
        raise InvalidInputError(what)


def check(settings: Any, wants: str) -> None:
    """Hold a dataclass of settings to their declared ranges and choices.

    ``wants`` is how the message begins, such as ``"a guide wants"``.

    Raises:
        InvalidInputError: For the first field that is not as declared, by name.
    """
    for item in fields(settings):
        part, value = item.type, getattr(settings, item.name)
        if isinstance(part, type) and is_dataclass(part):
            named = f"{wants} {item.name} as {part.__name__}, not {value!r}"
            want(isinstance(value, part), named)
    for setting in declared(type(settings)):
        value = getattr(settings, setting.name)
        if wish := setting.wish(value):
            raise InvalidInputError(f"{wants} {setting.name} {wish}, not {value!r}")
