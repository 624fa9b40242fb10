"""The first scenario for a new robot: commented, and ready to run."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from qpavoid.model.robot import Limits
from qpavoid.settings import want

MOST_VALUE = 1e6
"""m, m/s, rad/s or m/s²; no robot is beyond."""

STOPPING = 0.5
"""m in which the robot stops from the speed of its reference."""

WALKING = 0.4
"""m/s of who crosses; of a robot below 1 m/s, as share of its greatest speed."""

TEXT = Path(__file__).with_suffix(".txt")
"""The file, with a place for each number."""


def first_scenario(
    path: Path, corners: Sequence[tuple[float, float]], limits: Limits
) -> str:
    """Return the file; the scene is as large as the robot, and as fast.

    Args:
        path: Of the file.
        corners: Of the footprint, m, counter-clockwise, robot frame.
        limits: v_max, v_min (m/s), ω_max (rad/s), acceleration (m/s²).

    Raises:
        InvalidInputError: A number is not finite, or not below a million, or the robot
            cannot drive forwards.
    """
    numbers = limits.v_max, limits.v_min, limits.omega_max, limits.acceleration
    small = bool((np.abs([*np.ravel(corners), *numbers]) < MOST_VALUE).all())
    want(small, f"footprint and limits must be finite, and below {MOST_VALUE:g}")
    want(limits.v_max > 0.0, f"v_max is above 0, not {limits.v_max:g}")
    x, y = np.ptp(np.asarray(corners), axis=0)
    size = float(max(x, y))
    speed = min(0.7 * limits.v_max, (2.0 * limits.acceleration * STOPPING) ** 0.5)
    pace = min(WALKING, WALKING * limits.v_max)
    length = max(8.0, 8.0 * size)
    time = 3.0 * length / speed + 10.0 + 2.0 * speed / limits.acceleration
    return TEXT.read_text(encoding="utf-8").format(
        title=path.stem.replace("_", " ").replace('"', ""),
        file=path,
        duration=round(time),
        corners=[[float(a), float(b)] for a, b in corners],
        limits=limits,
        half=0.5 * length,
        three=0.75 * length,
        length=length,
        pace=pace,
        speed=float(f"{speed:.3g}"),
        side=0.5 * size,
        far=round(-pace * 0.75 * length / speed - 1.0, 2),
        wall=2.0 + 2.0 * size,
    )
