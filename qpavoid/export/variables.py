"""Variables of a function in C: their kinds, and where they are declared."""

import ast
import inspect
import re
import textwrap
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from typing import Any

from qpavoid.export.expressions import Expressions
from qpavoid.export.values import (
    NUMBERS,
    UNKNOWN,
    Value,
    c_name,
    constant,
    joined,
    leaves,
    renamed,
    wrapped,
)

ANNOTATED = {"float": "double", "int": "int", "bool": "bool"}


class Variables(Expressions):
    """Keeps the variables and the lines of one function.

    It is translated again and again until the kinds of its variables stay as they are:
    the last time says what each is, where it is declared, and what is never read.

    Attributes:
        name: In C.
        result: Kind of what it returns.
        returned: If that is a tuple with parts that exist at translation alone, it.
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
        self.returned: Value | None = None
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
            self._begin()
            self.body(definition.body)
        self.taken = [name in self.reads for name in self.parameters]

    @abstractmethod
    def body(self, nodes: Sequence[ast.stmt]) -> None:
        """Translate statements one after another, up to the first that ends them."""

    def _begin(self) -> None:
        """Forget all but what the last translation found out about the variables."""
        self.inline = {n for n in self.places if self._declares(self.places[n])}
        self.unread = set(self.kinds) - self.reads if self.places else set()
        self.once = {name for name, times in self.stores.items() if times == 1}
        self.reads, self.stores, self.places = set(), {}, {}
        self.aliases = dict(self.bound)
        self.lines: list[str] = []
        self.loops: list[str] = []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.ended = False

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
            held = renamed(value, (f"{name.arg}_{i}" for i in count()))
            self.kinds |= {leaf.text: leaf.kind for leaf in leaves(held) if leaf.kind}
            known = isinstance(value.known, bool)
            self.bound[name.arg] = constant(value.known) if known else held

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
        text = line if reads is None else reads
        for word in re.findall(r"(?<![.\w])[A-Za-z_]\w*", text):
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

    def parts(self, node: ast.AST, value: Value) -> list[Value]:
        """Return the parts of a tuple."""
        if value.parts:
            return list(value.parts)
        if value.kind not in self.unit.packs:
            self.refuse(node, "only a tuple has parts")
        if not value.text.isidentifier():
            value = self.temporary(value, value.text.partition("(")[0])
        kinds = enumerate(self.unit.packs[value.kind])
        return [Value(kind, f"{value.text}._{i}") for i, kind in kinds]

    def to_variable(self, node: ast.AST, name: str, value: Value) -> None:
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
