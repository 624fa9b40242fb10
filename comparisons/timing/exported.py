"""Recorded problems answered by the exported filter, compiled: agreement and time.

Run: python comparisons/timing/steps.py
"""

import shutil
import subprocess
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import Capacity, export_c
from qpavoid.model.robot import Robot
from qpavoid.types import Array

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
"""A decision in C, and its time."""

COUNTED = ("points", "discs", "walls", "polygons")
"""Obstacles with a number below their capacity."""


def problem_type(capacity: Capacity) -> np.dtype[Any]:
    """Return the record of a step that the replay reads.

    ``v`` and ``omega`` are desired; where ``anew`` is 1 a new run begins with
    ``last_v`` and ``last_omega`` driven; where it is 2 it goes on with these driven.
    """
    obstacles = [
        ("age", np.float64),
        *((f"n_{name}", np.int32) for name in COUNTED),
        ("points", np.float64, (capacity.points + 1, 2)),
        ("discs", np.float64, (capacity.discs, 3)),
        ("disc_velocities", np.float64, (capacity.discs, 2)),
        ("walls", np.float64, (capacity.walls + 1, 4)),
        ("corners", np.float64, (capacity.corners + 1, 2)),
        ("polygons", np.float64, (capacity.polygons + 1, 4)),
    ]
    numbers = [(name, np.float64) for name in ("v", "omega", "last_v", "last_omega")]
    inner = np.dtype(obstacles, align=True)
    return np.dtype([*numbers, ("anew", np.int32), ("obstacles", inner)], align=True)


def compile_replay(folder: str | PathLike[str], flags: Sequence[str] = ()) -> Path:
    """Compile an exported filter with the replay; QPAvoidError: it does not compile."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise QPAvoidError("there is no C compiler (gcc or cc)")
    target = Path(folder)
    program = target / "replay"
    shutil.copy(Path(__file__).with_name("replay.c"), target)
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
    """Return the answers (:data:`ANSWER`); each problem is solved ``repeat`` times."""
    done = subprocess.run(
        [str(program), str(repeat)],
        input=problems.tobytes(),
        capture_output=True,
        check=True,
    )
    return np.frombuffer(done.stdout, dtype=ANSWER)


def step_times(
    robot: Robot,
    settings: AvoidanceSettings,
    scans: Sequence[tuple[float, float, Array]],
    ahead: bool = True,
    repeat: int = 100,
) -> Array:
    """Return the time in ns of one exported step at each scan, in a single run.

    A time is the mean of ``repeat`` equal steps, all from the same memory.
    """
    capacity = Capacity(discs=1, points=max(len(points) for *_, points in scans))
    problems = np.zeros(len(scans), problem_type(capacity))
    for problem, (v, omega, points) in zip(problems, scans, strict=True):
        problem["v"], problem["omega"] = v, omega
        problem["obstacles"]["n_points"] = len(points)
        problem["obstacles"]["points"][: len(points)] = points
    with TemporaryDirectory() as folder:
        export_c(folder, robot, settings, capacity, ahead)
        answers = replay(compile_replay(folder), problems, repeat)
    return np.asarray(answers["nanoseconds"], dtype=np.float64)
