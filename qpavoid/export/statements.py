"""Statements of the compiled subset, as C: one function at a time."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from qpavoid.export.expressions import Expressions
from qpavoid.export.values import (
    NUMBERS,
    UNKNOWN,
    Value,
    c_name,
    constant,
    joined,
    wrapped,
)

ANNOTATED = {"float": "double", "int": "int", "bool": "bool"}


class Function(Expressions):
    """One compiled function as C, for arguments of given kinds.

    It is translated again and again until the kinds of its variables stay as they are:
    the last time says what each is, where it is declared, and what is never read.

    Attributes:
        name: In C.
        result: Kind of what it returns.
        taken: Which of the arguments, tuples that exist at translation alone taken
            apart, it takes in C: those that it reads.
    """

    def __init__(
        self, unit: Any, function: Callable[..., Any], arguments: Sequence[Value]
    ) -> None:
        super().__init__(unit, function)
        source = textwrap.dedent(inspect.getsource(function))
        definition = ast.parse(source).body[0]
        assert isinstance(definition, ast.FunctionDef)
        self.definition = definition
        self.name, self.result = c_name(function.__name__), "void"
        self.kinds: dict[str, str] = {}
        self.bound: dict[str, Value] = {}
        self.reads: set[str] = set()
        self.stores: dict[str, int] = {}
        self.places: dict[str, list[tuple[tuple[int, ...], bool]]] = {}
        self._bind(arguments)
        self.parameters = list(self.kinds)
        before = None
        while before != (state := (dict(self.kinds), self.result, dict(self.places))):
            before = state
            self._translate()
        self.taken = [name in self.reads for name in self.parameters]

    def _bind(self, arguments: Sequence[Value]) -> None:
        """Give the parameters what exists at translation, and their kinds else."""
        names = self.definition.args.args
        if len(names) != len(arguments):
            self.refuse(self.definition, f"called with {len(arguments)} arguments")
        for name, value in zip(names, arguments, strict=True):
            if value.kind:
                told = ANNOTATED.get(ast.unparse(name.annotation or name))
                self.kinds[name.arg] = told or value.kind
                continue
            parts = []
            for i, part in enumerate(value.parts):
                if part.kind:
                    self.kinds[f"{name.arg}_{i}"] = part.kind
                    part = Value(part.kind, f"{name.arg}_{i}")
                parts.append(part)
            known = value.known
            fixed = constant(known) if isinstance(known, bool) else value
            self.bound[name.arg] = fixed._replace(parts=tuple(parts))

    def _translate(self) -> None:
        self.inline = {n for n in self.places if self._declares(self.places[n])}
        self.unread = set(self.kinds) - self.reads if self.places else set()
        self.once = {name for name, count in self.stores.items() if count == 1}
        self.reads, self.stores, self.places = set(), {}, {}
        self.aliases = dict(self.bound)
        self.lines: list[str] = []
        self.loops: list[str] = []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.ended = False
        self.body(self.definition.body)

    @staticmethod
    def _declares(places: list[tuple[tuple[int, ...], bool]]) -> bool:
        """Say whether a variable's first assignment stands in a block with all uses."""
        first, assigned = places[0]
        return assigned and all(path[: len(first)] == first for path, _ in places)

    @property
    def text(self) -> str:
        """The whole function in C."""
        names = [n for n, kept in zip(self.parameters, self.taken, strict=True) if kept]
        taken = ", ".join(f"{self.kinds[n]} {c_name(n)}" for n in names) or "void"
        top = [
            f"    {self.kinds[name]} {c_name(name)} = "
            f"{'0' if self.kinds[name] in NUMBERS else '{0}'};"
            for name in self.reads
            if name not in self.inline and name not in self.parameters
        ]
        head = wrapped(f"static {self.result} {self.name}({taken})", 0)
        return "\n".join([head, "{", *sorted(top), *self.lines, "}"])

    def emit(self, line: str, reads: str | None = None) -> None:
        """Add a line, and note which variables it reads."""
        names = {c_name(name): name for name in self.kinds if name not in self.loops}
        for word in re.findall(
            r"(?<![.\w])[A-Za-z_]\w*", line if reads is None else reads
        ):
            if word in names:
                self.reads.add(names[word])
                self.places.setdefault(names[word], []).append((self.path, False))
        self.lines.append(wrapped(line, len(self.path) + 1))

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Indent what is emitted meanwhile."""
        self.emit(f"{head} {{")
        self.blocks += 1
        self.path += (self.blocks,)
        yield
        self.path = self.path[:-1]
        self.ended = False

    def body(self, nodes: Sequence[ast.stmt]) -> None:
        """Translate statements one after another, up to the first that ends them."""
        for node in nodes:
            method = getattr(self, f"_{type(node).__name__}", None)
            if method is None:
                self.refuse(node, f"{type(node).__name__} is outside the subset")
            method(node)
            if self.ended:
                return

    def variable(self, name: str) -> Value | None:
        """Return a local variable; None if there is none."""
        if name in self.loops:
            return Value("int", c_name(name))
        if name in self.aliases:
            return self.aliases[name]
        return Value(self.kinds[name], c_name(name)) if name in self.kinds else None

    def temporary(self, value: Value, name: str) -> Value:
        """Return the value as a variable of its own."""
        self.temporaries += 1
        name = f"{name}_{self.temporaries}"
        self.emit(f"const {value.kind} {name} = {value.text};")
        return Value(value.kind, name)

    def assign(self, node: ast.AST, target: ast.expr, value: Value) -> None:
        """Give a value to whatever can have one."""
        if isinstance(target, ast.Name):
            self._to_variable(node, target.id, value)
        elif isinstance(target, ast.Tuple):
            self._unpack(node, target, value)
        else:
            place = self.expr(target)
            if ".at[" not in place.text or value.kind not in NUMBERS:
                self.refuse(node, "only numbers are stored, and only in arrays")
            self.emit(f"{place.text} = {value.text};")

    def _to_variable(self, node: ast.AST, name: str, value: Value) -> None:
        """Assign to a variable; declare it where that can be here."""
        if name == "_":
            return
        fixed = any(
            c_name(name) == p.text for a in self.aliases.values() for p in a.parts
        )
        if name in self.loops or fixed:
            self.refuse(node, f"{name} must not change: a loop or a tuple has it")
        if not value.kind or name in self.bound:
            if self.path or (value.kind and value.known is UNKNOWN):
                self.refuse(node, f"{name} must be known at translation")
            self.aliases[name] = value
            return
        kind = joined(self.kinds.get(name, value.kind), value.kind)
        if not kind:
            self.refuse(node, f"{name} is {self.kinds[name]}, not {value.kind}")
        self.kinds[name] = kind
        if name in self.unread:
            return
        self.stores[name] = self.stores.get(name, 0) + 1
        declared = ""
        if name in self.inline and self.stores[name] == 1:
            declared = f"{'const ' if name in self.once else ''}{kind} "
        self.emit(f"{declared}{c_name(name)} = {value.text};", value.text)
        stores = self.places.setdefault(name, [])
        stores.append((self.path, name not in self.parameters))

    def _unpack(self, node: ast.AST, target: ast.Tuple, value: Value) -> None:
        """Assign the parts of a tuple, all of them read before one is written."""
        parts = list(value.parts)
        if not parts:
            if value.kind not in self.unit.packs:
                self.refuse(node, "only a tuple has parts")
            if not value.text.isidentifier():
                value = self.temporary(value, value.text.partition("(")[0])
            kinds = enumerate(self.unit.packs[value.kind])
            parts = [Value(kind, f"{value.text}._{i}") for i, kind in kinds]
        if len(parts) != len(target.elts):
            self.refuse(node, f"{len(parts)} parts for {len(target.elts)}")
        for i, one in enumerate(target.elts):
            later = " ".join(part.text for part in parts[i + 1 :])
            name = c_name(one.id) if isinstance(one, ast.Name) else "at"
            if value.parts and re.search(rf"\b{name}\b", later):
                parts[i + 1 :] = [
                    part if part.known is not UNKNOWN else self.temporary(part, "new")
                    for part in parts[i + 1 :]
                ]
            self.assign(node, one, parts[i])

    def _Assign(self, node: ast.Assign) -> None:
        value = self.expr(node.value)
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        unread = {"_", *self.unread}
        if isinstance(node.value, ast.Call) and all(
            isinstance(one, ast.Name) and one.id in unread for one in names
        ):
            self.emit(f"{value.text};")
            return
        if len(node.targets) > 1 and value.known is UNKNOWN:
            value = self.temporary(value, "same")
        for target in node.targets:
            self.assign(node, target, value)

    def _AugAssign(self, node: ast.AugAssign) -> None:
        left = ast.parse(ast.unparse(node.target), mode="eval").body
        changed = ast.BinOp(left, node.op, node.value)
        value = self.expr(ast.fix_missing_locations(ast.copy_location(changed, node)))
        self.assign(node, node.target, value)

    def _Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.emit(f"{self.expr(node.value).text};")
        elif not isinstance(node.value, ast.Constant):
            self.refuse(node, "an expression without effect")

    def _If(self, node: ast.If, head: str = "if") -> None:
        test = self.number(node.test)
        if test.known is not UNKNOWN:
            self.body(node.body if test.known else node.orelse)
            return
        with self.block(f"{head} ({test.text})"):
            self.body(node.body)
        other = node.orelse[0] if len(node.orelse) == 1 else None
        if isinstance(other, ast.If) and self.number(other.test).known is UNKNOWN:
            self._If(other, "} else if")
            return
        if node.orelse:
            with self.block("} else"):
                self.body(node.orelse)
        self.emit("}")

    def _While(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "a loop with else")
        with self.block(f"while ({self.number(node.test).text})"):
            self.body(node.body)
        self.emit("}")

    def _For(self, node: ast.For) -> None:
        call, target = node.iter, node.target
        if node.orelse or not isinstance(target, ast.Name):
            self.refuse(node, "a loop with else, or over several names")
        self.temporaries += 1
        i = f"turn_{self.temporaries}"
        value, begin = Value("int", i), constant(0)
        if not isinstance(call, ast.Call):
            value = self.chosen(node, parts := self.expr(call), i)
            end = constant(len(parts.parts))
        elif self.found(call.func) is range and len(call.args) < 3:
            begin, end = [begin, *map(self.number, call.args)][-2:]
            i = i if target.id in ("_", *self.kinds) else c_name(target.id)
        else:
            self.refuse(node, "only over a range or a tuple")
        if end.known is UNKNOWN:
            end = self.temporary(end, "end")
        with self.block(f"for (int {i} = {begin.text}; {i} < {end.text}; {i}++)"):
            own = i == c_name(target.id)
            self.loops.append(target.id if own else "")
            if not own:
                self.assign(node, target, value)
            self.body(node.body)
            self.loops.pop()
        self.emit("}")

    def _Return(self, node: ast.Return) -> None:
        self.ended = True
        if node.value is None:
            self.emit("return;")
            return
        value = self.expr(node.value)
        told = ANNOTATED.get(ast.unparse(self.definition.returns or node))
        if self.result not in ("void", told or value.kind):
            self.refuse(node, f"returned {self.result} before")
        self.result = told or value.kind
        self.emit(f"return {value.text};")

    def _Break(self, node: ast.Break) -> None:
        self.ended = True
        self.emit("break;")

    def _Continue(self, node: ast.Continue) -> None:
        self.ended = True
        self.emit("continue;")
