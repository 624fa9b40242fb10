"""C compilers: the system's, else zig, which PyPI has as ``ziglang``."""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from qpavoid.errors import MissingExtraError, QPAvoidError

FLAGS = (
    *("-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fwrapv"),
    *("-fno-trapping-math", "-fno-tree-slp-vectorize"),
)
"""No fast-math and no fused multiply-add: the bits are those of Python. No vectors of
neighbouring numbers: loading them waits for the preceding stores."""

WASM = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-s"),
    *("-fno-sanitize=undefined", "-Wl,-z,stack-size=1048576"),
)


SHARED = ("-shared", "-fPIC", "-fvisibility=hidden")

MACOS = ("-undefined", "dynamic_lookup")
"""Linker options of macOS: Python's symbols are resolved when the module is loaded."""


class CompileError(QPAvoidError):
    """A compiler failed."""


def system_compiler() -> list[str]:
    """Return the command of the system's C compiler; empty if there is none."""
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        return named if shutil.which(named[0]) else []
    found = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    return [found] if found else []


def zig() -> list[str]:
    """Return the command of zig as a C compiler; empty if it is not installed."""
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    found = shutil.which("zig")
    return [found, "cc"] if found else []


def compile_c(command: Sequence[str], folder: Path, *arguments: str) -> None:
    """Run a compiler in a folder.

    Raises:
        CompileError: It failed.
    """
    made = subprocess.run(
        [*command, *arguments], cwd=folder, capture_output=True, text=True
    )
    if made.returncode:
        last = "\n".join(made.stderr.splitlines()[-20:])
        raise CompileError(f"{shlex.join(command)} failed:\n{last}")


def compile_wasm(source: Path, target: Path, names: Sequence[str]) -> None:
    """Compile C to a WebAssembly module without imports that exports some names.

    Raises:
        MissingExtraError: zig is not installed.
        CompileError: It failed.
    """
    command = zig()
    if not command:
        raise MissingExtraError("zig, a compiler of WebAssembly,", "wasm")
    exported = [f"-Wl,--export={name}" for name in names]
    files = [str(source.resolve()), "-o", str(target.resolve())]
    compile_c(command, source.parent, *FLAGS, *WASM, *exported, *files)


def compile_extension(source: Path, target: Path) -> str:
    """Compile C to an extension module; return the name of the compiler.

    Raises:
        CompileError: There is no compiler, or it failed.
    """
    system, flags = sys.platform == "darwin", [*FLAGS, *SHARED]
    command = system_compiler()
    if not command:
        command = zig()
        flags.append("-fno-sanitize=undefined")
    if not command:
        raise CompileError("no C compiler: neither cc, gcc, clang nor ziglang")
    files = [str(source.resolve()), "-o", str(target.resolve()), "-lm"]
    compile_c(command, source.parent, *flags, *(MACOS if system else ()), *files)
    return " ".join(command)
