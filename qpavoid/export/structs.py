"""The C types of tuples and named tuples."""

from collections.abc import Sequence
from itertools import chain, count
from typing import NamedTuple

from qpavoid.export.arithmetic import as_double
from qpavoid.export.values import (
    ANNOTATED,
    MEMBERS,
    NUMBERS,
    RESERVED,
    Unsupported,
    Value,
    c_name,
    commented,
)


class Struct(NamedTuple):
    """The C type of a tuple.

    Attributes:
        of: Class of a named tuple; ``tuple`` for any other.
        fields: Names of all its parts.
        parts: Kinds of these, and the members' names; what exists at translation alone
            is itself, and no member.
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


class Structs(dict[str, Struct]):
    """The structs of a translation by name.

    Attributes:
        names: All identifiers of file scope that are in use.
    """

    def __init__(self) -> None:
        super().__init__()
        self.names = set(RESERVED)

    def free(self, name: str) -> str:
        """Return a new identifier, numbered where the name is in use."""
        numbered = (f"{name}{i}" for i in count(2))
        new = next(n for n in chain([name], numbered) if n not in self.names)
        self.names.add(new)
        return new

    def packed(
        self, parts: Sequence[Value], of: type = tuple, named: bool = False
    ) -> Value:
        """Return a tuple as a compound literal, with designators if ``named``.

        Parts that exist at translation alone are no members; a tuple of nothing but
        such exists at translation alone itself.
        """
        fields = getattr(of, "_fields", tuple(f"_{i}" for i in range(len(parts))))
        hints = getattr(of, "__annotations__", {})
        kinds = [ANNOTATED.get(hints.get(field)) for field in fields]
        parts = tuple(
            self.cast(part, kind) if part.kind and kind else part
            for part, kind in zip(parts, kinds, strict=True)
        )
        if not any(part.kind for part in parts):
            text = f"{of.__name__}({', '.join(part.identity for part in parts)})"
            known = parts if of is tuple else of(*parts)
            return Value("", text, known=known, parts=parts)
        name = self.struct(of, fields, parts)
        texts = ", ".join(
            f".{member.text} = {part.text}" if named else part.text
            for member, part in zip(self[name].parts, parts, strict=True)
            if part.kind
        )
        return Value(name, f"({name}){{{texts}}}", parts=parts)

    def struct(self, of: type, fields: Sequence[str], parts: Sequence[Value]) -> str:
        """Return the name of the struct with such members, defined if it is new."""
        members = tuple(
            Value(part.kind, c_name(field, MEMBERS)) if part.kind else part
            for field, part in zip(fields, parts, strict=True)
        )
        identities = [part.identity for part in members]
        for name, struct in self.items():
            if (struct.of, [part.identity for part in struct.parts]) == (of, identities):
                return name
        kinds = [part.kind for part in members if part.kind]
        letters = "".join(f"{k}_" if k in self else k[0] for k in kinds)
        tuple_name = f"tuple_{letters.replace('tuple', 't')}"
        name = self.free(tuple_name if of is tuple else of.__name__.lstrip("_"))
        self[name] = Struct(of, tuple(fields), members)
        return name

    def part(self, value: Value, place: int) -> Value:
        """Return one part of a tuple."""
        if value.parts:
            return value.parts[place]
        if value.kind not in self:
            raise Unsupported("only a tuple has parts")
        part = self[value.kind].parts[place]
        return Value(part.kind, f"{value.text}.{part.text}") if part.kind else part

    def fields(self, value: Value) -> tuple[str, ...]:
        """Return the names of the parts; none of what is no tuple."""
        if value.kind in self:
            return self[value.kind].fields
        return tuple(getattr(value.known, "_fields", ()))

    def common(self, one: Value, other: Value) -> str:
        """Return the kind that both of two values convert to.

        Raises:
            Unsupported: There is none.
        """
        first, second = self.get(one.kind), self.get(other.kind)
        if one.identity == other.identity:
            return one.kind
        if {one.kind, other.kind} == {"int", "double"}:
            return "double"
        if first and second and first.of is second.of is tuple:
            if len(first.parts) == len(second.parts):
                pairs = zip(first.parts, second.parts, strict=True)
                kinds = [Value(self.common(*pair), pair[0].text) for pair in pairs]
                return self.struct(tuple, first.fields, kinds)
        names = [value.kind or value.text for value in (one, other)]
        raise Unsupported(f"two kinds of value, {names[0]} and {names[1]}")

    def cast(self, value: Value, kind: str) -> Value:
        """Return a value converted to a kind that holds it."""
        if value.kind == kind or "bool" in (value.kind, kind):
            return value
        if kind in NUMBERS and value.kind in NUMBERS:
            return as_double(value) if kind == "double" else value
        parts = [self.part(value, i) for i in range(len(self[kind].parts))]
        kinds = [part.kind for part in self[kind].parts]
        pairs = zip(parts, kinds, strict=True)
        return self.packed([self.cast(*pair) if pair[1] else pair[0] for pair in pairs])
