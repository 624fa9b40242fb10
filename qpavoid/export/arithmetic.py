"""Operators and functions of numbers in C, folded where their operands are known."""

import ast
import math
import operator
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np

from qpavoid.export.values import (
    ADD,
    AND,
    ATOM,
    COMPARE,
    LIBM,
    MULTIPLY,
    NUMBERS,
    OR,
    UNARY,
    UNKNOWN,
    Unsupported,
    Value,
    constant,
)

SAME = {getattr(math, name): name for name in LIBM} | {np.ceil: "ceil"}
"""Functions that C's of that name compute."""

ROUNDINGS = {int: "", round: "rint", math.floor: "floor", math.ceil: "ceil"}
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


def unbounded(value: Value) -> Value:
    """Return what is rounded to an integer as the double that it was rounded to.

    An integer of Python's has room for more than an int of C.
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
    if not isinstance(op, ast.USub) or value.kind == "bool":
        raise Unsupported("an operator outside the subset")
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
    if type(op) not in (*BINARY, ast.Mod) or "bool" in (left.kind, right.kind):
        raise Unsupported("an operator outside the subset")
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
    if type(op) not in COMPARISONS:
        raise Unsupported("a comparison outside the subset")
    sign, holds = COMPARISONS[type(op)]
    left, right = unbounded(left), unbounded(right)
    both = left.decided and right.decided
    known = holds(left.known, right.known) if both else UNKNOWN
    sides = [
        f"(bool){side.at(UNARY)}" if side.text.startswith("is") else side.at(ADD)
        for side in (left, right)
    ]
    return Value("bool", f" {sign} ".join(sides), COMPARE, known)


def joined(parts: Sequence[Value], either: bool) -> Value:
    """Return a disjunction or conjunction without the operands that are known."""
    sign, level = ("||", OR) if either else ("&&", AND)
    open_ = [part for part in parts if not part.decided]
    if any(part.decided and bool(part.known) == either for part in parts):
        return constant(either)
    if len(open_) < 2:
        return open_[0] if open_ else constant(not either)
    return Value("bool", f" {sign} ".join(part.at(COMPARE) for part in open_), level)


def called(function: Any, values: Sequence[Value]) -> Value:
    """Return the call of a built-in function or one of ``math``."""
    if not values or any(value.kind not in NUMBERS for value in values):
        raise Unsupported("a function of numbers is wanted here")
    first, single = values[0], len(values) == 1
    kind = "int" if all(value.kind == "int" for value in values) else "double"
    if function is bool and single:
        whole = first.kind == "bool"
        return first if whole else compared(first, ast.NotEq(), constant(0))
    if function in ROUNDINGS and single and first.kind != "double":
        return first._replace(kind="int")
    if function is float:
        return as_double(first)
    texts = [(unbounded(v) if kind == "double" else v).text for v in values]
    if function in ROUNDINGS and single:
        name = ROUNDINGS[function]
        return Value("int", f"whole({name}({texts[0]}))" if name else f"whole({texts[0]})")
    if function in (min, max) and not single:
        name = f"i{function.__name__}" if kind == "int" else f"{function.__name__}2"
        return Value(kind, reduce(lambda a, b: f"{name}({a}, {b})", texts))
    if function is abs:
        return Value(kind, f"{'abs' if kind == 'int' else 'fabs'}({texts[0]})")
    if function in SAME:
        kind = "bool" if SAME[function].startswith("is") else "double"
        return Value(kind, f"{SAME[function]}({', '.join(texts)})")
    raise Unsupported("a function outside the subset")
