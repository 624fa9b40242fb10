"""Mount and timing of a LiDAR, fitted to a recording by the thickness of its walls.

A beam is taken at stamp − delay + |sweep|/2 + sweep · (share − 1/2), share 0 to 1 from
the first to the last. Odometry and mount put its echo into the odometry frame. A
residual is the distance of two echoes of different scans along the normal of their
wall; least squares (soft L1) over x, y, yaw, delay and sweep. Intervals are of 95 %:
the covariance is that of sums of scores over blocks of time, a pair in both of its
blocks [Liang1986]; none is narrower than an unseen thickness of :data:`UNSEEN` allows.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.lab.study.bags import Event, found_topics, read_bag, topic_of
from qpavoid.lab.study.identify import Estimate
from qpavoid.perception.scan import CHORD, FLAT, MOST_CHORD
from qpavoid.perception.settings import MOUNT, Lidar
from qpavoid.ros.messages import read_pose, read_scan, seconds
from qpavoid.settings import want
from qpavoid.types import Array

EXCITED = {
    "x": (0.05, "m", "turns of 90° or more"),
    "y": (0.05, "m", "turns of 90° or more"),
    "yaw": (0.03, "rad", "ways of 1 m or more"),
    "delay": (0.02, "s", "quick turns to both sides"),
    "sweep": (0.025, "s", "quick turns to both sides"),
}
"""Greatest half width of each parameter's interval, unit, motion that excites it."""

TIMES, CELL, YAW, FEWER = (-0.08, 0.0, 0.08), 0.1, 0.1, 20_000
"""Search for a start: s of the middles of scans and of sweeps, m of a cell, rad of a
step, number of echoes."""

PARTNERS, SPARED, SPAN = 8, 0.3, 5.0
"""Scans with which each is compared; least and greatest time between them, s."""

GATES, COSINE, SOFT = (0.6, 0.4, 0.3, 0.2, 0.15, 0.15), 0.9, 0.03
"""m between a pair, by iteration; least cosine of its normals; m from which on
residuals count less."""

STEPS = np.array([5e-3, 5e-3, 2e-3, 2e-3, 2e-3])
BOUNDS = np.array([5.0, 5.0, 10.0, 0.5, 0.5])
"""m, rad, s: of finite differences; largest parameters."""

LEAST_PAIRS, BLOCK_LENGTH, LEAST_BLOCKS, UNSEEN = 1000, 2.0, 8, 0.003
"""Pairs; s of a block; blocks of a recording; m of thickness."""


class Recording(NamedTuple):
    """Scans of a LiDAR, and poses of its robot.

    Attributes:
        stamps: (n,) s.
        ranges: (n, beams) m, as recorded, from right to left.
        first: Angle of the first beam, rad.
        step: Angle between neighbouring beams, rad, > 0.
        limits: Least and greatest range, m.
        poses: (m, 4) time (s), x, y (m), heading (rad, continuous).
        frame: Of the scans.
    """

    stamps: Array
    ranges: Array
    first: float
    step: float
    limits: tuple[float, float]
    poses: Array
    frame: str = ""

    def pose_at(self, times: Array) -> Array:
        """Return poses (n, 3) at times (n,), linear between those recorded."""
        known, *columns = self.poses.T
        return np.column_stack([np.interp(times, known, one) for one in columns])

    def lidar(self, parameters: Sequence[float] = (0.0,) * 5, **given: Any) -> Lidar:
        """Return the LiDAR with x, y, yaw, delay and sweep."""
        x, y, yaw, delay, sweep = (round(float(one), 4) for one in parameters)
        wide = self.step * (self.ranges.shape[1] - 1)
        wide = 2.0 * math.pi if wide > 2.0 * math.pi - 1.5 * self.step else wide
        mount = (x, y, round(yaw + self.first + 0.5 * wide, 4))
        near, far = (round(limit, 3) for limit in self.limits)
        return Lidar(wide, mount, far, near, sweep, delay, **given)


def poses_of(events: Sequence[Event], topic: str) -> Array:
    """Return (n, 4) time (s), x, y (m), heading (rad, continuous) of messages."""
    found = {
        seconds(one.header.stamp): read_pose(getattr(one.pose, "pose", one.pose))
        for one in (event.message for event in events if event.topic == topic)
    }
    rows = np.array([(time, *found[time]) for time in sorted(found)]).reshape(-1, 4)
    rows[:, 3] = np.unwrap(rows[:, 3])
    return rows


def scans_of(events: Sequence[Event], topic: str, poses: Array) -> Recording:
    """Return the scans of a topic; InvalidInputError: their beams differ."""
    scans = [event.message for event in events if event.topic == topic]
    stamps, rows = np.unique([seconds(one.header.stamp) for one in scans], True)
    counts = {len(one.ranges) for one in scans}
    want(len(counts) == 1 < max(counts), f"{topic}: no scans, or of unlike beams")
    ranges = np.array([scans[k].ranges for k in rows], dtype=np.float64)
    one, fan = scans[0], read_scan(scans[0]).fan
    first, step = (fan.first, fan.step) if fan else (0.0, 0.0)
    if step < 0.0:
        ranges, first = ranges[:, ::-1], first + step * (len(ranges[0]) - 1)
    known = stamps, ranges, first, abs(step)
    return Recording(*known, (one.range_min, one.range_max), poses, one.header.frame_id)


def read_recording(path: Path, scan: str = "", odometry: str = "") -> Recording:
    """Return scans and poses of a bag.

    Args:
        path: As :func:`qpavoid.lab.study.bags.bag_drive` takes it.
        scan: Topic; empty: the first LaserScan.
        odometry: Topic of Odometry or PoseStamped; empty: the first Odometry.

    Raises:
        QPAvoidError: It cannot be read, or lacks a topic.
    """

    def choose(held: dict[str, str]) -> dict[str, str]:
        found = found_topics(held)
        seen = topic_of(scan or next(iter(found.scans), "scan"), held)
        poses = topic_of(odometry or found.odometry or "odometry", held)
        return {seen: "scan", poses: "odometry"}

    _, events = read_bag(path, choose)
    return scans_of(events, "scan", poses_of(events, "odometry"))


class Echoes:
    """Echoes of walls, and their pairs; places are complex numbers, m.

    Attributes:
        recording: Scans and poses.
        scan: (n,) Number of the scan of each.
        share: (n,) 0 to 1 from the first to the last beam.
        places: (n,) Sensor frame.
        normals: (n,) Unit vectors across the wall.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording, (near, far) = recording, recording.limits
        seen = (recording.ranges < far) & (recording.ranges > max(near, 0.0))
        ranges = np.where(seen, recording.ranges, math.nan)
        row, beam = np.ogrid[: ranges.shape[0], : ranges.shape[1]]
        places = ranges * np.exp(1j * (recording.first + recording.step * beam))
        space = np.where(seen, np.maximum(ranges * recording.step, 1e-3), CHORD)
        wide = np.clip(np.ceil(CHORD / space), 1, MOST_CHORD).astype(int)
        low, high = beam - wide, beam + wide
        a, b = places[row, low.clip(0)], places[row, high.clip(max=beam[0, -1])]
        size = np.maximum(np.abs(b - a), 1e-9)
        normals = 1j * (b - a) * (1.0 / size)
        wall = (low >= 0) & (high <= beam[0, -1]) & (size < 4.0 * CHORD)
        wall &= np.abs(along(places - 0.5 * (a + b), normals)) < FLAT
        self.scan, number = np.nonzero(wall)
        self.share = number / beam[0, -1]
        self.places, self.normals = places[wall], normals[wall]

    def placed(self, given: Array, rows: Any = slice(None)) -> tuple[Any, Any]:
        """Return places and normals of rows, odometry frame.

        ``given`` is x, y, yaw, s from the stamp to the middle of the scan, sweep.
        """
        after = given[3] + given[4] * (self.share[rows] - 0.5)
        times = self.recording.stamps[self.scan[rows]] + after
        x, y, heading = self.recording.pose_at(times).T
        robot, sensor = np.exp(1j * heading), np.exp(1j * given[2])
        places = given[0] + 1j * given[1] + sensor * self.places[rows]
        return x + 1j * y + robot * places, robot * sensor * self.normals[rows]

    def pairs(self, given: Array, gate: float, random: Any) -> tuple[Any, ...]:
        """Return rows of echoes, rows of their partners, and common normals (n,)."""
        from scipy.spatial import cKDTree

        places, normals = self.placed(given)
        flat, stamps = places.view(float).reshape(-1, 2), self.recording.stamps
        begins = np.searchsorted(self.scan, range(1, len(stamps)))
        rows = np.split(np.arange(len(places)), begins)
        trees = [cKDTree(flat[one]) for one in rows]
        found = [np.zeros((2, 0), dtype=int)]
        for k, time in enumerate(stamps):
            apart = np.abs(stamps - time)
            others = np.flatnonzero((apart > SPARED) & (apart < SPAN))
            for j in random.permutation(others)[:PARTNERS]:
                away, row = trees[j].query(flat[rows[k]], distance_upper_bound=gate)
                near = away < gate
                found.append(np.stack([rows[k][near], rows[j][row[near]]]))
        one, other = np.hstack(found)
        cos = along(normals[one], normals[other])
        alike = np.abs(cos) > COSINE
        both = (normals[one] + np.sign(cos) * normals[other])[alike]
        return one[alike], other[alike], both / np.abs(both)

    def apart(self, given: Array, pairs: tuple[Any, ...]) -> Array:
        """Return the distances (n,) of pairs along their normals, m."""
        one, other, normals = pairs
        return along(self.placed(given, one)[0] - self.placed(given, other)[0], normals)

    def slopes(self, given: Array, pairs: tuple[Any, ...]) -> Array:
        """Return the derivatives (n, 5) of the distances, by central differences."""
        ends = [(given + h, given - h) for h in np.diag(STEPS)]
        changes = [self.apart(a, pairs) - self.apart(b, pairs) for a, b in ends]
        return np.column_stack(changes) / (2.0 * STEPS)


def along(vectors: Any, units: Any) -> Array:
    """Return the scalar products of complex vectors."""
    return np.real(vectors * np.conj(units))


class Calibration(NamedTuple):
    """Parameters of a LiDAR with their intervals.

    Attributes:
        estimates: Of x, y (m), yaw (rad), delay, sweep (s).
        thickness: Median distance of two echoes of a wall along its normal, m.
    """

    estimates: dict[str, Estimate]
    thickness: float

    @property
    def unexcited(self) -> str:
        """Parameters with too wide an interval, and the motion that they need."""
        widths = {name: one.high - one.value for name, one in self.estimates.items()}
        return "; ".join(
            f"{name} (± {widths[name]:.2g} {unit}) needs {motion}"
            for name, (most, unit, motion) in EXCITED.items()
            if not widths[name] <= most
        )


def calibrate(recording: Recording, strict: bool = True) -> Calibration:
    """Fit mount and timing of a LiDAR.

    Args:
        recording: Static walls, and poses without drift within :data:`SPAN`.
        strict: Whether motion that does not excite a parameter is refused.

    Raises:
        InvalidInputError: Too short a recording, too few walls, or such motion.
    """
    least = LEAST_BLOCKS * BLOCK_LENGTH if strict else 0.0
    long = float(np.ptp(recording.stamps)) > least and len(recording.poses) > 1
    want(long, f"calibrate needs {least:g} s of scans, and poses")
    echoes, random = Echoes(recording), np.random.default_rng(0)
    starts = [_fitted(echoes, one, random, GATES[:2]) for one in _starts(echoes)]
    start = min(starts, key=lambda one: one[1])[0]
    found, _, pairs = _fitted(echoes, start, random, GATES[2:])
    made = _estimates(echoes, found, pairs)
    want(not (strict and made.unexcited), f"the motion does not tell {made.unexcited}")
    return made


def _starts(echoes: Echoes) -> list[Array]:
    """Return parameters whose echoes fill the fewest cells, with several sweeps."""
    rows = np.arange(0, len(echoes.scan), 1 + len(echoes.scan) // FEWER)

    def cells(yaw: float, middle: float) -> int:
        places, _ = echoes.placed(np.array([0.0, 0.0, yaw, middle, 0.0]), rows)
        return len(np.unique(np.round(places / CELL)))

    yaws = np.arange(-math.pi, math.pi, YAW)
    _, yaw, middle = min((cells(yaw, t), yaw, t) for yaw in yaws for t in TIMES)
    return [np.array([0.0, 0.0, yaw, middle, sweep]) for sweep in TIMES]


def _fitted(
    echoes: Echoes, found: Array, random: Any, gates: Sequence[float]
) -> tuple[Array, float, tuple[Any, ...]]:
    """Return parameters, their mean cost, and the last pairs."""
    from scipy.optimize import least_squares

    cost, pairs = math.inf, tuple[Any, ...]()
    for gate in gates:
        pairs = echoes.pairs(found, gate, random)
        want(len(pairs[0]) > LEAST_PAIRS, "calibrate needs walls that are seen again")
        how = {"loss": "soft_l1", "f_scale": SOFT, "args": (pairs,)}
        how |= {"x_scale": STEPS, "bounds": (-BOUNDS, BOUNDS)}
        made = least_squares(echoes.apart, found, echoes.slopes, **how)
        found, cost = made.x, made.cost / len(pairs[0])
    return found, cost, pairs


def _estimates(echoes: Echoes, found: Array, pairs: tuple[Any, ...]) -> Calibration:
    """Return the estimates with their intervals."""
    from scipy.stats import t as student

    stamps, left = echoes.recording.stamps, echoes.apart(found, pairs)
    told = np.eye(5)  # delay = |sweep|/2 − middle
    told[3, 3:] = -1.0, 0.5 * np.sign(found[4])
    value, slopes = told @ found, echoes.slopes(found, pairs) @ np.linalg.inv(told)
    weight = 1.0 / np.sqrt(1.0 + (left / SOFT) ** 2)
    block = ((stamps - stamps[0]) // BLOCK_LENGTH).astype(int)
    scores = np.zeros((block[-1] + 1, 5))
    for ends in pairs[:2]:
        np.add.at(scores, block[echoes.scan[ends]], (weight * left)[:, None] * slopes)
    curvature = np.einsum("n,nj,nk->jk", weight, slopes, slopes) / weight.sum()
    inverse = np.linalg.inv(curvature + np.diag((UNSEEN / BOUNDS) ** 2))
    spread = inverse @ (scores.T @ scores) @ inverse / weight.sum() ** 2
    factor = student.ppf(0.975, max(len(scores) - 5, 1))
    width = np.sqrt(np.maximum(factor**2 * spread, UNSEEN**2 * inverse).diagonal())
    rows = zip(EXCITED, value, value - width, value + width, strict=True)
    estimates = {name: Estimate(*map(float, one)) for name, *one in rows}
    return Calibration(estimates, float(np.median(np.abs(left))))


def settings_of(recording: Recording, parameters: Sequence[float]) -> str:
    """Return x, y, yaw, delay, sweep as Python, table of scenarios, node parameters."""
    lidar, given = recording.lidar(parameters), [round(float(v), 4) for v in parameters]
    values = *lidar.mount, lidar.sweep, lidar.delay
    rows = zip((*MOUNT, "sweep_s", "delay_s"), values, strict=True)
    table = "\n".join(f"{key} = {value!r}" for key, value in rows)
    pose = [*given[:2], 0.0, 0.0, 0.0, given[2]]
    node = json.dumps({"frames": [recording.frame], "frame_poses": pose})
    return f"qp.{lidar}\n\n[lidar]\n{table}\n\nqpavoid:\n  ros__parameters: {node}"
