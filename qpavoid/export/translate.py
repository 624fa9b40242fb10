"""Translation of compiled functions to C: one visitor per function, and shared data."""

import ast
import builtins
import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from itertools import chain, zip_longest
from typing import Any

import numpy as np

from qpavoid.export.body import FunctionBody, address
from qpavoid.export.structs import Structs
from qpavoid.export.values import (
    ADD,
    ANNOTATED,
    ARRAYS,
    ATOM,
    MULTIPLY,
    NUMBERS,
    OR,
    PRELUDE,
    TERNARY,
    UNARY,
    TranslationError,
    Unsupported,
    Value,
    binary,
    c_name,
    c_number,
    c_words,
    called,
    commented,
    compared,
    constant,
    joined,
    require,
    unary,
)
from qpavoid.types import LAYOUTS

MOST_COPIED = 16
"""Bytes; greatest size of a struct passed by value, in two registers."""

MOST_PASSES = 99
"""Greatest number of passes until the kinds of all variables are found."""

SCALARS = bool | int | float | np.number | np.bool_


class Function(ast.NodeVisitor):
    """Translator of one function, specialised to the kinds of its arguments.

    Visiting an expression returns its :class:`Value`; visiting a statement writes it.

    Attributes:
        name: In C.
        body: Its lines.
        static: Variables that exist only at translation.
        counters: Of the loops that have ended.
    """

    def __init__(
        self,
        unit: "Translation",
        plain: Callable[..., Any],
        arguments: Sequence[Value],
    ) -> None:
        self.unit, self.structs, self.plain = unit, unit.structs, plain
        self.scope = {**vars(builtins), **plain.__globals__}
        tree = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        kinds: dict[str, str] = {}
        self.bound: dict[str, Value] = {}
        for one, value in zip(tree.args.args, arguments, strict=True):
            if value.kind:
                kinds[one.arg] = annotated(one.annotation) or value.kind
            else:
                self.bound[one.arg] = value
        self.body, before = FunctionBody(kinds), None
        for _ in range(MOST_PASSES):
            if before == (before := self.body.state):
                break
            self.body.begin()
            self.static, self.counters = dict(self.bound), set[str]()
            self.write(tree.body)
        else:
            raise TranslationError(
                f"cannot be C: the kinds of {plain.__name__} do not converge"
            )
        self.name = unit.structs.free(c_name(plain.__name__))
        self.body.pointers = {n for n in kinds if self.is_handed_on(n)}

    def is_handed_on(self, name: str) -> bool:
        """Return whether a struct is passed by pointer: it is large, and only read."""
        stored = any(stored for _, stored in self.body.uses.get(name, ()))
        return self.structs.size(self.body.kinds[name]) > MOST_COPIED and not stored

    def visit(self, node: ast.AST) -> Any:
        """Translate a node.

        Raises:
            TranslationError: It cannot be C; the error names file, line and construct.
        """
        try:
            return super().visit(node)
        except Unsupported as why:
            line = inspect.getsourcelines(self.plain)[1] - 1
            line += getattr(node, "lineno", 1)
            text = ast.unparse(node).partition("\n")[0]
            place = f"{inspect.getsourcefile(self.plain)}:{line}"
            raise TranslationError(f"{place}: cannot be C: {text!r}: {why}") from None

    def generic_visit(self, node: ast.AST) -> None:
        """Reject a node without a method of its own."""
        raise Unsupported(f"{type(node).__name__} is outside the subset")

    # Values of expressions.

    def number(self, node: ast.expr) -> Value:
        """Return the value of an expression that must be a number."""
        return as_number(self.visit(node))

    def values(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Return the values of arguments or parts, starred ones unpacked."""
        values: list[Value] = []
        for one in nodes:
            if isinstance(one, ast.Starred):
                values += self.parts(self.visit(one.value))
            else:
                values.append(self.visit(one))
        return values

    def inline(self, node: ast.expr) -> Value:
        """Return a value that is not always evaluated; it must not write first."""
        before = len(self.body.lines)
        value: Value = self.visit(node)
        written = len(self.body.lines) > before
        require(not written, "not always evaluated: it needs a variable of its own")
        return value

    def python(self, known: Any, name: str = "") -> Value:
        """Return the value of a Python object; ``name``: its name in the module."""
        if isinstance(known, Value):
            return known
        if isinstance(known, SCALARS):
            module = self.plain.__module__
            text = self.unit.define(name, known, module) if name else ""
            return constant(known, text)
        if isinstance(known, tuple):
            return self.structs.packed([self.python(k) for k in known], type(known))
        require(not isinstance(known, np.ndarray), "an array of a module")
        return Value("", name, known=known)

    def parts(self, value: Value) -> list[Value]:
        """Return the parts of a tuple, evaluated once."""
        if not value.parts and value.kind in self.structs:
            value = self.simple(value)
        return list(self.structs.parts(value))

    def simple(self, value: Value) -> Value:
        """Return a value that can be used more than once."""
        plain = value.text.replace("->", "").replace(".", "").isidentifier()
        return value if plain else self.body.temporary(value)

    def item(self, parts: Sequence[Value], i: str, hoisted: bool = False) -> Value:
        """Return the part of a tuple at an index known only at run time."""
        kinds = {part.kind for part in parts}
        require(len(kinds) == 1 and "" not in kinds, "only from a tuple of one kind")
        kind, texts = kinds.pop(), ", ".join(part.text for part in parts)
        table = f"((const {kind}[]){{{texts}}})"
        if hoisted:
            table = self.body.new("among")
            self.body.emit(f"const {kind} {table}[] = {{{texts}}};")
        return Value(kind, f"{table}[{i}]")

    def visit_Constant(self, node: ast.Constant) -> Value:
        return self.python(node.value)

    def visit_Name(self, node: ast.Name) -> Value:
        name, kinds = node.id, self.body.kinds
        if name in self.static:
            return self.static[name]
        if name in self.counters:  # read after its loop: now a variable
            kinds.setdefault(name, "int")
        if name in kinds:
            return Value(kinds[name], c_name(name))
        require(name in self.scope, "no such name, or not assigned before")
        return self.python(self.scope[name], name)

    def visit_Tuple(self, node: ast.Tuple) -> Value:
        return self.structs.packed(self.values(node.elts))

    def visit_Attribute(self, node: ast.Attribute) -> Value:
        owner, name = self.visit(node.value), node.attr
        owner = self.structs.pointed(owner)
        fields = self.structs.fields(owner)
        if name in fields:
            return self.structs.parts(owner)[fields.index(name)]
        field = self.structs.field(owner, name)
        if field is not None:
            return field
        if isinstance(owner.known, np.void) and name in (owner.known.dtype.names or ()):
            return constant(owner.known[name], f"{owner.text}.{name}")
        if inspect.ismodule(owner.known) and hasattr(owner.known, name):
            return self.python(getattr(owner.known, name))
        shape = name == "shape" and owner.kind in (*ARRAYS, *self.structs.tables)
        require(shape, "only records and the settings have fields")
        text = self.simple(owner).text
        sizes = ("rows", "columns")[: 2 if owner.kind == "matrix" else 1]
        return self.structs.packed([Value("int", f"{text}.{size}") for size in sizes])

    def visit_Subscript(self, node: ast.Subscript) -> Value:
        base: Value = self.visit(node.value)
        where = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if base.kind in self.structs.records:
            require(ast.unparse(node.slice) == "0", "an array of one record")
            return base
        if isinstance(base.known, np.ndarray):  # the settings
            return Value("", base.text, known=base.known[self.number(node.slice).known])
        if base.kind in self.structs.tables:
            return self.table_row(self.simple(base), node.slice)
        if base.kind not in ARRAYS:
            place = self.number(node.slice)
            if place.decided:
                return self.structs.parts(base)[int(place.known)]
            return self.item(self.parts(base), place.text)
        array = self.simple(base).text
        i = self.index(where[0], f"{array}.rows")
        plane = base.kind == "matrix" and i.kind != "slice"
        require(len(where) == 1 or plane, "not contiguous")
        if i.kind == "slice":
            name = "part" if base.kind == "vector" else "band"
            return Value(base.kind, f"{name}({array}, {i.text})")
        if base.kind == "vector":
            return Value("double", f"{array}.at[{i.text}]")
        row = f"row_of({array}, {i.text})"
        if len(where) == 1:
            return Value("vector", row)
        j = self.index(where[1], f"{array}.columns")
        require(j.kind == "int", "not contiguous")
        begin = "" if i.text == "0" else f"{i.at(ATOM)} * {array}.columns + "
        return Value("double", f"{array}.at[{begin}{j.text}]")

    def table_row(self, table: Value, where: ast.expr) -> Value:
        """Return a row of a table of records, or successive ones."""
        i = self.index(where, f"{table.text}.rows")
        if i.kind != "slice":
            kind = f"{self.structs.tables[table.kind]} *"
            return Value(kind, f"&{table.text}.at[{i.text}]", UNARY)
        begin, end = i.parts
        text = f"({table.kind}){{{table.text}.at + {begin.at(ADD)}, {end.at(ADD)}"
        return Value(table.kind, f"{text} - {begin.at(MULTIPLY)}}}")

    def viewed(self, base: Value, layout: Value) -> Value:
        """Return memory as a table of records."""
        fits = base.kind == "vector" and layout.known in LAYOUTS
        require(fits, "only a vector is viewed, as records")
        kind = self.structs.table(LAYOUTS[layout.known])
        base, of = self.simple(base), self.structs.tables[kind]
        rows = f"{base.text}.rows / (int)(sizeof({of}) / sizeof(double))"
        return Value(kind, f"({kind}){{({of} *){base.text}.at, {rows}}}")

    def index(self, node: ast.expr, size: str) -> Value:
        """Return an integer, from the end if known to be negative, or a slice.

        The text of a slice is both its bounds, as arguments in C.
        """
        if isinstance(node, ast.Slice) and node.step is None:
            begin = self.index(node.lower, size) if node.lower else constant(0)
            end = self.index(node.upper, size) if node.upper else Value("int", size)
            text = f"{begin.text}, {end.text}"
            return Value("slice", text, parts=(begin, end))
        value = self.number(node)
        require(value.kind == "int", "an integer is needed here")
        if value.decided and value.known < 0:
            return Value("int", f"{size} - {-value.known}", ADD)
        return value

    # Operators and calls.

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Value:
        return unary(node.op, self.number(node.operand))

    def visit_BinOp(self, node: ast.BinOp) -> Value:
        left, right = self.number(node.left), self.number(node.right)
        return binary(node.op, left, right)

    def visit_Compare(self, node: ast.Compare) -> Value:
        left, parts = self.visit(node.left), list[Value]()
        for op, other in zip(node.ops, node.comparators, strict=True):
            right = self.inline(other) if parts else self.visit(other)
            parts.append(self.compared(left, op, right))
            left = right
        return joined(parts, either=False)

    def compared(self, left: Value, op: ast.cmpop, right: Value) -> Value:
        """Return a comparison of numbers or of tuples."""
        if left.kind not in self.structs:
            return compared(as_number(left), op, as_number(right))
        pairs = list(zip_longest(self.parts(left), self.parts(right)))
        require(None not in chain(*pairs), "only tuples of one length are compared")
        if isinstance(op, ast.Lt):
            return self.less(pairs)
        require(isinstance(op, ast.Eq | ast.NotEq), "a comparison outside the subset")
        equal = [self.compared(one, op, other) for one, other in pairs]
        return joined(equal, either=isinstance(op, ast.NotEq))

    def less(self, pairs: Sequence[tuple[Value, Value]]) -> Value:
        """Return whether a tuple of numbers comes before another one."""
        (one, other), later = pairs[0], pairs[1:]
        less = self.compared(one, ast.Lt(), other)
        if not later:
            return less
        equal = self.compared(one, ast.Eq(), other)
        return joined([less, joined([equal, self.less(later)], False)], True)

    def visit_BoolOp(self, node: ast.BoolOp) -> Value:
        either, parts = isinstance(node.op, ast.Or), [self.number(node.values[0])]
        for other in node.values[1:]:
            if parts[-1].decided and bool(parts[-1].known) == either:
                break
            static = all(part.decided for part in parts)
            parts.append(as_number(self.visit(other) if static else self.inline(other)))
        return joined(parts, either)

    def visit_IfExp(self, node: ast.IfExp) -> Value:
        test = self.number(node.test)
        one, other = self.inline(node.body), self.inline(node.orelse)
        kind = self.structs.common(one, other)
        text = f"{test.at(OR)} ? {one.at(TERNARY)} : {other.at(TERNARY)}"
        return Value(kind, text, TERNARY)

    def visit_Call(self, node: ast.Call) -> Value:
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            return self.reshaped(self.visit(node.func.value), self.values(node.args))
        if isinstance(node.func, ast.Attribute) and node.func.attr == "view":
            return self.viewed(self.visit(node.func.value), self.visit(node.args[0]))
        function = self.visit(node.func).known
        if hasattr(function, "py_func"):
            plain = function.py_func
            return self.unit.called(plain, self.matched(plain, node))
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self.structs.packed(self.matched(function, node), function)
        require(not node.keywords, "arguments by keyword")
        values = self.values(node.args)
        if function is len and values[0].kind in (*ARRAYS, *self.structs.tables):
            return Value("int", f"{self.simple(values[0]).text}.rows")
        if function is len:
            return constant(len(self.structs.fields(values[0])))
        return called(function, values)

    def reshaped(self, base: Value, sizes: Sequence[Value]) -> Value:
        """Return a vector reshaped to a matrix."""
        sizes = self.parts(sizes[0]) if len(sizes) == 1 else sizes
        kinds = [base.kind, *(size.kind for size in sizes)]
        fits = kinds == ["vector", "int", "int"]
        require(fits, "only a vector takes a shape of two sizes")
        texts = ", ".join([base.text, *(size.text for size in sizes)])
        return Value("matrix", f"shaped({texts})")

    def matched(self, function: Callable[..., Any], node: ast.Call) -> list[Value]:
        """Return the arguments of a call in the order of the parameters."""
        named = {str(one.arg): self.visit(one.value) for one in node.keywords}
        try:
            bound = inspect.signature(function).bind(*self.values(node.args), **named)
        except TypeError as error:
            raise Unsupported(str(error)) from None
        if not isinstance(function, type):
            bound.apply_defaults()
        elif len(bound.arguments) < len(bound.signature.parameters):
            raise Unsupported("compiled, the fields of a record have no defaults")
        return [self.python(one) for one in bound.arguments.values()]

    # Assignments.

    def visit_Assign(self, node: ast.Assign) -> None:
        value = self.visit(node.value)
        if len(node.targets) > 1 and value.runtime:
            value = self.body.temporary(value, "same")
        for target in node.targets:
            self.assign(target, value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.visit(node.value))

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        changed = ast.BinOp(node.target, node.op, node.value)
        self.assign(node.target, self.visit(ast.copy_location(changed, node)))

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.discard(self.visit(node.value))

    def assign(self, target: ast.expr, value: Value) -> None:
        """Assign to a variable, the variables of a tuple, or an element."""
        if isinstance(target, ast.Name):
            self.store(target.id, value)
        elif isinstance(target, ast.Tuple):
            self.unpack(target.elts, value)
        else:
            place = self.structs.pointed(self.visit(target))
            value = self.structs.pointed(value)
            element = ".at[" in place.text or "->" in place.text
            fits = value.kind in NUMBERS and place.kind in NUMBERS
            fits = element and (fits or value.kind == place.kind)
            require(fits, "only numbers and records are stored, and only in arrays")
            self.body.emit(f"{place.text} = {value.text};")

    def unpack(self, targets: Sequence[ast.expr], value: Value) -> None:
        """Assign the parts of a tuple; all are read before one is written."""
        struct = self.structs.get(value.kind)
        parts = list(struct.parts) if struct and not value.parts else []
        if parts and all(map(self.unused, targets, parts)):
            self.discard(value)
        else:
            parts = self.parts(value)
        count = len(targets)
        require(len(parts) == count, f"{len(parts)} parts for {count}")
        for i, target in enumerate(targets):
            later = parts[i + 1 :]
            if any(clobbers(target, part.text) for part in later):
                parts[i + 1 :] = [
                    self.body.temporary(part, "new") if part.runtime else part
                    for part in later
                ]
            self.assign(target, parts[i])

    def unused(self, target: ast.expr, part: Value) -> bool:
        """Return whether the assignment of a part has no effect in C."""
        names = {"_", *self.body.unread}
        return not part.kind or (isinstance(target, ast.Name) and target.id in names)

    def store(self, name: str, value: Value) -> None:
        """Assign to a variable."""
        if name not in self.bound and isinstance(value.known, bool | int | float):
            value = as_number(value)
        if not value.kind or name in self.bound:
            same = self.static.get(name, value).identity == value.identity
            static = (same or not self.body.path) and not value.runtime
            require(static, f"{name} must be known at translation")
            self.static[name] = value
        elif name in self.body.unread or name == "_":
            self.discard(value)
        else:
            kinds = self.body.kinds
            held = Value(kinds.get(name, value.kind), name)
            kinds[name] = self.structs.common(held, value)
            if value.text != name:  # a constant has been folded away
                self.body.store(name, value.text)

    def discard(self, value: Value) -> None:
        """Evaluate an unused value if its function might write to an array."""
        names = {made.name for made in self.unit.functions.values()}
        if names & set(re.findall(r"(\w+)\(", value.text)):
            plain = value.level == ATOM and re.fullmatch(r"\w+\(.*\)", value.text)
            self.body.emit(f"{'' if plain else '(void)'}{value.at(ATOM)};")

    # Control flow.

    def write(self, nodes: Sequence[ast.stmt]) -> None:
        """Write successive statements, up to the first that returns or breaks."""
        for node in nodes:
            self.visit(node)
            if self.body.ended:
                return

    def visit_If(self, node: ast.If, head: str = "if") -> None:
        test = self.number(node.test)
        if test.decided:
            self.write(node.body if test.known else node.orelse)
            return
        with self.body.block(f"{head} ({test.text})"):
            self.write(node.body)
        other = node.orelse[0] if len(node.orelse) == 1 else None
        if isinstance(other, ast.If):
            before, value = len(self.body.lines), self.number(other.test)
            if len(self.body.lines) == before and not value.decided:
                self.visit_If(other, "} else if")
                return
            del self.body.lines[before:]
        if node.orelse:
            with self.body.block("} else"):
                self.write(node.orelse)
        self.body.emit("}")

    def visit_While(self, node: ast.While) -> None:
        require(not node.orelse, "a loop with else")
        with self.body.block(f"while ({as_number(self.inline(node.test)).text})"):
            self.write(node.body)
        self.body.emit("}")

    def visit_For(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        require(not node.orelse, "a loop with else")
        i, begin, step = self.body.new("turn"), constant(0), constant(1)
        value, counter = Value("int", i), ""
        ranged = isinstance(call, ast.Call) and self.visit(call.func).known is range
        if isinstance(call, ast.Call) and ranged:
            given = [self.number(argument) for argument in call.args]
            begin, end = [begin, *given[:2]][-2:]
            step = given[2] if len(given) > 2 else step
            names = ("_", *self.body.kinds)
            if isinstance(target, ast.Name) and target.id not in names:
                i, counter = c_name(target.id), target.id
        else:
            parts = self.parts(self.visit(call))
            end, value = constant(len(parts)), self.item(parts, i, hoisted=True)
        if not end.decided:
            end = self.body.temporary(end, "end")
        known = step.decided and step.known != 0
        require(known, "a range with a step that is not known")
        count = f"{i}++" if step.known == 1 else f"{i} += {step.text}"
        sign = "<" if step.known > 0 else ">"
        head = f"for (int {i} = {begin.text}; {i} {sign} {end.text}; {count})"
        with self.body.block(head):
            if counter:
                self.static[counter] = Value("int", i)
            else:
                self.assign(target, value)
            self.write(node.body)
        self.static.pop(counter, None)
        self.counters.add(counter)
        self.body.emit("}")

    def visit_Return(self, node: ast.Return) -> None:
        self.body.ended = True
        if node.value is None:
            self.body.emit("return;")
            return
        value, result = self.visit(node.value), self.body.result
        value = value if value.kind else as_number(value)
        before = Value(value.kind if result == "void" else result, "")
        self.body.result = self.structs.common(before, value)
        self.body.emit(f"return {value.text};")

    def visit_Break(self, node: ast.Break | ast.Continue) -> None:
        self.body.ended = True
        self.body.emit(f"{ast.unparse(node)};")

    visit_Continue = visit_Break


class Translation:
    """A C file: functions, each before its callers, and shared data.

    Attributes:
        functions: By their Python function and the kinds of their arguments.
        constants: Of the modules.
        structs: Types of the tuples.
        wanted: Names of the functions that are called from outside.
    """

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.constants: dict[str, float] = {}
        self.structs = Structs()
        self.wanted: set[str] = set()

    def call(self, function: Any, arguments: Sequence[Value]) -> Value:
        """Return the call, from outside, of a compiled function."""
        value = self.called(function.py_func, arguments)
        self.wanted.add(value.text.partition("(")[0])
        return value

    def called(self, plain: Callable[..., Any], arguments: Sequence[Value]) -> Value:
        """Return the call of a function, translated at the first call."""
        kinds = ("" if a.kind in NUMBERS else a.identity for a in arguments)
        key = (plain, *kinds)
        if key not in self.functions:
            self.functions[key] = Function(self, plain, arguments)
        made = self.functions[key]
        given = (argument.text for argument in arguments if argument.kind)
        pairs = zip(made.body.parameters, given, strict=True)
        texts = ", ".join(
            address(made.body.kinds[name], text) if name in made.body.pointers else text
            for name, text in pairs
            if name in made.body.reads
        )
        return Value(made.body.result, f"{made.name}({texts})")

    def define(self, name: str, number: Any, module: str) -> str:
        """Return the C name of a module's constant; longer if that is in use."""
        if self.constants.setdefault(name, number) != number:
            name = f"{module.rpartition('.')[2].upper()}_{name}"
            self.constants[name] = number
        self.structs.names.add(name)
        return name

    @property
    def text(self) -> str:
        """All functions, after the constants, types and helpers that they use."""
        used, functions = set(self.wanted), []
        for made in reversed(self.functions.values()):
            known = made.plain.__globals__.get(made.plain.__name__)
            text = made.body.text(made.name, is_inlined(known))
            if made.name in used:
                comment = made.plain.__module__, made.plain.__doc__
                functions.append(commented(*comment, text))
                used |= c_words(text)
        types = PRELUDE | self.structs.texts()
        for name, text in reversed(types.items()):
            used |= c_words(text) if name in used else set()
        defines = [
            f"#define {name} {c_number(number)}"
            for name, number in self.constants.items()
            if name in used
        ]
        texts = [text for name, text in types.items() if name in used]
        return "\n\n".join(["\n".join(defines), *texts, *reversed(functions)])


def is_inlined(function: Any) -> bool:
    """Return whether calls from compiled functions are inlined."""
    return bool(getattr(function, "options", {}).get("forceinline"))


def annotated(hint: ast.expr | None) -> str:
    """Return the kind of number of an annotation; empty for anything else."""
    return ANNOTATED.get(ast.unparse(hint), "") if hint else ""


def as_number(value: Value) -> Value:
    """Return a value that must be a number."""
    if isinstance(value.known, bool | int | float) and not value.kind:
        value = constant(value.known)
    require(value.kind in NUMBERS, "a number is needed here")
    return value


def clobbers(target: ast.expr, text: str) -> bool:
    """Return whether an assignment to a target may change an expression's value."""
    if isinstance(target, ast.Name):
        return c_name(target.id) in c_words(text)
    return "(" in text or "at[" in text or "->" in text
