"""Values of expressions in C, and operators on them, with constant folding."""

import ast
import math
import operator
import re
import textwrap
from collections.abc import Callable, Sequence
from functools import partial, reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.types import Array

TEMPLATES = Path(__file__).with_name("templates")

UNKNOWN: Any = object()
"""Value that is known only at run time."""

TERNARY, OR, AND, COMPARE, ADD, MULTIPLY, UNARY, ATOM = range(8)
"""Precedence of C's operators."""

NUMBERS = ("bool", "int", "double")
ARRAYS = ("vector", "matrix")
KINDS = {bool: "bool", int: "int", float: "double"}
ANNOTATED: dict[Any, str] = KINDS | {of.__name__: kind for of, kind in KINDS.items()}
"""Kinds of numbers by their annotations, evaluated or not."""


class TranslationError(QPAvoidError):
    """A compiled function uses a construct outside the subset translated to C."""


class Unsupported(Exception):
    """Reason why a node cannot be translated; the visitor adds its location."""


def require(holds: bool, why: str) -> None:
    """Raise :class:`Unsupported` unless a condition of the subset holds."""
    if not holds:
        raise Unsupported(why)


class Value(NamedTuple):
    """An expression.

    Attributes:
        kind: Its C type: a number, ``vector``, ``matrix`` or the struct of a tuple;
            empty for values that exist only at translation, such as the settings.
        text: C.
        level: Precedence of the text's outermost operator.
        known: The Python value if it is known at translation.
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
        """Whether it exists in C and is known only at run time."""
        return bool(self.kind) and not self.decided

    @property
    def identity(self) -> str:
        """C type; of values that exist only at translation, their type and name."""
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


def braced(array: Array) -> str:
    """Return a C initialiser."""
    if array.ndim:
        return f"{{{', '.join(braced(part) for part in array)}}}"
    return c_number(array.item())


_PRELUDE = (TEMPLATES / "prelude.c").read_text(encoding="utf-8").strip()
PRELUDE = {
    name: text
    for text in _PRELUDE.split("\n\n")
    for name in re.findall(r"^.*?(\w+)(?:\(|;$)", text)
}
"""Types and helpers by name, with Python's semantics: ``min`` and ``max`` return the
first of equal ones, ``%`` and ``//`` round towards -∞, no number exceeds an int."""

MEMBERS = {
    *PRELUDE,
    *"""auto break case char const continue default do double else enum extern float for
    goto if inline int long register restrict return short signed sizeof static struct
    switch typedef union unsigned void volatile while bool true false""".split(),
}
"""Names that members of a struct must not have."""

LIBM = """sqrt sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh hypot
exp expm1 log log1p log2 log10 erf erfc copysign fabs isfinite isinf isnan""".split()
"""Functions of ``math`` that C has under the same name."""

RESERVED = {
    *MEMBERS,
    *LIBM,
    *"abs pow ceil floor rint fmin fmax fmod round main edges robot settings".split(),
}
"""Names with a meaning in C."""


def c_name(name: str, reserved: set[str] = RESERVED) -> str:
    """Return an identifier that is no reserved name in C."""
    return f"{name}_" if name in reserved else name


def c_words(text: str) -> set[str]:
    """Return the identifiers in C, except members and in comments."""
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return set(re.findall(r"(?<![.\w])[A-Za-z_]\w*", code))


fill = partial(textwrap.fill, width=88, break_long_words=False, break_on_hyphens=False)


def wrapped(line: str, depth: int) -> str:
    """Return a line of C, broken at blanks if it is too long."""
    indent = "    " * depth
    return fill(line, initial_indent=indent, subsequent_indent=indent + "    ")


def commented(module: str, docstring: str | None, text: str) -> str:
    """Return C after a comment: its Python module and its docstring's summary."""
    said = (docstring or "").partition("\n\n")[0]
    summary = f"/* {module}: {' '.join(said.split())} */"
    return f"{textwrap.fill(summary, 88, subsequent_indent=' * ')}\n{text}"


SAME: dict[Any, str] = {getattr(math, name): name for name in LIBM}
SAME |= {np.ceil: "ceil", np.hypot: "hypot"}
"""Python functions with a C function of the same result."""

ROUNDINGS = {int: "", round: "rint", math.floor: "floor", math.ceil: "ceil"}
"""Conversions of a number to an integer, and the C function that rounds it first."""

POWERS = {2: "square", 3: "cube"}
"""Integer powers, multiplied out as numba does."""

BINARY: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", ADD),
    ast.Sub: ("-", ADD),
    ast.Mult: ("*", MULTIPLY),
    ast.Div: ("/", MULTIPLY),
}
MACROS = ("isnan(", "isinf(", "isfinite(")
"""Tests of C that return an int other than 0."""

COMPARISONS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}


def unbounded(value: Value) -> Value:
    """Return the double of a value that was rounded to an integer.

    Python's integers are unbounded, an int of C is not.
    """
    rounds = tuple(f"whole({name}(" for name in ("floor", "ceil", "rint"))
    if value.level == ATOM and value.text.startswith(rounds):
        return Value("double", value.text.removeprefix("whole(")[:-1])
    return value


def as_double(value: Value) -> Value:
    """Return a number converted to double."""
    value = unbounded(value)
    if value.kind == "double":
        return value
    if value.decided:
        return constant(float(value.known))
    return Value("double", f"(double){value.at(UNARY)}", UNARY)


def unary(op: ast.unaryop, value: Value) -> Value:
    """Return a negation, of a truth value or of a number."""
    if isinstance(op, ast.Not):
        known = not value.known if value.decided else UNKNOWN
        return Value("bool", f"!{value.at(UNARY)}", UNARY, known)
    negates = isinstance(op, ast.USub) and value.kind != "bool"
    require(negates, "an operator outside the subset")
    known = -value.known if value.decided else UNKNOWN
    return Value(value.kind, f"-{value.at(ATOM)}", UNARY, known)


def binary(op: ast.operator, left: Value, right: Value) -> Value:
    """Return a binary operation."""
    whole = left.kind == right.kind == "int"
    if isinstance(op, ast.Pow) and left.kind == "double" and right.decided:
        if right.known in POWERS:
            return Value("double", f"{POWERS[right.known]}({left.text})")
    if isinstance(op, ast.Mod | ast.FloorDiv) and whole:
        name = "modulo" if isinstance(op, ast.Mod) else "quotient"
        return Value("int", f"{name}({left.text}, {right.text})")
    known = type(op) in (*BINARY, ast.Mod) and "bool" not in (left.kind, right.kind)
    require(known, "an operator outside the subset")
    if isinstance(op, ast.Mod):
        return Value("double", f"fmodulo({left.text}, {right.text})")
    sign, level = BINARY[type(op)]
    if sign == "/" and whole:
        left, whole = as_double(left), False
    if not whole:
        left, right = unbounded(left), unbounded(right)
    text = f"{left.at(level)} {sign} {right.at(level + 1)}"
    return Value("int" if whole else "double", text, level)


def compared(left: Value, op: ast.cmpop, right: Value) -> Value:
    """Return a comparison of two numbers."""
    require(type(op) in COMPARISONS, "a comparison outside the subset")
    sign, holds = COMPARISONS[type(op)]
    left, right = unbounded(left), unbounded(right)
    both = left.decided and right.decided
    known = holds(left.known, right.known) if both else UNKNOWN
    sides = [
        f"(bool){side.at(UNARY)}" if side.text.startswith(MACROS) else side.at(ADD)
        for side in (left, right)
    ]
    return Value("bool", f" {sign} ".join(sides), COMPARE, known)


def joined(parts: Sequence[Value], either: bool) -> Value:
    """Return a disjunction or conjunction without its constant operands."""
    sign, level = ("||", OR) if either else ("&&", AND)
    open_ = [part for part in parts if not part.decided]
    if any(part.decided and bool(part.known) == either for part in parts):
        return constant(either)
    if len(open_) < 2:
        return open_[0] if open_ else constant(not either)
    return Value("bool", f" {sign} ".join(part.at(COMPARE) for part in open_), level)


def called(function: Any, values: Sequence[Value]) -> Value:
    """Return the call of a built-in function or one of ``math``."""
    numbers = bool(values) and all(value.kind in NUMBERS for value in values)
    require(numbers, "a function of numbers is needed here")
    first, single = values[0], len(values) == 1
    kind = "int" if all(value.kind == "int" for value in values) else "double"
    if function is bool and single:
        truth = first.kind == "bool"
        return first if truth else compared(first, ast.NotEq(), constant(0))
    if function in ROUNDINGS and single and first.kind != "double":
        return first._replace(kind="int")
    if function is float:
        return as_double(first)
    texts = [(unbounded(v) if kind == "double" else v).text for v in values]
    if function in ROUNDINGS and single:
        name = ROUNDINGS[function]
        rounded = f"{name}({texts[0]})" if name else texts[0]
        return Value("int", f"whole({rounded})")
    if function in (min, max) and not single:
        name = f"i{function.__name__}" if kind == "int" else f"{function.__name__}2"
        return Value(kind, reduce(lambda a, b: f"{name}({a}, {b})", texts))
    if function is abs:
        return Value(kind, f"{'abs' if kind == 'int' else 'fabs'}({texts[0]})")
    if function in SAME:
        kind = "bool" if SAME[function].startswith("is") else "double"
        return Value(kind, f"{SAME[function]}({', '.join(texts)})")
    raise Unsupported("a function outside the subset")
