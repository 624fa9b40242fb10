"""Prediction of moving discs: velocities for the coming seconds, by a plug-in.

A *predictor* maps the recent positions of all moving discs to one velocity each, that
of their motion over the coming seconds, and its standard deviation. The guide scores
candidates among discs of these velocities; QP, verdict and theorems keep the measured
ones: a wrong prediction does not weaken what they promise.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.model.capsules import RADIUS, SIGMA, V_X, V_Y, X1, Y1
from qpavoid.model.kinematics import relative, to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.validation import finite_rows
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

TRACK_STEP, TRACK_LENGTH = 0.4, 8
"""s between the positions of a track, and their number."""

SAME_DISC = 0.5
"""m; a disc farther from all places where the last ones should be now is a new one."""


class Tracks(NamedTuple):
    """Input of a predictor: n moving discs, the robot and all else, world frame.

    Attributes:
        positions: (n, TRACK_LENGTH, 2) m, one every :data:`TRACK_STEP`, the last one
            now; NaN before a disc was first seen.
        velocities: (n, 2) measured, m/s.
        sigmas: (n,) their standard deviations, m/s.
        radii: (n,) m.
        pose: Of the robot: x, y (m), heading (rad).
        driven: Its twist, m/s and rad/s.
        others: Static obstacles, moving walls and polygons.
    """

    positions: Array
    velocities: Array
    sigmas: Array
    radii: Array
    pose: Pose
    driven: Twist
    others: Obstacles


Predictor: TypeAlias = Callable[[Tracks], npt.ArrayLike]
"""Function of tracks that returns (n, 3): v_x, v_y, world frame, and σ ≥ 0, m/s."""


class Prediction:
    """Tracks of moving discs, and their predicted velocities.

    Discs have no ids: each one continues the track that is nearest, seen from both,
    after a control step with its measured velocity.

    Args:
        predict: The predictor.
        dt: Control step, s.
    """

    def __init__(self, predict: Predictor, dt: float) -> None:
        want(callable(predict), "predict must be a function of tracks")
        self._predict, self._dt = predict, dt
        steps = np.round(TRACK_STEP / dt * np.arange(TRACK_LENGTH - 1, -1, -1), 9)
        self._before = np.floor(steps).astype(np.int64)
        self._late = np.ceil(steps).astype(np.int64)
        self._share = (steps - self._before)[:, None]
        self.forget()

    def forget(self) -> None:
        """Begin new tracks."""
        # Positions of every disc, the newest first, one per control step.
        self._past = np.empty((0, self._late[0] + 1, 2))
        self._velocities = np.empty((0, 2))

    @np.errstate(over="ignore", invalid="ignore")  # numbers that the filter refuses
    def see(self, seen: Obstacles, pose: Pose, driven: Twist) -> Obstacles:
        """Return the obstacles of a control step, robot frame, as predicted.

        Args:
            seen: As measured, robot frame.
            pose: Of the robot, world frame.
            driven: Its twist, m/s and rad/s.

        Raises:
            InvalidInputError: The predictor did not return (n, 3) finite numbers with
                σ ≥ 0.
        """
        world = seen.seen_from(relative(pose, (0.0, 0.0, 0.0)))
        capsules = seen.capsules.copy()
        moving = world.is_disc & ((world.speeds > 0.0) | (capsules[:, SIGMA] > 0.0))
        discs = world.capsules[moving]
        self._follow(discs[:, X1 : Y1 + 1], discs[:, V_X : V_Y + 1])
        if not len(discs):
            return seen
        positions = self._past[:, self._before]
        positions += self._share * (self._past[:, self._late] - positions)
        known = positions, self._velocities.copy(), discs[:, SIGMA], discs[:, RADIUS]
        predicted = self._predict(Tracks(*known, pose, driven, world.chosen(~moving)))
        found = finite_rows(predicted, 3, "what predict returns")
        want(len(found) == len(discs), "predict must return a row for every disc")
        want(bool((found[:, 2] >= 0.0).all()), "predict must not return a σ below 0")
        velocities = to_world(found[:, :2], (0.0, 0.0, -pose[2]))  # seen by the robot
        capsules[moving, V_X : V_Y + 1] = velocities
        capsules[moving, SIGMA] = found[:, 2]
        return Obstacles.of(seen.points, capsules)

    def _follow(self, places: Array, velocities: Array) -> None:
        """Continue the tracks with the discs of a control step."""
        past = np.full((len(places), *self._past.shape[1:]), np.nan)
        if len(places) and len(self._past):
            there = self._past[:, 0] + self._dt * self._velocities
            away = np.hypot(*(places[:, None] - there).transpose(2, 0, 1))
            nearest, rows = away.argmin(axis=1), np.arange(len(places))
            same = (away.argmin(axis=0)[nearest] == rows) & (away.min(1) < SAME_DISC)
            past[same, 1:] = self._past[nearest[same], :-1]
        past[:, 0] = places
        self._past, self._velocities = past, velocities
