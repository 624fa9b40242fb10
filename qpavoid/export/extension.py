"""Python extension module of the entries: table-driven glue, no formulas."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from string import Template
from typing import Any

from qpavoid.compiled import ENTRIES
from qpavoid.export.build import compile_extension
from qpavoid.export.entries import PREFIX, SIZES, Entry, Shape, Unit, unit_of
from qpavoid.export.values import NUMBERS, TEMPLATES
from qpavoid.stamps import source_stamp

MEMBERS = {"double": "number", "int": "whole", "bool": "whole"}
"""Member of a slot of the glue that holds a number."""

POSIX = "#define _POSIX_C_SOURCE 200809L"
"""Macro for the clock."""

MOST_SLOTS, MOST_VIEWS, MOST_NUMBERS = 128, 24, 128
"""Limits of the glue: leaves and arrays of the arguments, numbers of a result."""


def extension_text(
    functions: dict[str, Callable[..., Any]], stamps: Mapping[str, str]
) -> str:
    """Return the C source of an extension module.

    Args:
        functions: Entries by name.
        stamps: Of the sources of their modules.

    Raises:
        TranslationError: A compiled function cannot be written as C.
    """
    unit = unit_of(functions)
    classes = list(dict.fromkeys(c for one in unit.entries for c in named(one.result)))
    template = Template((TEMPLATES / "extension.c").read_text(encoding="utf-8"))
    told = "".join(f"{module} {stamp}\\n" for module, stamp in sorted(stamps.items()))
    glue = template.substitute(
        classes=", ".join(
            f'{{"{c.__module__}", "{c.__qualname__}"}}' for c in classes or [tuple]
        ),
        calls="\n\n".join(map(trampoline, unit.entries)),
        entries=",\n".join(row(unit, one, classes) for one in unit.entries),
        stamps=f'"{told}"',
        slots=MOST_SLOTS,
        views=MOST_VIEWS,
        numbers=MOST_NUMBERS,
    )
    return f"{POSIX}\n{unit.text}{glue}"


def named(shape: Shape) -> list[type]:
    """Return the classes of the named tuples of a result."""
    inner = [of for part in shape.parts for of in named(part)]
    return [shape.of, *inner] if shape.fields else inner


def trampoline(one: Entry) -> str:
    """Return the C function that passes the slots of a call on."""
    given, i = [], 0
    for leaf in one.leaves:
        if leaf.kind in NUMBERS:
            given.append(f"s[{i}].{MEMBERS[leaf.kind]}")
        else:
            sizes = ("rows", "columns")[: SIZES.get(leaf.kind, 0)]
            given += [f"s[{i}].at", *(f"s[{i}].{size}" for size in sizes)]
        i += 1
    assert i <= MOST_SLOTS and len(list(one.result.leaves)) <= MOST_NUMBERS
    if not one.result.kind:
        given.append("r")
    call = f"{PREFIX}{one.name}({', '.join(given)});"
    if one.result.kind in NUMBERS:
        call = f"r[0] = {call}"
    head = f"static void call_{one.name}(const slot *s, double *r)"
    return f"{head}\n{{\n    (void)s, (void)r;\n    {call}\n}}"


def program(shape: Shape, classes: list[type] | None = None) -> str:
    """Return the leaves of an argument, or with classes of a result, as characters."""
    if shape.kind in NUMBERS:
        return shape.kind[0]
    if shape.kind == "void":
        return "n"
    if shape.kind:
        least, record = ",".join(map(str, shape.least)), shape.record
        letter = "r" if record else shape.kind[0]
        size = record.dtype.itemsize if record else least
        return f"{letter.upper() if shape.written else letter}{size}"
    inner = "".join(program(part, classes) for part in shape.parts)
    if classes and shape.fields:
        return f"<{classes.index(shape.of):02}{inner}>"
    return f"({inner})"


def row(unit: Unit, one: Entry, classes: list[type]) -> str:
    """Return the row of an entry in the glue's table."""
    takes = "".join(map(program, one.arguments))
    gives = program(one.result, classes)
    assert sum(letter in "vmrVMR" for letter in takes) <= MOST_VIEWS
    about = json.dumps(one.summary, ensure_ascii=False)
    told = [f'"{one.name}", "{takes}", "{gives}", {about}, {len(one.arguments)}']
    told.append(f"call_{one.name}")
    checks = [other for other in unit.entries if other.name == one.asks]
    assert len(checks) == bool(one.asks)
    told += [] if checks else ["NULL", "0"]
    for check in checks:
        asked = [(leaf.kind, leaf.least) for leaf in check.leaves]
        assert asked == [(leaf.kind, leaf.least) for leaf in one.leaves[: len(asked)]]
        told += [f"call_{check.name}", str(len(asked))]
    return f"    {{{', '.join(told)}}}"


def build_extension(file: Path) -> str:
    """Build the extension of the entries of all loaded modules; return the compiler.

    Raises:
        TranslationError: A compiled function cannot be written as C.
        CompileError: There is no compiler, or it failed.
    """
    plain = [one.py_func for one in ENTRIES.values()]  # type: ignore[attr-defined]
    files = {one.__module__: Path(one.__code__.co_filename) for one in plain}
    stamps = {module: source_stamp(path) for module, path in files.items()}
    source = file.with_name("qpavoid.c")
    source.write_text(extension_text(ENTRIES, stamps), encoding="utf-8")
    return compile_extension(source, file)
