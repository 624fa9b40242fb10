"""The plants that studies can be run on, and what the filter is told of them.

``kinematic``: twists are driven as they are. ``mujoco``: rigid bodies, of which the
filter knows nothing. ``mujoco-told``: the same, with the settings that serve it.
"""

import argparse
from typing import Any

MUJOCO: dict[str, dict[str, Any]] = {
    base: {"plant.kind": "mujoco", "plant.base": base}
    for base in ("differential", "skid-steer")
}
"""Settings by dotted key, by base."""

TOLD: dict[str, dict[str, Any]] = {
    "differential": {},
    "skid-steer": {},
}
"""What the filter is told of a base."""

PLANTS = "kinematic", "mujoco", "mujoco-told"


def add_plant(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--plant``."""
    parser.add_argument("--plant", choices=PLANTS, default=PLANTS[0])


def changes_of(plant: str, base: str) -> dict[str, Any]:
    """Return the settings of a plant for a base, by dotted key."""
    if plant == "kinematic":
        return {}
    return MUJOCO[base] | (TOLD[base] if plant == "mujoco-told" else {})
