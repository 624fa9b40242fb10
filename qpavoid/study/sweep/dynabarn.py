"""DynaBARN worlds [Nair2022] for a kinematic Jackal, each at three times of its motion.

The robot drives straight from the published start, which lies just outside the open
side of the field, to the published goal 20 m on, and has arrived within 1 m of it. The
episode is over at the published 100 s of the world's clock, or at the first jump.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.datasets.dynabarn import DynaBarnWorld, Restart, read_world
from qpavoid.datasets.folder import find_file
from qpavoid.study.sweep.sources import digest

PHASES = 3
"""Starts of the robot in a world, evenly over the time to its first jump."""

FOLDERS = ("dynabarn", "")


@dataclass(frozen=True)
class DynaBarn:
    """DynaBARN episodes; seeds are :data:`PHASES` · world + phase.

    In phase k the robot starts after k/3 of the time to the world's first jump.

    Attributes:
        jumps: What happens where a cylinder would jump: ``end`` or ``reverse``.
        speed: Greatest speed, m/s.
        data: Folder of published data sets.
    """

    jumps: Restart
    speed: float
    data: str | None

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"DynaBARN, jumps {self.jumps}, v <= {self.speed:g} m/s"

    def identity(self, data: str | None) -> str:
        """Return kind and rule, and the digest of the worlds."""
        return self.name + digest(find_worlds(self.data))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the episode with this number."""
        return episode_document(*self.episode(seed or 0), self)

    def episode(self, seed: int) -> tuple[DynaBarnWorld, float]:
        """Return the world of an episode, and when on its clock the robot starts, s."""
        file, (number, phase) = find_worlds(self.data), divmod(seed, PHASES)
        first_jump = read_world(file, number).duration
        return read_world(file, number, self.jumps), phase / PHASES * first_jump


def find_worlds(data: str | os.PathLike[str] | None) -> Path:
    """Return the file of the worlds.

    Raises:
        DataError: No data folder, or no such file in it.
    """
    return find_file("DynaBARN worlds", "dynabarn.json", data, FOLDERS)


def episode_document(
    world: DynaBarnWorld, start: float, source: DynaBarn
) -> dict[str, Any]:
    """Return a world as a scenario file for a robot that starts then, s."""
    x, y, heading = world.start
    return {
        "title": source.name,
        "duration_s": world.duration - start,
        "dt_s": 0.05,
        "ends_at_goal": True,
        "arrival_m": world.goal_radius,
        "arrival_rad": 3.2,
        "start": {"x_m": x, "y_m": y, "heading_rad": heading},
        "robot": {
            "preset": "jackal",
            "v_min_mps": -source.speed,
            "v_max_mps": source.speed,
            "omega_min_radps": -1.57,
            "omega_max_radps": 1.57,
        },
        "reference": {
            "kind": "spline",
            "points_m": [[x, y], list(world.goal)],
            "speed_mps": source.speed,
            "acceleration_mps2": 1.5,
        },
        "tracking": {
            "k_x_per_s": 1.0,
            "k_y_rad_per_m2": 8.0,
            "k_gamma_radps": 3.0,
            "waiting": True,
        },
        "radius": {"low_m": 0.1, "high_m": 0.1},
        "obstacles": [
            *(
                {
                    "kind": "waypoints",
                    "times_s": (cylinder.times - start).tolist(),
                    "positions_m": cylinder.positions.tolist(),
                    "radius_m": world.radius,
                }
                for cylinder in world.cylinders
            ),
            *(
                {"kind": "wall", "start_m": wall[:2], "end_m": wall[2:]}
                for wall in world.walls.tolist()
            ),
        ],
    }


def motion_measure(world: DynaBarnWorld) -> float:
    """Return the sum of the cylinders' mean speeds, m/s: their number times their pace.

    The world is one whose jumps are reversed, so that all are seen equally long.
    """
    lengths = [
        np.hypot(*np.diff(cylinder.positions, axis=0).T).sum() / cylinder.times[-1]
        for cylinder in world.cylinders
    ]
    return float(np.sum(lengths))
