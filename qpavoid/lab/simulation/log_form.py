"""Whether what a file says is a log: what its metadata and arrays have to be."""

import math
from collections.abc import Mapping
from typing import Any

from qpavoid.types import Array

TEXTS = "scenario", "title", "controller", "solver"
TIMES = "dt_s", "duration_s"
SHAPES = {
    "final": (3,),
    "final_reference": (5,),
    "discs": ("n", None, 3),
    "points": (None, 2),
    "walls": (None, 4),
    "vertices": (None, 2),
    "planes": ("n", None, 4),
    "corners": (None, None, 2),
    "polygons": (None,),
}
"""Of the arrays beside the columns: n steps, or any number."""

LONGEST_RUN = 1e7
"""s; more than four months are no run."""


def misfit(meta: Any, columns: Mapping[str, Array], arrays: Mapping[str, Array]) -> str:
    """Return what is wrong with the parts of a log; empty: nothing."""
    if wrong := _wrong_meta(meta):
        return f"its metadata: {wrong}"
    every = {**columns, **arrays}
    if text := next((name for name, x in every.items() if x.dtype.kind != "f"), ""):
        return f"{text} are no floating-point numbers"
    n = columns["t_s"].size
    if not n or any(x.shape != (n,) for x in columns.values()):
        return "columns that are empty, or of two lengths"
    for name, shape in SHAPES.items():
        wanted = [n if size == "n" else size for size in shape]
        found = arrays[name].shape
        fits = len(found) == len(wanted) and all(
            size in (None, there) for size, there in zip(wanted, found, strict=True)
        )
        if not fits:
            return f"{name} of shape {found}"
    if len(arrays["vertices"]) < 3:
        return "a footprint of fewer than three corners"
    steps, corners, _ = arrays["corners"].shape
    sizes = arrays["polygons"]
    if not ((sizes >= 1.0).all() and (sizes % 1.0 == 0.0).all()):
        return "polygons of no whole number of corners"
    if sizes.sum() != corners or (corners and steps != n):
        return "corners of no polygon"
    return ""


def _wrong_meta(meta: Any) -> str:
    if not isinstance(meta, dict):
        return "no table"
    for name in TEXTS:
        if not isinstance(meta.get(name), str):
            return f"{name} is no text"
    for name in TIMES:
        if not _is_number(meta.get(name)) or not 0.0 < meta[name] < LONGEST_RUN:
            return f"{name} is no time"
    lists = meta.get("arrival"), meta.get("frames_s")
    if not all(map(_are_numbers, lists)) or len(meta["arrival"]) != 2:
        return "arrival or frames_s are no lists of numbers"
    return ""


def _are_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_number(value: Any) -> bool:
    known = isinstance(value, int | float) and not isinstance(value, bool)
    return known and abs(value) < math.inf
