"""Names, constants and places in arrays and tuples, as C."""

import ast
import builtins
import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.export.values import ATOM, NUMBERS, UNKNOWN, Value, constant


class TranslationError(QPAvoidError):
    """Something in a compiled function lies outside what can be written as C."""


class Names(ABC):
    """Translates what one function names.

    Attributes:
        unit: The :class:`~qpavoid.export.translate.Translation` that it is part of.
        function: In Python.
        aliases: Names of what exists at translation alone.
    """

    def __init__(self, unit: Any, function: Callable[..., Any]) -> None:
        self.unit = unit
        self.function = function
        self.aliases: dict[str, Value] = {}

    def refuse(self, node: ast.AST, why: str) -> NoReturn:
        """Raise the error that names file, line and construct."""
        line = inspect.getsourcelines(self.function)[1] + getattr(node, "lineno", 1) - 1
        text = ast.unparse(node).partition("\n")[0]
        file = inspect.getsourcefile(self.function)
        raise TranslationError(f"{file}:{line}: cannot be C: {text!r}: {why}")

    def packed(self, parts: Sequence[Value]) -> Value:
        """Return a tuple."""
        value: Value = self.unit.packed(parts)
        return value

    @abstractmethod
    def temporary(self, value: Value, name: str) -> Value:
        """Return the value as a variable of its own."""

    @abstractmethod
    def parts(self, node: ast.AST, value: Value) -> list[Value]:
        """Return the parts of a tuple."""

    @abstractmethod
    def variable(self, name: str) -> Value | None:
        """Return a local variable; None if there is none."""

    def expr(self, node: ast.expr) -> Value:
        """Return any expression."""
        method = getattr(self, f"_{type(node).__name__}", None)
        if method is None:
            self.refuse(node, f"{type(node).__name__} is outside the subset")
        value: Value = method(node)
        return value

    def number(self, node: ast.expr) -> Value:
        """Return an expression that must be a number."""
        value = self.expr(node)
        if value.kind not in NUMBERS:
            self.refuse(node, "a number is wanted here")
        return value

    def found(self, node: ast.expr) -> Any:
        """Return the Python object that a name of the module stands for."""
        if isinstance(node, ast.Name) and self.variable(node.id) is None:
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
        value = self.variable(node.id)
        if value is not None:
            return value
        known = self.found(node)
        if known is UNKNOWN:
            self.refuse(node, "no such name, or not assigned before")
        if isinstance(known, bool | int | float):
            module = self.function.__module__
            return constant(known, self.unit.define(node.id, known, module))
        if isinstance(known, tuple):
            return self.packed([constant(part) for part in known])
        return Value("", "", known=known)

    def _Tuple(self, node: ast.Tuple) -> Value:
        return self.packed([self.expr(part) for part in node.elts])

    def _Attribute(self, node: ast.Attribute) -> Value:
        known = self.found(node)
        if known is not UNKNOWN:
            return constant(known)
        owner = self.expr(node.value)
        if not isinstance(owner.known, np.void):
            self.refuse(node, "only fields of the settings have names")
        return constant(owner.known[node.attr].item(), f"{owner.text}.{node.attr}")

    def _Subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            array, place = self.expr(node.value.value), self.number(node.slice)
            return self.size(node, array, place.known)
        base = self.expr(node.value)
        if base.parts or base.kind in self.unit.packs:
            return self._of_tuple(node, base, self.number(node.slice))
        where = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base.known, np.ndarray):
            return self._of_constant(node, base, [self.number(one) for one in where])
        if base.kind not in ("vector", "matrix"):
            self.refuse(node, "neither an array nor a tuple")
        bounds = self._bounds(where[0])
        if bounds is not None:
            if len(where) > 1:
                self.refuse(node, "not contiguous")
            name = "part" if base.kind == "vector" else "band"
            end = bounds[1] or f"{base.text}.rows"
            return Value(base.kind, f"{name}({base.text}, {bounds[0]}, {end})")
        return self._element(node, base, [self.number(one) for one in where])

    def size(self, node: ast.AST, array: Value, place: int) -> Value:
        """Return how many rows (0) or columns (1) an array has."""
        if isinstance(array.known, np.ndarray):
            return constant(array.known.shape[place])
        if array.parts and place == 0:
            return constant(len(array.parts))
        if array.kind not in ("vector", "matrix") or place not in (0, 1):
            self.refuse(node, "only arrays have a size")
        return Value("int", f"{array.text}.{('rows', 'columns')[place]}")

    def _of_tuple(self, node: ast.AST, base: Value, place: Value) -> Value:
        if isinstance(place.known, int):
            if base.parts:
                return base.parts[place.known]
            kind = self.unit.packs[base.kind][place.known]
            return Value(kind, f"{base.text}._{place.known}")
        return self.chosen(node, base, place.text)

    def chosen(self, node: ast.AST, base: Value, place: str) -> Value:
        """Return the part of a tuple at a place that is only known in the end."""
        kinds = {part.kind for part in base.parts}
        if len(kinds) != 1:
            self.refuse(node, "only from a tuple written out, of one kind")
        kind, parts = kinds.pop(), ", ".join(part.text for part in base.parts)
        return Value(kind, f"((const {kind}[]){{{parts}}})[{place}]")

    def _of_constant(
        self, node: ast.AST, base: Value, places: Sequence[Value]
    ) -> Value:
        """Return an element of the footprint, the limits or the settings."""
        if base.known.dtype.names:
            return Value("", base.text, known=base.known[places[0].known])
        if len(places) != base.known.ndim:
            self.refuse(node, "only elements of a constant array can be taken")
        text = base.text + "".join(f"[{place.text}]" for place in places)
        if any(place.known is UNKNOWN for place in places):
            return Value("double", text)
        return constant(base.known[tuple(place.known for place in places)].item(), text)

    def _bounds(self, node: ast.expr) -> tuple[str, str] | None:
        """Return where a slice begins and ends (empty: with the array); or None."""
        known = self.found(node)
        if isinstance(known, slice):
            return str(known.start), str(known.stop)
        if not isinstance(node, ast.Slice) or node.step is not None:
            return None
        begin = "0" if node.lower is None else self.number(node.lower).text
        return begin, "" if node.upper is None else self.number(node.upper).text

    def _element(self, node: ast.AST, base: Value, places: Sequence[Value]) -> Value:
        if len(places) != (1 if base.kind == "vector" else 2):
            self.refuse(node, "neither an element nor a contiguous part")
        if any(place.known is not UNKNOWN and place.known < 0 for place in places):
            self.refuse(node, "a negative place")
        if not base.text.replace(".", "").isidentifier():
            self.refuse(node, "take the view first, then its element")
        text = places[0].text
        if len(places) == 2 and text == "0":
            text = places[1].text
        elif len(places) == 2:
            text = f"{places[0].at(ATOM)} * {base.text}.columns + {places[1].text}"
        return Value("double", f"{base.text}.at[{text}]")
