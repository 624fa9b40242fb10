"""Where the scenes of a study come from: scenario files, forests, BARN worlds."""

import hashlib
import json
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from qpavoid.datasets.barn import find_folder
from qpavoid.datasets.map_server import find_map, read_map
from qpavoid.study.sweep.crowd import find_scene, read_tasks, task_document
from qpavoid.study.sweep.forest import forest_document
from qpavoid.study.sweep.maps import map_document


class Source(Hashable, Protocol):
    """Where the scenes of a study come from."""

    @property
    def name(self) -> str:
        """What tables call it."""
        ...

    def identity(self, data: str | None) -> str:
        """Return all that determines the scene, but for seed, settings and code."""
        ...

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of a seed; without a seed that of the file."""
        ...


@dataclass(frozen=True)
class ScenarioFile:
    """A scenario file.

    Attributes:
        name: Of the scenario.
        path: Of the file.
        text: What it says, as JSON.
    """

    name: str
    path: str
    text: str

    @property
    def obstacles(self) -> Sequence[Mapping[str, Any]]:
        """Its obstacles as they stand in the file."""
        found: Sequence[Mapping[str, Any]] = self.sample().get("obstacles", [])
        return found

    def identity(self, data: str | None) -> str:
        """Return the file's content, and the digest of every file that it names."""
        parts = [self.name, self.text]
        beside = Path(self.path).parent
        for thing in [*self.obstacles, self.sample().get("reference", {})]:
            if thing.get("kind") == "points":
                parts.append(digest(beside / thing["file"]))
            elif thing.get("kind") == "map":
                parts.append(_map_digest(find_map(thing["file"], beside, data)))
            elif thing.get("kind") == "barn":
                number = thing["world"]
                folder = find_folder(data, number)
                parts.append(digest(folder / f"world_{number}.world"))
                parts.append(digest(folder / "path_files" / f"path_{number}.npy"))
        return "\n".join(parts)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file, with another seed where one is given."""
        document: dict[str, Any] = json.loads(self.text)
        return document if seed is None else document | {"seed": seed}


@dataclass(frozen=True)
class Forest:
    """Random forests, see :mod:`qpavoid.study.sweep.forest`.

    Attributes:
        family: Seed of the whole family.
    """

    family: int

    @property
    def name(self) -> str:
        """What tables call it."""
        return "forest"

    def identity(self, data: str | None) -> str:
        """Return kind and family."""
        return repr(self)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the forest with this number."""
        return forest_document(self.family, seed or 0)


@dataclass(frozen=True)
class BarnWorlds:
    """BARN worlds and rule [Perille2020] for a kinematic Jackal; seeds are worlds.

    Success: within 1 m of the goal in 100 s, without contact.

    Attributes:
        speed: Greatest speed, m/s.
        family: Seed of all noise.
    """

    speed: float
    family: int = 0

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"BARN, v <= {self.speed:g} m/s"

    def identity(self, data: str | None) -> str:
        """Return kind and speed, and the digest of every world that there is."""
        folder = find_folder(data, 0)
        files = [*folder.glob("*.world"), *folder.glob("path_files/*.npy")]
        return repr(self) + "".join(map(digest, sorted(files)))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the world with this number."""
        world = {"kind": "barn", "world": seed or 0}
        return {
            "title": f"BARN world {seed or 0}",
            "duration_s": 100.0,
            "dt_s": 0.02,
            "seed": 1000 * self.family + (seed or 0),
            "ends_at_goal": True,
            "arrival_m": 1.0,
            "arrival_rad": 3.2,
            "robot": {
                "preset": "jackal",
                "v_min_mps": -self.speed,
                "v_max_mps": self.speed,
                "omega_min_radps": -1.57,
                "omega_max_radps": 1.57,
            },
            "reference": world | {"speed_mps": self.speed, "turn_rate_radps": 1.57},
            "tracking": {
                "k_x_per_s": 1.0,
                "k_y_rad_per_m2": 8.0,
                "k_gamma_radps": 3.0,
                "waiting": True,
            },
            "radius": {"low_m": 0.1, "high_m": 0.1},
            "obstacles": [world],
        }


@dataclass(frozen=True)
class Crowd:
    """Recorded pedestrians, one replaced, see :mod:`qpavoid.study.sweep.crowd`.

    Attributes:
        scene: eth, hotel or zara01.
        data: Folder of published data sets.
        seen_before: s; see :func:`qpavoid.study.sweep.crowd.task_document`.
    """

    scene: str
    data: str | None
    seen_before: float = 0.0

    @property
    def name(self) -> str:
        """What tables call it."""
        early = f", seen {self.seen_before:g} s before" if self.seen_before else ""
        return f"crowd {self.scene}{early}"

    def identity(self, data: str | None) -> str:
        """Return the scene, and the digest of its tracks."""
        return f"{self.name} " + digest(find_scene(self.scene, self.data))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the task with this number."""
        tasks = read_tasks(find_scene(self.scene, self.data))
        return task_document(tasks[seed or 0], self.seen_before)


@dataclass(frozen=True)
class Maps:
    """Ways through a map, see :mod:`qpavoid.study.sweep.maps`.

    Attributes:
        place: Name of its file, without ``.yaml``.
        data: Folder of published data sets.
    """

    place: str
    data: str | None

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"map {self.place}"

    @property
    def file(self) -> str:
        """Name of the file."""
        return f"{self.place}.yaml"

    def identity(self, data: str | None) -> str:
        """Return the name, and the digest of the map."""
        path = find_map(self.file, Path(), self.data)
        return f"map {self.place} {_map_digest(path)}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the task with this number."""
        path = find_map(self.file, Path(), self.data)
        return map_document(path, self.file, seed or 0)


def _map_digest(path: Path) -> str:
    """Return the hash of a map's file and of what its image says."""
    chart = read_map(path)
    cells = hashlib.sha256(chart.occupied.tobytes() + chart.free.tobytes())
    return digest(path) + cells.hexdigest()


def digest(path: Path) -> str:
    """Return the hash of a file; empty for one that is not there."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
