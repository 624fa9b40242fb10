"""Values of the translated subset: their kind, which is a C type, and their C text."""

import math
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

UNKNOWN: Any = object()
"""The value of what is only known when the filter runs."""

TERNARY, OR, AND, COMPARE, ADD, MULTIPLY, UNARY, ATOM = range(8)
"""How tightly a C expression binds."""

NUMBERS = ("bool", "int", "double")


class Value(NamedTuple):
    """An expression.

    Attributes:
        kind: Its C type: a number, ``vector``, ``matrix``, the struct of a tuple;
            empty for what exists at translation alone, such as the settings.
        text: C.
        level: How tightly the text binds.
        known: The Python value where it is known already.
        parts: Of a tuple that is written out.
    """

    kind: str
    text: str
    level: int = ATOM
    known: Any = UNKNOWN
    parts: "tuple[Value, ...]" = ()

    def at(self, level: int) -> str:
        """Return the text, in parentheses where it binds less than ``level``."""
        return self.text if self.level >= level else f"({self.text})"


def leaves(value: Value) -> list[Value]:
    """Return a value or, of a tuple that exists at translation alone, its parts."""
    if value.kind or not value.parts:
        return [value]
    return [leaf for part in value.parts for leaf in leaves(part)]


def renamed(value: Value, names: Iterator[str]) -> Value:
    """Return the value with other names for all that C holds of it."""
    if value.kind:
        return Value(value.kind, next(names))
    return value._replace(parts=tuple(renamed(part, names) for part in value.parts))


PRELUDE = {
    "vector": "typedef struct { double *at; int rows; } vector;",
    "matrix": "typedef struct { double *at; int rows, columns; } matrix;",
    "min2": "static double min2(double a, double b) { return b < a ? b : a; }",
    "max2": "static double max2(double a, double b) { return b > a ? b : a; }",
    "imin": "static int imin(int a, int b) { return b < a ? b : a; }",
    "imax": "static int imax(int a, int b) { return b > a ? b : a; }",
    "square": "static double square(double a) { return a * a; }",
    "fmodulo": "static double fmodulo(double a, double b)\n"
    "{\n    const double r = fmod(a, b);\n    return r < 0.0 ? r + b : r;\n}",
    "modulo": "static int modulo(int a, int n) { return (a % n + n) % n; }",
    "quotient": "static int quotient(int a, int n) "
    "{ return (a - (a % n + n) % n) / n; }",
    "whole": "static int whole(double a)\n"
    "{\n    return a >= 1e9 ? 1000000000 : a > -1e9 ? (int)a : -1000000000;\n}",
    "part": "static vector part(vector a, int from, int to)\n"
    "{\n    vector r = {a.at + from, to - from};\n    return r;\n}",
    "band": "static matrix band(matrix a, int from, int to)\n"
    "{\n    matrix r = {a.at + from * a.columns, to - from, a.columns};\n"
    "    return r;\n}",
    "shaped": "static matrix shaped(vector a, int rows, int columns)\n"
    "{\n    matrix r = {a.at, rows, columns};\n    return r;\n}",
}
"""What stands for Python's own: ``min`` and ``max`` keep the first of equal ones, ``%``
and ``//`` are those of a positive divisor, and no number is too large for an int."""


def c_number(number: Any) -> str:
    """Return a number as C, to the last bit."""
    if isinstance(number, bool | int | np.integer):
        return str(int(number)) if not isinstance(number, bool) else str(number).lower()
    if math.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return repr(float(number))


def constant(number: Any, text: str = "") -> Value:
    """Return the value of a known number, and how it is written where it has a name."""
    kinds = {bool: "bool", int: "int", float: "double"}
    text = text or c_number(number)
    level = UNARY if text.startswith("-") else ATOM
    return Value(kinds[type(number)], text, level, number)


def joined(one: str, other: str) -> str:
    """Return the kind that holds both, as Python's numbers widen; empty without one."""
    if one == other or {one, other} == {"int", "double"}:
        return one if one == other else "double"
    return ""


RESERVED = {
    *PRELUDE,
    *"""auto break case char const continue default do double else enum extern float for
    goto if inline int long register restrict return short signed sizeof static struct
    switch typedef union unsigned void volatile while bool true false abs fabs sqrt sin
    cos tan atan2 copysign isfinite ceil floor rint exp log pow fmin fmax fmod round
    edges robot settings""".split(),
}
"""Names that mean something else in C."""


def c_name(name: str) -> str:
    """Return a name that C leaves free."""
    return f"{name}_" if name in RESERVED else name


def wrapped(line: str, depth: int) -> str:
    """Return a line of C, broken at blanks where it is too long."""
    return textwrap.fill(
        line,
        width=88,
        initial_indent="    " * depth,
        subsequent_indent="    " * (depth + 1),
        break_long_words=False,
        break_on_hyphens=False,
    )
