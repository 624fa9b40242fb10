"""C types of tuples and named tuples."""

from collections.abc import Sequence
from itertools import chain, count
from typing import Any, NamedTuple

import numpy as np

from qpavoid.export.values import (
    ARRAYS,
    ATOM,
    KINDS,
    MEMBERS,
    RESERVED,
    UNARY,
    Value,
    c_name,
    commented,
    require,
)
from qpavoid.types import Record


class Struct(NamedTuple):
    """C type of a tuple.

    Attributes:
        of: Class of a named tuple; ``tuple`` for any other.
        parts: Kinds and names of the members; parts that exist only at translation are
            stored themselves and are no members.
    """

    of: type
    parts: tuple[Value, ...]

    @property
    def identity(self) -> list[object]:
        """Key that is equal for tuples of one C type."""
        return [self.of, *(part.identity for part in self.parts)]

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
    """Structs of a translation by name.

    Attributes:
        names: All identifiers of file scope in use.
        records: Types of arrays of one record that are known only at run time.
        tables: Structs of the rows of tables, by the type of the table.
    """

    def __init__(self) -> None:
        super().__init__()
        self.names, self.records = set(RESERVED), dict[str, Record]()
        self.tables = dict[str, str]()

    def table(self, of: type) -> str:
        """Return the type of a table whose rows are named tuples of numbers."""
        hints = of.__annotations__.values()
        struct = self.struct(of, [Value(KINDS[hint], "") for hint in hints])
        kind = f"{struct}_table"
        self.names.add(kind)
        self.tables[kind] = struct
        return kind

    def record(self, record: Record, text: str) -> Value:
        """Return the value of a pointer to a record."""
        known = self.records.setdefault(record.name, record)
        require(known == record, f"two records of the name {record.name}")
        self.names.add(record.name)
        return Value(record.name, text)

    def field(self, owner: Value, name: str) -> Value | None:
        """Return a field of a record; None if there is none."""
        record = self.records.get(owner.kind)
        if record is None or name not in (record.dtype.names or ()):
            return None
        text = f"{owner.at(ATOM)}->{c_name(name, MEMBERS)}"
        if record.dtype[name].kind == "f":
            return Value("double", text)
        return Value("int", f"(int){text}", UNARY)

    def pointed(self, value: Value) -> Value:
        """Return a row of a table that a pointer points to; any other value itself."""
        kind = value.kind.removesuffix(" *")
        if kind == value.kind:
            return value
        if value.text.startswith("&"):
            return Value(kind, value.text[1:])
        return Value(kind, f"(*{value.text})")

    def size(self, kind: str) -> int:
        """Return the greatest size of a value in bytes; 0 for a number."""
        if kind in self:
            return sum(max(self.size(part.kind), 8) for part in self[kind].parts)
        return 16 if kind in (*ARRAYS, *self.tables) else 0

    def texts(self) -> dict[str, str]:
        """Return all definitions by name."""
        records = {name: record_text(one) for name, one in self.records.items()}
        tables = {
            name: f"typedef struct {{ {of} *at; int rows; }} {name};"
            for name, of in self.tables.items()
        }
        structs = {name: one.text(name) for name, one in self.items()}
        rows = {name: structs.pop(name) for name in self.tables.values()}
        return records | rows | tables | structs

    def free(self, name: str) -> str:
        """Return a new identifier, numbered if the name is in use."""
        numbered = (f"{name}{i}" for i in count(2))
        new = next(n for n in chain([name], numbered) if n not in self.names)
        self.names.add(new)
        return new

    def packed(self, parts: Sequence[Value], of: type = tuple) -> Value:
        """Return a tuple as a compound literal.

        Parts that exist only at translation are no members.
        """
        name, texts = self.struct(of, parts), ", ".join(p.text for p in parts if p.kind)
        return Value(name, f"({name}){{{texts}}}", parts=tuple(parts))

    def struct(self, of: type, parts: Sequence[Value]) -> str:
        """Return the name of the struct with such members; define it if it is new."""
        members = tuple(
            Value(part.kind, c_name(field, MEMBERS)) if part.kind else part
            for field, part in zip(field_names(of, len(parts)), parts, strict=True)
        )
        new = Struct(of, members)
        for name, struct in self.items():
            if struct.identity == new.identity:
                return name
        kinds = [part.kind for part in members if part.kind]
        letters = "".join(f"{k}_" if k in self else k[0] for k in kinds)
        tuple_name = f"tuple_{letters.replace('tuple', 't')}"
        name = self.free(tuple_name if of is tuple else of.__name__.lstrip("_"))
        self[name] = new
        return name

    def parts(self, value: Value) -> Sequence[Value]:
        """Return the parts of a tuple."""
        if value.parts:
            return value.parts
        require(value.kind in self, "only a tuple has parts")
        owner = f"{value.text}."
        if value.text.startswith("(*"):
            owner = f"{value.text[2:-1]}->"
        return [
            Value(part.kind, f"{owner}{part.text}") if part.kind else part
            for part in self[value.kind].parts
        ]

    def fields(self, value: Value) -> tuple[str, ...]:
        """Return the names of the parts; empty for other values."""
        if value.kind not in self:
            return ()
        return field_names(self[value.kind].of, len(self[value.kind].parts))

    def common(self, one: Value, other: Value) -> str:
        """Return the kind of two values.

        Raises:
            Unsupported: They differ.
        """
        same = one.identity == other.identity
        require(same, f"two kinds of value, {one.identity} and {other.identity}")
        return one.kind


def field_names(of: type, count: int) -> tuple[str, ...]:
    """Return the names of the parts of a tuple, numbered if it has none."""
    names: tuple[str, ...] = getattr(of, "_fields", ())
    return names or tuple(f"_{i}" for i in range(count))


MEMBER: dict[Any, str] = {np.dtype(np.float64): "double", np.dtype(np.int64): "int64_t"}
"""C types of the fields of records."""


def record_text(record: Record) -> str:
    """Return the definition of the pointer to a record, with numpy's layout."""
    fields = [(record.dtype[name], name) for name in record.dtype.names or ()]
    members = [f"{MEMBER[of]} {c_name(name, MEMBERS)};" for of, name in fields]
    const = "" if record.written else "const "
    body = "\n    ".join([f"typedef {const}struct {{", *members])
    return f"{body}\n}} *{record.name};"
