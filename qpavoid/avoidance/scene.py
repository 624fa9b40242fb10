"""What all predictions of a control step share: robot, settings, request, bodies."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.barrier_rows import tolerated
from qpavoid.avoidance.settings import FilterSettings
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.robot import UNLIMITED_TWIST, limits_of
from qpavoid.types import Array, Arrays, Box, Edges, LimitVector, Pair


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
        pending: Sums of |v|, m/s, and of |ω|, rad/s, of the steps on their way.
        arcs: Memory for a rollout; see :mod:`qpavoid.avoidance.prediction`.
        groups: A wall each that holds as many bodies as follow one another: what keeps
            from it keeps from them. Its ``owner`` is the number of the body after them.
        longest: s that a control step lasts at most.
        drift: m/s by which the robot leaves the way of a rollout; what stands grows by
            it meanwhile.
        closest: m; no more of r_min is wanted of what stands. ``inf``: all of it.
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
    closest: float


@compiled
def altered(scene: Scene, bodies: Array, drift: float, closest: float) -> Scene:
    """Return the scene with other bodies, drift and ``closest``."""
    # Compiled functions have no NamedTuple._replace.
    e, r, s, _, last, pending, arcs, groups, longest, _, _ = scene
    return Scene(e, r, s, bodies, last, pending, arcs, groups, longest, drift, closest)


@compiled
def tolerance(scene: Scene) -> float:
    """Return ε, m."""
    return tolerated(scene.settings)


@compiled_once
def look_box(robot: Array) -> Box:
    """Return the box of the twists that the look-ahead may aim at."""
    limits = limits_of(robot)
    return Box(
        max(limits.v_min, -UNLIMITED_TWIST),
        min(limits.v_max, UNLIMITED_TWIST),
        max(limits.omega_min, -UNLIMITED_TWIST),
        min(limits.omega_max, UNLIMITED_TWIST),
    )
