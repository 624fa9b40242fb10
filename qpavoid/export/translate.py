"""From a compiled function to C: everything that it calls, in order."""

import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

from qpavoid.export.statements import Function
from qpavoid.export.values import (
    ARRAY,
    PRELUDE,
    Pack,
    Scalar,
    Value,
    c_number,
    c_type,
)


class Translation:
    """Functions translated so far, each before those that call it."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.constants: dict[str, float] = {}
        self.packs: dict[str, Pack] = {}

    def call(self, function: Any, arguments: Sequence[Value]) -> Value:
        """Return the call of a compiled function, translated where that is new."""
        plain: Callable[..., Any] = function.py_func
        kinds = tuple(a.kind if a.kind is not None else a.text for a in arguments)
        key = (plain, *(Scalar if isinstance(k, Scalar) else k for k in kinds))
        if key not in self.functions:
            made = Function(self, plain, arguments)
            same = [f for f in self.functions.values() if f.name == made.name]
            made.name += str(len(same) + 1) if same else ""
            self.functions[key] = made
        made = self.functions[key]
        given = dict(zip(made.parameters, arguments, strict=True))
        texts = ", ".join(given[name].text for name in made.taken)
        kind = made.result if made.result is not None else Pack(())
        return Value(kind, f"{made.name}({texts})")

    def define(self, name: str, number: float, module: str) -> str:
        """Return the name of a module's constant; another's of that name gets both."""
        if self.constants.setdefault(name, number) != number:
            name = f"{module.rpartition('.')[2].upper()}_{name}"
            self.constants[name] = number
        return name

    def pack(self, kind: Pack) -> str:
        """Return the struct's name of a tuple."""
        self.packs[c_type(kind)] = kind
        return c_type(kind)

    def packed(self, parts: Sequence[Value]) -> Value:
        """Return a tuple of values; one of what exists only here does so too."""
        kinds = tuple(part.kind for part in parts if part.kind is not None)
        if len(kinds) < len(parts):
            return Value(None, "", parts=tuple(parts))
        text = ", ".join(part.text for part in parts)
        name = self.pack(Pack(kinds))
        return Value(Pack(kinds), f"({name}){{{text}}}", parts=tuple(parts))

    @property
    def text(self) -> str:
        """All functions, and above them what they use."""
        body = "\n\n".join(map(commented, self.functions.values()))
        code = "\n".join(made.text for made in self.functions.values())
        used = set(re.findall(r"\w+", code))
        for name in reversed(PRELUDE):
            if name in used:
                used |= set(re.findall(r"\w+", PRELUDE[name]))
        helpers = [text for name, text in PRELUDE.items() if name in used]
        structs = [struct(kind) for name, kind in self.packs.items() if name in used]
        defines = [
            f"#define {name} {c_number(number)}"
            for name, number in self.constants.items()
            if name in used
        ]
        parts = ["\n".join(defines), ARRAY, *structs, *helpers, body]
        return "\n\n".join(parts)


def struct(kind: Pack) -> str:
    """Return the C struct of a tuple."""
    parts = " ".join(f"{c_type(part)} _{i};" for i, part in enumerate(kind.parts))
    return f"typedef struct {{ {parts} }} {c_type(kind)};"


def commented(made: Function) -> str:
    """Return a function below where it comes from and what its docstring says."""
    place = made.function.__module__
    summary = textwrap.fill(f"/* {place}: {made.summary} */", 88, subsequent_indent=" * ")
    return f"{summary}\n{made.text}"
