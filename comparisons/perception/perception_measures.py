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
    seconds: float = 0.0
    known: int = 0
    to_know: int = 0
    speed_errors: list[float] = field(default_factory=list)
    place_errors: list[float] = field(default_factory=list)
    waits: list[float] = field(default_factory=list)
    where: list[tuple[float, ...]] = field(default_factory=list)

    def row(self) -> str:
        """Return the figures as text: shares, medians and 90 % quantiles."""
        share = 100.0 / max(self.scans, 1)
        known = self.known / max(self.to_know, 1)
        return (
            f"false {share * self.false:.2f} % (within 5 m {share * self.false_near:.2f}), "
            f"right {known:.3f} of {self.to_know}, velocity {halves(self.speed_errors)} "
            f"m/s, place {halves(self.place_errors)} m, after {halves(self.waits)} s"
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


def measure(
    made: Recorded,
    tracker: Tracker,
    total: Measured | None = None,
    skip: float = 1.5,
    near: float = NEAR,
) -> Measured:
    """Return what a tracker makes of recorded scans."""
    m = total if total is not None else Measured()
    first: dict[int, float] = {}
    done: set[int] = set()
    angles = made.lidar.field_of_view * (
        (np.arange(made.lidar.beams) + 0.5) / made.lidar.beams - 0.5
    )
    past = np.searchsorted(made.stamps, made.stamps - 1.2)
    for k, time in enumerate(made.stamps):
        found = tracker(float(time), tuple(made.odometry[k]), made.ranges[k])
        if time < skip:
            continue
        m.scans += 1
        truth = to_robot(made.poses[k], made.truth[k])
        r = made.ranges[k]
        ok = np.isfinite(r)
        x, y, g = made.lidar.mount
        echoes = np.column_stack(
            [x + r[ok] * np.cos(angles[ok] + g), y + r[ok] * np.sin(angles[ok] + g)]
        )
        there = [
            i
            for i in range(len(truth))
            if np.isfinite(truth[i]).all() and math.hypot(*truth[i, :2]) < 30
        ]
        wrong = wrong_near = False
        for one in found:
            if math.hypot(*one[2:]) > FALSE:
                # a false velocity: no mover is near the place
                recent = to_robot(
                    made.poses[k],
                    np.vstack(
                        [made.truth[past[k] : k + 1].reshape(-1, 5), made.truth[k]]
                    ),
                )
                if not (np.hypot(*(recent[:, :2] - one[:2]).T) < 1.0).any():
                    wrong = True
                    wrong_near |= math.hypot(*one[:2]) < 5.0
                    m.where.append((float(time), *one))
        m.false += wrong
        m.false_near += wrong_near
        for i in there:
            seen = (
                (np.hypot(*(echoes - truth[i, :2]).T) < 0.75).sum() >= 2
                if len(echoes)
                else False
            )
            if not seen:
                continue
            # who has been seen without a break since
            first.setdefault(i, float(time))
            apart = math.hypot(*truth[i, :2])
            best = None
            for one in found:
                d = math.dist(one[:2], truth[i, :2])
                if d < PLACE and (best is None or d < best[0]):
                    best = (d, math.dist(one[2:], truth[i, 2:4]))
            right = best is not None and best[1] < SPEED
            moving = math.hypot(*truth[i, 2:4]) > 0.1
            if not moving and best is None:
                right = True  # a body at rest may be points
            if right and moving and i not in done:
                done.add(i)
                m.waits.append(float(time) - first[i])
            if apart < near and moving and time - first[i] > SETTLED:
                m.to_know += 1
                m.known += right
                if best is not None:
                    m.place_errors.append(best[0])
                    m.speed_errors.append(best[1])
    return m
