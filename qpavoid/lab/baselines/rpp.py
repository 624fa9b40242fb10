"""Regulated pure pursuit [Macenski2023b] behind Nav2's collision monitor."""

import math
from dataclasses import dataclass

import numpy as np

from qpavoid.avoidance.controllers import StepContext
from qpavoid.lab.baselines.drive import Baseline, Command, reference_ahead
from qpavoid.lab.baselines.stopping import free_time
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import TINY
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Array, Twist

TICK, TICKS = 0.1, 40
"""s, and number: ticks of the path on which the carrot is searched."""

LOOK = (0.3, 0.9)
"""m; least and greatest distance of the carrot: Nav2's."""

CARROT_ASIDE = 0.785
"""rad; bearing of the carrot from which on the robot turns on the spot: Nav2's."""

SLOWEST_CURVE = 0.25
"""m/s; least speed in curves and near obstacles: Nav2's."""

APPROACH = 0.6
"""m from the goal at which the robot begins to slow down: Nav2's."""

DOCKING = 0.25
"""m from the goal within which Eq. 6 drives the robot to its pose: Nav2's tolerance of
the goal."""

IMMINENT = 1.0
"""s for which the arc to the carrot must be free, else the robot stops: Nav2's."""


@dataclass(frozen=True)
class PursuitController(Baseline):
    """Pure pursuit of a carrot on the path, slowed down by a collision monitor.

    The carrot is the first point of the reference (with its present twist held) at
    least ``look_time`` times the speed away, L. The arc to it has the curvature
    κ = 2y/L²; the speed is that of the reference, times ρ/``radius`` in curves of a
    radius ρ below that and times d/``near`` if an obstacle is nearer than that, d. If
    the arc to the carrot has a contact within 1 s, the robot stops.

    The collision monitor then multiplies the twist by the lesser factor of two zones: 0
    if an obstacle is within ``stop`` m of the footprint, and t/``time`` if the
    footprint would have a contact in t < ``time`` (Nav2's *approach*). Obstacles are
    taken as static, the footprint is the polygon. Left out: Nav2's planner
    (``astar+rpp`` has one), its recoveries, its slow zone, and
    reversing. A static obstacle on the path stops the robot for good.

    Attributes:
        look_time: s.
        radius: m.
        near: m.
        stop: m.
        time: s.
    """

    look_time: float = 1.0
    radius: float = 0.9
    near: float = 0.3
    stop: float = 0.02
    time: float = 2.0

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the twist to the carrot, slowed down; None: the desired twist."""
        distance = clearance_of(self.robot.footprint, obstacles.arrays)
        if math.hypot(*context.goal[:2]) < DOCKING:
            wanted = desired
        else:
            path = reference_ahead(context, self.robot, TICKS, TICK)
            wanted, time = self.pursued(path, context, distance)
            if self._free(wanted, obstacles, context, time) < time:
                return self.brake(context)
        share = self._free(wanted, obstacles, context, self.time) / self.time
        if distance < self.stop or share == 0.0:
            return self.brake(context)
        return Command((share * wanted[0], share * wanted[1]))

    def pursued(
        self, path: Array, context: StepContext, distance: float
    ) -> tuple[Twist, float]:
        """Return the twist to the carrot, and the time for which it must be free, s.

        Args:
            path: (n, 3) poses, one per tick.
            context: Of the step.
            distance: d, of the nearest obstacle, m.
        """
        look = min(max(self.look_time * abs(context.driven[0]), LOOK[0]), LOOK[1])
        away = np.hypot(path[:, 0], path[:, 1])
        k = int(np.argmax(away >= look)) if away.max() >= look else len(path) - 1
        x, y, _ = path[k].tolist()
        angle, limits = math.atan2(y, x), self.robot.limits
        way = max(math.hypot(x, y), TINY)
        if abs(angle) > CARROT_ASIDE:
            omega = min(max(angle / IMMINENT, limits.omega_min), limits.omega_max)
            return (0.0, 2.0 * omega), IMMINENT
        then = min(round(self.look_time / TICK), len(path)) - 1
        pace = min(float(away[then]) / (TICK * (then + 1)), limits.v_max)
        curvature = 2.0 * y / way**2
        share = min(1.0, 1.0 / max(self.radius * abs(curvature), TINY))
        share *= min(1.0, max(distance, 0.0) / self.near)
        v = max(share * pace, min(SLOWEST_CURVE, pace))
        v *= min(1.0, math.hypot(*context.goal[:2]) / APPROACH)
        return (v, v * curvature), min(IMMINENT, way / max(v, TINY))

    def _free(
        self, wanted: Twist, obstacles: Obstacles, context: StepContext, time: float
    ) -> float:
        """Return for how long the footprint is free on a twist, ≤ ``time``, s."""
        twist = self.limited(wanted, context)
        return free_time(self.setup, obstacles.arrays, 0.0, twist, time)
