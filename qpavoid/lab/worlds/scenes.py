"""Scenes of a scenario file; scenes of another source with a sensor."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qpavoid.lab.worlds.barn import find_folder
from qpavoid.lab.worlds.map_server import find_map, map_digest
from qpavoid.lab.worlds.source import Source
from qpavoid.stamps import file_digest


@dataclass(frozen=True)
class ScenarioFile:
    """A scenario file.

    Attributes:
        name: Of the scenario.
        path: Of the file.
        text: Its content as JSON.
    """

    name: str
    path: str
    text: str

    @property
    def is_drawn(self) -> bool:
        """Whether obstacles or robots are drawn from the seed."""
        document = self.sample()
        things = [*document.get("obstacles", []), *document.get("robots", [])]
        drawn = ("jitter_m", "jitter_rad")
        return any(
            one.get("kind") == "random" or any(map(one.get, drawn)) for one in things
        )

    def identity(self, data: str | None) -> str:
        """Return the file's content, and the digests of all files that it names."""
        parts, document = [self.name, self.text], self.sample()
        robots = [document, *document.get("robots", [])]
        ways = [robot.get("reference", {}) for robot in robots]
        beside = Path(self.path).parent
        for thing in [*document.get("obstacles", []), *ways]:
            if thing.get("kind") == "points":
                parts.append(file_digest(beside / thing["file"]))
            elif thing.get("kind") == "map":
                parts.append(map_digest(find_map(thing["file"], beside, data)))
            elif thing.get("kind") == "barn":
                number = thing["world"]
                folder = find_folder(data, number)
                parts.append(file_digest(folder / f"world_{number}.world"))
                parts.append(file_digest(folder / "path_files" / f"path_{number}.npy"))
        return "\n".join(parts)

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file, with another seed if one is given."""
        document: dict[str, Any] = json.loads(self.text)
        return document if seed is None else document | {"seed": seed}


@dataclass(frozen=True)
class Sensed:
    """Scenes with a LiDAR: 180 beams all round, 10 Hz, σ 1 cm.

    The control step is 0.05 s; arrival is within 0.3 m and 0.3 rad.

    Attributes:
        scene: Source of the scenes.
        perception: Whether moving obstacles have velocities; else all are points.
    """

    scene: Source
    perception: bool

    @property
    def name(self) -> str:
        """Label in tables."""
        seen = "tracks" if self.perception else "points"
        return f"{self.scene.name.rpartition('/')[2]} as {seen}"

    def identity(self, data: str | None) -> str:
        """Return the identity of the scene, and of its sensor."""
        return f"{self.name} {self.scene.identity(data)}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of a seed, which also draws the noise."""
        return self.scene.sample(seed) | {
            "dt_s": 0.05,
            "seed": seed or 0,
            "arrival_m": 0.3,
            "arrival_rad": 0.3,
            "lidar": {"beams": 180, "noise_m": 0.01, "perception": self.perception},
        }
