"""The lines of a function in C, and its variables: where they are declared."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from qpavoid.export.values import NUMBERS, Value, c_name, c_words, wrapped


class Body:
    """Lines and variables of one function.

    A function is written again and again until the kinds of its variables stay as they
    are: the last time says what each is, where it is declared, and what is never read.

    Attributes:
        name: In C.
        result: Kind of what it returns.
        kinds: Of the variables.
        parameters: Those of them that are given.
        unread: Those that need not be kept.
        loops: Those that a loop around the present line counts with.
        times: How often it has been begun to be written.
        ended: Whether the present block goes no further.
    """

    def __init__(self, name: str) -> None:
        self.name, self.result = name, "void"
        self.kinds: dict[str, str] = {}
        self.parameters: list[str] = []
        self.reads: set[str] = set()
        self.stores: dict[str, int] = {}
        self.places: dict[str, list[tuple[tuple[int, ...], bool]]] = {}
        self.times = -1
        self.begin()

    def begin(self) -> None:
        """Forget all but what was found out about the variables."""
        self.times += 1
        self.inline = {name for name in self.places if self._declared(name)}
        self.unread = set(self.kinds) - self.reads if self.times > 1 else set()
        self.once = {name for name, times in self.stores.items() if times == 1}
        self.reads, self.stores, self.places = set(), {}, {}
        self.lines: list[str] = []
        self.loops: list[str] = []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.ended = False

    def _declared(self, name: str) -> bool:
        """Say whether a variable's first assignment stands in a block with all uses."""
        first, assigned = self.places[name][0]
        return assigned and all(p[: len(first)] == first for p, _ in self.places[name])

    @property
    def state(self) -> object:
        """What stays when nothing is left to be found out."""
        return dict(self.kinds), self.result, dict(self.places)

    @property
    def taken(self) -> list[bool]:
        """Which parameters it takes in C: those that it reads."""
        return [name in self.reads for name in self.parameters]

    @property
    def text(self) -> str:
        """The whole function in C."""
        names = [name for name in self.parameters if name in self.reads]
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
        for word in c_words(text) & set(names):
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

    def new(self, name: str) -> str:
        """Return a name for what is needed here only."""
        self.temporaries += 1
        return f"{name}_{self.temporaries}"

    def temporary(self, value: Value, name: str = "") -> Value:
        """Return the value as a variable of its own."""
        start = re.match(r"[A-Za-z]\w*(?=\()", value.text)
        name = self.new(name or (start[0] if start else "one"))
        self.emit(f"const {value.kind} {name} = {value.text};")
        return Value(value.kind, name)

    def store(self, name: str, kind: str, text: str) -> None:
        """Assign to a variable that is read; declare it where that can be here."""
        self.stores[name] = self.stores.get(name, 0) + 1
        declared = ""
        if name in self.inline and self.stores[name] == 1:
            declared = f"{'const ' if name in self.once else ''}{kind} "
        self.emit(f"{declared}{c_name(name)} = {text};", text)
        stores = self.places.setdefault(name, [])
        stores.append((self.path, name not in self.parameters))
