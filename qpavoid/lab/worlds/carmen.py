"""Laser scans of real robots from CARMEN logs, plain or compressed with gzip.

A scan is a line

    FLASER n r_1 … r_n  x y γ  odom_x odom_y odom_γ  time host logger_time
    ROBOTLASER1 type start fov step max accuracy mode n r_1 … r_n m i_1 … i_m
        x y γ  robot_x robot_y robot_γ  tv rv front side turn  time host logger_time

with the laser's pose, corrected in a corrected log. Beam k of FLASER's n = 180 or 360
points to −90° + k 180°/n, counter-clockwise; n = 181 or 361 has one beam more, at +90°;
for other numbers the field of view has to be given. Beams of ROBOTLASER1 point to start
+ k step. Other messages are ignored.
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
"""Numbers of beams of known directions; FLASER has no field of view."""

MESSAGES = {"FLASER": (1, 9), "ROBOTLASER1": (8, 14)}
"""Index of the number of beams in a line, and number of words after its echoes."""

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
        ranges: (n,) m; without an echo :data:`LARGEST`, FLASER's as logged.
        angles: (n,) directions of the beams, rad, 0 straight ahead.
    """

    time: float
    pose: tuple[float, float, float]
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


def beam_angles(beams: int, view: float | None = None) -> Array:
    """Return the (n,) directions of the beams in rad, 0 straight ahead.

    ``view``: from the first to the last; default that of a SICK with as many.
    """
    if view is not None:
        return np.linspace(-0.5 * view, 0.5 * view, beams)
    return np.asarray(-math.pi / 2 + math.pi / (beams // 2 * 2) * np.arange(beams))


def read_scans(
    path: str | os.PathLike[str], message: str = "FLASER", view: float | None = None
) -> Iterator[Scan]:
    """Yield the scans of a ``.log`` or ``.log.gz``, one at a time.

    Args:
        path: The log.
        message: Name of its scans, one of :data:`MESSAGES`.
        view: From FLASER's first beam to its last, rad; default a SICK's.

    Raises:
        DataError: The file is missing, ends early, holds no scan, or a line is damaged;
            the message names the line.
    """
    number, lines, found = 0, read_lines(path), False
    while True:
        number += 1
        from_here = f"{path}:{number}", "not readable from here on"
        with reading(*from_here) if number > 1 else reading(path):
            line = next(lines, "")
        if not line:
            break
        if line.split(maxsplit=1)[:1] == [message]:
            found = True
            yield _scan(f"{path}:{number}", line, view)
    if not found:
        raise DataError(f"{path}: holds no {message} line")


def _check(where: str, numbers: Sequence[float], time: float) -> None:
    if not np.isfinite([*numbers, time]).all():
        raise DataError(f"{where}: a number is not finite")
    if max(map(abs, numbers)) > LARGEST or not 0.0 <= time < LATEST:
        raise DataError(f"{where}: a number is beyond what a robot drives")


def _scan(where: str, line: str, view: float | None = None) -> Scan:
    words = line.split()
    message, (at, after) = words[0], MESSAGES[words[0]]
    plain = message == "FLASER"
    try:
        beams = int(words[at])
        if beams < 2:
            raise DataError(f"{where}: {beams} beams are no scan")
        if plain and view is None and beams not in BEAMS:
            told = (
                f"{beams} beams, where {BEAMS} are known: what do they span (--view)?"
            )
            raise DataError(f"{where}: {told}")
        echoes = 0 if plain else 1 + max(int(words[at + 1 + beams]), 0)
        wanted = at + 1 + beams + after + echoes
        if len(words) != wanted:
            told = f"{len(words)} words, where a scan of {beams} beams has {wanted}"
            raise DataError(f"{where}: {told}")
        ranges = np.array(words[at + 1 : at + 1 + beams], dtype=np.float64)
        most = math.inf if plain else float(words[5])
        poses = [*map(float, words[-after:][:6])]
        start, step, time = map(float, (words[2], words[4], words[-3]))
    except (ValueError, IndexError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{where}: a damaged {message} line ({error})") from None
    _check(where, [*ranges, *poses, start, step], time)
    if (ranges < 0).any():
        raise DataError(f"{where}: a range is negative")
    if most > 0.0:  # without an echo a range is the laser's greatest
        ranges[ranges >= most] = LARGEST
    if not plain and not 0.0 < abs(step) * (beams - 1) <= 2.0 * math.tau:
        raise DataError(f"{where}: {beams} beams {step:g} rad apart are no scan")
    angles = beam_angles(beams, view) if plain else start + step * np.arange(beams)
    x, y, heading, *_ = poses
    return Scan(time, (x, y, heading), ranges, np.asarray(angles))


def twist_between(start: Pose, end: Pose, dt: float) -> tuple[float, float]:
    """Return the twist whose arc has the chord and turn of a motion.

    A lateral part of the motion, which the robot cannot drive, is left out.
    """
    turn = wrap_angle(end[2] - start[2])
    middle = start[2] + 0.5 * turn
    chord = (end[0] - start[0]) * np.cos(middle) + (end[1] - start[1]) * np.sin(middle)
    return float(chord / np.sinc(turn / (2.0 * np.pi)) / dt), turn / dt


def in_order(scans: Sequence[Scan], where: str = "") -> list[Scan]:
    """Return scans without those that are not later than all before.

    ``where`` begins the error messages.

    Raises:
        DataError: There are fewer than two, or many are left out.
    """
    latest, kept = -math.inf, []
    for scan in scans:
        if scan.time > latest:
            kept.append(scan)
            latest = scan.time
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
