"""Data shared by all predictions of a control step."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import tolerated
from qpavoid.avoidance.settings import FilterSettings
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.robot import UNLIMITED_TWIST, limits_of
from qpavoid.types import Array, Arrays, Box, Edges, LimitVector, Pair

REPLAY_ROUNDING = 1e-8
"""m; tolerance of a plan's margin when it is carried on."""


class Setup(NamedTuple):
    """Robot and settings, constant over a run.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
    """

    edges: Edges
    robot: LimitVector
    settings: FilterSettings


class Request(NamedTuple):
    """Input of a control step.

    Attributes:
        obstacles: Robot frame.
        age: Of their measurement, s.
        ahead: Whether to look ahead.
        desired: v (m/s), ω (rad/s).
    """

    obstacles: Arrays
    age: float
    ahead: bool
    desired: Pair


class Scene(NamedTuple):
    """Context of all predictions of a control step.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        settings: One :data:`qpavoid.avoidance.settings.RECORD`.
        bodies: (n, ``BODY``) in reach; see :mod:`qpavoid.avoidance.body_table`.
        last: v, ω driven last.
        pending: Sums of |v|, m/s, and of |ω|, rad/s, over the pending steps.
        arcs: Memory for a rollout; see :mod:`qpavoid.avoidance.prediction`.
        groups: Walls, each containing successive bodies. The ``owner`` is the number of
            the body after them.
        longest: Greatest duration of a control step, s.
        drift: Velocity error of the robot, m/s; static bodies grow by it.
        clearance: Of the nearest obstacle, m.
    """

    edges: Array
    robot: Array
    settings: npt.NDArray[np.void]
    bodies: Array
    last: Pair
    pending: Pair
    arcs: Array
    groups: Array
    longest: float
    drift: float
    clearance: float


@compiled
def drifting(scene: Scene, drift: float) -> Scene:
    """Return the scene with a velocity error of the robot, m/s."""
    # Compiled functions have no NamedTuple._replace.
    e, r, s, bodies, last, pending, arcs, groups, longest, _, near = scene
    return Scene(e, r, s, bodies, last, pending, arcs, groups, longest, drift, near)


@compiled
def of_groups(scene: Scene) -> Scene:
    """Return the scene whose bodies are the groups."""
    e, r, s, _, last, pending, arcs, groups, longest, drift, near = scene
    return Scene(e, r, s, groups, last, pending, arcs, groups, longest, drift, near)


@compiled
def tolerance(scene: Scene) -> float:
    """Return ε, m."""
    return tolerated(scene.settings)


@compiled
def threshold(scene: Scene) -> float:
    """Return −ε: the least margin of a clear plan, m."""
    return -tolerance(scene) - REPLAY_ROUNDING


@compiled_once
def look_box(robot: Array) -> Box:
    """Return the limits of the look-ahead's target twist."""
    limits = limits_of(robot)
    return Box(
        max(limits.v_min, -UNLIMITED_TWIST),
        min(limits.v_max, UNLIMITED_TWIST),
        max(limits.omega_min, -UNLIMITED_TWIST),
        min(limits.omega_max, UNLIMITED_TWIST),
    )
