"""Laser scans of real robots from CARMEN logs, plain or compressed with gzip.

A scan is a line

    FLASER n r_1 … r_n  x y γ  odom_x odom_y odom_γ  time host logger_time

with the laser's pose, corrected in a corrected log, and the odometry. Beam k of
n = 180 or 360 points to −90° + k 180°/n, counter-clockwise; n = 181 or 361 has one beam
more, at +90°. Lines of other messages are passed over.
"""

import gzip
import math
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.types import Array

BEAMS = (180, 181, 360, 361)
"""Numbers of beams whose directions are known; a log does not say them."""

AFTER_RANGES = 9
"""Words of a line behind its ranges."""


class Scan(NamedTuple):
    """One scan.

    Attributes:
        time: s, on the log's clock.
        pose: x, y (m), γ (rad) of the laser, world frame.
        odometry: The same as the wheels tell it.
        ranges: (n,) m; what had no echo is as long as the laser's greatest range.
    """

    time: float
    pose: tuple[float, float, float]
    odometry: tuple[float, float, float]
    ranges: Array

    def points(self, farthest: float = 80.0) -> Array:
        """Return the echoes nearer than ``farthest`` (m) as points, laser frame."""
        angles = beam_angles(len(self.ranges))
        points = self.ranges[:, None] * np.column_stack(
            [np.cos(angles), np.sin(angles)]
        )
        return np.asarray(points[self.ranges < farthest])


def beam_angles(beams: int) -> Array:
    """Return the (n,) directions of the beams in rad, 0 straight ahead."""
    return np.asarray(-math.pi / 2 + math.pi / (beams // 2 * 2) * np.arange(beams))


def read_scans(path: str | os.PathLike[str]) -> Iterator[Scan]:
    """Yield the scans of a ``.log`` or ``.log.gz``, one at a time.

    Raises:
        DataError: The file is missing, ends early, holds no scan, or a line is damaged;
            the message names the line.
    """
    found, number = False, 0
    try:
        for number, line in enumerate(_lines(Path(path)), start=1):
            if line.startswith("FLASER"):
                found = True
                yield _scan(f"{path}:{number}", line)
    except (OSError, EOFError, UnicodeDecodeError, zlib.error) as error:
        where = f"{path}:{number + 1}" if number else f"{path}"
        raise DataError(f"{where}: not readable from here on ({error})") from None
    if not found:
        raise DataError(f"{path}: holds no FLASER line")


def _lines(path: Path) -> Iterator[str]:
    opened = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rt", encoding="utf-8") as file:
        yield from file


def _scan(where: str, line: str) -> Scan:
    words = line.split()
    try:
        beams = int(words[1])
        if beams not in BEAMS:
            raise DataError(f"{where}: {beams} beams, where {BEAMS} are known")
        if len(words) != 2 + beams + AFTER_RANGES:
            raise DataError(
                f"{where}: {len(words)} words, where a scan of {beams} beams has "
                f"{2 + beams + AFTER_RANGES}"
            )
        ranges = np.array(words[2 : 2 + beams], dtype=np.float64)
        x, y, heading, *odometry, time = map(float, words[2 + beams : 9 + beams])
    except (ValueError, IndexError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{where}: a damaged FLASER line ({error})") from None
    numbers = (x, y, heading, *odometry, time)
    if not (np.isfinite(ranges).all() and all(map(math.isfinite, numbers))):
        raise DataError(f"{where}: a number is not finite")
    if (ranges < 0).any():
        raise DataError(f"{where}: a range is negative")
    odom_x, odom_y, odom_heading = odometry
    return Scan(time, (x, y, heading), (odom_x, odom_y, odom_heading), ranges)
