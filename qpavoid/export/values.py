"""What an expression of the translated subset is: its kind, its C text, its value."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, TypeAlias, Union

import numpy as np


class Scalar(Enum):
    """A number; a wider one stands further on."""

    BOOL = "bool"
    INT = "int"
    DOUBLE = "double"


@dataclass(frozen=True)
class Grid:
    """A contiguous array of 1 to 3 dimensions: a view of memory that others own."""

    dims: int


@dataclass(frozen=True)
class Pack:
    """A tuple; in C a struct."""

    parts: "tuple[Kind, ...]"


Kind: TypeAlias = Union[Scalar, Grid, Pack]

UNKNOWN = object()
"""The value of what is only known when the filter runs."""

TERNARY, OR, AND, COMPARE, ADD, MULTIPLY, UNARY, ATOM = range(8)
"""How tightly a C expression binds."""


class Value(NamedTuple):
    """An expression.

    Attributes:
        kind: None for what exists at translation alone: the settings, a slice.
        text: C.
        level: How tightly the text binds.
        known: The Python value where it is known already.
        parts: Of a tuple that is written out here.
    """

    kind: Kind | None
    text: str
    level: int = ATOM
    known: Any = UNKNOWN
    parts: "tuple[Value, ...]" = ()

    def at(self, level: int) -> str:
        """Return the text, in parentheses where it binds less than ``level``."""
        return self.text if self.level >= level else f"({self.text})"


PRELUDE = {
    "min2": "static double min2(double a, double b) { return b < a ? b : a; }",
    "max2": "static double max2(double a, double b) { return b > a ? b : a; }",
    "imin": "static int imin(int a, int b) { return b < a ? b : a; }",
    "imax": "static int imax(int a, int b) { return b > a ? b : a; }",
    "square": "static double square(double a) { return a * a; }",
    "modulo": "static int modulo(int a, int n) { return (a % n + n) % n; }",
    "quotient": "static int quotient(int a, int n) { return (a - modulo(a, n)) / n; }",
    "whole": """static int whole(double a)
{
    return a >= 1e9 ? 1000000000 : a > -1e9 ? (int)a : -1000000000;
}""",
    "part": """static array part(array a, int from, int to)
{
    a.at += from * a.columns * a.depth;
    a.rows = to - from;
    return a;
}""",
    "row": """static array row(array a, int i)
{
    array r = {a.at + i * a.columns * a.depth, a.columns, a.depth, 1};
    return r;
}""",
    "shaped": """static array shaped(array a, int rows, int columns, int depth)
{
    array r = {a.at, rows, columns, depth};
    return r;
}""",
    "fill": """static void fill(array a, double value)
{
    for (int i = 0; i < a.rows * a.columns * a.depth; i++)
        a.at[i] = value;
}""",
    "copy": """static void copy(array a, array from)
{
    for (int i = 0; i < a.rows * a.columns * a.depth; i++)
        a.at[i] = from.at[i];
}""",
}
"""Functions that stand for Python's own, each with its meaning: ``min`` and ``max`` keep
the first of equal ones, ``%`` has the sign of its divisor."""

ARRAY = "typedef struct { double *at; int rows, columns, depth; } array;"


def c_number(number: float | int | bool) -> str:
    """Return a number as C, to the last bit."""
    if isinstance(number, bool | np.bool_):
        return "true" if number else "false"
    if isinstance(number, int | np.integer):
        return str(int(number))
    if math.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return repr(float(number))


def constant(number: Any, text: str | None = None) -> Value:
    """Return the value of a known number."""
    if isinstance(number, bool | np.bool_):
        kind = Scalar.BOOL
    else:
        whole = isinstance(number, int | np.integer)
        kind = Scalar.INT if whole else Scalar.DOUBLE
    text = c_number(number) if text is None else text
    return Value(kind, text, UNARY if text.startswith("-") else ATOM, number)


def c_type(kind: Kind) -> str:
    """Return the C type; that of a tuple is named after its parts."""
    if isinstance(kind, Scalar):
        return kind.value
    if isinstance(kind, Grid):
        return "array"
    names = [c_type(part) for part in kind.parts]
    letters = "".join(n[0] + (n[5:] if n.startswith("tuple") else "") for n in names)
    return f"tuple_{letters}" if letters else "void"


def joined(one: Kind, other: Kind) -> Kind | None:
    """Return the kind that holds both, as Python's numbers widen; None without one."""
    if one == other:
        return one
    if Scalar.BOOL in (one, other):
        return None
    if isinstance(one, Scalar) and isinstance(other, Scalar):
        return Scalar.DOUBLE
    if isinstance(one, Pack) and isinstance(other, Pack):
        if len(one.parts) != len(other.parts):
            return None
        pairs = zip(one.parts, other.parts, strict=True)
        parts = tuple(joined(a, b) for a, b in pairs)
        return None if None in parts else Pack(parts)  # type: ignore[arg-type]
    return None
