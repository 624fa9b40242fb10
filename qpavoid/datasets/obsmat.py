"""Pedestrian tracks as ``obsmat.txt``: ETH [Pellegrini2009] and UCY [Lerner2007].

A line holds frame, id, x, z, y, v_x, v_z, v_y in metres: the height z stands between x
and y. Samples are 0.4 s apart: 6 frames in seq_eth (15 a second), 10 in seq_hotel and
the UCY sets (25 a second).
"""

import math
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.model.footprint import Array

SET_FPS = {"seq_eth": 15.0, "seq_hotel": 25.0, "zara01": 25.0}
"""Frames a second of the published sets, by the folder of their ``obsmat.txt``."""


class Pedestrian(NamedTuple):
    """One person's way.

    Attributes:
        number: The id in the file.
        times: (n,) s, increasing; all tracks of a file have the same clock.
        positions: (n, 2) m.
    """

    number: int
    times: Array
    positions: Array


def read_tracks(path: str | os.PathLike[str], fps: float) -> list[Pedestrian]:
    """Return the tracks of a file, by ascending id, each sorted by time.

    Args:
        path: The ``obsmat.txt``.
        fps: Frames a second of the recording; see :data:`SET_FPS`.

    Raises:
        DataError: The file is missing or empty, or a line is damaged, not finite or
            repeats the frame of an id; the message names the line.
    """
    if not (math.isfinite(fps) and fps > 0):
        raise DataError(f"frames a second must be positive, not {fps}")
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not a readable track file ({error})") from None
    samples: dict[int, dict[float, tuple[float, float]]] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        frame, who, x, y = _sample(f"{path}:{number}", line)
        track = samples.setdefault(who, {})
        if frame in track:
            raise DataError(f"{path}:{number}: id {who} is at frame {frame:g} twice")
        track[frame] = x, y
    if not samples:
        raise DataError(f"{path}: holds no track")
    return [
        Pedestrian(
            who,
            np.array(sorted(track)) / fps,
            np.array([track[frame] for frame in sorted(track)]),
        )
        for who, track in sorted(samples.items())
    ]


def _sample(where: str, line: str) -> tuple[float, int, float, float]:
    """Return frame, id, x and y of a line."""
    try:
        numbers = [float(word) for word in line.split()]
    except ValueError as error:
        raise DataError(f"{where}: {error}") from None
    if len(numbers) != 8:
        raise DataError(f"{where}: 8 columns are wanted, not {len(numbers)}")
    frame, who, x, _, y, *_ = numbers
    if not all(map(math.isfinite, (frame, who, x, y))):
        raise DataError(f"{where}: a number is not finite")
    if who % 1:
        raise DataError(f"{where}: the id {who:g} is not a whole number")
    return frame, int(who), x, y
