"""Values of translated expressions: a C type, C text, and what is known of them."""

import math
import re
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import QPAvoidError

TEMPLATES = Path(__file__).with_name("templates")

UNKNOWN: Any = object()
"""The value of what is only known when the filter runs."""

TERNARY, OR, AND, COMPARE, ADD, MULTIPLY, UNARY, ATOM = range(8)
"""Precedence of C's operators."""

NUMBERS = ("bool", "int", "double")
ARRAYS = ("vector", "matrix")
KINDS = {bool: "bool", int: "int", float: "double"}
ANNOTATED: dict[Any, str] = KINDS | {of.__name__: kind for of, kind in KINDS.items()}
"""The kinds of numbers by their annotations, evaluated or not."""


class TranslationError(QPAvoidError):
    """Something in a compiled function lies outside the subset translated to C."""


class Unsupported(Exception):
    """Why a node cannot be translated; who visits it adds where it stands."""


class Value(NamedTuple):
    """An expression.

    Attributes:
        kind: Its C type: a number, ``vector``, ``matrix`` or the struct of a tuple;
            empty for what exists at translation alone, such as the settings.
        text: C.
        level: Precedence of the text's outermost operator.
        known: The Python value where it is known at translation.
        parts: Of a tuple that is written out.
    """

    kind: str
    text: str
    level: int = ATOM
    known: Any = UNKNOWN
    parts: "tuple[Value, ...]" = ()

    def at(self, level: int) -> str:
        """Return the text as an operand, in parentheses if its precedence is lower."""
        return self.text if self.level >= level else f"({self.text})"

    @property
    def decided(self) -> bool:
        """Whether it is known at translation."""
        return self.known is not UNKNOWN

    @property
    def runtime(self) -> bool:
        """Whether it exists in C and is only known there."""
        return bool(self.kind) and not self.decided

    @property
    def identity(self) -> str:
        """The C type; for what exists at translation alone, its type and name."""
        return self.kind or f"{type(self.known).__name__} {self.text}"


def constant(number: Any, text: str = "") -> Value:
    """Return the value of a known number; ``text`` is its name in C, if it has one."""
    number = number.item() if isinstance(number, np.generic) else number
    text = text or c_number(number)
    level = UNARY if text.startswith("-") else ATOM
    return Value(KINDS[type(number)], text, level, number)


def c_number(number: Any) -> str:
    """Return a number as C, to the last bit."""
    if isinstance(number, bool):
        return str(number).lower()
    if isinstance(number, int | np.integer):
        return str(int(number))
    if math.isinf(number):
        return "INFINITY" if number > 0 else "-INFINITY"
    return "NAN" if math.isnan(number) else repr(float(number))


_PRELUDE = (TEMPLATES / "prelude.c").read_text(encoding="utf-8").strip()
PRELUDE = {
    name: text
    for text in _PRELUDE.split("\n\n")
    for name in re.findall(r"^.*?(\w+)(?:\(|;$)", text)
}
"""Types and helpers by name, which stand for Python's own: ``min`` and ``max`` keep the
first of equal ones, ``%`` and ``//`` round towards -∞, no number exceeds an int."""

MEMBERS = {
    *PRELUDE,
    *"""auto break case char const continue default do double else enum extern float for
    goto if inline int long register restrict return short signed sizeof static struct
    switch typedef union unsigned void volatile while bool true false""".split(),
}
"""Names that no member of a struct can have."""

LIBM = """sqrt sin cos tan asin acos atan atan2 hypot exp log copysign fabs isfinite
isinf isnan""".split()
"""Functions of ``math`` that C has under the same name."""

RESERVED = {
    *MEMBERS,
    *LIBM,
    *"abs pow ceil floor rint fmin fmax fmod round main edges robot settings".split(),
}
"""Names that mean something else in C."""


def c_name(name: str, reserved: set[str] = RESERVED) -> str:
    """Return an identifier that C leaves free."""
    return f"{name}_" if name in reserved else name


def c_words(text: str) -> set[str]:
    """Return the identifiers in C, but for those of members and in comments."""
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code))


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
    """Return C below a comment: its Python module and its docstring's summary."""
    said = (docstring or "").partition("\n\n")[0]
    summary = f"/* {module}: {' '.join(said.split())} */"
    return f"{textwrap.fill(summary, 88, subsequent_indent=' * ')}\n{text}"
