"""Operators and calls, as C."""

import ast
import inspect
from collections.abc import Callable, Sequence
from typing import Any

from qpavoid.export import arithmetic
from qpavoid.export.names import Names
from qpavoid.export.values import (
    ARRAYS,
    NUMBERS,
    OR,
    TERNARY,
    Refusal,
    Value,
    constant,
)


class Expressions(Names):
    """Translates the expressions of one function."""

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        """Return the opposite."""
        return arithmetic.unary(node.op, self.number(node.operand))

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        """Return two numbers under an operator."""
        left, right = self.number(node.left), self.number(node.right)
        return arithmetic.binary(node.op, left, right)

    def visit_Compare(self, node: ast.Compare) -> Value:
        """Return whether all of a chain holds."""
        first: Value = self.visit(node.left)
        if first.kind in self.unit.structs:
            return self.compared(first, node)
        parts, left = [], self.as_number(first)
        for op, other in zip(node.ops, node.comparators, strict=True):
            if isinstance(op, ast.In | ast.NotIn):
                ones = self.parts(self.visit(other))
                equal = [arithmetic.compared(left, ast.Eq(), one) for one in ones]
                value = arithmetic.joined(equal, either=True)
                if isinstance(op, ast.NotIn):
                    value = arithmetic.unary(ast.Not(), value)
                parts.append(value)
                continue
            right = self.lazily(other) if parts else self.number(other)
            parts.append(arithmetic.compared(left, op, right))
            left = right
        return arithmetic.joined(parts, either=False)

    def compared(self, one: Value, node: ast.Compare) -> Value:
        """Return whether two tuples are the same, or whether they are not."""
        op, parts = node.ops[0], self.parts(one)
        others = self.parts(self.visit(node.comparators[0]))
        alike = len(node.ops) == 1 and len(parts) == len(others)
        if not alike or not isinstance(op, ast.Eq | ast.NotEq):
            raise Refusal("only two tuples of one length can be the same or not")
        pairs = zip(parts, others, strict=True)
        equal = [arithmetic.compared(left, op, right) for left, right in pairs]
        return arithmetic.joined(equal, either=isinstance(op, ast.NotEq))

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        """Return truths joined; what is decided by the first is not looked at."""
        either, parts = isinstance(node.op, ast.Or), [self.number(node.values[0])]
        for other in node.values[1:]:
            if parts[-1].decided and bool(parts[-1].known) == either:
                break
            open_ = not all(part.decided for part in parts)
            parts.append(self.lazily(other) if open_ else self.number(other))
        return arithmetic.joined(parts, either)

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        """Return one of two values."""
        test = self.number(node.test)
        if test.decided:
            value: Value = self.visit(node.body if test.known else node.orelse)
            return value
        one, other = (self.lazily(n, number=False) for n in (node.body, node.orelse))
        kind = self.unit.common(one, other)
        if not kind:
            return one
        if kind not in NUMBERS:
            one, other = self.unit.cast(one, kind), self.unit.cast(other, kind)
        text = f"{test.at(OR)} ? {one.at(TERNARY)} : {other.at(TERNARY)}"
        return Value(kind, text, TERNARY)

    def visit_Call(self, node: ast.Call) -> Value:
        """Return a call."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            return self.reshaped(self.visit(node.func.value), self.given(node.args))
        function = self.found(node.func)
        text = getattr(node.args[0], "value", 0) if node.args else 0
        if function is float and isinstance(text, str):
            return constant(float(text))
        if hasattr(function, "py_func"):
            values = self.bound_to(function.py_func, node)
            made: Value = self.unit.called(function.py_func, values)
            return made
        if isinstance(function, type) and hasattr(function, "_fields"):
            values, named = self.bound_to(function, node), bool(node.keywords)
            record: Value = self.unit.packed(values, function, named)
            return record
        if node.keywords:
            raise Refusal("arguments by keyword")
        values = self.given(node.args)
        if function is len:
            return self.length(values[0])
        if function in (min, max) and len(values) == 1:
            values = self.parts(values[0])
        return arithmetic.called(function, values)

    def length(self, value: Value) -> Value:
        """Return how many rows or parts there are."""
        if value.kind in ARRAYS:
            return Value("int", f"{self.simple(value).text}.rows")
        if value.kind in self.unit.structs:
            return constant(len(self.unit.structs[value.kind].parts))
        return constant(len(value.known))

    def reshaped(self, base: Value, sizes: Sequence[Value]) -> Value:
        """Return the matrix that a vector is laid out as."""
        sizes = self.parts(sizes[0]) if len(sizes) == 1 else sizes
        if base.kind != "vector" or [size.kind for size in sizes] != ["int", "int"]:
            raise Refusal("only a vector takes a shape of two sizes")
        texts = ", ".join([base.text, *(size.text for size in sizes)])
        return Value("matrix", f"shaped({texts})")

    def bound_to(self, function: Callable[..., Any], node: ast.Call) -> list[Value]:
        """Return the arguments of a call in the order of the parameters."""
        named = {str(one.arg): self.visit(one.value) for one in node.keywords}
        try:
            bound = inspect.signature(function).bind(*self.given(node.args), **named)
        except TypeError as error:
            raise Refusal(str(error)) from None
        if not isinstance(function, type):
            bound.apply_defaults()
        elif len(bound.arguments) < len(bound.signature.parameters):
            raise Refusal("compiled, the fields of a record have no defaults")
        return [self.literal(one) for one in bound.arguments.values()]
