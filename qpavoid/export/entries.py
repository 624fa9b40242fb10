"""Entry points: compiled functions in C with all arguments at run time.

Each is a C function ``qpavoid_NAME``: a number for a number, a pointer for an array or
a record, followed by the sizes of the array; tuples are flattened. A result other than
a number is written to ``result``, one double per number.
"""

import inspect
from collections.abc import Callable, Iterator
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from qpavoid.export.structs import Structs
from qpavoid.export.translate import Translation
from qpavoid.export.values import (
    KINDS,
    NUMBERS,
    Unsupported,
    Value,
    c_name,
    require,
    wrapped,
)
from qpavoid.types import Buffer, Record, Sizes

HEADERS = """#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>"""

PREFIX = "qpavoid_"


class Shape(NamedTuple):
    """Structure of an argument or a result.

    Attributes:
        name: In C, of an argument.
        kind: C type of a number, ``vector``, ``matrix`` or a record's name; empty for a
            tuple.
        written: Whether an array is changed.
        of: Class of a tuple.
        parts: Of a tuple.
        least: Least sizes of an array.
        record: Memory layout of a record.
    """

    name: str
    kind: str
    written: bool = False
    of: type = tuple
    parts: "tuple[Shape, ...]" = ()
    least: tuple[int, ...] = ()
    record: Record | None = None

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the parts; empty if they have none."""
        return getattr(self.of, "_fields", ())

    @property
    def leaves(self) -> Iterator["Shape"]:
        """Numbers, arrays and records, in their order."""
        if self.kind:
            yield self
        for part in self.parts:
            yield from part.leaves

    @property
    def names(self) -> list[str]:
        """Names of the parameters of the C function."""
        sizes = ("rows", "columns")[: SIZES.get(self.kind, 0)]
        return [c_name(self.name), *(f"{self.name}_{size}" for size in sizes)]

    @property
    def parameters(self) -> list[str]:
        """Parameters of the C function."""
        first, *sizes = self.names
        if self.kind in NUMBERS:
            return [f"{self.kind} {first}"]
        const, of = "" if self.written else "const ", "double *" if sizes else "void *"
        return [f"{const}{of}{first}", *(f"int {size}" for size in sizes)]


SIZES = {"vector": 1, "matrix": 2}
"""Number of sizes of an array."""


class Entry(NamedTuple):
    """A function that is called from outside.

    Attributes:
        name: Of the Python function.
        summary: First line of its docstring.
        arguments: Their structures.
        result: Its structure; of kind ``void`` without a result.
        call: In C.
        asks: Name of the entry that checks the first arguments, or empty.
    """

    name: str
    summary: str
    arguments: tuple[Shape, ...]
    result: Shape
    call: Value
    asks: str

    @property
    def leaves(self) -> list[Shape]:
        """Numbers, arrays and records of the arguments."""
        return [leaf for one in self.arguments for leaf in one.leaves]

    @property
    def head(self) -> str:
        """Declaration in C."""
        given = [text for leaf in self.leaves for text in leaf.parameters]
        kind = self.result.kind or "void"
        if not self.result.kind:
            given.append("double *result")
        return f"{kind} {PREFIX}{self.name}({', '.join(given) or 'void'})"

    def text(self, structs: Structs) -> str:
        """Return the definition in C."""
        lines = [f"(void){name};" for leaf in self.leaves for name in leaf.names]
        kind, call = self.call.kind, self.call.text
        if self.result.kind:
            lines.append(f"{'' if kind == 'void' else 'return '}{call};")
        else:
            lines.append(f"const {kind} answer = {call};")
            texts = numbers_in(structs, Value(kind, "answer"))
            lines += [f"result[{i}] = {text};" for i, text in enumerate(texts)]
        body = [wrapped(line, 1) for line in lines]
        return "\n".join([wrapped(self.head, 0), "{", *body, "}"])


def numbers_in(structs: Structs, value: Value) -> Iterator[str]:
    """Yield the numbers of a tuple."""
    if value.kind in NUMBERS:
        yield value.text
        return
    for part in structs.parts(value):
        yield from numbers_in(structs, part)


def shape_of(hint: Any, name: str) -> Shape:
    """Return the structure of a parameter from its annotation.

    Raises:
        Unsupported: The annotation is not specific enough.
    """
    if hint in KINDS:
        return Shape(name, KINDS[hint])
    if get_origin(hint) is Annotated:
        (about,) = hint.__metadata__[:1]
        if isinstance(about, Buffer):
            kind = ("vector", "matrix")[about.dimensions - 1]
            known = [one for one in hint.__metadata__ if isinstance(one, Sizes)]
            least = tuple((known or [Sizes(0)])[-1])[: about.dimensions]
            return Shape(name, kind, about.written, least=least)
        if isinstance(about, Record):
            return Shape(name, about.name, about.written, record=about)
    if get_origin(hint) is tuple:
        names = tuple(f"{name}_{i}" for i in range(len(get_args(hint))))
        parts = tuple(map(shape_of, get_args(hint), names))
        return Shape(name, "", parts=parts)
    if isinstance(hint, type) and hasattr(hint, "_fields"):
        hints = get_type_hints(hint, include_extras=True)
        parts = tuple(shape_of(of, f"{name}_{field}") for field, of in hints.items())
        return Shape(name, "", of=hint, parts=parts)
    raise Unsupported(f"{name}: an entry takes numbers and arrays of known dimensions")


def as_value(shape: Shape, structs: Structs) -> Value:
    """Return a parameter as a value of the translation."""
    (name, *sizes), kind = shape.names, shape.kind
    if kind in NUMBERS:
        return Value(kind, name)
    if kind in SIZES:
        at = name if shape.written else f"(double *){name}"
        return Value(kind, f"({kind}){{{', '.join([at, *sizes])}}}")
    if shape.record:
        return structs.record(shape.record, f"({kind}){name}")
    return structs.packed([as_value(part, structs) for part in shape.parts], shape.of)


def result_shape(structs: Structs, kind: str) -> Shape:
    """Return the structure of a result."""
    if kind not in structs:
        require(
            kind in (*NUMBERS, "void"), "an entry returns numbers, or tuples of them"
        )
        return Shape("", kind)
    struct = structs[kind]
    parts = tuple(result_shape(structs, part.kind) for part in struct.parts)
    return Shape("", "", of=struct.of, parts=parts)


def as_entry(unit: Translation, function: Callable[..., Any]) -> Entry:
    """Translate a function with all its arguments at run time."""
    plain = function.py_func  # type: ignore[attr-defined]
    hints = get_type_hints(plain, include_extras=True)
    names = inspect.signature(plain).parameters
    arguments = tuple(shape_of(hints[name], name) for name in names)
    values = [as_value(one, unit.structs) for one in arguments]
    call = unit.call(function, values)
    summary = " ".join((plain.__doc__ or "").partition("\n\n")[0].split())
    result = result_shape(unit.structs, call.kind)
    given = (plain.__name__, summary, arguments, result, call)
    return Entry(*given, function.asks)  # type: ignore[attr-defined]


class Unit(NamedTuple):
    """A C file with its entries.

    Attributes:
        entries: In their order.
        structs: Types of tuples and records.
        text: The file.
    """

    entries: tuple[Entry, ...]
    structs: Structs
    text: str


def unit_of(functions: dict[str, Callable[..., Any]]) -> Unit:
    """Return the C file of some functions, each an entry.

    Raises:
        TranslationError: One of them cannot be written as C.
    """
    unit = Translation()
    entries = tuple(as_entry(unit, one) for _, one in sorted(functions.items()))
    texts = [one.text(unit.structs) for one in entries]
    text = "\n\n".join([HEADERS, unit.text, *texts]) + "\n"
    return Unit(entries, unit.structs, text)
