"""Recorded problems answered by the exported filter, compiled: agreement and time."""

import shutil
import subprocess
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.errors import QPAvoidError
from qpavoid.export.write import TEMPLATES, Capacity

ANSWER = np.dtype(
    [
        *((name, np.float64) for name in ("v", "omega")),
        ("status", np.int32),
        *((n, np.float64) for n in ("clearance", "slack", "residual", "shortfall")),
        ("active", np.int32, 2),
        ("nanoseconds", np.float64),
    ],
    align=True,
)
"""A decision in C, and how long it took."""


def problem_type(capacity: Capacity) -> np.dtype[Any]:
    """Return what the replay reads, one record a step.

    ``v`` and ``omega`` are wanted; where ``anew`` is set the run begins anew with
    ``last_v`` and ``last_omega`` driven. Of ``obstacles``, ``age`` and ``points``,
    ``discs``, ``disc_velocities``, ``walls`` with their numbers ``n_points`` and so on.
    """
    fields: list[Any] = [("age", np.float64)]
    for name, size, columns in capacity.fields:
        if size and name != "disc_velocities":
            fields.append((f"n_{name}", np.int32))
        if size:
            fields.append((name, np.float64, (size, columns)))
    numbers = [(name, np.float64) for name in ("v", "omega", "last_v", "last_omega")]
    obstacles = np.dtype(fields, align=True)
    return np.dtype(
        [*numbers, ("anew", np.int32), ("obstacles", obstacles)], align=True
    )


def compile_replay(folder: str | PathLike[str], flags: Sequence[str] = ()) -> Path:
    """Compile an exported filter with the replay, and return the program.

    Raises:
        QPAvoidError: There is no C compiler, or it complains; the message says why.
    """
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise QPAvoidError("there is no C compiler (gcc or cc)")
    target = Path(folder)
    program = target / "replay"
    shutil.copy(TEMPLATES / "replay.c", target)
    sources = [target / "replay.c", target / "qpavoid_filter.c"]
    command = [compiler, "-std=c99", "-O2", "-ffp-contract=off", *flags]
    command += [*map(str, sources), "-o", str(program), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise QPAvoidError(f"{compiler} failed:\n{done.stderr}")
    return program


def replay(
    program: Path, problems: npt.NDArray[np.void], repeat: int = 1
) -> npt.NDArray[np.void]:
    """Return the answers (:data:`ANSWER`) to problems, each answered so often."""
    done = subprocess.run(
        [str(program), str(repeat)],
        input=problems.tobytes(),
        capture_output=True,
        check=True,
    )
    return np.frombuffer(done.stdout, dtype=ANSWER)
