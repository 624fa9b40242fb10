"""Body of a C function: its lines, and the declarations of its variables."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from qpavoid.export.values import NUMBERS, Value, c_name, c_words, wrapped


class FunctionBody:
    """Lines and variables of one function, written repeatedly until a fixed point.

    The previous pass gives the kind of each variable, its place of declaration, and
    which variables are never read.

    Attributes:
        kinds: Of the variables.
        result: Kind of the result.
        uses: Of each variable, in order: numbers of the enclosing blocks, and whether
            it is assigned there.
        ended: Whether the present block returns, breaks or continues.
        pointers: Parameters that are pointers to their values.
    """

    def __init__(self, parameters: Mapping[str, str]) -> None:
        self.kinds, self.parameters = dict(parameters), tuple(parameters)
        self.result = "void"
        self.uses: dict[str, list[tuple[tuple[int, ...], bool]]] = {}
        self.reads: set[str] = set()
        self.lines: list[str] = []
        self.pointers: set[str] = set()

    def begin(self) -> None:
        """Begin the next pass: discard all but the knowledge of the variables."""
        self.inline = {name for name in self.uses if self._declared_inline(name)}
        self.once = {n for n, uses in self.uses.items() if sum(s for _, s in uses) == 1}
        self.unread = set(self.kinds) - self.reads if self.lines else set()
        self.uses, self.reads, self.lines = {}, set(), []
        self.path: tuple[int, ...] = ()
        self.blocks = self.temporaries = 0
        self.ended = False

    def _declared_inline(self, name: str) -> bool:
        """Return whether a variable is first assigned in a block with all its uses."""
        first, assigned = self.uses[name][0]
        inside = all(path[: len(first)] == first for path, _ in self.uses[name])
        return assigned and inside and name not in self.parameters

    @property
    def state(self) -> object:
        """Knowledge of the variables, constant at the fixed point."""
        return dict(self.kinds), self.result, self.uses

    def text(self, name: str, inline: bool) -> str:
        """Return the definition, without parameters and variables never read."""
        kinds, given = self.kinds, self.parameters
        taken = [self.parameter(n) for n in given if n in self.reads]
        kind = f"static {'inline ' * inline}{self.result}"
        head = f"{kind} {name}({', '.join(taken) or 'void'})"
        top = [
            f"    {declaration(kinds[n], n)} = {'0' if kinds[n] in NUMBERS else '{0}'};"
            for n in self.reads - self.inline - set(given)
        ]
        lines = "\n".join(self.lines)
        for n in self.pointers:
            lines = re.sub(rf"(?<![.\w>])(&?)({c_name(n)})\b(\.?)", pointed, lines)
        return "\n".join([wrapped(head, 0), "{", *sorted(top), lines, "}"])

    def parameter(self, name: str) -> str:
        """Return the declaration of a parameter."""
        kind = self.kinds[name]
        if name in self.pointers:
            kind = f"const {kind} *restrict"
        return declaration(kind, name)

    def emit(self, line: str, reads: str | None = None) -> None:
        """Add a line; the variables in it, or in ``reads``, count as read."""
        words = c_words(line if reads is None else reads)
        for name in self.kinds:
            if c_name(name) in words:
                self.reads.add(name)
                self.uses.setdefault(name, []).append((self.path, False))
        self.lines.append(wrapped(line, len(self.path) + 1))

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Open a block around the lines emitted meanwhile; it is not closed."""
        self.emit(f"{head} {{")
        self.blocks += 1
        self.path += (self.blocks,)
        yield
        self.path, self.ended = self.path[:-1], False

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
        """Assign to a variable; declare it here if possible."""
        target = c_name(name)
        if name in self.inline and name not in self.uses:
            target = declaration(self.kinds[name], name)
            if name in self.once and "*" not in target:
                target = f"const {target}"
        self.emit(f"{target} = {text};", text)
        self.uses.setdefault(name, []).append((self.path, True))


def declaration(kind: str, name: str) -> str:
    """Return the declaration of a variable in C."""
    return f"{kind}{'' if kind.endswith('*') else ' '}{c_name(name)}"


def address(kind: str, text: str) -> str:
    """Return a pointer to a value; a variable or not."""
    if re.fullmatch(r"[\w.]+", text):
        return f"&{text}"
    return f"(const {kind}[]){{{text}}}"


def pointed(found: re.Match[str]) -> str:
    """Return the use of a parameter as the use of a pointer to it."""
    before, name, member = found.groups()
    if member:
        return f"{before}{name}->"
    return name if before else f"(*{name})"
