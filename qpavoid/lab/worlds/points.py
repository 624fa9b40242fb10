"""Obstacle points from a table: CSV or NPY."""

import os
import re
from pathlib import Path

import numpy as np

from qpavoid.errors import DataError
from qpavoid.files import read_array, read_text, reading
from qpavoid.types import Array


def read_points(path: str | os.PathLike[str]) -> Array:
    """Return points (n, 2) in m from a ``.csv`` (x,y; a header is fine) or ``.npy``.

    Raises:
        DataError: The file is missing, of another kind, or does not hold two columns of
            finite numbers.
    """
    kind = Path(path).suffix.lower()
    with reading(path, "not a readable table"):
        if kind == ".npy":
            points = read_array(path)
        elif kind == ".csv":
            lines = [line for line in read_text(path).splitlines() if line.strip()]
            headless = not lines or re.match(r"\s*[+.-]*\d", lines[0])
            rows = [line.split(",") for line in (lines if headless else lines[1:])]
            numbers = [[float(x) for x in row] for row in rows]
            points = np.array(numbers).reshape(len(rows), -1)
        else:
            raise DataError(f"{path}: points come from .csv or .npy, not {kind!r}")
        points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise DataError(f"{path}: points have two columns, not shape {points.shape}")
    if not np.isfinite(points).all():
        row = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise DataError(f"{path}: point {row} is not finite")
    return points
