"""Hashes of source files, which identify compiled code, programs and runs."""

import hashlib
import re
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent

IMPORT = re.compile(r"^ *(?:from|import) +([\w.]+)(?: +import +(\([^)]*\)|.*))?", re.M)


@cache
def source_stamp(path: Path) -> str:
    """Return a hash of a source file and of all files that it imports, directly or not.

    It covers the package and scripts beside the file; it is empty without a file, as in
    a notebook. The package's ``__init__`` is left out: it only re-exports names.
    """
    seen, left = set(), [path]
    while left:
        file = left.pop()
        if file not in seen:
            seen.add(file)
            left += imported_files(file)
    return hashlib.sha256("".join(sorted(map(file_stamp, seen))).encode()).hexdigest()


@cache
def imported_files(path: Path) -> tuple[Path, ...]:
    """Return the files of the modules that a source file imports itself."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError:
        return ()
    modules = set()
    for module, names in IMPORT.findall(text):
        modules |= {module, *(f"{module}.{n}" for n in re.findall(r"\w+", names))}
    places = []
    for module in modules:
        head, *rest = module.split(".")
        if head != PACKAGE.name:
            places.append(path.with_name(f"{head}.py"))
        elif rest:
            places.append(PACKAGE.joinpath(*rest).with_suffix(".py"))
    return tuple(place for place in places if place.is_file())


def file_digest(path: Path) -> str:
    """Return the hash of a file's present content; empty if it does not exist."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


@cache
def file_stamp(path: Path) -> str:
    """Return the hash of a source file when it was first requested."""
    return file_digest(path)
