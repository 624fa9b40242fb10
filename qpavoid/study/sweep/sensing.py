"""Scenes of another source, seen by a LiDAR instead of known."""

from dataclasses import dataclass
from typing import Any

from qpavoid.study.sweep.sources import Source


@dataclass(frozen=True)
class Sensed:
    """Scenes as a LiDAR sees them: 180 beams all round, 10 Hz, σ 1 cm.

    A control step is 0.05 s; to have arrived is to be within 0.3 m and 0.3 rad.

    Attributes:
        scene: Where they come from.
        tracks: Whether discs and their velocities are made of the points.
    """

    scene: Source
    tracks: bool

    @property
    def name(self) -> str:
        """What tables call it."""
        seen = "tracks" if self.tracks else "points"
        return f"{self.scene.name.rpartition('/')[2]} as {seen}"

    def identity(self, data: str | None) -> str:
        """Return what the scene is made of, and how it is seen."""
        return f"{self.name} {self.scene.identity(data)}"

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of a seed, which also draws the noise."""
        return self.scene.sample(seed) | {
            "dt_s": 0.05,
            "seed": seed or 0,
            "arrival_m": 0.3,
            "arrival_rad": 0.3,
            "lidar": {"beams": 180, "noise_m": 0.01, "tracks": self.tracks},
        }
