"""Python expressions of the compiled subset, as C expressions."""

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, Protocol

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.export.values import (
    ADD,
    AND,
    ATOM,
    COMPARE,
    MULTIPLY,
    OR,
    TERNARY,
    UNARY,
    UNKNOWN,
    Grid,
    Kind,
    Pack,
    Scalar,
    Value,
    c_type,
    constant,
    joined,
)

LIBM: dict[Any, str] = {
    function: function.__name__
    for function in (math.sqrt, math.sin, math.cos, math.tan, math.atan2, math.hypot)
} | {math.copysign: "copysign", math.isfinite: "isfinite", np.ceil: "ceil"}
"""Functions that C has too."""

BINARY: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", ADD),
    ast.Sub: ("-", ADD),
    ast.Mult: ("*", MULTIPLY),
    ast.Div: ("/", MULTIPLY),
}
COMPARISONS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", lambda a, b: a < b),
    ast.LtE: ("<=", lambda a, b: a <= b),
    ast.Gt: (">", lambda a, b: a > b),
    ast.GtE: (">=", lambda a, b: a >= b),
    ast.Eq: ("==", lambda a, b: a == b),
    ast.NotEq: ("!=", lambda a, b: a != b),
}


class TranslationError(QPAvoidError):
    """Something in a compiled function lies outside what can be written as C."""


class Unit(Protocol):
    """The C file that the function becomes part of."""

    def call(self, function: Any, arguments: Sequence[Value]) -> Value:
        """Return the call of another compiled function, translated before."""

    def define(self, name: str, number: float, module: str) -> str:
        """Return the name under which a module's constant stands in the file."""

    def packed(self, parts: Sequence[Value]) -> Value:
        """Return a tuple of values; one of what exists only here does so too."""


class Expressions:
    """Translates the expressions of one function."""

    def __init__(self, unit: Unit, function: Callable[..., Any]) -> None:
        self.unit = unit
        self.function = function
        self.file = inspect.getsourcefile(function)
        self.line = inspect.getsourcelines(function)[1]
        self.aliases: dict[str, Value] = {}

    def refuse(self, node: ast.AST, why: str) -> NoReturn:
        """Raise the error that names file, line and construct."""
        line = self.line + getattr(node, "lineno", 1) - 1
        text = ast.unparse(node).partition("\n")[0]
        raise TranslationError(f"{self.file}:{line}: cannot be C: {text!r}: {why}")

    def is_local(self, name: str) -> bool:
        """Say whether a variable of that name has been assigned."""
        raise NotImplementedError

    def variable(self, name: str) -> Value:
        """Return a local variable that is read."""
        raise NotImplementedError

    def expr(self, node: ast.expr) -> Value:
        """Return any expression."""
        method = getattr(self, f"_{type(node).__name__}", None)
        if method is None:
            self.refuse(node, f"{type(node).__name__} is outside the subset")
        value: Value = method(node)
        return value

    def scalar(self, node: ast.expr) -> Value:
        """Return an expression that must be a number."""
        value = self.expr(node)
        if not isinstance(value.kind, Scalar):
            self.refuse(node, "a number is wanted here")
        return value

    def found(self, node: ast.expr) -> Any:
        """Return the Python object that a name of the module stands for."""
        if isinstance(node, ast.Name):
            if node.id in self.aliases or self.is_local(node.id):
                return UNKNOWN
            known = {**vars(builtins), **self.function.__globals__}
            return known.get(node.id, UNKNOWN)
        if isinstance(node, ast.Attribute):
            owner = self.found(node.value)
            if inspect.ismodule(owner):
                return getattr(owner, node.attr, UNKNOWN)
        return UNKNOWN

    def _Constant(self, node: ast.Constant) -> Value:
        if not isinstance(node.value, bool | int | float):
            self.refuse(node, "only numbers are constants")
        return constant(node.value)

    def _Name(self, node: ast.Name) -> Value:
        if node.id in self.aliases:
            return self.aliases[node.id]
        if self.is_local(node.id):
            return self.variable(node.id)
        known = self.found(node)
        if known is UNKNOWN:
            self.refuse(node, "no such name, or not assigned before")
        if isinstance(known, bool | int | float):
            module = self.function.__module__
            return constant(known, self.unit.define(node.id, known, module))
        return self._known(known)

    def _known(self, known: Any) -> Value:
        """Return a module's tuple as a struct; anything else exists only here."""
        if not isinstance(known, tuple):
            return Value(None, "", known=known)
        return self.unit.packed([constant(part) for part in known])

    def _Tuple(self, node: ast.Tuple) -> Value:
        return self.unit.packed([self.expr(part) for part in node.elts])

    def _Attribute(self, node: ast.Attribute) -> Value:
        known = self.found(node)
        if known is not UNKNOWN:
            return constant(known)
        owner = self.expr(node.value)
        if isinstance(owner.known, np.void):
            number = owner.known[node.attr].item()
            return constant(number, f"{owner.text}.{node.attr}")
        return self.refuse(node, "only fields of the settings have names")

    def _shape(self, node: ast.Subscript) -> Value:
        assert isinstance(node.value, ast.Attribute)
        array = self.expr(node.value.value)
        place = self.scalar(node.slice).known
        if isinstance(array.known, np.ndarray):
            return constant(array.known.shape[place])
        if not isinstance(array.kind, Grid) or array.level != ATOM:
            self.refuse(node, "only arrays have a shape")
        return Value(Scalar.INT, f"{array.text}.{('rows', 'columns', 'depth')[place]}")

    def _Subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            return self._shape(node)
        base = self.expr(node.value)
        if isinstance(base.kind, Pack):
            return self._of_tuple(node, base)
        where = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base.known, np.ndarray):
            return self._of_fixed(node, base, [self.scalar(one) for one in where])
        if not isinstance(base.kind, Grid):
            self.refuse(node, "neither an array nor a tuple")
        slices = [self._bounds(one) for one in where]
        if slices[0] is not None:
            if len(where) > 1:
                self.refuse(node, "only a slice of the first axis is contiguous")
            return self._part(base, *slices[0])
        return self.element(node, base, [self.scalar(one) for one in where])

    def _of_tuple(self, node: ast.Subscript, base: Value) -> Value:
        assert isinstance(base.kind, Pack)
        place = self.scalar(node.slice)
        if isinstance(place.known, int):
            if base.parts:
                return base.parts[place.known]
            return Value(base.kind.parts[place.known], f"{base.text}._{place.known}")
        return self.choice(node, base, place.text)

    def choice(self, node: ast.AST, base: Value, place: str) -> Value:
        """Return the part of a tuple at a place that is only known in the end."""
        if not base.parts:
            self.refuse(node, "only a tuple that is written out can be chosen from")
        kind = base.parts[0].kind
        for part in base.parts:
            kind = kind and part.kind and joined(kind, part.kind)
        if kind is None:
            self.refuse(node, "parts of several kinds")
        parts = ", ".join(part.text for part in base.parts)
        return Value(kind, f"((const {c_type(kind)}[]){{{parts}}})[{place}]")

    def _of_fixed(
        self, node: ast.Subscript, base: Value, places: Sequence[Value]
    ) -> Value:
        """Return an element of what is constant in the file."""
        if base.known.dtype.names:
            return Value(None, base.text, known=base.known[places[0].known])
        if len(places) != base.known.ndim:
            self.refuse(node, "only the elements of a constant array can be taken")
        text = base.text + "".join(f"[{place.text}]" for place in places)
        if any(place.known is UNKNOWN for place in places):
            return Value(Scalar.DOUBLE, text)
        return constant(base.known[tuple(place.known for place in places)].item(), text)

    def _bounds(self, node: ast.expr) -> tuple[Value, Value | None] | None:
        """Return first and end (None: the array's own) of a slice; None without."""
        known = self.found(node)
        if isinstance(known, slice):
            return constant(known.start or 0), constant(known.stop)
        if not isinstance(node, ast.Slice):
            return None
        if node.step is not None:
            self.refuse(node, "a slice with a step is not contiguous")
        begin = constant(0) if node.lower is None else self.scalar(node.lower)
        return begin, None if node.upper is None else self.scalar(node.upper)

    def _part(self, base: Value, begin: Value, end: Value | None) -> Value:
        if end is None and begin.known == 0:
            return base
        last = f"{base.text}.rows" if end is None else end.text
        return Value(base.kind, f"part({base.text}, {begin.text}, {last})")

    def element(self, node: ast.AST, base: Value, places: Sequence[Value]) -> Value:
        """Return an element, or with fewer places than dimensions a row, of an array."""
        assert isinstance(base.kind, Grid)
        if any(isinstance(p.known, int) and p.known < 0 for p in places):
            self.refuse(node, "a negative place")
        if len(places) < base.kind.dims:
            text = f"row({base.text}, {places[0].text})"
            value = Value(Grid(base.kind.dims - 1), text)
            return self.element(node, value, places[1:]) if places[1:] else value
        if not re.fullmatch(r"[\w.]+", base.text):
            self.refuse(node, "take the view first, then its element")
        text = places[0].text
        for size, place in zip(("columns", "depth"), places[1:], strict=False):
            first = text if text.isidentifier() or text.isdigit() else f"({text})"
            before = "" if first == "1" else f"{first} * "
            after = "" if place.text == "0" else f" + {place.text}"
            text = f"{before}{base.text}.{size}{after}"
            text = place.text if first == "0" else text
        return Value(Scalar.DOUBLE, f"{base.text}.at[{text}]")

    def _UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.scalar(node.operand)
        if isinstance(node.op, ast.Not):
            known = UNKNOWN if value.known is UNKNOWN else not value.known
            return Value(Scalar.BOOL, f"!{value.at(UNARY)}", UNARY, known)
        if not isinstance(node.op, ast.USub):
            self.refuse(node, "an operator outside the subset")
        known = UNKNOWN if value.known is UNKNOWN else -value.known
        return Value(value.kind, f"-{value.at(ATOM)}", UNARY, known)

    def _BinOp(self, node: ast.BinOp) -> Value:
        return self.binary(node, self.scalar(node.left), node.op, node.right)

    def binary(
        self, node: ast.AST, left: Value, op: ast.operator, right_node: ast.expr
    ) -> Value:
        """Return an arithmetic operation on numbers."""
        right = self.scalar(right_node)
        whole = left.kind == right.kind == Scalar.INT
        if isinstance(op, ast.Pow) and right.known == 2:
            return Value(Scalar.DOUBLE, f"square({left.text})")
        if isinstance(op, ast.Mod | ast.FloorDiv) and whole:
            name = "modulo" if isinstance(op, ast.Mod) else "quotient"
            return Value(Scalar.INT, f"{name}({left.text}, {right.text})")
        if type(op) not in BINARY or Scalar.BOOL in (left.kind, right.kind):
            self.refuse(node, "an operator outside the subset")
        sign, level = BINARY[type(op)]
        if isinstance(op, ast.Div) and whole:
            left = Value(Scalar.DOUBLE, f"(double){left.at(UNARY)}", UNARY)
        kind = Scalar.INT if whole and sign != "/" else Scalar.DOUBLE
        return Value(kind, f"{left.at(level)} {sign} {right.at(level + 1)}", level)

    def _Compare(self, node: ast.Compare) -> Value:
        parts = []
        left_node = node.left
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            parts.append(self._comparison(left_node, op, right_node))
            left_node = right_node
        return self._all(parts, "&&", AND)

    def _comparison(
        self, left_node: ast.expr, op: ast.cmpop, right_node: ast.expr
    ) -> Value:
        if isinstance(op, ast.In | ast.NotIn) and isinstance(right_node, ast.Tuple):
            equal: ast.cmpop = ast.Eq() if isinstance(op, ast.In) else ast.NotEq()
            parts = [self._comparison(left_node, equal, one) for one in right_node.elts]
            inside = isinstance(op, ast.In)
            return self._all(parts, "||" if inside else "&&", OR if inside else AND)
        if type(op) not in COMPARISONS:
            self.refuse(right_node, "a comparison outside the subset")
        left, right = self.scalar(left_node), self.scalar(right_node)
        sign, holds = COMPARISONS[type(op)]
        known = UNKNOWN
        if left.known is not UNKNOWN and right.known is not UNKNOWN:
            known = holds(left.known, right.known)
        text = f"{left.at(ADD)} {sign} {right.at(ADD)}"
        return Value(Scalar.BOOL, text, COMPARE, known)

    def _BoolOp(self, node: ast.BoolOp) -> Value:
        parts = [self.scalar(part) for part in node.values]
        either = isinstance(node.op, ast.Or)
        return self._all(parts, "||" if either else "&&", OR if either else AND)

    def _all(self, parts: Sequence[Value], sign: str, level: int) -> Value:
        """Return truth values joined; what is known already is left out."""
        decides = sign == "||"
        if any(p.known is not UNKNOWN and bool(p.known) == decides for p in parts):
            return constant(decides)
        parts = [part for part in parts if part.known is UNKNOWN]
        if not parts:
            return constant(not decides)
        text = f" {sign} ".join(part.at(COMPARE) for part in parts)
        single = len(parts) == 1
        return parts[0] if single else Value(Scalar.BOOL, text, level)

    def _IfExp(self, node: ast.IfExp) -> Value:
        test = self.scalar(node.test)
        if test.known is not UNKNOWN:
            return self.expr(node.body if test.known else node.orelse)
        return self._either(node, test, self.expr(node.body), self.expr(node.orelse))

    def _either(self, node: ast.AST, test: Value, one: Value, other: Value) -> Value:
        kind = one.kind and other.kind and joined(one.kind, other.kind)
        if isinstance(kind, Pack) and one.parts and other.parts:
            pairs = zip(one.parts, other.parts, strict=True)
            return self.unit.packed([self._either(node, test, a, b) for a, b in pairs])
        if kind is None or (isinstance(kind, Pack) and one.kind != other.kind):
            self.refuse(node, "two kinds of value")
        text = f"{test.at(OR)} ? {one.at(TERNARY)} : {other.at(TERNARY)}"
        return Value(kind, text, TERNARY)

    def _Call(self, node: ast.Call) -> Value:
        if node.keywords:
            self.refuse(node, "arguments by keyword")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            return self._reshape(node, self.expr(node.func.value))
        function = self.found(node.func)
        if hasattr(function, "py_func"):
            return self.unit.call(function, self._arguments(node))
        if function is len:
            shape = ast.Attribute(node.args[0], "shape", ast.Load())
            value = self.expr(node.args[0])
            if isinstance(value.kind, Pack):
                return constant(len(value.kind.parts))
            return self._shape(ast.Subscript(shape, ast.Constant(0), ast.Load()))
        return self._builtin(node, function, [self.scalar(one) for one in node.args])

    def _arguments(self, node: ast.Call) -> list[Value]:
        values: list[Value] = []
        for one in node.args:
            if not isinstance(one, ast.Starred):
                values.append(self.expr(one))
                continue
            pack = self.expr(one.value)
            if not pack.parts:
                self.refuse(one, "only a tuple of what exists at translation")
            values += pack.parts
        return values

    def _reshape(self, node: ast.Call, base: Value) -> Value:
        sizes = node.args
        if len(sizes) == 1 and isinstance(sizes[0], ast.Tuple):
            sizes = sizes[0].elts
        if not isinstance(base.kind, Grid) or len(sizes) not in (2, 3):
            self.refuse(node, "only an array takes a shape of two or three sizes")
        texts = [self.scalar(size).text for size in sizes] + ["1"]
        return Value(Grid(len(sizes)), f"shaped({base.text}, {', '.join(texts[:3])})")

    def _builtin(self, node: ast.Call, function: Any, values: list[Value]) -> Value:
        whole = all(value.kind == Scalar.INT for value in values)
        texts = [value.text for value in values]
        if function in (min, max) and len(values) > 1:
            name = function.__name__
            name = f"i{name}" if whole else f"{name}2"
            text = texts[0]
            for other in texts[1:]:
                text = f"{name}({text}, {other})"
            return Value(Scalar.INT if whole else Scalar.DOUBLE, text)
        if function is abs:
            return Value(values[0].kind, f"{'abs' if whole else 'fabs'}({texts[0]})")
        if function is float and not whole:
            return values[0]
        if function is float:
            return Value(Scalar.DOUBLE, f"(double){values[0].at(UNARY)}", UNARY)
        if function in (int, round, math.floor, math.ceil):
            text = texts[0]
            if function is not int:
                text = f"{'rint' if function is round else function.__name__}({text})"
            return values[0] if whole else Value(Scalar.INT, f"whole({text})")
        if function in LIBM:
            kind = Scalar.BOOL if function is math.isfinite else Scalar.DOUBLE
            return Value(kind, f"{LIBM[function]}({', '.join(texts)})")
        return self.refuse(node, "a function outside the subset")
