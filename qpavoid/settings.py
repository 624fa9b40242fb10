"""Declarations of settings: type, unit, range and default of every field, once.

    low: Annotated[float, "m", NOT_NEGATIVE] = 0.17

The unit is the suffix of the field's key in files, ``low_m``; :func:`check` enforces
the range. A tuple names the key of each of its numbers; choices (``Literal``) and
switches (``bool``) need only their type. A plain field is no setting.
"""

import math
import operator
from collections.abc import Sized
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Rational, Real
from operator import attrgetter
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

from qpavoid.errors import InvalidInputError

NO_KEY = "no key"
"""Mark of a field without a key in files: it is set by the robot or the scenario."""

BOUNDS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


class Range(NamedTuple):
    """Range of allowed numbers: bounds >, >=, <, <=; ``None``: no such bound.

    NaN is in no range with a bound; infinite numbers are excluded only with
    ``allow_inf_nan=False``.
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
    """One declared field.

    Attributes:
        name: Of the field.
        kind: Type of its value, or of each number of a tuple.
        keys: In files, one per number of a tuple; empty with :data:`NO_KEY`.
        range: Of its numbers, or None.
        default: Its default, or ``...`` if it has none.
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
        """Allowed words of a ``Literal``, else empty."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    def of(self, value: Any) -> tuple[Any, ...]:
        """Return the values of its keys, one per key."""
        return tuple(value) if self.many else (value,)

    def requirement(self, value: Any) -> str:
        """Return the requirement that a value violates, or an empty string."""
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
    """Return the declared settings of a dataclass, in order."""
    if kind not in _KNOWN:
        _KNOWN[kind] = tuple(filter(None, map(_setting, fields(kind))))
    return _KNOWN[kind]


def _setting(item: Any) -> Setting | None:
    """Return the declaration of a field; None if it is no setting."""
    hint, default = item.type, item.default
    kind, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if not marks and kind is not bool and get_origin(kind) is not Literal:
        return None
    many = get_origin(kind) is tuple
    units = [x for x in marks if isinstance(x, str) and x != NO_KEY]
    keys = next(
        (x for x in marks if type(x) is tuple), ("_".join([item.name, *units]),)
    )
    return Setting(
        item.name,
        get_args(kind)[0] if many else kind,
        () if NO_KEY in marks else keys,
        next((x for x in marks if isinstance(x, Range)), None),
        ... if default is MISSING else default,
        many,
    )


def want(holds: bool, what: str) -> None:
    """Raise InvalidInputError with the message ``what`` unless ``holds``."""
    if not holds:
        raise InvalidInputError(what)


def check(settings: Any, wants: str) -> None:
    """Check a dataclass of settings against their declared ranges, choices and order.

    ``wants`` begins the message, such as ``"a guide needs"``. The order of fields is in
    a class variable ``ORDERED``: first side, sign, second side; see :func:`factors`.

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
        if required := setting.requirement(value):
            raise InvalidInputError(f"{wants} {setting.name} {required}, not {value!r}")
    for first, sign, second in getattr(settings, "ORDERED", ()):
        one, other = (
            math.prod(
                x if isinstance(x, float) else attrgetter(x)(settings) for x in side
            )
            for side in map(factors, (first, second))
        )
        holds, told = BOUNDS[sign](one, other), f"not {one:g} and {other:g}"
        want(holds, f"{wants} {first} {sign} {second}, {told}")


def factors(side: str) -> list[str | float]:
    """Return fields and numbers whose product is a side, such as ``8 * ahead.tick``."""
    return [x if x[0].isalpha() else float(x) for x in side.split(" * ")]
