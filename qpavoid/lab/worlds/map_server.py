"""Occupancy maps of ROS' map_server: a YAML file beside a PGM or PNG image.

A pixel of brightness b from 0 to 1 is occupied with p = 1 − b (``negate: 1``: p = b):
occupied above ``occupied_thresh``, free below ``free_thresh``, else unknown. The first
row of the image is the map's top. In the mode scale, too, values between the
thresholds are unknown; the mode raw is not read.
"""

import hashlib
import io
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, Field

from qpavoid.errors import DataError
from qpavoid.files import below, read_bytes, read_yaml, reading
from qpavoid.lab.worlds.source import Number, data_roots, find_file, parsed
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.stamps import file_digest
from qpavoid.types import Array, Pose

Cells: TypeAlias = npt.NDArray[np.bool_]

MAP_FOLDERS = ("maps", "")
MOST_PIXELS, MOST_WALLS, OPAQUE, OPAQUE_DEEP = 16_000_000, 1_000_000, 255, 65_535


class MapFile(BaseModel):
    """Keys of a map's file; others are ignored. Thresholds are probabilities."""

    image: Annotated[str, Field(strict=True)]
    resolution: Annotated[Number, Field(gt=0.0)]
    origin: tuple[Number, Number, Annotated[Number, Field(ge=-math.tau, le=math.tau)]]
    occupied_thresh: Annotated[Number, Field(le=1.0)]
    free_thresh: Annotated[Number, Field(ge=0.0)]
    negate: bool
    mode: Literal["trinary", "scale"] = "trinary"


@dataclass(frozen=True, eq=False)
class GridMap:
    """Occupancy grid of a plane.

    Cell (i, j) covers i to i + 1 along y and j to j + 1 along x, times the resolution,
    in the grid's frame, whose pose in the world is ``origin``.

    Attributes:
        occupied: (rows, columns), C-contiguous; row 0 is the bottom.
        free: (rows, columns) free cells; the rest is unknown.
        resolution: Side of a cell, m.
        origin: x, y (m), γ (rad) of the lower left corner, world frame.
    """

    occupied: Cells
    free: Cells
    resolution: float
    origin: Pose

    def walls(self) -> Array:
        """Return the outline of the occupied cells as walls (K, 4), world frame, m.

        Adjoining collinear sides are one wall.
        """
        i, low, high = _runs(self.occupied)
        j, left, right = _runs(self.occupied.T)
        ends = np.vstack([np.column_stack([low, i]), np.column_stack([j, left])])
        others = np.vstack([np.column_stack([high, i]), np.column_stack([j, right])])
        return np.hstack([self._in_world(ends), self._in_world(others)])

    def middles(self, cells: Cells, most: float = math.inf) -> Array:
        """Return the middles (n, 2), world frame, m, of cells of (rows, columns).

        Of their equal parts, if their sides are longer than ``most`` (m).
        """
        parts = math.ceil(self.resolution / most - 1e-9) or 1
        parted = np.kron(cells, np.ones((parts, parts), dtype=bool))
        return self._in_world((np.argwhere(parted)[:, ::-1] + 0.5) / parts)

    def covers(self, places: Array, margin: float = 0.0) -> npt.NDArray[np.bool_]:
        """Return which positions (n, 2), world frame, m, are on the map."""
        there = Obstacles(places).seen_from(self.origin).points
        rows, columns = self.occupied.shape
        size = self.resolution * np.array([columns, rows])
        found = (there >= -margin) & (there <= size + margin)
        return np.asarray(found.all(axis=1))

    def _in_world(self, cells: npt.NDArray[Any]) -> Array:
        return to_world(self.resolution * cells, self.origin)


def find_map(
    file: str, beside: Path, data: str | os.PathLike[str] | None = None
) -> Path:
    """Return the path of a map: beside a scenario, or in the data folder.

    Raises:
        DataError: It is in neither, or leads out of both.
    """
    near = beside / file
    there = os.path.isfile(near)
    path = near if there else find_file("maps", file, data, MAP_FOLDERS)
    return below(path, beside, *data_roots(data))


def _runs(cells: Cells) -> tuple[npt.NDArray[np.intp], ...]:
    """Return row, first and last corner of the longest lines between different rows."""
    sides = np.diff(np.pad(cells, ((1, 1), (0, 0))), axis=0)
    change = np.diff(np.pad(sides, ((0, 0), (1, 1))), axis=1)
    if np.count_nonzero(change) > 2 * MOST_WALLS:
        raise DataError(f"a map has at most {MOST_WALLS:,} walls along an axis")
    row, corner = np.nonzero(change)
    return row[::2], corner[::2], corner[1::2]


def read_map(path: str | os.PathLike[str]) -> GridMap:
    """Return the map of a YAML file and the image that it names.

    Raises:
        DataError: A file is missing, damaged, or not supported.
    """
    file, folder = parsed(MapFile, read_yaml(path), path), Path(path).parent
    occupied, free = file.occupied_thresh, file.free_thresh
    if free > occupied:
        raise DataError(f"{path}: free_thresh <= occupied_thresh does not hold")
    brightness = read_image(below(folder / file.image, folder))[::-1]
    p = brightness if file.negate else 1.0 - brightness
    cells = [np.ascontiguousarray(part) for part in (p > occupied, p < free)]
    return GridMap(cells[0], cells[1], file.resolution, file.origin)


def read_image(path: str | os.PathLike[str]) -> Array:
    """Return the brightness (rows, columns) of a PGM or PNG image, 0 to 1, top first.

    Colours are averaged.

    Raises:
        DataError: The file is missing, damaged, of another kind, too large or
            transparent.
    """
    from PIL import Image

    with (
        reading(path, "not a readable image"),
        Image.open(io.BytesIO(read_bytes(path)), formats=("PPM", "PNG")) as image,
    ):
        width, height = image.size
        if width * height > MOST_PIXELS:
            raise ValueError(
                f"{width} × {height} pixels, where {MOST_PIXELS:,} are most"
            )
        clear = np.asarray(image.convert("RGBA"))[:, :, 3].min() < OPAQUE
        deep, grey = image.mode.startswith("I"), image.mode in ("L", "I", "I;16")
        pixels = np.asarray(image if grey else image.convert("RGB"), dtype=np.float64)
    if clear:
        raise DataError(f"{path}: transparent pixels have no brightness")
    brightness = pixels if pixels.ndim == 2 else pixels.mean(axis=2)
    return np.asarray(brightness / (OPAQUE_DEEP if deep else OPAQUE))


def map_digest(path: Path) -> str:
    """Return the hash of a map's file and of its image's cells."""
    chart = read_map(path)
    cells = hashlib.sha256(chart.occupied.tobytes() + chart.free.tobytes())
    return file_digest(path) + cells.hexdigest()
