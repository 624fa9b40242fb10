"""Names, constants and places in arrays, tuples and records, as C."""

import ast
import builtins
import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from qpavoid.export.body import Body
from qpavoid.export.values import (
    ADD,
    ARRAYS,
    ATOM,
    NUMBERS,
    UNKNOWN,
    Refusal,
    TranslationError,
    Value,
    c_name,
    constant,
)


class Names(Body, ast.NodeVisitor):
    """Translates names and places: visiting an expression returns its value.

    Attributes:
        unit: What the function is part of.
        plain: The function in Python.
        aliases: Names of what exists at translation alone.
        counted: Names that loops counted with.
    """

    def __init__(self, unit: Any, plain: Callable[..., Any]) -> None:
        super().__init__(c_name(plain.__name__))
        self.unit, self.plain = unit, plain
        self.aliases: dict[str, Value] = {}
        self.counted: set[str] = set()

    def visit(self, node: ast.AST) -> Any:
        """Return the value of an expression, or write a statement.

        Raises:
            TranslationError: It cannot be C; the error names file, line and construct.
        """
        try:
            return super().visit(node)
        except Refusal as why:
            line = inspect.getsourcelines(self.plain)[1] - 1
            line += getattr(node, "lineno", 1)
            text = ast.unparse(node).partition("\n")[0]
            place = f"{inspect.getsourcefile(self.plain)}:{line}"
            raise TranslationError(f"{place}: cannot be C: {text!r}: {why}") from None

    def generic_visit(self, node: ast.AST) -> None:
        """Refuse what has no method of its own."""
        raise Refusal(f"{type(node).__name__} is outside the subset")

    def number(self, node: ast.expr) -> Value:
        """Return an expression that must be a number."""
        return self.as_number(self.visit(node))

    def as_number(self, value: Value) -> Value:
        """Return a value that must be a number."""
        if isinstance(value.known, bool | int | float) and not value.kind:
            value = constant(value.known)
        if value.kind not in NUMBERS:
            raise Refusal("a number is wanted here")
        return value

    def lazily(self, node: ast.expr, number: bool = True) -> Value:
        """Return what is not always evaluated: nothing of it can be written before."""
        before = len(self.lines)
        value: Value = self.number(node) if number else self.visit(node)
        if len(self.lines) > before:
            raise Refusal("not always evaluated: it needs a variable of its own")
        return value

    def found(self, node: ast.expr) -> Any:
        """Return the Python object that a name of the module stands for."""
        if isinstance(node, ast.Name) and self.variable(node.id) is None:
            known = {**vars(builtins), **self.plain.__globals__}
            return known.get(node.id, UNKNOWN)
        if isinstance(node, ast.Attribute):
            owner = self.found(node.value)
            if inspect.ismodule(owner):
                return getattr(owner, node.attr, UNKNOWN)
        return UNKNOWN

    def variable(self, name: str) -> Value | None:
        """Return a local variable; None if there is none."""
        if name in self.loops:
            return Value("int", c_name(name))
        if name in self.aliases:
            return self.aliases[name]
        if name in self.counted:  # read after its loop: from now on kept
            self.kinds.setdefault(name, "int")
        return Value(self.kinds[name], c_name(name)) if name in self.kinds else None

    def literal(self, known: Any, text: str = "") -> Value:
        """Return what is known at translation; ``text`` is its name in C."""
        if isinstance(known, Value):
            return known
        if isinstance(known, bool | int | float | np.number | np.bool_):
            return constant(known, text)
        if isinstance(known, tuple) and not text:
            made: Value = self.unit.packed(
                [self.literal(one) for one in known], type(known)
            )
            return made
        return Value("", text, known=known)

    def parts(self, value: Value) -> list[Value]:
        """Return the parts of a tuple."""
        if isinstance(value.known, tuple):
            names = getattr(value.known, "_fields", None)
            places = [f".{name}" for name in names] if names else []
            places = places or [f"[{i}]" for i in range(len(value.known))]
            pairs = zip(value.known, places, strict=True)
            return [self.literal(one, value.text + place) for one, place in pairs]
        if value.kind not in self.unit.structs:
            raise Refusal("only a tuple has parts")
        if not value.parts:
            value = self.simple(value)
        count = len(self.unit.structs[value.kind].parts)
        return [self.unit.part(value, i) for i in range(count)]

    def part(self, value: Value, place: int) -> Value:
        """Return one part of a tuple."""
        if value.kind in self.unit.structs:
            made: Value = self.unit.part(value, place)
            return made
        return self.parts(value)[place]

    def simple(self, value: Value) -> Value:
        """Return a value that can be named more than once."""
        plain = value.text.replace(".", "").isidentifier()
        return value if plain else self.temporary(value)

    def chosen(self, parts: Sequence[Value], i: str, hoisted: bool = False) -> Value:
        """Return the part of a tuple at a place that is only known in the end."""
        kinds = {part.kind for part in parts}
        kinds = {"double"} if kinds == {"int", "double"} else kinds
        if len(kinds) != 1 or "" in kinds:
            raise Refusal("only from a tuple of one kind")
        kind, texts = kinds.pop(), ", ".join(part.text for part in parts)
        table = f"((const {kind}[]){{{texts}}})"
        if hoisted:
            table = self.new("among")
            self.emit(f"const {kind} {table}[] = {{{texts}}};")
        return Value(kind, f"{table}[{i}]")

    def visit_Constant(self, node: ast.Constant) -> Value:
        """Return a number."""
        if not isinstance(node.value, bool | int | float):
            raise Refusal("only numbers are constants")
        return constant(node.value)

    def visit_Name(self, node: ast.Name) -> Value:
        """Return a variable, or a constant of the module."""
        value = self.variable(node.id)
        if value is not None:
            return value
        known = self.found(node)
        if known is UNKNOWN:
            raise Refusal("no such name, or not assigned before")
        if isinstance(known, bool | int | float):
            module = self.plain.__module__
            return constant(known, self.unit.define(node.id, known, module))
        return self.literal(known, "" if isinstance(known, tuple) else node.id)

    def given(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Return arguments or parts, those with a star taken apart."""
        values: list[Value] = []
        for one in nodes:
            if isinstance(one, ast.Starred):
                values += self.parts(self.visit(one.value))
            else:
                values.append(self.visit(one))
        return values

    def visit_Tuple(self, node: ast.Tuple) -> Value:
        """Return a tuple."""
        made: Value = self.unit.packed(self.given(node.elts))
        return made

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        """Return a field of a record or the settings, or a constant of a module."""
        known = self.found(node)
        if known is not UNKNOWN:
            return self.literal(known)
        owner: Value = self.visit(node.value)
        if node.attr == "shape" and owner.kind in ARRAYS:
            sizes = ("rows", "columns")[: 1 + (owner.kind == "matrix")]
            owner = self.simple(owner)
            made: Value = self.unit.packed(
                [Value("int", f"{owner.text}.{s}") for s in sizes]
            )
            return made
        if node.attr == "shape" and isinstance(owner.known, np.ndarray):
            return self.literal(owner.known.shape)
        if node.attr in getattr(owner.known, "_fields", ()):
            text = f"{owner.text}.{node.attr}"
            return self.literal(getattr(owner.known, node.attr), text)
        if isinstance(owner.known, np.void):
            return constant(owner.known[node.attr], f"{owner.text}.{node.attr}")
        struct = self.unit.structs.get(owner.kind)
        if struct is None or node.attr not in struct.fields:
            raise Refusal("only records and the settings have fields")
        field: Value = self.unit.part(owner, struct.fields.index(node.attr))
        return field

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        """Return a part of a tuple, an element of an array, or a view of it."""
        base: Value = self.visit(node.value)
        where = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if isinstance(base.known, np.ndarray):
            return self.of_constant(base, [self.number(one) for one in where])
        if base.kind not in ARRAYS:
            place = self.number(node.slice)
            if not place.decided:
                return self.chosen(self.parts(base), place.text)
            return self.part(base, place.known)
        base = self.simple(base)
        if base.kind == "matrix" and self.bounds(where[0], "") is None:
            i = self.place(where[0], f"{base.text}.rows")
            view = Value("vector", f"row_of({base.text}, {i.text})")
            if len(where) == 1:
                return view
            bounds = self.bounds(where[1], f"{base.text}.columns")
            if bounds is not None:
                return Value("vector", f"part({view.text}, {bounds[0]}, {bounds[1]})")
            j = self.place(where[1], f"{base.text}.columns").text
            j = j if i.text == "0" else f"{i.at(ATOM)} * {base.text}.columns + {j}"
            return Value("double", f"{base.text}.at[{j}]")
        if len(where) > 1:
            raise Refusal("not contiguous")
        bounds = self.bounds(where[0], f"{base.text}.rows")
        if bounds is None:
            i = self.place(where[0], f"{base.text}.rows")
            return Value("double", f"{base.text}.at[{i.text}]")
        name = "part" if base.kind == "vector" else "band"
        return Value(base.kind, f"{name}({base.text}, {bounds[0]}, {bounds[1]})")

    def of_constant(self, base: Value, places: Sequence[Value]) -> Value:
        """Return an element of the footprint, the limits or the settings."""
        if base.known.dtype.names:
            return Value("", base.text, known=base.known[places[0].known])
        if len(places) != base.known.ndim:
            raise Refusal("only elements of a constant array can be taken")
        text = base.text + "".join(f"[{place.text}]" for place in places)
        if not all(place.decided for place in places):
            return Value("double", text)
        return constant(base.known[tuple(place.known for place in places)], text)

    def place(self, node: ast.expr, size: str) -> Value:
        """Return an index, counted from the end where it is known to be negative."""
        value = self.number(node)
        if value.kind != "int":
            raise Refusal("an integer is wanted here")
        if value.decided and value.known < 0:
            return Value("int", f"{size} - {-value.known}", ADD)
        return value

    def bounds(self, node: ast.expr, size: str) -> tuple[str, str] | None:
        """Return where a slice begins and ends; None if it is no slice."""
        known = self.found(node)
        if isinstance(known, slice):
            return str(known.start or 0), str(known.stop)
        if not isinstance(node, ast.Slice) or node.step is not None:
            return None
        begin = "0" if node.lower is None else self.place(node.lower, size).text
        return begin, size if node.upper is None else self.place(node.upper, size).text
