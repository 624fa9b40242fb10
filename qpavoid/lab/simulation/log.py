"""The log of one run: columns over time, with provenance, saved without pickle."""

import json
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpavoid.errors import DataError
from qpavoid.files import read_arrays, reading
from qpavoid.model.footprint import Footprint
from qpavoid.types import Array


class LogRow(NamedTuple):
    """One control step: world frame, units in the names.

    ``least_clearance_m`` is the least within the step, ``room_m`` that of clearance
    less r_min over all obstacles, ``changed`` 1 where the twist is another than
    tracking alone would drive, ``progress_s`` the time on the path's own clock.
    """

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    progress_s: float
    x_ref_m: float
    y_ref_m: float
    heading_ref_rad: float
    v_ref_mps: float
    omega_ref_radps: float
    v_desired_mps: float
    omega_desired_radps: float
    v_mps: float
    omega_radps: float
    clearance_m: float
    least_clearance_m: float
    room_m: float
    r_min_m: float
    r_m: float
    contact_x_m: float
    contact_y_m: float
    obstacle: float
    slack_mps: float
    residual: float
    solve_time_s: float
    changed: float
    status: float


COLUMNS = LogRow._fields

PACKAGES = "numpy numba osqp casadi qpsolvers daqp scipy mujoco".split()


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """Record of one run.

    Attributes:
        meta: Scenario, controller, solver, settings, versions and machine (JSON-able).
        columns: Arrays over the n control steps, by :data:`COLUMNS`; ``status`` holds
            numbers of :data:`qpavoid.avoidance.decision.STATUSES`. World frame.
        final: (3,) the pose x, y, γ after the last step.
        final_reference: (5,) the path's goal: x, y, γ, and v, ω, which are zero.
        discs: (n, M, 3) discs over time, world frame.
        points: (N, 2) points.
        walls: (K, 4) walls.
        corners: (n, C, 2) corners of all polygons, one polygon after the other, over
            time, world frame.
        polygons: (P,) how many of them each has.
        vertices: (k, 2) the footprint's corners, one polygon after the other, robot
            frame.
        outlines: (p,) how many of them each polygon has.
    """

    meta: Mapping[str, Any]
    columns: Mapping[str, Array]
    final: Array
    final_reference: Array
    discs: Array
    points: Array
    walls: Array
    vertices: Array
    corners: Array
    polygons: Array
    outlines: Array

    def __repr__(self) -> str:
        meta = self.meta
        return (
            f"<Log of {meta['scenario']}, {meta['controller']}: {len(self)} steps of "
            f"{meta['dt_s']:g} s, least distance "
            f"{self['least_clearance_m'].min(initial=np.inf):.3f} m>"
        )

    def __getitem__(self, column: str) -> Array:
        return self.columns[column]

    def __len__(self) -> int:
        return len(self.columns["t_s"])

    def polygons_at(self, step: int) -> list[Array]:
        """Return the corners (n, 2) of every polygon at a control step, m."""
        if not len(self.polygons):
            return []
        return np.split(self.corners[step], np.cumsum(self.polygons[:-1]).astype(int))

    @property
    def footprint(self) -> Footprint:
        """Of the robot."""
        ends = np.cumsum(self.outlines[:-1]).astype(int)
        return Footprint(tuple(np.split(self.vertices, ends)))

    def save(self, path: str | os.PathLike[str] | BinaryIO) -> None:
        """Write the log as a compressed ``.npz`` file without pickled objects."""
        arrays = {name: getattr(self, name) for name in SHAPES}
        meta = np.array(json.dumps(dict(self.meta)))
        arrays |= {"meta": meta, **self.columns}
        np.savez_compressed(path, allow_pickle=False, **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Log":
        """Read a log that :meth:`save` wrote.

        Raises:
            DataError: The file is missing, damaged or not a log.
        """
        with reading(path, "not a readable log"):
            data = read_arrays(path)
            columns = {name: data[name] for name in COLUMNS}
            arrays = {name: data[name] for name in SHAPES}
            meta = json.loads(str(data["meta"]))
            if wrong := misfit(meta, columns, arrays):
                raise DataError(f"{path}: not a readable log ({wrong})")
            return cls(meta, columns, **arrays)


def provenance() -> dict[str, Any]:
    """Return versions and machine, to stand beside every result."""
    versions = {"qpavoid": _version("qpavoid")}
    versions |= {name: _version(name) for name in PACKAGES}
    return {
        "versions": versions,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "cpu": _cpu(),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "absent"


def _cpu() -> str:
    """Return the processor's name, with the number of cores."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            name = next(x.split(":")[1].strip() for x in lines if "model name" in x)
    except (OSError, StopIteration):
        pass
    return f"{name}, {os.cpu_count()} cores"


def read_only(array: npt.ArrayLike) -> Array:
    """Return the array as floats that nobody can write to."""
    result = np.asarray(array, dtype=np.float64)
    result.setflags(write=False)
    return result


Number = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(gt=0.0, lt=1e7)]
"""s; more than four months are no run."""

SHAPES = {
    "final": (3,),
    "final_reference": (5,),
    "discs": ("n", None, 3),
    "points": (None, 2),
    "walls": (None, 4),
    "vertices": (None, 2),
    "corners": (None, None, 2),
    "polygons": (None,),
    "outlines": (None,),
}
"""Arrays of a log beside its columns: n steps, or any number."""


class Meta(BaseModel):
    """Metadata that every log has; others are kept as they are."""

    model_config = ConfigDict(strict=True)
    scenario: str
    title: str
    controller: str
    solver: str
    dt_s: Time
    duration_s: Time
    arrival: Annotated[list[Number], Field(min_length=2, max_length=2)]
    frames_s: list[Number]


def misfit(meta: Any, columns: Mapping[str, Array], arrays: Mapping[str, Array]) -> str:
    """Return what is wrong with the parts of a log; empty: nothing."""
    try:
        Meta.model_validate(meta)
    except ValidationError as error:
        return f"its metadata: {error.errors()[0]['loc']}"
    every = {**columns, **arrays}
    if text := next((name for name, x in every.items() if x.dtype.kind != "f"), ""):
        return f"{text} are no floating-point numbers"
    n = columns["t_s"].size
    if not n or any(x.shape != (n,) for x in columns.values()):
        return "columns that are empty, or of two lengths"
    for name, shape in SHAPES.items():
        wanted, found = [n if k == "n" else k for k in shape], arrays[name].shape
        fits = [k in (None, size) for k, size in zip(wanted, found, strict=False)]
        if len(found) != len(wanted) or not all(fits):
            return f"{name} of shape {found}"
    footprint, parts = arrays["vertices"], arrays["outlines"]
    if not len(parts) or parts.sum() != len(footprint) or (parts < 3).any():
        return "a footprint of fewer than three corners"
    steps, corners, _ = arrays["corners"].shape
    sizes = arrays["polygons"]
    whole = (sizes >= 1.0).all() and (sizes % 1.0 == 0.0).all()
    if not whole or sizes.sum() != corners or (corners and steps != n):
        return "corners of no polygon"
    return ""
