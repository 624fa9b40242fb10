"""BARN worlds [Perille2020] in their published form: Gazebo SDF and path files.

Every obstacle of a world is a vertical cylinder. The start is (−2.25, 3.0, π/2), the
goal (−2.25, 13.0). Path cells are mapped with x = 0.15 c − 4.425, y = 0.15 r + 5.225;
the organisers' transform is one cell off and passes too near to some cylinders.
"""

import math
import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.errors import DataError
from qpavoid.files import read_array, read_text, reading
from qpavoid.lab.worlds.source import FAR, data_folders, find_file
from qpavoid.settings import POSITIVE
from qpavoid.stamps import file_digest
from qpavoid.types import Array

START = (-2.25, 3.0, math.pi / 2)
GOAL = (-2.25, 13.0)
WHAT = "BARN worlds"
BARN_FOLDERS = ("", "BARN", "barn/BARN", "worlds/BARN")


def find_folder(data: str | os.PathLike[str] | None, world: int) -> Path:
    """Return the folder of ``world_<world>.world``.

    Args:
        data: A data folder; without one, the environment's ``QPAVOID_DATA``. The worlds
            may lie in it or in its BARN, barn/BARN or worlds/BARN.
        world: Number of the world.

    Raises:
        DataError: No such folder or world; the message lists the folders searched.
    """
    return find_file(WHAT, f"world_{world}.world", data, BARN_FOLDERS).parent


def read_world(path: str | os.PathLike[str]) -> Array:
    """Return the cylinders of an SDF world as discs (n, 3): x, y, radius in m.

    Models without collision, and planes, are ignored.

    Raises:
        DataError: The file is missing, is not SDF, has no or damaged cylinders, or
            something to collide with that is no upright cylinder at its model's pose.
    """
    with reading(path, "not a readable SDF world"):
        text = read_text(path)
        if "<!DOCTYPE" in text:
            raise DataError(f"{path}: entities and types of documents are not read")
        root = ElementTree.fromstring(text)
    if root.find("./world//include") is not None:
        raise DataError(f"{path}: includes are not read")
    if root.find(".//model//model/pose") is not None:
        raise DataError(f"{path}: models within models are not read")
    poses = root.iter("pose")
    if any(pose.get("relative_to") or pose.get("frame") for pose in poses):
        raise DataError(f"{path}: poses relative to something are not read")
    discs = [_disc(path, m) for m in root.iterfind("./world/model") if _solid(m)]
    if not discs:
        raise DataError(f"{path}: the world has no cylinder")
    array = np.array(discs)
    if not ((np.abs(array) < FAR).all() and (array[:, 2] > 0).all()):
        raise DataError(f"{path}: a cylinder is not finite or has no radius")
    return array


def _solid(model: ElementTree.Element) -> list[ElementTree.Element]:
    """Return the collision shapes, except planes."""
    shapes = model.findall(".//collision/geometry/*")
    return [shape for shape in shapes if shape.tag != "plane"]


def _disc(
    path: str | os.PathLike[str], model: ElementTree.Element
) -> tuple[float, float, float]:
    """Return x, y and radius of a model, one upright cylinder on the floor, m."""
    where, shapes = f"{path}: model {model.get('name')!r}", _solid(model)
    if [shape.tag for shape in shapes] != ["cylinder"]:
        told = ", ".join(shape.tag for shape in shapes)
        raise DataError(f"{where} is to be one cylinder, not {told}")
    try:
        radius = float(shapes[0].findtext("radius", ""))
        height = float(shapes[0].findtext("length", "inf"))
        x, y, z, *turns = map(float, model.findtext("pose", "").split())
        _, _, _ = turns  # of six numbers
        inner = [
            float(word)
            for place in (
                *model.findall("link/pose"),
                *model.findall(".//collision/pose"),
            )
            for word in (place.text or "").split()
        ]
    except ValueError:
        raise DataError(f"{where} has a damaged pose or radius") from None
    if any(turns[:2]) or any(inner):
        raise DataError(f"{where} leans, or is not where its pose is")
    if not abs(z) <= height / 2:
        raise DataError(f"{where} does not reach the floor")
    return x, y, radius


def read_cells(path: str | os.PathLike[str]) -> Array:
    """Return the cells (n, 2), column and row, of a path file.

    Raises:
        DataError: The file is missing or is not an (n, 2) array of finite cells.
    """
    cells = read_array(path)
    if cells.dtype.kind == "U":
        raise DataError(f"{path}: a path file holds numbers")
    if cells.ndim != 2 or cells.shape[1] != 2 or len(cells) < 2:
        raise DataError(f"{path}: a path file holds (n, 2) cells, not {cells.shape}")
    if not np.isfinite(cells).all():
        raise DataError(f"{path}: a cell is not finite")
    return np.asarray(cells, dtype=np.float64)


def read_path(path: str | os.PathLike[str]) -> Array:
    """Return the reference way-points (n, 2) in m, from the start to the goal.

    Published paths start with cells along the field's first row, where it is still
    open; of these only the last is kept, so that the path to it is straight.

    Raises:
        DataError: As :func:`read_cells` does.
    """
    points = 0.15 * read_cells(path) + (-4.425, 5.225)
    last = int(np.flatnonzero(points[:, 1] == points[0, 1]).max())
    return np.vstack([START[:2], points[last:], GOAL])


def jackal(speed: float) -> dict[str, Any]:
    """Return robot, tracking and radius of a scenario file for a Jackal (m/s)."""
    return {
        "robot": {
            "preset": "jackal",
            "v_min_mps": -speed,
            "v_max_mps": speed,
            "omega_min_radps": -1.57,
            "omega_max_radps": 1.57,
        },
        "tracking": {
            "k_x_per_s": 1.0,
            "k_y_rad_per_m2": 8.0,
            "k_gamma_radps": 3.0,
            "waiting": True,
        },
        "radius": SafetyRadius.keys_of(0.1, 0.1),
    }


@dataclass(frozen=True)
class BarnWorlds:
    """BARN worlds and rule [Perille2020] for a kinematic Jackal; seeds are worlds.

    Success: within 1 m of the goal in 100 s, without contact.

    Attributes:
        speed: Greatest speed, m/s.
    """

    speed: Annotated[float, "mps", POSITIVE] = 0.5

    @property
    def name(self) -> str:
        """Label in tables."""
        return f"BARN, v <= {self.speed:g} m/s"

    def identity(self, data: str | None) -> str:
        """Return kind and speed, and the digests of all worlds."""
        files: list[Path] = []
        for folder in data_folders(WHAT, data, BARN_FOLDERS):
            files += [*folder.glob("*.world"), *folder.glob("path_files/*.npy")]
        return repr(self) + "".join(map(file_digest, sorted(files)))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the world with this number."""
        world = {"kind": "barn", "world": seed or 0}
        return {
            "title": f"BARN world {seed or 0}",
            "duration_s": 100.0,
            "dt_s": 0.02,
            "seed": seed or 0,
            "ends_at_goal": True,
            "arrival_m": 1.0,
            "arrival_rad": 3.2,
            "reference": world
            | {
                "speed_mps": self.speed,
                "turn_rate_radps": 1.57,
                "acceleration_mps2": 2.0,
            },
            **jackal(self.speed),
            "obstacles": [world],
        }
