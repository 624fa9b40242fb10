"""Operators and calls of the compiled subset, as C."""

import ast
import math
import operator
from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import numpy as np

from qpavoid.export.names import Names
from qpavoid.export.values import (
    ADD,
    AND,
    ATOM,
    COMPARE,
    MULTIPLY,
    NUMBERS,
    OR,
    TERNARY,
    UNARY,
    UNKNOWN,
    Value,
    constant,
    joined,
    renamed,
)

LIBM = (math.sqrt, math.sin, math.cos, math.atan2, math.copysign, math.isfinite)
"""Functions that C has under the same name."""

WHOLE = {int: "", round: "rint", math.floor: "floor", math.ceil: "ceil"}
"""What makes an integer of a number, and how C rounds it before."""

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


class Expressions(Names):
    """Translates the expressions of one function."""

    def _UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.number(node.operand)
        known = value.known
        if isinstance(node.op, ast.Not):
            known = known if known is UNKNOWN else not known
            return Value("bool", f"!{value.at(UNARY)}", UNARY, known)
        if not isinstance(node.op, ast.USub):
            self.refuse(node, "an operator outside the subset")
        known = known if known is UNKNOWN else -known
        return Value(value.kind, f"-{value.at(ATOM)}", UNARY, known)

    def _BinOp(self, node: ast.BinOp) -> Value:
        left, right = self.number(node.left), self.number(node.right)
        whole = left.kind == right.kind == "int"
        if isinstance(node.op, ast.Pow) and right.known == 2:
            return Value("double", f"square({left.text})")
        if isinstance(node.op, ast.Mod) and not whole:
            return Value("double", f"fmodulo({left.text}, {right.text})")
        if isinstance(node.op, ast.Mod | ast.FloorDiv) and whole:
            name = "modulo" if isinstance(node.op, ast.Mod) else "quotient"
            return Value("int", f"{name}({left.text}, {right.text})")
        if type(node.op) not in BINARY or "bool" in (left.kind, right.kind):
            self.refuse(node, "an operator outside the subset")
        sign, level = BINARY[type(node.op)]
        if sign == "/" and whole:
            left, whole = left._replace(text=f"(double){left.at(UNARY)}"), False
        text = f"{left.at(level)} {sign} {right.at(level + 1)}"
        return Value("int" if whole else "double", text, level)

    def _Compare(self, node: ast.Compare) -> Value:
        parts, left = [], node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.In) and isinstance(right, ast.Tuple):
                equal = [self._compared(left, ast.Eq(), one) for one in right.elts]
                parts.append(self._all(equal, "||", OR))
            else:
                parts.append(self._compared(left, op, right))
            left = right
        return self._all(parts, "&&", AND)

    def _compared(self, one: ast.expr, op: ast.cmpop, other: ast.expr) -> Value:
        if type(op) not in COMPARISONS:
            self.refuse(other, "a comparison outside the subset")
        left, right = self.number(one), self.number(other)
        sign, holds = COMPARISONS[type(op)]
        known = UNKNOWN
        if left.known is not UNKNOWN and right.known is not UNKNOWN:
            known = holds(left.known, right.known)
        return Value("bool", f"{left.at(ADD)} {sign} {right.at(ADD)}", COMPARE, known)

    def _BoolOp(self, node: ast.BoolOp) -> Value:
        parts = [self.number(part) for part in node.values]
        either = isinstance(node.op, ast.Or)
        return self._all(parts, "||" if either else "&&", OR if either else AND)

    def _all(self, parts: Sequence[Value], sign: str, level: int) -> Value:
        """Return truth values joined; what is known already is left out."""
        decides = sign == "||"
        open_ = [part for part in parts if part.known is UNKNOWN]
        if any(part.known is not UNKNOWN and part.known == decides for part in parts):
            return constant(decides)
        if len(open_) < 2:
            return open_[0] if open_ else constant(not decides)
        return Value("bool", f" {sign} ".join(p.at(COMPARE) for p in open_), level)

    def _IfExp(self, node: ast.IfExp) -> Value:
        test = self.number(node.test)
        if test.known is not UNKNOWN:
            return self.expr(node.body if test.known else node.orelse)
        return self._either(node, test, self.expr(node.body), self.expr(node.orelse))

    def _either(self, node: ast.AST, test: Value, one: Value, other: Value) -> Value:
        if one.parts and other.parts:
            pairs = zip(one.parts, other.parts, strict=True)
            return self.packed([self._either(node, test, *pair) for pair in pairs])
        kind = joined(one.kind, other.kind)
        if kind not in NUMBERS:
            self.refuse(node, "two kinds of value")
        text = f"{test.at(OR)} ? {one.at(TERNARY)} : {other.at(TERNARY)}"
        return Value(kind, text, TERNARY)

    def _Call(self, node: ast.Call) -> Value:
        if node.keywords:
            self.refuse(node, "arguments by keyword")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            base, sizes = self.expr(node.func.value), map(self.number, node.args)
            texts = ", ".join([base.text, *(size.text for size in sizes)])
            if base.kind != "vector" or len(node.args) != 2:
                self.refuse(node, "only a vector takes a shape of two sizes")
            return Value("matrix", f"shaped({texts})")
        function = self.found(node.func)
        if hasattr(function, "py_func"):
            return self._called(self.unit.call(function, self._arguments(node)))
        values = self._arguments(node)
        if function is len:
            return self.size(node, values[0], 0)
        if any(value.kind not in NUMBERS for value in values):
            self.refuse(node, "a function of numbers is wanted here")
        return self._builtin(node, function, values)

    def _called(self, value: Value) -> Value:
        """Return what a call gives: also what exists at translation alone."""
        if not isinstance(value.known, Value):
            return value
        name = self.temporary(value, value.text.partition("(")[0]).text
        return renamed(value.known, (f"{name}._{i}" for i in count()))

    def _arguments(self, node: ast.Call) -> list[Value]:
        values: list[Value] = []
        for one in node.args:
            if isinstance(one, ast.Starred):
                values += self.parts(one, self.expr(one.value))
            else:
                values.append(self.expr(one))
        return values

    def _builtin(self, node: ast.Call, function: Any, values: list[Value]) -> Value:
        kind = "int" if all(v.kind == "int" for v in values) else "double"
        texts = [value.text for value in values]
        if function in (min, max) and len(values) > 1:
            name = (
                f"{function.__name__}2" if kind == "double" else f"i{function.__name__}"
            )
            text = texts[0]
            for other in texts[1:]:
                text = f"{name}({text}, {other})"
            return Value(kind, text)
        if function is abs:
            return Value(kind, f"{'abs' if kind == 'int' else 'fabs'}({texts[0]})")
        if function is float:
            return Value("double", f"(double){values[0].at(UNARY)}", UNARY)
        if function is np.ceil:
            return Value("double", f"ceil({texts[0]})")
        if function in WHOLE and values[0].kind != "double":
            return values[0]._replace(kind="int")
        if function in WHOLE:
            text = f"{WHOLE[function]}({texts[0]})" if WHOLE[function] else texts[0]
            return Value("int", f"whole({text})")
        if function in LIBM:
            kind = "bool" if function is math.isfinite else "double"
            return Value(kind, f"{function.__name__}({', '.join(texts)})")
        return self.refuse(node, "a function outside the subset")
