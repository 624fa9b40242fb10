"""Statements of the compiled subset, as C: one function at a time."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from qpavoid.export.expressions import BINARY, Expressions, Unit
from qpavoid.export.values import (
    PRELUDE,
    TERNARY,
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

SCALARS = {"float": Scalar.DOUBLE, "int": Scalar.INT, "bool": Scalar.BOOL}

RESERVED = {
    *("auto break case char const continue default do double else enum extern".split()),
    *("float for goto if inline int long register restrict return short".split()),
    *("signed sizeof static struct switch typedef union unsigned void".split()),
    *("volatile while array bool true false".split()),
    *("abs fabs sqrt sin cos tan atan2 hypot copysign isfinite ceil floor rint".split()),
    *("exp log pow fmin fmax fmod round".split()),
    *PRELUDE,
}
"""Names that mean something else in C."""


def c_name(name: str) -> str:
    """Return a name that C leaves free."""
    return f"{name}_" if name in RESERVED else name


class Function(Expressions):
    """One compiled function as C, for arguments of given kinds.

    It is translated again and again until the kinds of its variables stay as they are:
    the last time says what each is, where it is declared, and what is never read.
    """

    def __init__(
        self, unit: Unit, function: Callable[..., Any], arguments: Sequence[Value]
    ) -> None:
        super().__init__(unit, function)
        source = textwrap.dedent(inspect.getsource(function))
        definition = ast.parse(source).body[0]
        assert isinstance(definition, ast.FunctionDef)
        self.definition = definition
        self.name = c_name(function.__name__)
        self.summary = (ast.get_docstring(definition) or "").partition("\n\n")[0]
        self.arguments = arguments
        self.kinds: dict[str, Kind] = {}
        self.result: Kind | None = None
        self.returns = False
        self.reads: dict[str, int] = {}
        self.stores: dict[str, int] = {}
        self.places: dict[str, list[tuple[tuple[int, ...], bool]]] = {}
        self.bound: dict[str, Value] = {}
        self.parameters = self._parameters()
        before = None
        while before != (state := (dict(self.kinds), self.result, dict(self.places))):
            before = state
            self._translate()

    def _parameters(self) -> list[str]:
        """Bind the arguments: what exists only here to its value, the rest to kinds."""
        names = self.definition.args.args
        if len(names) != len(self.arguments):
            self.refuse(self.definition, f"{len(self.arguments)} arguments")
        for name, value in zip(names, self.arguments, strict=True):
            if value.kind is None:
                known = isinstance(value.known, bool | int | float)
                self.bound[name.arg] = constant(value.known) if known else value
                continue
            told = SCALARS.get(ast.unparse(name.annotation or name))
            if isinstance(value.kind, Scalar) and told is None:
                self.refuse(self.definition, f"{name.arg} is a number")
            self.kinds[name.arg] = told or value.kind
        return [name.arg for name in names]

    def _translate(self) -> None:
        self.inline = self._plan()
        self.read_before = {n: self.reads.get(n, 0) for n in self.kinds}
        self.stored_before = dict(self.stores)
        self.reads, self.stores, self.places = {}, {}, {}
        self.aliases = dict(self.bound)
        self.lines: list[str] = []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.loops: list[str] = []
        self.known: dict[str, Any] = {}
        self.ended = False
        self.body(self.definition.body)

    def _plan(self) -> dict[str, bool]:
        """Return for every variable whether its first assignment can declare it."""
        plan = {}
        for name, places in self.places.items():
            common = places[0][0]
            for path, _ in places:
                while path[: len(common)] != common:
                    common = common[:-1]
            plan[name] = places[0] == (common, True)
        return plan

    @property
    def taken(self) -> list[str]:
        """The parameters that C takes: those that are read."""
        return [
            n for n in self.parameters if n not in self.bound and self.reads.get(n)
        ]

    @property
    def text(self) -> str:
        """The whole function in C."""
        result = c_type(self.result) if self.result else "void"
        taken = [f"{c_type(self.kinds[n])} {c_name(n)}" for n in self.taken]
        head = wrapped(f"static {result} {self.name}({', '.join(taken) or 'void'})", "")
        top: dict[str, list[str]] = {}
        for name, inline in self._plan().items():
            if not inline and name not in self.parameters and self.reads.get(name):
                kind = self.kinds[name]
                zero = "0" if isinstance(kind, Scalar) else "{0}"
                zero = {"bool": "false", "double": "0.0"}.get(c_type(kind), zero)
                top.setdefault(c_type(kind), []).append(f"{c_name(name)} = {zero}")
        declared = [
            wrapped(f"{kind} {', '.join(names)};", "    ")
            for kind, names in top.items()
        ]
        return "\n".join([head, "{", *declared, *self.lines, "}"])

    def emit(self, line: str) -> None:
        """Add a line, broken where it is too long, and note which variables it reads."""
        if line:
            self.read(line)
            self.lines.append(wrapped(line, "    " * (len(self.path) + 1)))

    def read(self, text: str) -> None:
        """Note which variables are read here."""
        names = {c_name(name): name for name in self.kinds if name not in self.loops}
        for word in re.findall(r"(?<![.\w])[A-Za-z_]\w*", text):
            if word in names:
                name = names[word]
                self.reads[name] = self.reads.get(name, 0) + 1
                self.places.setdefault(name, []).append((self.path, False))

    @contextmanager
    def block(self, head: str, tail: str = "}") -> Iterator[None]:
        """Indent what is emitted meanwhile, between two lines."""
        self.emit(head)
        self.blocks += 1
        self.path += (self.blocks,)
        yield
        self.path = self.path[:-1]
        self.ended = False
        self.emit(tail)

    def body(self, nodes: Sequence[ast.stmt]) -> None:
        """Translate statements one after another."""
        for node in nodes:
            method = getattr(self, f"_{type(node).__name__}", None)
            if method is None:
                self.refuse(node, f"{type(node).__name__} is outside the subset")
            method(node)
            if self.ended:
                return

    def is_local(self, name: str) -> bool:
        """Say whether a variable of that name has been assigned."""
        return name in self.kinds or name in self.loops

    def variable(self, name: str) -> Value:
        """Return a local variable that is read."""
        if name in self.loops:
            return Value(Scalar.INT, c_name(name))
        if name in self.known:
            return constant(self.known[name])
        return Value(self.kinds[name], c_name(name))

    def temporary(self, value: Value, name: str) -> Value:
        """Return the value as a variable that is not assigned again."""
        if value.text.isidentifier() and not isinstance(value.kind, Scalar):
            return value
        assert value.kind is not None
        self.temporaries += 1
        name = f"{name}_{self.temporaries}"
        self.emit(f"const {c_type(value.kind)} {name} = {value.text};")
        return Value(value.kind, name)

    def assign(self, node: ast.AST, target: ast.expr, value: Value) -> None:
        """Give a value to whatever can have one."""
        if isinstance(target, ast.Name):
            self._to_variable(node, target.id, value)
        elif isinstance(target, ast.Tuple):
            self._unpack(node, target, value)
        else:
            self._store(node, self.expr(target), value)

    def _to_variable(self, node: ast.AST, name: str, value: Value) -> None:
        """Assign to a variable; declare it where that can be here."""
        if name == "_":
            return
        if name in self.loops:
            self.refuse(node, "the variable of a loop is its own")
        if any(c_name(name) == p.text for a in self.aliases.values() for p in a.parts):
            self.refuse(node, f"{name} changes, but stands in a tuple")
        if value.kind is None or name in self.bound:
            if self.path or (name in self.bound and value.known is UNKNOWN):
                self.refuse(node, f"{name} must stay what it is at translation")
            self.aliases[name] = value
            return
        before = self.kinds.get(name, value.kind)
        kind = joined(before, value.kind)
        if kind is None:
            self.refuse(node, f"{name} is {c_type(before)}, not {c_type(value.kind)}")
        self.kinds[name] = kind
        self.stores[name] = self.stores.get(name, 0) + 1
        self.known.pop(name, None)
        once = self.stored_before.get(name) == 1
        if once and not self.path and isinstance(value.known, bool):
            self.known[name] = value.known
            return
        if self.read_before.get(name, 1) == 0:
            return
        self.read(value.text)
        self.places.setdefault(name, []).append((self.path, True))
        head = ""
        first = self.inline.get(name) and self.stores[name] == 1
        if first and name not in self.parameters:
            head = f"{'const ' if once else ''}{c_type(kind)} "
        indent = "    " * (len(self.path) + 1)
        self.lines.append(wrapped(f"{head}{c_name(name)} = {value.text};", indent))

    def _parts(self, node: ast.AST, value: Value, count: int) -> list[Value]:
        """Return the parts of a tuple or of a row."""
        if value.parts:
            parts = list(value.parts)
        elif isinstance(value.kind, Pack):
            value = self.temporary(value, value.text.split("(")[0] or "tuple")
            assert isinstance(value.kind, Pack)
            kinds = enumerate(value.kind.parts)
            parts = [Value(kind, f"{value.text}._{i}") for i, kind in kinds]
        elif value.kind == Grid(1):
            value = self.temporary(value, "row")
            parts = [self.element(node, value, [constant(i)]) for i in range(count)]
        else:
            self.refuse(node, "only a tuple or a row has parts")
        if len(parts) != count:
            self.refuse(node, f"{len(parts)} parts for {count}")
        return parts

    def _unpack(self, node: ast.AST, target: ast.Tuple, value: Value) -> None:
        """Assign the parts of a tuple or of a row, all read before one is written."""
        parts = self._parts(node, value, len(target.elts))
        for i, one in enumerate(target.elts[:-1]):
            later = " ".join(part.text for part in parts[i + 1 :])
            name = c_name(one.id) if isinstance(one, ast.Name) else "at"
            if value.parts and re.search(rf"\b{name}\b", later):
                parts = [
                    p if p.known is not UNKNOWN else self.temporary(p, "new")
                    for p in parts
                ]
                break
        for one, part in zip(target.elts, parts, strict=True):
            self.assign(node, one, part)

    def _store(self, node: ast.AST, place: Value, value: Value) -> None:
        """Write to an element of an array, or to a whole view."""
        scalar = isinstance(value.kind, Scalar)
        if isinstance(place.kind, Scalar) and scalar and ".at[" in place.text:
            self.emit(f"{place.text} = {value.text};")
        elif isinstance(place.kind, Grid) and scalar:
            self.emit(f"fill({place.text}, {value.text});")
        elif isinstance(place.kind, Grid) and place.kind == value.kind:
            self.emit(f"copy({place.text}, {value.text});")
        elif place.kind == Grid(1) and isinstance(value.kind, Pack):
            place = self.temporary(place, "row")
            for i, part in enumerate(self._parts(node, value, len(value.kind.parts))):
                self._store(node, self.element(node, place, [constant(i)]), part)
        else:
            self.refuse(node, "cannot be assigned")

    def _Assign(self, node: ast.Assign) -> None:
        value = self.expr(node.value)
        if len(node.targets) > 1 and value.known is UNKNOWN:
            value = self.temporary(value, "same")
        if isinstance(node.value, ast.Call) and self._unread(node.targets[0]):
            self.emit(f"{value.text};")
            return
        for target in node.targets:
            self.assign(node, target, value)

    def _unread(self, target: ast.expr) -> bool:
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        return all(
            isinstance(one, ast.Name) and self.read_before.get(one.id, 1) == 0
            for one in names
        )

    def _AugAssign(self, node: ast.AugAssign) -> None:
        target = ast.copy_location(ast.parse(ast.unparse(node.target)).body[0], node)
        assert isinstance(target, ast.Expr)
        left = self.expr(target.value)
        value = self.binary(node, left, node.op, node.value)
        if isinstance(node.target, ast.Name):
            self._to_variable(node, node.target.id, value)
        else:
            self._store(node, left, value)

    def _AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is None:
            self.refuse(node, "a name without a value")
        self.assign(node, node.target, self.expr(node.value))

    def _Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.emit(f"{self.expr(node.value).text};")
        elif not isinstance(node.value, ast.Constant):
            self.refuse(node, "an expression without effect")

    def _If(self, node: ast.If, head: str = "if") -> None:
        test = self.scalar(node.test)
        if test.known is not UNKNOWN:
            self.body(node.body if test.known else node.orelse)
            return
        with self.block(f"{head} ({test.text}) {{", ""):
            self.body(node.body)
        other = node.orelse[0] if len(node.orelse) == 1 else None
        if isinstance(other, ast.If) and self.scalar(other.test).known is UNKNOWN:
            self._If(other, "} else if")
        elif node.orelse:
            with self.block("} else {"):
                self.body(node.orelse)
        else:
            self.emit("}")

    def _While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "a loop with else")
        with self.block(f"while ({self.scalar(node.test).text}) {{"):
            self.body(node.body)

    def _For(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        if node.orelse or not isinstance(target, ast.Name):
            self.refuse(node, "a loop with else, or over several names")
        if isinstance(call, ast.Tuple):
            several = self.expr(call)
            self.temporaries += 1
            i = f"turn_{self.temporaries}"
            with self.block(f"for (int {i} = 0; {i} < {len(call.elts)}; {i}++) {{"):
                self.assign(node, target, self.choice(node, several, i))
                self.body(node.body)
            return
        if not isinstance(call, ast.Call) or self.found(call.func) is not range:
            self.refuse(node, "only for … in range(…) or in a tuple written out")
        if target.id in self.kinds:
            self.refuse(node, f"{target.id} is a variable of the function too")
        bounds = [self.scalar(one) for one in call.args]
        begin, end = bounds if len(bounds) == 2 else [constant(0), bounds[0]]
        if end.known is UNKNOWN:
            end = self.temporary(end, "end")
        self.temporaries += 1
        i = f"turn_{self.temporaries}" if target.id == "_" else c_name(target.id)
        self.loops.append(target.id)
        with self.block(f"for (int {i} = {begin.text}; {i} < {end.text}; {i}++) {{"):
            self.body(node.body)
        self.loops.pop()

    def _Return(self, node: ast.Return) -> None:
        self.ended = True
        if node.value is None:
            self.emit("return;")
            return
        value = self.expr(node.value)
        told = SCALARS.get(ast.unparse(self.definition.returns or node.value))
        kind = value.kind and joined(self.result or value.kind, value.kind)
        kind = told or kind
        if kind is None:
            self.refuse(node, "another kind of value than before")
        self.result = kind
        if kind != value.kind and isinstance(kind, Pack):
            parts = zip(value.parts, kind.parts, strict=True)
            value = self.unit.packed([part._replace(kind=one) for part, one in parts])
        self.emit(f"return {value.text};")

    def _Break(self, node: ast.Break) -> None:
        self.ended = True
        self.emit("break;")

    def _Continue(self, node: ast.Continue) -> None:
        self.ended = True
        self.emit("continue;")

    def _Pass(self, node: ast.Pass) -> None:
        pass


def wrapped(line: str, indent: str) -> str:
    """Return a line of C, broken at blanks where it is too long."""
    return textwrap.fill(
        line,
        width=88,
        initial_indent=indent,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
