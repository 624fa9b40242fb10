"""Measures of a tracker against truth: false velocities, errors, delays, shares."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from perception_scenes import Recorded

NEAR = 4.0
"""m; movers within it are to be known."""

PLACE, SPEED = 0.5, 0.35
"""m and m/s; a mover is known right where it is found so near."""

SKIPPED = 1.5
"""s at the start of a recording that are not counted."""

FALSE = 0.2
"""m/s; a velocity above it with no mover near is false."""

SETTLED = 0.6
"""s after the first sight from which on a mover is to be known."""

Tracker = Callable[[float, tuple[float, float, float], np.ndarray], np.ndarray]
"""Of stamp, odometry and ranges: (m, 4) x, y, v_x, v_y of movers, robot frame."""


@dataclass
class Measured:
    """Sums over the scans of scenes."""

    scans: int = 0
    false: int = 0
    false_near: int = 0
    known: int = 0
    to_know: int = 0
    speed_errors: list[float] = field(default_factory=list)
    place_errors: list[float] = field(default_factory=list)
    waits: list[float] = field(default_factory=list)

    def row(self) -> str:
        """Return the figures as text: shares, medians and 90 % quantiles."""
        share = 100.0 / max(self.scans, 1)
        return ", ".join(
            [
                f"false {share * self.false:.2f} %",
                f"within 5 m {share * self.false_near:.2f} %",
                f"right {self.known / max(self.to_know, 1):.3f} of {self.to_know}",
                f"velocity {halves(self.speed_errors)} m/s",
                f"place {halves(self.place_errors)} m",
                f"known after {halves(self.waits)} s",
            ]
        )


def halves(values: list[float]) -> str:
    """Return the median and the 90 % quantile."""
    if not values:
        return "-"
    return "/".join(f"{np.quantile(values, q):.3f}" for q in (0.5, 0.9))


def to_robot(pose: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return states (m, 4) in the robot frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    out = np.empty((len(states), 4))
    out[:, :2] = (states[:, :2] - pose[:2]) @ turn
    out[:, 2:] = states[:, 2:4] @ turn
    return out


def measure(made: Recorded, tracker: Tracker) -> Measured:
    """Return what a tracker makes of recorded scans."""
    total, first, done = Measured(), dict[int, float](), set[int]()
    past = np.searchsorted(made.stamps, made.stamps - 1.2)
    for k, time in enumerate(made.stamps.tolist()):
        found = tracker(time, tuple(made.odometry[k]), made.ranges[k])
        if time < SKIPPED:
            continue
        recent = made.truth[past[k] : k + 1].reshape(-1, made.truth.shape[2])
        judge_false(total, found, to_robot(made.poses[k], recent))
        truth, echoes = to_robot(made.poses[k], made.truth[k]), echoes_of(made, k)
        for i, one in enumerate(truth):
            seen = np.hypot(*(echoes - one[:2]).T) < made.reach[i] + 0.1
            if seen.sum() >= 2:
                first.setdefault(i, time)
                known = judge_known(total, found, one, time - first[i])
                if known and i not in done:
                    done.add(i)
                    total.waits.append(time - first[i])
    return total


def echoes_of(made: Recorded, k: int) -> np.ndarray:
    """Return the echoes (n, 2) of a scan in the robot frame, m."""
    lidar, ranges = made.lidar, made.ranges[k]
    beam = (np.arange(lidar.beams) + 0.5) / lidar.beams - 0.5
    angles = lidar.field_of_view * beam + lidar.mount[2]
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    echo = np.isfinite(ranges)
    return ranges[echo, None] * rays[echo] + lidar.mount[:2]


def judge_false(total: Measured, found: np.ndarray, recent: np.ndarray) -> None:
    """Count a scan, and whether something at rest was given a velocity."""
    fast = [one for one in found if math.hypot(*one[2:]) > FALSE]
    lone = [x for x in fast if not (np.hypot(*(recent[:, :2] - x[:2]).T) < 1.0).any()]
    total.scans += 1
    total.false += bool(lone)
    total.false_near += any(math.hypot(*one[:2]) < 5.0 for one in lone)


def judge_known(
    total: Measured, found: np.ndarray, truth: np.ndarray, since: float
) -> bool:
    """Count a visible mover; return whether it moves and is known right.

    Args:
        total: Changed.
        found: (m, 4) by the tracker, robot frame.
        truth: (4,) of the mover.
        since: s since it was seen first.
    """
    if math.hypot(*truth[2:]) < 0.1:
        return False
    apart = np.hypot(*(found[:, :2] - truth[:2]).T)
    near = int(np.argmin(apart)) if len(found) else 0
    known = len(found) > 0 and bool(apart[near] < PLACE)
    off = math.dist(found[near, 2:], truth[2:]) if known else math.inf
    if since > SETTLED and math.hypot(*truth[:2]) < NEAR:
        total.to_know += 1
        total.known += off < SPEED
        if known:
            total.place_errors.append(float(apart[near]))
            total.speed_errors.append(off)
    return off < SPEED
