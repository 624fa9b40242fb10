"""WebAssembly module of the compiled functions, ready for npm, with types."""

import json
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from os import PathLike
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from qpavoid.export.build import compile_wasm
from qpavoid.export.entries import PREFIX, Shape, Unit, unit_of
from qpavoid.export.values import TEMPLATES
from qpavoid.types import Record

WASM_FILES = ("qpavoid.c", "qpavoid.wasm", "qpavoid.js", "qpavoid.d.ts", "package.json")

TYPES = {"double": "number", "int": "number", "bool": "boolean", "void": "void"}
"""Types of C in TypeScript."""


def export_wasm(
    folder: str | PathLike[str],
    functions: dict[str, Callable[..., Any]],
    say: Callable[[str], None] = lambda step: None,
) -> list[Path]:
    """Write some entries as C, WebAssembly, JavaScript and types; return the files.

    Args:
        folder: Target; created if missing.
        functions: By name, such as :data:`qpavoid.compiled.ENTRIES`, those of all
            loaded modules.
        say: Called with each step before it is done.

    Raises:
        TranslationError: A compiled function cannot be written as C.
        MissingExtraError: zig is not installed.
    """
    say("1 of 2: translating the package to C, some seconds")
    target, unit = Path(folder), unit_of(functions)
    target.mkdir(parents=True, exist_ok=True)
    source, module, script, types, package = (target / name for name in WASM_FILES)
    source.write_text(unit.text, encoding="utf-8")
    names = ["malloc", "free", *(PREFIX + one.name for one in unit.entries)]
    say("2 of 2: compiling it to WebAssembly, 1 to 3 minutes, once for these sources")
    compile_wasm(source, module, names)
    texts = {"table": json.dumps(table(unit)), "types": declared(unit)}
    records = sorted(unit.structs.records)
    texts["records"] = "".join(f"  {name}: {name};\n" for name in records)
    for path in (script, types):
        template = Template((TEMPLATES / path.name).read_text(encoding="utf-8"))
        path.write_text(template.substitute(texts), encoding="utf-8")
    package.write_text(json.dumps(about(), indent=2) + "\n", encoding="utf-8")
    return [target / name for name in WASM_FILES]


def about() -> dict[str, Any]:
    """Return the metadata for npm."""
    return {
        "name": "qpavoid",
        "version": own_version(),
        "description": "Obstacle avoidance for differential-drive robots",
        "license": "MIT",
        "type": "module",
        "main": "qpavoid.js",
        "types": "qpavoid.d.ts",
        "files": list(WASM_FILES[:-1]),
    }


def own_version() -> str:
    """Return the version of the package; 0.0.0 while it is being built."""
    try:
        return version("qpavoid")
    except PackageNotFoundError:
        return "0.0.0"


def table(unit: Unit) -> dict[str, Any]:
    """Return the description of entries and records for callers."""
    entries = {
        one.name: {
            "about": one.summary,
            "arguments": [described(shape) for shape in one.arguments],
            "result": described(one.result),
        }
        for one in unit.entries
    }
    records = unit.structs.records
    return {"entries": entries, "records": {n: layout(r) for n, r in records.items()}}


def described(shape: Shape) -> dict[str, Any]:
    """Return an argument or a result as plain data."""
    known: dict[str, Any] = {"name": shape.name, "kind": shape.kind or "tuple"}
    if shape.written:
        known["written"] = True
    if not shape.kind:
        known["fields"] = list(shape.fields)
        known["parts"] = [described(part) for part in shape.parts]
    return known


def layout(record: Record) -> dict[str, Any]:
    """Return offsets, in bytes, and kinds of the fields of a record."""
    kinds = {True: "double", False: "int64"}
    fields = {
        name: {"offset": offset, "kind": kinds[of == np.float64]}
        for name, (of, offset, *_) in (record.dtype.fields or {}).items()
    }
    return {"size": record.dtype.itemsize, "fields": fields}


def declared(unit: Unit) -> str:
    """Return the types of the entries and of their arguments, in TypeScript."""
    named: dict[str, Shape] = {}
    for one in unit.entries:
        for shape in (*one.arguments, one.result):
            collect(shape, named)
    texts = [
        f"export interface {name} {{\n"
        + "".join(
            f"  {field}: {typed(part)};\n"
            for field, part in zip(shape.fields, shape.parts, strict=True)
        )
        + "}\n"
        for name, shape in sorted(named.items())
    ]
    for name, record in sorted(unit.structs.records.items()):
        fields = "".join(f"  {one}: number;\n" for one in record.dtype.names or ())
        texts.append(f"export interface {name} {{\n{fields}}}\n")
    functions = []
    for one in unit.entries:
        given = [f"{shape.name}: {typed(shape)}" for shape in one.arguments]
        head = f"  {one.name}({', '.join(given)}): {typed(one.result)};"
        functions.append(f"  /** {one.summary} */\n{head}")
    kernel = "\n".join(functions)
    return "\n".join([*texts, f"export interface Entries {{\n{kernel}\n}}\n"])


def collect(shape: Shape, named: dict[str, Shape]) -> None:
    """Add the records of named fields in an argument or a result."""
    if shape.fields:
        named[shape.of.__name__] = shape
    for part in shape.parts:
        collect(part, named)


def typed(shape: Shape) -> str:
    """Return the type of an argument or a result."""
    if shape.fields:
        return shape.of.__name__
    if not shape.kind:
        return f"[{', '.join(map(typed, shape.parts))}]"
    return TYPES.get(shape.kind, "Block")
