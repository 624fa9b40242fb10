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

SETTLED, MOVES = 0.6, 0.1
"""s after the first sight in motion from which on a mover is to be known; m/s."""

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

    def row(self) -> dict[str, object]:
        """Return the figures: shares, medians and 90 % quantiles; m, s."""
        share = 100.0 / max(self.scans, 1)
        found: dict[str, object] = {
            "scans": self.scans,
            "false_near_percent": round(share * self.false_near, 2),
            "false_percent": round(share * self.false, 2),
            "right": round(self.known / self.to_know, 3) if self.to_know else "",
            "right_of": self.to_know,
        }
        for name in ("speed_errors", "place_errors", "waits"):
            values = getattr(self, name)
            for mark, q in (("median", 0.5), ("p90", 0.9)) if values else ():
                found[f"{name}_{mark}"] = round(float(np.quantile(values, q)), 3)
        return found


def to_robot(pose: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return states (m, 4) in the robot frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    out = np.empty((len(states), 4))
    out[:, :2] = (states[:, :2] - pose[:2]) @ turn
    out[:, 2:] = states[:, 2:] @ turn
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
                if math.hypot(*one[2:4]) > MOVES:
                    first.setdefault(i, time)
                known = judge_known(total, found, one, time - first.get(i, time))
                if known and i not in done:
                    done.add(i)
                    total.waits.append(time - first[i])
    return total


def echoes_of(made: Recorded, k: int) -> np.ndarray:
    """Return the echoes (n, 2) of a scan in the robot frame, m."""
    lidar, ranges = made.lidar, made.ranges[k]
    angles = lidar.step(len(ranges)) * np.arange(len(ranges))
    angles += lidar.mount[2] - 0.5 * lidar.field_of_view
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
    if math.hypot(*truth[2:]) < MOVES:
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
