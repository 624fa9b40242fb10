"""Laser scans of real robots from CARMEN logs, plain or compressed with gzip.

A scan is a line

    FLASER n r_1 … r_n  x y γ  odom_x odom_y odom_γ  time host logger_time

with the laser's pose, corrected in a corrected log. Beam k of n = 180 or 360 points to
−90° + k 180°/n, counter-clockwise; n = 181 or 361 has one beam more, at +90°. Other
messages are ignored.
"""

import math
import os
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.files import read_lines, reading
from qpavoid.types import Array

BEAMS = (180, 181, 360, 361)
"""Numbers of beams of known directions; FLASER has no field of view."""

OTHER_WORDS = 11
"""Words of a line beside its ranges: name, number of beams, and 9 after them."""

NO_ECHO = 80.0
"""m; least range that counts as no echo."""

LONGEST_HOLD = 1.0
"""s; greatest time that a twist is held in a replay."""

LARGEST, LATEST, LONGEST_ROBOT = 1e7, 2.0**31, 20.0
"""m, s, and m of a robot; larger values are damaged, or of another unit."""

LOST_SHARE, FEW_LOST = 0.05, 3
"""Greatest share of scans, or number of few, that are not later than all before."""


class Scan(NamedTuple):
    """One scan.

    Attributes:
        time: s, on the log's clock.
        pose: x, y (m), γ (rad) of the laser, world frame.
        ranges: (n,) m, as logged.
        angles: (n,) directions of the beams, rad, 0 straight ahead.
    """

    time: float
    pose: tuple[float, float, float]
    ranges: Array
    angles: Array

    def points(self) -> Array:
        """Return the echoes nearer than :data:`NO_ECHO` as points, laser frame.

        A range of 0 is no echo.
        """
        points = self.ranges[:, None] * np.column_stack(
            [np.cos(self.angles), np.sin(self.angles)]
        )
        return np.asarray(points[(self.ranges > 0.0) & (self.ranges < NO_ECHO)])


def beam_angles(beams: int) -> Array:
    """Return the (n,) directions of the beams in rad, 0 straight ahead."""
    return np.asarray(-math.pi / 2 + math.pi / (beams // 2 * 2) * np.arange(beams))


def read_scans(path: str | os.PathLike[str]) -> Iterator[Scan]:
    """Yield the scans of a ``.log`` or ``.log.gz``, one at a time.

    Raises:
        DataError: The file is missing, ends early, holds no scan, or a line is damaged;
            the message names the line.
    """
    number, found = 0, False
    with reading(path):
        for number, line in enumerate(read_lines(path), start=1):
            if line.split(maxsplit=1)[:1] == ["FLASER"]:
                found = True
                yield _scan(f"{path}:{number}", line)
    if not found:
        raise DataError(f"{path}: holds no FLASER line")


def _scan(where: str, line: str) -> Scan:
    words = line.split()
    with reading(where, "a damaged FLASER line"):
        beams = int(words[1])
        if beams not in BEAMS or len(words) != beams + OTHER_WORDS:
            raise DataError(f"{where}: {len(words)} words of {beams} beams")
        numbers = np.array([*words[2:-3], words[-3]], dtype=np.float64)
        if not (np.abs(numbers[:-1]) <= LARGEST).all() or (numbers[:beams] < 0.0).any():
            raise DataError(f"{where}: a number is not finite, negative or too large")
        if not 0.0 <= numbers[-1] < LATEST:
            raise DataError(f"{where}: the time is {words[-3]} s")
    x, y, heading = numbers[beams : beams + 3].tolist()
    return Scan(
        float(numbers[-1]), (x, y, heading), numbers[:beams], beam_angles(beams)
    )


def in_order(scans: Sequence[Scan], where: str = "") -> list[Scan]:
    """Return scans without those that are not later than all before.

    ``where`` begins the error messages.

    Raises:
        DataError: There are fewer than two, or many are left out.
    """
    times = np.array([scan.time for scan in scans])
    before = np.maximum.accumulate(np.concatenate([[-math.inf], times]))[:-1]
    kept = [scans[k] for k in np.flatnonzero(times > before).tolist()]
    lost = len(scans) - len(kept)
    if lost > max(LOST_SHARE * len(scans), FEW_LOST):
        told = f"{lost} of {len(scans)} scans are not later than all before"
        raise DataError(f"{where}{told}: is a time wrong, or are these two drives?")
    if len(kept) < 2:
        raise DataError(f"{where}a replay needs two scans or more, one after the other")
    return kept


def hold_time(times: Sequence[float], where: str = "") -> float:
    """Return the median time between scans or commands, s.

    ``where`` begins the error messages.

    Raises:
        DataError: It is too long for a control step.
    """
    dt = float(np.median(np.diff(times)))
    if dt > LONGEST_HOLD:
        raise DataError(f"{where}{dt:.3g} s apart: no step is so long")
    return dt
