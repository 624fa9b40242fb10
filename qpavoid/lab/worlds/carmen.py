"""Laser scans of real robots from CARMEN logs, plain or compressed with gzip.

A scan is a line

    FLASER n r_1 … r_n  x y γ  odom_x odom_y odom_γ  time host logger_time
    ROBOTLASER1 type start fov step max accuracy mode n r_1 … r_n m i_1 … i_m
        x y γ  robot_x robot_y robot_γ  tv rv front side turn  time host logger_time
    RAWLASER1 type start fov step max accuracy mode n r_1 … r_n m i_1 … i_m
        time host logger_time

with the laser's pose, corrected in a corrected log, and the odometry. RAWLASER1 has
neither: where the robot was is between the two lines

    ODOM x y γ tv rv acceleration  time host logger_time

about its time: on the chord between them, a second apart at most. Beam k of FLASER's
n = 180 or 360 points to −90° + k 180°/n, counter-clockwise; n = 181 or 361 has one beam
more, at +90°; what other numbers span has to be told. Beams of the others point to
start + k step. Other messages are passed over.
"""

import math
import os
import warnings
from collections.abc import Iterator, Sequence
from itertools import compress, pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from qpavoid.errors import DataError
from qpavoid.files import read_lines, reading
from qpavoid.model.kinematics import to_world, wrap_angle
from qpavoid.types import Array, Pose

BEAMS = (180, 181, 360, 361)
"""Numbers of beams whose directions are known; FLASER does not say what they span."""

RAW = "RAWLASER1"

MESSAGES = {"FLASER": (1, 9), "ROBOTLASER1": (8, 14), RAW: (8, 3)}
"""Where the number of beams stands in a line, and how many words follow its echoes."""

ODOM_WORDS, LOST = 10, " between two ODOM lines, 1 s apart at most"

LONGEST_HOLD = 1.0
"""s; a twist that is held for longer says nothing of a filter."""

LARGEST, LATEST, LONGEST_ROBOT = 1e7, 2.0**31, 20.0
"""m, s, and m of a robot; what is beyond is damaged, or of another unit."""

LOST_SHARE, FEW_LOST = 0.05, 3
"""Of the scans, or of few: the most without a pose, or not later than all before."""


class Scan(NamedTuple):
    """One scan.

    Attributes:
        time: s, on the log's clock.
        pose: x, y (m), γ (rad) of the laser, world frame.
        odometry: The same as the wheels tell it; the robot's, but for FLASER.
        ranges: (n,) m; what had no echo is :data:`LARGEST` off, FLASER's as logged.
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


def beam_angles(beams: int, view: float | None = None) -> Array:
    """Return the (n,) directions of the beams in rad, 0 straight ahead.

    ``view``: from the first to the last; that of a SICK with so many if not given.
    """
    if view is not None:
        return np.linspace(-0.5 * view, 0.5 * view, beams)
    return np.asarray(-math.pi / 2 + math.pi / (beams // 2 * 2) * np.arange(beams))


def read_scans(
    path: str | os.PathLike[str],
    message: str = "FLASER",
    laser: float = 0.0,
    view: float | None = None,
) -> Iterator[Scan]:
    """Yield the scans of a ``.log`` or ``.log.gz``, one at a time.

    Args:
        path: The log.
        message: What its scans are called, one of :data:`MESSAGES`. The log of
            RAWLASER1 is read as a whole first, and scans that are not between two lines
            of odometry, at most a second apart, are left out if they are few, and a
            warning says how many.
        laser: How far it is ahead of the axle, m, of which RAWLASER1 says nothing.
        view: From FLASER's first beam to its last, rad; a SICK's if not given.

    Raises:
        DataError: The file is missing, ends early, holds no scan, or a line is damaged;
            the message names the line. More than 5 % of the scans have no pose.
    """
    raw = message == RAW
    plain = (_scan(*line, view) for line in _lines(path, message))
    scans = _placed(path, laser) if raw else plain
    first = next(scans, None)
    if first is None:
        raise DataError(f"{path}: holds no {message} line{LOST * raw}")
    yield first
    yield from scans


def _lines(path: str | os.PathLike[str], *messages: str) -> Iterator[tuple[str, str]]:
    """Yield where a line stands, and the line, of some messages."""
    number, lines = 0, read_lines(path)
    while True:
        number += 1
        from_here = f"{path}:{number}", "not readable from here on"
        with reading(*from_here) if number > 1 else reading(path):
            line = next(lines, "")
        if not line:
            return
        if _name(line) in messages:
            yield f"{path}:{number}", line


def _name(line: str) -> str:
    return "".join(line.split(maxsplit=1)[:1])


def _placed(path: str | os.PathLike[str], laser: float) -> Iterator[Scan]:
    """Yield scans of RAWLASER1 with the poses that odometry has at their times."""
    found = [*_lines(path, RAW, "ODOM")]
    told = [(line[0], _odometer(*line)) for line in found if _name(line[1]) == "ODOM"]
    scans = [_scan(*line) for line in found if _name(line[1]) == RAW]
    for (_, before), (where, here) in pairwise(told):
        if here[0] < before[0] - LONGEST_HOLD:
            raise DataError(f"{where}: {before[0] - here[0]:g} s before the ODOM above")
    poses = sorted((pose for _, pose in told), key=itemgetter(0))
    times, x, y, heading = np.reshape(poses, (-1, 4)).T
    way = x, y, np.unwrap(heading)
    at = np.array([scan.time for scan in scans])
    apart = np.diff(times, prepend=-np.inf, append=np.inf)[np.searchsorted(times, at)]
    known = (apart <= LONGEST_HOLD) | np.isin(at, times)
    lost = int((~known).sum())
    _check_lost(f"{path}: ", lost, len(scans), f"are not{LOST}")
    if 0 < lost < len(scans):
        warnings.warn(f"{path}: {lost} scans left out: not{LOST}", stacklevel=3)
    for scan in compress(scans, known):
        east, north, turned = (float(np.interp(scan.time, times, of)) for of in way)
        robot = east, north, wrap_angle(turned)
        place_x, place_y = to_world(np.array([[laser, 0.0]]), robot)[0].tolist()
        yield scan._replace(pose=(place_x, place_y, robot[2]), odometry=robot)


def _odometer(where: str, line: str) -> list[float]:
    """Return t, x, y, γ."""
    words = line.split()
    if len(words) != ODOM_WORDS:
        raise DataError(f"{where}: {len(words)} words, where ODOM has {ODOM_WORDS}")
    try:
        *numbers, time = map(float, words[1:8])
    except ValueError as error:
        raise DataError(f"{where}: a damaged ODOM line ({error})") from None
    _check(where, numbers, time)
    return [time, *numbers[:3]]


def _check(where: str, numbers: Sequence[float], time: float) -> None:
    if not np.isfinite([*numbers, time]).all():
        raise DataError(f"{where}: a number is not finite")
    if max(map(abs, numbers)) > LARGEST or not 0.0 <= time < LATEST:
        raise DataError(f"{where}: a number is beyond what a robot drives")


def _check_lost(where: str, lost: int, scans: int, why: str) -> None:
    if lost > max(LOST_SHARE * scans, FEW_LOST):
        told = f"{where}{lost} of {scans} scans {why}"
        raise DataError(f"{told}: is a time wrong, or are these two drives?")


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
        poses = [0.0] * 6 if message == RAW else [*map(float, words[-after:][:6])]
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
    x, y, heading, odom_x, odom_y, odom_heading = poses
    odometry = odom_x, odom_y, odom_heading
    return Scan(time, (x, y, heading), odometry, ranges, np.asarray(angles))


def twist_between(start: Pose, end: Pose, dt: float) -> tuple[float, float]:
    """Return the twist whose arc turns as far as the robot did, and has its chord.

    A sideways part of the motion, which the robot cannot drive, is left out.
    """
    turn = wrap_angle(end[2] - start[2])
    middle = start[2] + 0.5 * turn
    chord = (end[0] - start[0]) * np.cos(middle) + (end[1] - start[1]) * np.sin(middle)
    return float(chord / np.sinc(turn / (2.0 * np.pi)) / dt), turn / dt


def in_order(scans: Sequence[Scan], where: str = "") -> list[Scan]:
    """Return scans without those that are not later than all before.

    ``where`` is what errors begin with.

    Raises:
        DataError: There are fewer than two, or many are left out.
    """
    latest, kept = -math.inf, []
    for scan in scans:
        if scan.time > latest:
            kept.append(scan)
            latest = scan.time
    lost = len(scans) - len(kept)
    _check_lost(where, lost, len(scans), "are not later than all before")
    if len(kept) < 2:
        raise DataError(f"{where}a replay needs two scans or more, one after the other")
    return kept


def hold_time(times: Sequence[float], where: str = "") -> float:
    """Return the median time between scans or commands, s.

    ``where`` is what errors begin with.

    Raises:
        DataError: It is too long for a control step.
    """
    dt = float(np.median(np.diff(times)))
    if dt > LONGEST_HOLD:
        raise DataError(f"{where}{dt:.3g} s apart: no step is so long")
    return dt
