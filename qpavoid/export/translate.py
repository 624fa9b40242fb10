"""From a compiled function to C: everything that it calls, in order."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from qpavoid.export.arithmetic import as_double, widened
from qpavoid.export.statements import Function
from qpavoid.export.values import (
    ANNOTATED,
    MEMBERS,
    NUMBERS,
    PRELUDE,
    RESERVED,
    Refusal,
    Value,
    c_name,
    c_number,
    c_words,
    commented,
)


class Struct(NamedTuple):
    """The C type of a tuple.

    Attributes:
        of: Class of a record; ``tuple`` for one without names.
        fields: Names of all its parts.
        parts: Kinds of these, and where they stand in C; what exists at translation
            alone is itself, and no member.
    """

    of: type
    fields: tuple[str, ...]
    parts: tuple[Value, ...]

    def text(self, name: str) -> str:
        """Return the definition."""
        members = [f"{part.kind} {part.text};" for part in self.parts if part.kind]
        if self.of is tuple:
            return f"typedef struct {{ {' '.join(members)} }} {name};"
        body = "\n    ".join(["typedef struct {", *members])
        said = self.of.__doc__ or ""
        said = "" if said.startswith(f"{self.of.__name__}(") else said
        return commented(self.of.__module__, said, f"{body}\n}} {name};")


class Translation:
    """Functions translated so far, each before those that call it."""

    def __init__(self) -> None:
        self.functions: dict[tuple[Any, ...], Function] = {}
        self.constants: dict[str, float] = {}
        self.structs: dict[str, Struct] = {}
        self.wanted: set[str] = set()

    def call(self, function: Any, arguments: Sequence[Value]) -> Value:
        """Return the call, from outside, of a compiled function."""
        value = self.called(function.py_func, arguments)
        self.wanted.add(value.text.partition("(")[0])
        return value

    def called(self, plain: Callable[..., Any], arguments: Sequence[Value]) -> Value:
        """Return the call of a function, translated where that is new."""
        names = ("" if a.kind in NUMBERS else a.identity for a in arguments)
        key = (plain, *names)
        if key not in self.functions:
            made = Function(self, plain, arguments)
            made.name = self.free(made.name)
            self.functions[key] = made
        made = self.functions[key]
        given = [argument.text for argument in arguments if argument.kind]
        texts = [t for t, kept in zip(given, made.taken, strict=True) if kept]
        return Value(made.result, f"{made.name}({', '.join(texts)})")

    def free(self, name: str) -> str:
        """Return a name for a function or a type, numbered where it is taken."""
        taken = {made.name for made in self.functions.values()}
        taken |= {*self.structs, *self.constants, *RESERVED}
        numbered = (f"{name}{i}" for i in range(2, len(taken) + 3))
        return next(one for one in (name, *numbered) if one not in taken)

    def define(self, name: str, number: float, module: str) -> str:
        """Return the name of a module's constant; longer where that is taken."""
        if self.constants.setdefault(name, number) != number:
            name = f"{module.rpartition('.')[2].upper()}_{name}"
            self.constants[name] = number
        return name

    def packed(
        self, parts: Sequence[Value], of: type = tuple, named: bool = False
    ) -> Value:
        """Return the tuple or record of some values, written with names if wanted.

        Parts that exist at translation alone are no members; a tuple of nothing but
        such exists at translation alone itself.
        """
        fields = getattr(of, "_fields", tuple(f"_{i}" for i in range(len(parts))))
        told = [ANNOTATED.get(told_name(of, field)) for field in fields]
        parts = tuple(
            self.cast(part, kind) if part.kind and kind else part
            for part, kind in zip(parts, told, strict=True)
        )
        if not any(part.kind for part in parts):
            text = f"{of.__name__}({', '.join(part.identity for part in parts)})"
            return Value("", text, known=parts if of is tuple else of(*parts))
        name = self.struct(of, fields, parts)
        members = self.structs[name].parts
        texts = ", ".join(
            f".{member.text} = {part.text}" if named else part.text
            for member, part in zip(members, parts, strict=True)
            if part.kind
        )
        return Value(name, f"({name}){{{texts}}}", parts=parts)

    def struct(self, of: type, fields: Sequence[str], parts: Sequence[Value]) -> str:
        """Return the C type of a tuple of such parts."""
        held = tuple(
            Value(part.kind, c_name(field, MEMBERS)) if part.kind else part
            for field, part in zip(fields, parts, strict=True)
        )
        for name, known in self.structs.items():
            same = known.of is of and len(known.parts) == len(held)
            pairs = zip(known.parts, held, strict=False)
            if same and all(one.identity == other.identity for one, other in pairs):
                return name
        kinds = [part.kind for part in held if part.kind]
        letters = "".join(f"{k}_" if k in self.structs else k[0] for k in kinds)
        letters = letters.replace("tuple", "t")
        plain = f"tuple_{letters}" if of is tuple else of.__name__.lstrip("_")
        name = self.free(plain)
        self.structs[name] = Struct(of, tuple(fields), held)
        return name

    def part(self, value: Value, place: int) -> Value:
        """Return one part of a tuple or record."""
        if value.parts:
            return value.parts[place]
        part = self.structs[value.kind].parts[place]
        return Value(part.kind, f"{value.text}.{part.text}") if part.kind else part

    def common(self, one: Value, other: Value) -> str:
        """Return the kind that holds both of two values.

        Raises:
            Refusal: There is none.
        """
        first, second = (self.structs.get(v.kind) for v in (one, other))
        if one.identity == other.identity:
            return one.kind
        if first and second and first.of is second.of is tuple:
            if len(first.parts) == len(second.parts):
                pairs = zip(first.parts, second.parts, strict=True)
                kinds = [Value(self.common(*pair), pair[0].text) for pair in pairs]
                return self.struct(tuple, first.fields, kinds)
        kind = widened(one.kind, other.kind)
        if not kind:
            names = [value.kind or value.text for value in (one, other)]
            raise Refusal(f"two kinds of value, {names[0]} and {names[1]}")
        return kind

    def cast(self, value: Value, kind: str) -> Value:
        """Return a value as one of a kind that holds it."""
        if value.kind == kind or value.kind == "bool" or kind == "bool":
            return value
        if kind in NUMBERS and value.kind in NUMBERS:
            return as_double(value) if kind == "double" else value
        parts = [self.part(value, i) for i in range(len(self.structs[kind].parts))]
        kinds = [part.kind for part in self.structs[kind].parts]
        pairs = zip(parts, kinds, strict=True)
        return self.packed([self.cast(*pair) if pair[1] else pair[0] for pair in pairs])

    @property
    def text(self) -> str:
        """All functions, below the constants, types and helpers that they use."""
        used, functions = set(self.wanted), []
        for made in reversed(self.functions.values()):
            if made.name in used:
                functions.append(made)
                used |= c_words(made.text)
        structs = {name: struct.text(name) for name, struct in self.structs.items()}
        types = PRELUDE | structs
        for name, text in reversed(types.items()):
            used |= c_words(text) if name in used else set()
        defines = [
            f"#define {name} {c_number(number)}"
            for name, number in self.constants.items()
            if name in used
        ]
        texts = [text for name, text in types.items() if name in used]
        texts += [
            commented(made.plain.__module__, made.plain.__doc__, made.text)
            for made in reversed(functions)
        ]
        return "\n\n".join(["\n".join(defines), *texts])


def told_name(of: type, field: str) -> str:
    """Return the name of the type that a record's field is said to have."""
    told = getattr(of, "__annotations__", {}).get(field)
    return getattr(told, "__name__", str(told))
