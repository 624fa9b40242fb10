"""From a compiled function to C: everything that it calls, in order."""

import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any

from qpavoid.export.statements import Function
from qpavoid.export.values import NUMBERS, PRELUDE, Value, c_number, leaves


class Translation:
    """Functions translated so far, each before those that call it."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.constants: dict[str, float] = {}
        self.packs: dict[str, tuple[str, ...]] = {}

    def call(self, function: Any, arguments: Sequence[Value]) -> Value:
        """Return the call of a compiled function, translated where that is new."""
        plain: Callable[..., Any] = function.py_func
        flat = [leaf for argument in arguments for leaf in leaves(argument)]
        key = (plain, *("" if a.kind in NUMBERS else a.kind or a.text for a in flat))
        if key not in self.functions:
            made = Function(self, plain, arguments)
            same = [f for f in self.functions.values() if f.name == made.name]
            made.name += str(len(same) + 1) if same else ""
            self.functions[key] = made
        made = self.functions[key]
        given = [part.text for part in flat if part.kind]
        texts = [t for t, kept in zip(given, made.taken, strict=True) if kept]
        value = Value(made.result, f"{made.name}({', '.join(texts)})")
        return value._replace(known=made.returned) if made.returned else value

    def define(self, name: str, number: float, module: str) -> str:
        """Return the name of a module's constant; longer where that is taken."""
        if self.constants.setdefault(name, number) != number:
            name = f"{module.rpartition('.')[2].upper()}_{name}"
            self.constants[name] = number
        return name

    def packed(self, parts: Sequence[Value]) -> Value:
        """Return the tuple of some values; one of what exists only here does so too."""
        kinds = tuple(part.kind for part in parts)
        if not all(kinds):
            return Value("", "", parts=tuple(parts))
        letters = (k.replace("tuple", "t") + "_" if "_" in k else k[0] for k in kinds)
        name = f"tuple_{''.join(letters)}"
        self.packs[name] = kinds
        text = f"({name}){{{', '.join(part.text for part in parts)}}}"
        return Value(name, text, parts=tuple(parts))

    @property
    def text(self) -> str:
        """All functions, below the constants, types and helpers that they use."""
        functions = self.functions.values()
        used = set(re.findall(r"\w+", "\n".join(made.text for made in functions)))
        structs = {
            name: f"typedef struct {{ "
            f"{' '.join(f'{kind} _{i};' for i, kind in enumerate(kinds))} }} {name};"
            for name, kinds in self.packs.items()
        }
        for name, text in reversed([*PRELUDE.items(), *structs.items()]):
            used |= set(re.findall(r"\w+", text)) if name in used else set()
        defines = [
            f"#define {name} {c_number(number)}"
            for name, number in self.constants.items()
            if name in used
        ]
        types = [text for n, text in {**PRELUDE, **structs}.items() if n in used]
        return "\n\n".join(["\n".join(defines), *types, *map(commented, functions)])


def commented(made: Function) -> str:
    """Return a function below where it comes from and what its docstring says."""
    said = (made.function.__doc__ or "").partition("\n\n")[0]
    summary = f"/* {made.function.__module__}: {' '.join(said.split())} */"
    return f"{textwrap.fill(summary, 88, subsequent_indent=' * ')}\n{made.text}"
