"""Stamps of sources: compiled code, programs and runs are of these and no others."""

import hashlib
import re
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent

IMPORT = re.compile(r"^ *(?:from|import) +([\w.]+)(?: +import +(\([^)]*\)|.*))?", re.M)


@cache
def source_stamp(path: Path) -> str:
    """Return a hash of a source file and of all that it imports, directly or not.

    Of the package, and of scripts beside it; empty for what has no file, as in a
    notebook. The package's ``__init__`` hands on names and compiles nothing.
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
    """Return the files of the modules that a source file may import itself."""
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
    """Return the hash of a file as it is now; empty for one that is not there."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


@cache
def file_stamp(path: Path) -> str:
    """Return the hash of a source file as it was when it was first asked for."""
    return file_digest(path)
