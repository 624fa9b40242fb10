"""Interface of a world in a study; published files, and points from a table."""

import os
import re
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeAlias, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, ValidationError

from qpavoid.errors import DataError
from qpavoid.files import below, read_array, read_text, reading
from qpavoid.types import Array

FAR = 1e6
"""m; greatest coordinate in a file."""


Number: TypeAlias = Annotated[
    float,
    Field(allow_inf_nan=False),
    BeforeValidator(lambda told: "bool" if isinstance(told, bool) else told),
]
M = TypeVar("M", bound=BaseModel)


def parsed(model: type[M], told: Any, path: object) -> M:
    """Return the content of a file as a model.

    Raises:
        DataError: With the path, and place and kind of the first problem.
    """
    try:
        return model.model_validate(told)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "keys"
        raise DataError(f"{path}: {where}: {first['msg']}") from None


class Source(Hashable, Protocol):
    """Source of the scenes of a study."""

    @property
    def name(self) -> str:
        """Label in tables."""
        ...

    def identity(self, data: str | None) -> str:
        """Return all that determines the scene, but for seed, settings and code."""
        ...

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of a seed; without a seed that of the file."""
        ...


def data_roots(data: str | os.PathLike[str] | None) -> list[Path]:
    """Return the data folder, or that of the environment's ``QPAVOID_DATA``, if any."""
    root = data if data is not None else os.environ.get("QPAVOID_DATA")
    return [] if root is None else [Path(root)]


def data_folders(
    what: str, data: str | os.PathLike[str] | None, folders: Sequence[str]
) -> list[Path]:
    """Return the possible folders of a data set; arguments as :func:`find_file`."""
    roots = data_roots(data)
    if not roots:
        raise DataError(
            f"{what} are not part of qpavoid: give their folder with --data PATH or in "
            "the environment variable QPAVOID_DATA"
        )
    return [roots[0] / folder for folder in folders]


def find_file(
    what: str, name: str, data: str | os.PathLike[str] | None, folders: Sequence[str]
) -> Path:
    """Return the path of a published file.

    Args:
        what: Name of the data set, for the message.
        name: Of the file.
        data: The data folder; without one, the environment's ``QPAVOID_DATA``.
        folders: Possible folders in it.

    Raises:
        DataError: No data folder, or no such file, or one that leads out of it; lists
            the folders searched.
    """
    paths = [folder / name for folder in data_folders(what, data, folders)]
    for path in paths:
        if os.path.isfile(path):
            return below(path, *data_roots(data))
    raise DataError(f"{name} is in none of {', '.join(str(p.parent) for p in paths)}")


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
