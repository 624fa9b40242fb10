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
    "differential": {
        "robot.acceleration_mps2": 1.8,
        "robot.angular_acceleration_radps2": 2.2,
        "actuation.delay_s": 0.08,
    },
    "skid-steer": {
        "robot.acceleration_mps2": 4.6,
        "robot.angular_acceleration_radps2": 5.0,
        "actuation.delay_s": 0.1,
    },
}
"""What the filter is told of a base: the safe ends of the intervals of ``physics.py``;
of the skid-steered one, whose delay ends at 0.06 s, a period of the LiDAR (1/30 s)
more, since so old is what it sees: without that 2 of 500 runs at 2 m/s touched, in two
training worlds.

``actuation.ramps`` stays off: only braking is trusted then, the proof counts the change
of a step for as long as a stop takes, 0.1 m at 2 m/s, and BARN's gaps close (at 4 m/s²
and 10 rad/s² ``qp-ahead+guide`` passes 22 of 25 training worlds with it, 25 without).
"""

PLANTS = "kinematic", "mujoco", "mujoco-told"


def add_plant(parser: argparse.ArgumentParser) -> None:
    """Add the option ``--plant``."""
    parser.add_argument("--plant", choices=PLANTS, default=PLANTS[0])


def changes_of(plant: str, base: str) -> dict[str, Any]:
    """Return the settings of a plant for a base, by dotted key."""
    if plant == "kinematic":
        return {}
    return MUJOCO[base] | (TOLD[base] if plant == "mujoco-told" else {})
