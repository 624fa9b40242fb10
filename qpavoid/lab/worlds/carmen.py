"""Laser scans of real robots from CARMEN logs, plain or compressed with gzip.

A scan is a line

    FLASER n r_1 … r_n  x y γ  odom_x odom_y odom_γ  time host logger_time
    ROBOTLASER1 type start fov step max accuracy mode n r_1 … r_n m i_1 … i_m
        x y γ  robot_x robot_y robot_γ  tv rv front side turn  time host logger_time

with the laser's pose, corrected in a corrected log, and the odometry. Beam k of
FLASER's n = 180 or 360 points to −90° + k 180°/n, counter-clockwise; n = 181 or 361 has
one beam more, at +90°; one of ROBOTLASER1 to start + k step. Lines of other messages
are passed over.
"""

import math
import os
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.files import read_lines, reading
from qpavoid.model.kinematics import wrap_angle
from qpavoid.types import Array, Pose

BEAMS = (180, 181, 360, 361)
"""Numbers of beams whose directions are known; FLASER does not say them."""

MESSAGES = {"FLASER": (1, 9), "ROBOTLASER1": (8, 14)}
"""Where the number of beams stands in a line, and how many words follow its echoes."""


SLOWEST = 1.0
"""s; a twist that is held for longer says nothing of a filter."""


class Scan(NamedTuple):
    """One scan.

    Attributes:
        time: s, on the log's clock.
        pose: x, y (m), γ (rad) of the laser, world frame.
        odometry: The same as the wheels tell it; of ROBOTLASER1 the robot's pose.
        ranges: (n,) m; what had no echo is as long as the laser's greatest range.
        angles: (n,) directions of the beams, rad, 0 straight ahead.
    """

    time: float
    pose: tuple[float, float, float]
    odometry: tuple[float, float, float]
    ranges: Array
    angles: Array

    def points(self, farthest: float = 80.0) -> Array:
        """Return the echoes nearer than ``farthest`` (m) as points, laser frame.

        A range of 0 is no echo.
        """
        points = self.ranges[:, None] * np.column_stack(
            [np.cos(self.angles), np.sin(self.angles)]
        )
        return np.asarray(points[(self.ranges > 0.0) & (self.ranges < farthest)])


def beam_angles(beams: int) -> Array:
    """Return the (n,) directions of the beams in rad, 0 straight ahead."""
    return np.asarray(-math.pi / 2 + math.pi / (beams // 2 * 2) * np.arange(beams))


def read_scans(path: str | os.PathLike[str], message: str = "FLASER") -> Iterator[Scan]:
    """Yield the scans of a ``.log`` or ``.log.gz``, one at a time.

    Args:
        path: The log.
        message: What its scans are called, one of :data:`MESSAGES`.

    Raises:
        DataError: The file is missing, ends early, holds no scan, or a line is damaged;
            the message names the line.
    """
    found, number, lines = False, 0, read_lines(path)
    while True:
        number += 1
        from_here = f"{path}:{number}", "not readable from here on"
        with reading(*from_here) if number > 1 else reading(path):
            line = next(lines, "")
        if not line:
            break
        if line.split(maxsplit=1)[:1] == [message]:
            found = True
            yield _scan(f"{path}:{number}", line)
    if not found:
        raise DataError(f"{path}: holds no {message} line")


def _scan(where: str, line: str) -> Scan:
    words = line.split()
    message, (at, after) = words[0], MESSAGES[words[0]]
    plain = message == "FLASER"
    try:
        beams = int(words[at])
        if beams < 2:
            raise DataError(f"{where}: {beams} beams are no scan")
        if plain and beams not in BEAMS:
            raise DataError(f"{where}: {beams} beams, where {BEAMS} are known")
        rest = words[at + 1 + beams :]
        wanted = at + 1 + beams + after + (0 if plain else 1 + int(rest[0]))
        if len(words) != wanted:
            told = f"{len(words)} words, where a scan of {beams} beams has {wanted}"
            raise DataError(f"{where}: {told}")
        ranges = np.array(words[at + 1 : at + 1 + beams], dtype=np.float64)
        x, y, heading, *odometry = map(float, words[-after:][:6])
        start, step, time = map(float, (words[2], words[4], words[-3]))
    except (ValueError, IndexError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{where}: a damaged {message} line ({error})") from None
    angles = beam_angles(beams) if plain else start + step * np.arange(beams)
    numbers = (x, y, heading, *odometry, time, start, step)
    if not (np.isfinite(ranges).all() and all(map(math.isfinite, numbers))):
        raise DataError(f"{where}: a number is not finite")
    if (ranges < 0).any():
        raise DataError(f"{where}: a range is negative")
    odom_x, odom_y, odom_heading = odometry
    odometer = odom_x, odom_y, odom_heading
    return Scan(time, (x, y, heading), odometer, ranges, np.asarray(angles))


def twist_between(start: Pose, end: Pose, dt: float) -> tuple[float, float]:
    """Return the twist whose arc turns as far as the robot did, and has its chord.

    A sideways part of the motion, which the robot cannot drive, is left out.
    """
    turn = wrap_angle(end[2] - start[2])
    middle = start[2] + 0.5 * turn
    chord = (end[0] - start[0]) * np.cos(middle) + (end[1] - start[1]) * np.sin(middle)
    return float(chord / np.sinc(turn / (2.0 * np.pi)) / dt), turn / dt


def in_order(scans: Sequence[Scan]) -> list[Scan]:
    """Return scans without those that are not later than all before.

    Raises:
        DataError: There are fewer than two.
    """
    latest, kept = -math.inf, []
    for scan in scans:
        if scan.time > latest:
            kept.append(scan)
            latest = scan.time
    if len(kept) < 2:
        raise DataError("a replay wants two scans or more, one after the other")
    return kept


def hold_time(times: Sequence[float]) -> float:
    """Return the median time between scans or commands, s.

    Raises:
        DataError: It is too long for a control step.
    """
    dt = float(np.median(np.diff(times)))
    if dt > SLOWEST:
        raise DataError(f"{dt:.3g} s apart: say with --dt how long a twist holds")
    return dt
