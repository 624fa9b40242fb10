"""Progress monitor: remaining length of a plan, and time without progress.

The remaining length is that of the plan from its row nearest to the robot, plus the
distance to that row: oscillation does not reduce it.
"""

import math

import numpy as np

from qpavoid.model.capsules import TURN, V_X, V_Y, X1, X2, Y1, Y2
from qpavoid.model.kinematics import wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Pose

EVERY = 0.1
"""s; spacing of the samples of a plan."""

SEARCH_WINDOW = 3.0
"""m along the plan within which the next nearest row is searched."""

BEHIND = 1.0
"""m; distance behind the robot of a path's beginning that is skipped."""

BAND = 0.1
"""m; rows so much farther than the nearest one are candidates, too: a path may cross
itself."""

AT_GOAL = 0.5
"""m from the goal within which heading counts, and smaller progress suffices."""

TURN_WEIGHT = 0.3
"""m of length that a radian of heading error counts at the goal."""

NEAR_DISTANCE, NEAR_TIME = 3.0, 3.0
"""m, and s; a moving obstacle is near if it can be within that distance by then."""

STANDING_SPEED = 0.2
"""m/s; estimated speed of a standing person while the robot drives."""

PROGRESS_SHARE, PROGRESS_LEAST = 0.5, 0.05
"""Relative and absolute (m) reduction of the length that is progress at the goal."""


MOST_PATHS = 3
"""Detours found since the last progress that count as progress while followed."""


def lengths(plan: Array) -> Array:
    """Return the length of a plan (n, 5) up to each of its rows, m."""
    steps = np.hypot(*np.diff(plan[:, :2], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def start_row(plan: Array, pose: Pose, left: float | None = None) -> int:
    """Return the row of a plan from which a robot at a pose follows it.

    Args:
        plan: (n, 5) reference, world frame.
        pose: Of the robot, or its last reference, world frame.
        left: Remaining length, m, on the last plan to the same goal: the row is the
            nearest. None: a new plan, followed from its beginning unless that lies
            closely behind the robot.
    """
    along, away = lengths(plan), np.hypot(*(plan[:, :2] - pose[:2]).T)
    if left is None:
        d_x, d_y = pose[0] - plan[0, 0], pose[1] - plan[0, 1]
        passed = d_x * math.cos(plan[0, 2]) + d_y * math.sin(plan[0, 2])
        if passed <= 0.0 or away[0] > BEHIND:
            return 0
        return int(np.where(along <= 2.0 * away[0], away, math.inf).argmin())
    off = np.abs(along[-1] - along - left)
    return int(np.where(away <= away.min() + BAND, off, math.inf).argmin())


def moves_near(seen: Obstacles) -> bool:
    """Return whether an obstacle, robot frame, moves near the robot."""
    rows = seen.capsules
    if not len(rows):
        return False
    with np.errstate(over="ignore"):  # numbers that the filter refuses
        speeds = np.hypot(rows[:, V_X], rows[:, V_Y])
        near = NEAR_DISTANCE + NEAR_TIME * speeds
        ends = np.hypot(rows[:, [X1, X2]], rows[:, [Y1, Y2]])
    moves = (speeds > STANDING_SPEED) | (rows[:, TURN] != 0.0)
    return bool((moves & (ends.min(axis=1) < near)).any())


class Headway:
    """Monitor of progress along a plan.

    Attributes:
        left: Remaining length, m.
        time: s since it, or the rest of a detour, was last reduced by ``progress``.

    Args:
        plan: (n, 5) reference, world frame.
        place: First row.
        progress: m.
    """

    def __init__(self, plan: Array, place: int, progress: float) -> None:
        stride = max(1, len(plan) // 1000)
        rows = np.append(np.arange(0, len(plan) - 1, stride), len(plan) - 1)
        along = lengths(plan)
        self._along, self._xy, self._at = along[rows], plan[rows, :2], along[place]
        self._heading, self._progress = plan[-1, 2], progress
        self.left, self.time, self._best = along[-1] - along[place], 0.0, math.inf
        self._wait, self._paths, self._detour = 0.0, 0, math.inf

    def note(self, pose: Pose, dt: float, detour: float = math.inf) -> None:
        """Update with the robot's pose after a step of dt, world frame.

        ``detour``: remaining actions of a detour; ``inf``: none.
        """
        self.time, self._wait = self.time + dt, self._wait - dt
        is_new = detour > self._detour or self._detour == math.inf > detour
        if detour == math.inf or is_new or detour <= self._detour - 1.0:
            self._detour = detour
            if is_new:
                self.found()
            elif detour < math.inf and self._paths <= MOST_PATHS:
                self.time = 0.0
        if self._wait > 0.0:
            return
        self._wait = EVERY
        window = np.abs(self._along - self._at) <= SEARCH_WINDOW
        away = np.hypot(*(self._xy - pose[:2]).T)
        row = int(np.where(window, away, math.inf).argmin())
        self._at, end = self._along[row], self._along[-1]
        turn = math.pi
        if away[-1] < AT_GOAL:
            turn = abs(wrap_angle(self._heading - pose[2]))
        self.left = float(end - self._at + away[row])
        left, enough = self.left + TURN_WEIGHT * turn, self._progress
        if away[-1] < AT_GOAL:
            enough = min(enough, max(PROGRESS_SHARE * self._best, PROGRESS_LEAST))
        if left < self._best - enough:
            self._best, self.time, self._paths = left, 0.0, 0

    def found(self) -> None:
        """Register a new path, as progress unless there were several without any."""
        self._paths += 1
        if self._paths <= MOST_PATHS:
            self.time = 0.0

    def restart(self) -> None:
        """Restart from the present pose."""
        self.time, self._best, self._paths = 0.0, math.inf, 0

    def take_over(self, other: "Headway") -> None:
        """Take over the state of the monitor of a plan to about the same goal."""
        self.time, self._best = other.time, max(other._best, self.left)
        self._paths, self._detour = other._paths, other._detour
