"""Scenes for tests of sweeps, some of them dangerous; workers import this module."""

import hashlib
import json
import os
import signal
from dataclasses import dataclass
from pathlib import Path

from qpavoid.lab.study.sweep.job import CLOCK

DOCUMENT = {
    "title": "Past a disc",
    "duration_s": 3.0,
    "dt_s": 0.05,
    "reference": {
        "kind": "cubic",
        "start": {"x_m": 0.0, "y_m": 0.0},
        "goal": {"x_m": 2.0, "y_m": 0.5},
        "k_m": 2.0,
        "duration_s": 3.0,
    },
    "obstacles": [
        {
            "kind": "random",
            "count": 3,
            "low_m": [1.0, -1.0],
            "high_m": [3.0, 1.0],
            "speed_high_mps": 0.5,
        }
    ],
}


@dataclass(frozen=True)
class Harmless:
    """Three discs before the robot, other ones for every seed."""

    name: str = "discs"

    def identity(self, data):
        return "discs"

    def sample(self, seed=None):
        return DOCUMENT | {"seed": seed or 0}


@dataclass(frozen=True)
class KillsOnce(Harmless):
    """Harmless scenes, of which number 3 kills the first process that runs it."""

    mark: str = ""

    def sample(self, seed=None):
        if seed == 3 and not Path(self.mark).exists():
            Path(self.mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().sample(seed)


@dataclass(frozen=True)
class KillsAlways(Harmless):
    """Harmless scenes, of which number 3 kills every process that runs it."""

    def sample(self, seed=None):
        if seed == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().sample(seed)


@dataclass(frozen=True)
class Raises(Harmless):
    """Harmless scenes, of which number 3 cannot be made."""

    def sample(self, seed=None):
        if seed == 3:
            raise ValueError("no such scene")
        return super().sample(seed)


def toml(value, inside=False):
    """Text of a document; of what is inside of it, in one line."""
    if not isinstance(value, dict):
        parts = [toml(one, True) for one in value] if isinstance(value, list) else None
        return json.dumps(value) if parts is None else f"[{', '.join(parts)}]"
    lines = [f"{key} = {toml(one, True)}" for key, one in value.items()]
    return "{ " + ", ".join(lines) + " }" if inside else "\n".join(lines)


def table_hash(rows):
    """Return a hash of all that does not depend on the clock."""
    bare = [{k: v for k, v in row.items() if k not in CLOCK} for row in rows]
    return hashlib.sha256(json.dumps(bare, sort_keys=True).encode()).hexdigest()


STUDY = """
title = "Small"
controllers = {controllers}
seeds = "{seeds}"
trajectories = "{keep}"
{settings}
[[scenarios]]
config = "past.toml"
"""


def write_study(folder, seeds, controllers=("eq5", "qp"), keep="none", settings=""):
    """Write a study of :data:`DOCUMENT`, which lies beside it; return its path."""
    (folder / "past.toml").write_text(toml(DOCUMENT))
    told = {"controllers": json.dumps(controllers), "settings": settings}
    (folder / "study.toml").write_text(STUDY.format(seeds=seeds, keep=keep, **told))
    return folder / "study.toml"
