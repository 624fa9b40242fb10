"""Operators and functions of numbers, as C."""

import ast
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from qpavoid.export.values import (
    ADD,
    AND,
    ATOM,
    COMPARE,
    MULTIPLY,
    NUMBERS,
    OR,
    UNARY,
    UNKNOWN,
    Refusal,
    Value,
    constant,
)

LIBM = """sqrt sin cos tan asin acos atan atan2 hypot exp log copysign fabs isfinite
isinf isnan""".split()
"""Functions of ``math`` that C has under the same name."""

WHOLE = {int: "", round: "rint", math.floor: "floor", math.ceil: "ceil"}
"""What makes an integer of a number, and how C rounds it before."""

POWERS = {2: "square", 3: "cube"}
"""Whole powers, multiplied out as numba does."""

BINARY: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", ADD),
    ast.Sub: ("-", ADD),
    ast.Mult: ("*", MULTIPLY),
    ast.Div: ("/", MULTIPLY),
}
COMPARISONS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], bool]]] = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}


def widened(one: str, other: str) -> str:
    """Return the kind that holds both, as Python's numbers widen; empty without one."""
    if one == other or {one, other} == {"int", "double"}:
        return one if one == other else "double"
    return ""


def unbounded(value: Value) -> Value:
    """Return what is rounded to an integer as the number that it was rounded to.

    An integer of Python's has room for more than an int of C.
    """
    rounds = tuple(f"whole({name}(" for name in ("floor", "ceil", "rint"))
    if value.level == ATOM and value.text.startswith(rounds):
        return Value("double", value.text.removeprefix("whole(")[:-1])
    return value


def as_double(value: Value) -> Value:
    """Return an integer as a number that need not be one."""
    value = unbounded(value)
    if value.kind == "double":
        return value
    if value.decided:
        return constant(float(value.known))
    return Value("double", f"(double){value.at(UNARY)}", UNARY)


def unary(op: ast.unaryop, value: Value) -> Value:
    """Return the opposite of a truth or of a number."""
    known = value.known
    if isinstance(op, ast.Not):
        known = not known if value.decided else UNKNOWN
        return Value("bool", f"!{value.at(UNARY)}", UNARY, known)
    if not isinstance(op, ast.USub) or value.kind == "bool":
        raise Refusal("an operator outside the subset")
    known = -known if value.decided else UNKNOWN
    return Value(value.kind, f"-{value.at(ATOM)}", UNARY, known)


def binary(op: ast.operator, left: Value, right: Value) -> Value:
    """Return two numbers under an operator."""
    whole = left.kind == right.kind == "int"
    if isinstance(op, ast.Pow) and left.kind == "double" and right.decided:
        if right.known in POWERS:
            return Value("double", f"{POWERS[right.known]}({left.text})")
    if isinstance(op, ast.Mod | ast.FloorDiv) and whole:
        name = "modulo" if isinstance(op, ast.Mod) else "quotient"
        return Value("int", f"{name}({left.text}, {right.text})")
    if type(op) not in (*BINARY, ast.Mod) or "bool" in (left.kind, right.kind):
        raise Refusal("an operator outside the subset")
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
    """Return whether a comparison holds."""
    if type(op) not in COMPARISONS:
        raise Refusal("a comparison outside the subset")
    sign, holds = COMPARISONS[type(op)]
    left, right = unbounded(left), unbounded(right)
    known = UNKNOWN
    if left.decided and right.decided:
        known = holds(left.known, right.known)
    sides = [
        f"(bool){side.at(UNARY)}" if side.text.startswith("is") else side.at(ADD)
        for side in (left, right)
    ]
    return Value("bool", f" {sign} ".join(sides), COMPARE, known)


def joined(parts: Sequence[Value], either: bool) -> Value:
    """Return truths joined by or, or by and; what is known already is left out."""
    sign, level = ("||", OR) if either else ("&&", AND)
    open_ = [part for part in parts if not part.decided]
    if any(part.decided and bool(part.known) == either for part in parts):
        return constant(either)
    if len(open_) < 2:
        return open_[0] if open_ else constant(not either)
    return Value("bool", f" {sign} ".join(part.at(COMPARE) for part in open_), level)


def called(function: Any, values: Sequence[Value]) -> Value:
    """Return one of Python's own functions of numbers."""
    if not values or any(value.kind not in NUMBERS for value in values):
        raise Refusal("a function of numbers is wanted here")
    kind = "int" if all(value.kind == "int" for value in values) else "double"
    if function is bool and len(values) == 1:
        plain = values[0].kind == "bool"
        return values[0] if plain else compared(values[0], ast.NotEq(), constant(0))
    if kind == "double" or function is float:
        values = [unbounded(value) for value in values]
    first, texts = values[0], [value.text for value in values]
    if function in (min, max) and len(values) > 1:
        plain = function.__name__
        name = f"{plain}2" if kind == "double" else f"i{plain}"
        text = texts[0]
        for other in texts[1:]:
            text = f"{name}({text}, {other})"
        return Value(kind, text)
    if function is abs:
        return Value(kind, f"{'abs' if kind == 'int' else 'fabs'}({texts[0]})")
    if function is float and first.kind == "double":
        return first
    if function is float:
        return Value("double", f"(double){first.at(UNARY)}", UNARY)
    if function is np.ceil:
        return Value("double", f"ceil({texts[0]})")
    if function in WHOLE and len(values) == 1 and first.kind != "double":
        return first._replace(kind="int")
    if function in WHOLE and len(values) == 1:
        text = f"{WHOLE[function]}({texts[0]})" if WHOLE[function] else texts[0]
        return Value("int", f"whole({text})")
    name = getattr(function, "__name__", "")
    if name in LIBM and function is getattr(math, name):
        kind = "bool" if name.startswith("is") else "double"
        return Value(kind, f"{name}({', '.join(texts)})")
    raise Refusal("a function outside the subset")
