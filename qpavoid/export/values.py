"""Values of the translated subset: their kind, which is a C type, and their C text."""

import math
import re
import textwrap
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import QPAvoidError

UNKNOWN: Any = object()
"""The value of what is only known when the filter runs."""

TERNARY, OR, AND, COMPARE, ADD, MULTIPLY, UNARY, ATOM = range(8)
"""How tightly a C expression binds."""

NUMBERS = ("bool", "int", "double")
ARRAYS = ("vector", "matrix")
ANNOTATED = {"float": "double", "int": "int", "bool": "bool"}


class TranslationError(QPAvoidError):
    """Something in a compiled function lies outside what can be written as C."""


class Refusal(Exception):
    """Why something cannot be C, on its way to the one that knows where it stands."""


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

    @property
    def decided(self) -> bool:
        """Whether it is known at translation."""
        return self.known is not UNKNOWN

    @property
    def identity(self) -> str:
        """What two values have in common that one C type, or none, holds."""
        return self.kind or f"{type(self.known).__name__} {self.text}"


def constant(number: Any, text: str = "") -> Value:
    """Return the value of a known number, and how it is written where it has a name."""
    number = number.item() if isinstance(number, np.generic) else number
    kinds = {bool: "bool", int: "int", float: "double"}
    text = text or c_number(number)
    level = UNARY if text.startswith("-") else ATOM
    return Value(kinds[type(number)], text, level, number)


def c_number(number: Any) -> str:
    """Return a number as C, to the last bit."""
    if isinstance(number, bool | int | np.integer):
        return str(int(number)) if not isinstance(number, bool) else str(number).lower()
    if math.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return "NAN" if math.isnan(number) else repr(float(number))


PRELUDE = {
    "vector": "typedef struct { double *at; int rows; } vector;",
    "matrix": "typedef struct { double *at; int rows, columns; } matrix;",
    "min2": "static double min2(double a, double b) { return b < a ? b : a; }",
    "max2": "static double max2(double a, double b) { return b > a ? b : a; }",
    "imin": "static int imin(int a, int b) { return b < a ? b : a; }",
    "imax": "static int imax(int a, int b) { return b > a ? b : a; }",
    "square": "static double square(double a) { return a * a; }",
    "cube": "static double cube(double a) { return a * (a * a); }",
    "fmodulo": "static double fmodulo(double a, double b)\n"
    "{\n    const double r = fmod(a, b);\n"
    "    return r == 0.0 ? copysign(0.0, b) : (r < 0.0) != (b < 0.0) ? r + b : r;\n}",
    "modulo": "static int modulo(int a, int n)\n"
    "{\n    return a % n != 0 && (a < 0) != (n < 0) ? a % n + n : a % n;\n}",
    "quotient": "static int quotient(int a, int n)\n"
    "{\n    return a % n != 0 && (a < 0) != (n < 0) ? a / n - 1 : a / n;\n}",
    "whole": "static int whole(double a)\n"
    "{\n    return a >= 1e9 ? 1000000000 : a > -1e9 ? (int)a : -1000000000;\n}",
    "part": "static vector part(vector a, int from, int to)\n"
    "{\n    vector r = {a.at + from, to - from};\n    return r;\n}",
    "row_of": "static vector row_of(matrix a, int i)\n"
    "{\n    vector r = {a.at + i * a.columns, a.columns};\n    return r;\n}",
    "band": "static matrix band(matrix a, int from, int to)\n"
    "{\n    matrix r = {a.at + from * a.columns, to - from, a.columns};\n"
    "    return r;\n}",
    "shaped": "static matrix shaped(vector a, int rows, int columns)\n"
    "{\n    matrix r = {a.at, rows, columns};\n    return r;\n}",
}
"""What stands for Python's own: ``min`` and ``max`` keep the first of equal ones, ``%``
and ``//`` round towards -∞, and no number is too large for an int."""

MEMBERS = {
    *PRELUDE,
    *"""auto break case char const continue default do double else enum extern float for
    goto if inline int long register restrict return short signed sizeof static struct
    switch typedef union unsigned void volatile while bool true false""".split(),
}
"""Names that no member of a struct can have."""

RESERVED = {
    *MEMBERS,
    *"""abs fabs sqrt sin cos tan asin acos atan atan2 hypot exp log pow copysign
    isfinite isinf isnan ceil floor rint fmin fmax fmod round main edges robot
    settings""".split(),
}
"""Names that mean something else in C."""


def c_name(name: str, reserved: set[str] = RESERVED) -> str:
    """Return a name that C leaves free."""
    return f"{name}_" if name in reserved else name


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


def commented(module: str, docstring: str | None, text: str) -> str:
    """Return C below where it comes from and what its docstring says."""
    said = (docstring or "").partition("\n\n")[0]
    summary = f"/* {module}: {' '.join(said.split())} */"
    return f"{textwrap.fill(summary, 88, subsequent_indent=' * ')}\n{text}"


def c_words(text: str) -> set[str]:
    """Return the names in C, but for those of members and in comments."""
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code))
