"""Why a twist was chosen: the QP of every step of a run, whatever controller drives."""

import math
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import Controller, FilterController
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import Array

MOST_PLANES = 16
"""Rows that are kept of a step: those nearest to the twist aimed at."""


class QPRecord(NamedTuple):
    """The QP of one step.

    Attributes:
        limits: Least and greatest v (m/s), least and greatest ω (rad/s) of this step,
            and the twist aimed at: the desired one, or where the look-ahead turned it.
        planes: (:data:`MOST_PLANES`, 4) rows a_v, a_ω, b, obstacle with
            a_v v + a_ω ω ≥ b, NaN where there are fewer; obstacle −1: a limit of the
            robot.
    """

    limits: tuple[float, float, float, float, float, float]
    planes: Array


NOT_EXPLAINED = QPRecord((math.nan,) * 6, np.empty((0, 4)))


class QPRecorder:
    """Sets up at every step the QP that the filter would solve; it drives nothing.

    Args:
        robot: Footprint and limits.
        settings: Of the filter.
        driver: The controller that drives. The filters are gone along with
            step by step, since they remember; of all others the rows of the present
            are shown.
    """

    def __init__(
        self, robot: Robot, settings: AvoidanceSettings, driver: Controller
    ) -> None:
        self._filters = isinstance(driver, FilterController)
        if not isinstance(driver, FilterController):
            driver = FilterController(robot, settings, ahead=False)
        self._safety = driver.fresh()

    def look(self, v: float, omega: float, seen: Obstacles) -> QPRecord:
        """Return the QP for a desired twist among obstacles, robot frame."""
        problem = self._safety.problem(v, omega, seen)
        aim, size = problem.desired, np.hypot(*problem.A.T)
        turns = np.flatnonzero(size > 0.0)
        room = (problem.A[turns] @ aim - problem.b[turns]) / size[turns]
        kept = turns[np.argsort(room, kind="stable")[:MOST_PLANES]]
        planes = np.full((MOST_PLANES, 4), np.nan)
        planes[: len(kept), :2] = problem.A[kept]
        planes[: len(kept), 2] = problem.b[kept]
        planes[: len(kept), 3] = problem.obstacle[kept]
        box = zip(problem.lower.tolist(), problem.upper.tolist(), strict=True)
        (v_low, v_high), (omega_low, omega_high) = box
        return QPRecord((v_low, v_high, omega_low, omega_high, *aim.tolist()), planes)

    def reset(self, v: float, omega: float) -> None:
        """Forget everything but that the robot drives (v, ω)."""
        self._safety.reset(v, omega)

    def follow(
        self, desired: tuple[float, float], seen: Obstacles, driven: tuple[float, float]
    ) -> None:
        """Remember what was driven in the step looked at last."""
        if self._filters:
            self._safety.filter(*desired, seen)
        else:
            self._safety.reset(*driven)
