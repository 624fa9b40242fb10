"""A tracker like that of github.com/tysik/obstacle_detector.

Written from its published description, with its default parameters: groups of echoes
are split into segments (iterative end point fit); visible ones become circles about
equilateral triangles; these are followed by nearest neighbours and Kalman filters with
constant velocity at 100 Hz. Everything at rest is tracked as well.
"""

import math

import numpy as np

import qpavoid as qp

GROUP, POINTS, SPLIT, LARGEST = 0.1, 5, 0.2, 0.6
"""m between neighbours of a group; its echoes; m off a line; m radius."""

REACH, KEPT, RATE, PLACE_NOISE, SPEED_NOISE, NOISE = 0.3, 2.0, 100.0, 0.01, 0.1, 1.0
"""m to a track; s unseen; Hz; variances of a step and of a measurement."""


class Peer:
    """Tracks of circles; :meth:`track` is a tracker of recorded scans."""

    def __init__(self, lidar: qp.Lidar) -> None:
        self._lidar, self._time = lidar, math.nan
        self._tracks: list[tuple[np.ndarray, np.ndarray, float]] = []

    def track(self, time: float, odometry, ranges: np.ndarray) -> np.ndarray:
        """Return the tracks (n, 4) x, y, v_x, v_y, robot frame."""
        pose, sensor = np.exp(1j * odometry[2]), np.exp(1j * self._lidar.mount[2])
        step, wide = self._lidar.step(len(ranges)), self._lidar.field_of_view
        rays = np.exp(1j * (step * np.arange(len(ranges)) - 0.5 * wide))
        origin = complex(*odometry[:2]) + pose * complex(*self._lidar.mount[:2])
        echo = np.isfinite(ranges) & (ranges < self._lidar.range_max)
        centres = circles(ranges[echo] * rays[echo], step) * pose * sensor + origin
        steps = 0 if math.isnan(self._time) else round((time - self._time) * RATE)
        move = np.array([[1.0, 1.0 / RATE], [0.0, 1.0]])
        known, left = [], list(centres)
        for state, spread, seen in self._tracks:
            for _ in range(steps):
                state = move @ state
                spread = move @ spread @ move.T + np.diag([PLACE_NOISE, SPEED_NOISE])
            near = min(left, key=lambda c, s=state: abs(c - s[0]), default=math.inf)
            if abs(near - state[0]) < REACH:
                left.remove(near)
                gain = spread[:, 0] / (spread[0, 0] + NOISE)
                state, seen = state + gain * (near - state[0]), time
                spread = spread - np.outer(gain, spread[0])
            if time - seen < KEPT:
                known.append((state, spread, seen))
        new = [(np.array([one, 0j]), np.eye(2), time) for one in left]
        self._tracks, self._time = known + new, time
        found = np.array([state for state, *_ in known], dtype=complex).reshape(-1, 2)
        found[:, 0] -= complex(*odometry[:2])
        return (found / pose).view(float)


def circles(echoes: np.ndarray, step: float) -> np.ndarray:
    """Return the centres of circles among echoes in scan order, complex, m.

    ``step`` is the angle between beams, rad, by which limits grow with the range.
    """
    gaps = np.abs(np.diff(echoes)) > GROUP + step * np.abs(echoes[1:])
    groups, found = np.split(echoes, np.flatnonzero(gaps) + 1), []
    for k, group in enumerate(groups):
        behind = np.abs([groups[k - 1][-1:], groups[(k + 1) % len(groups)][:1]])
        visible = len(group) >= POINTS and (behind.T > np.abs(group[[0, -1]])).all()
        for part in split(group, step) if visible else []:
            middle = 0.5 * (part[0] + part[-1])
            radius = abs(part[-1] - part[0]) / math.sqrt(3.0)
            if 0.0 < radius < LARGEST:
                found.append(middle + 0.5 * radius * middle / abs(middle))
    return np.array(found, dtype=complex)


def split(group: np.ndarray, step: float) -> list[np.ndarray]:
    """Return the parts of a group that are straight to :data:`SPLIT`."""
    line = group[-1] - group[0]
    off = np.abs(((group - group[0]) * line.conjugate()).imag) / max(abs(line), 1e-9)
    k = int(off.argmax())
    if off[k] <= SPLIT + step * abs(group[k]) or not 0 < k < len(group) - 1:
        return [group]
    return split(group[: k + 1], step) + split(group[k:], step)
