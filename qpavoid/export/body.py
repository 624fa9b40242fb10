"""The body of a C function: its lines, and where its variables are declared."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from qpavoid.export.values import NUMBERS, Value, c_name, c_words, wrapped


class Use(NamedTuple):
    """Where a variable is used: the numbers of the blocks around, and what for."""

    path: tuple[int, ...]
    stored: bool


class Body:
    """Lines and variables of one function.

    It is written repeatedly until a fixed point: the pass before says of which kind
    each variable is, where it is declared, and which are never read.

    Attributes:
        kinds: Of the variables.
        parameters: Those of them that are parameters.
        result: Kind of what is returned.
        unread: Variables that are never read.
        loops: Counters of the loops around the present line.
        ended: Whether the present block returns, breaks or continues.
    """

    def __init__(self, parameters: Mapping[str, str]) -> None:
        self.kinds, self.parameters = dict(parameters), tuple(parameters)
        self.result = "void"
        self.uses: dict[str, list[Use]] = {}
        self.lines: list[str] = []

    def begin(self) -> None:
        """Begin the next pass: forget all but what is known of the variables."""
        self.inline = {name for name in self.uses if self._declared_inline(name)}
        stores = {name: [u.stored for u in uses] for name, uses in self.uses.items()}
        self.once = {name for name, stored in stores.items() if sum(stored) == 1}
        self.unread = set(self.kinds) - self.reads if self.lines else set()
        self.uses, self.lines = {}, []
        self.loops: list[str] = []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.ended = False

    def _declared_inline(self, name: str) -> bool:
        """Say whether a variable is assigned first, in a block around all its uses."""
        first, stored = self.uses[name][0]
        inside = all(path[: len(first)] == first for path, _ in self.uses[name])
        return stored and inside and name not in self.parameters

    @property
    def reads(self) -> set[str]:
        """Variables that are read."""
        return {
            name
            for name, uses in self.uses.items()
            if not all(use.stored for use in uses)
        }

    @property
    def state(self) -> object:
        """What is known of the variables; it stays at the fixed point."""
        return dict(self.kinds), self.result, self.uses

    @property
    def taken(self) -> list[bool]:
        """Whether each parameter is one in C: those that are read."""
        return [name in self.reads for name in self.parameters]

    def text(self, name: str) -> str:
        """Return the definition of the function of that name in C."""
        reads = self.reads
        names = [name for name in self.parameters if name in reads]
        taken = ", ".join(f"{self.kinds[n]} {c_name(n)}" for n in names) or "void"
        top = [
            f"    {self.kinds[name]} {c_name(name)} = "
            f"{'0' if self.kinds[name] in NUMBERS else '{0}'};"
            for name in reads - self.inline - set(self.parameters)
        ]
        head = wrapped(f"static {self.result} {name}({taken})", 0)
        return "\n".join([head, "{", *sorted(top), *self.lines, "}"])

    def emit(self, line: str, reads: str | None = None) -> None:
        """Add a line; the variables in it, or in ``reads``, are read."""
        names = {c_name(name): name for name in self.kinds if name not in self.loops}
        for word in c_words(line if reads is None else reads) & set(names):
            self.uses.setdefault(names[word], []).append(Use(self.path, False))
        self.lines.append(wrapped(line, len(self.path) + 1))

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Open a block and indent what is emitted meanwhile; it is not closed."""
        self.emit(f"{head} {{")
        self.blocks += 1
        self.path += (self.blocks,)
        yield
        self.path = self.path[:-1]
        self.ended = False

    def new(self, name: str) -> str:
        """Return the name of a temporary."""
        self.temporaries += 1
        return f"{name}_{self.temporaries}"

    def temporary(self, value: Value, name: str = "") -> Value:
        """Return a value that is evaluated once, here."""
        start = re.match(r"[A-Za-z]\w*(?=\()", value.text)
        name = self.new(name or (start[0] if start else "one"))
        self.emit(f"const {value.kind} {name} = {value.text};")
        return Value(value.kind, name)

    def store(self, name: str, text: str) -> None:
        """Assign to a variable; declare it where that can be here."""
        declared = ""
        if name in self.inline and name not in self.uses:
            const = "const " if name in self.once else ""
            declared = f"{const}{self.kinds[name]} "
        self.emit(f"{declared}{c_name(name)} = {text};", text)
        self.uses.setdefault(name, []).append(Use(self.path, True))
