"""The package as WebAssembly: built into the wheel, else cached, else made now."""

import hashlib
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import qpavoid.avoidance.laws
import qpavoid.export.wasm
import qpavoid.guide.guide
import qpavoid.lab.sensing.lidar
from qpavoid.compiled import ENTRIES
from qpavoid.export.values import TEMPLATES
from qpavoid.export.wasm import export_wasm
from qpavoid.stamps import file_stamp, source_stamp

FILES = ("qpavoid.wasm", "qpavoid.js")

BUILT = Path(__file__).with_name("built")
"""Where :func:`build` puts them when a wheel is made; not there in a source tree."""

SOURCES = (
    qpavoid.avoidance.laws.__file__,
    qpavoid.guide.guide.__file__,
    qpavoid.lab.sensing.lidar.__file__,
    qpavoid.export.wasm.__file__,
)
"""Modules of the entries, with all that they import, and the one that writes them."""


class Program(NamedTuple):
    """The functions of the package as a browser runs them.

    Attributes:
        module: WebAssembly.
        script: The JavaScript that calls it.
    """

    module: bytes
    script: str


def program(say: Callable[[str], None] = lambda step: None) -> Program:
    """Return the program of these very sources.

    Args:
        say: Called with each step of a build before it is done.

    Raises:
        MissingExtraError: It is not built, and zig, which could, is not installed.
        CompileError: It could not be compiled.
    """
    for folder in (BUILT, cached()):
        if all((folder / name).is_file() for name in FILES):
            return read_program(folder)
    with TemporaryDirectory() as made:
        build(Path(made), say)
        found = read_program(Path(made))
        with suppress(OSError):  # then it is made anew the next time
            keep(Path(made), cached())
        return found


def build(folder: Path, say: Callable[[str], None] = lambda step: None) -> list[Path]:
    """Write the program, ready for npm; return its files."""
    return export_wasm(folder, ENTRIES, say)


def read_program(folder: Path) -> Program:
    """Return the program in a folder."""
    module, script = (folder / name for name in FILES)
    return Program(module.read_bytes(), script.read_text(encoding="utf-8"))


def keep(made: Path, folder: Path) -> None:
    """Copy what was made into the cache; nobody ever sees a part of a file."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        part = folder / f"{name}.{os.getpid()}"
        shutil.copy(made / name, part)
        part.replace(folder / name)


def cached() -> Path:
    """Return where the program of these sources is kept, if it is."""
    stamps = "".join(source_stamp(Path(str(file))) for file in SOURCES)
    stamps += "".join(map(file_stamp, sorted(TEMPLATES.iterdir())))
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    digest = hashlib.sha256(stamps.encode()).hexdigest()[:16]
    return Path(home) / "qpavoid" / f"wasm-{digest}"
