"""Step of a baseline (plan, limits, status), and common functions of baselines."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from time import perf_counter
from typing import ClassVar, NamedTuple, TypeAlias

import numpy as np

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.cbf_rows import required_distance
from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.proposals import SAME_TWIST
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import PIVOT_X, PIVOT_Y, RADIUS, TURN, V_X, V_Y, X1, Y2
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import TINY
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, braking_twist, limit_twist
from qpavoid.types import Array, Twist

NONE = np.empty((0, 5))
"""No moving points."""


class Command(NamedTuple):
    """Output of a method, before the robot's limits.

    Attributes:
        twist: v (m/s), ω (rad/s), not yet within the limits.
        status: ``steered``, ``filtered`` (by a QP), ``relaxed``, or ``stopped`` where
            the solver failed and the robot brakes.
        slack: Violation that had to be allowed, m/s; 0 unless relaxed.
        shortfall: Predicted violation of r_min, m; 0 unless relaxed.
        lateral: Speed to the left, m/s; 0 but for an omnidirectional base.
    """

    twist: Twist
    status: Status = Status.STEERED
    slack: float = 0.0
    shortfall: float = 0.0
    lateral: float = 0.0


RELAXED_FROM = 1e-3
"""m/s, or m within r_min; violation from which a solution counts as relaxed."""

FAILED = Command((0.0, 0.0), Status.STOPPED)
"""Command after a failure of the solver: brake."""

Method: TypeAlias = Callable[[Twist, Obstacles, StepContext], Command | None]
"""Function of desired twist, obstacles and context; None: drive the desired twist."""


def wide_discs(
    obstacles: Obstacles, settings: AvoidanceSettings, more: Array = NONE
) -> Array:
    """Return points, discs and more points (n, 5): x, y, radius + r_min, v_x, v_y.

    In m and m/s; sensed points are static; ``more`` (m, 5): e.g. points of lines.
    """
    record, still = settings.record(), wide_still(settings)
    first, last = len(obstacles.points), len(obstacles.points) + len(obstacles.discs)
    wide = np.zeros((last + len(more), 5))
    wide[:first, :2], wide[last:] = obstacles.points, more
    wide[first:last, :3] = obstacles.discs
    wide[first:last, 3:] = obstacles.disc_velocities
    wide[:, 2] += still
    for i in np.flatnonzero(wide[:, 3:].any(axis=1)):
        speed = math.hypot(wide[i, 3], wide[i, 4])
        wide[i, 2] += required_distance(record, speed, 0.0)[1] - still
    return wide


def wide_lines(obstacles: Obstacles, settings: AvoidanceSettings) -> Array:
    """Return walls and edges of polygons (n, 11) with r_min as their radius, m."""
    record, rows, still = settings.record(), ~obstacles.is_disc, wide_still(settings)
    lines, speeds = obstacles.capsules[rows], obstacles.speeds[rows]
    lines[:, RADIUS] += still
    for i in np.flatnonzero(speeds):
        lines[i, RADIUS] += required_distance(record, speeds[i], 0.0)[1] - still
    return lines


def wide_still(settings: AvoidanceSettings) -> float:
    """Return the required distance of static obstacles, with the inflation, m."""
    return required_distance(settings.record(), 0.0, 0.0)[1]


def out_of_reach(robot: Robot, discs: Array, horizon: float) -> bool:
    """Return whether no twist brings the robot near a disc within ``horizon`` s.

    Args:
        robot: Footprint and limits.
        discs: See :func:`wide_discs`.
        horizon: s.
    """
    return bool(soonest_reached(robot, discs).min(initial=math.inf) > horizon)


def soonest_reached(robot: Robot, discs: Array, v: float = 0.0) -> Array:
    """Return the earliest time at which the robot can reach each disc (n,), s, or inf.

    Args:
        robot: Footprint and limits.
        discs: See :func:`wide_discs`.
        v: Present speed, m/s.
    """
    limits = robot.limits
    speed = min(max(limits.v_max, -limits.v_min), limits.wheel_speed)
    gap = np.hypot(discs[:, 0], discs[:, 1]) - discs[:, 2]
    gap = np.maximum(gap - robot.footprint.circumradius, 0.0)
    pace = max(speed, abs(v)) + np.hypot(discs[:, 3], discs[:, 4])
    never = np.where(gap > 0.0, math.inf, 0.0)
    soonest: Array = np.divide(gap, pace, out=never, where=pace > 0.0)
    return soonest


def line_points(obstacles: Obstacles, spacing: float = 0.2) -> Array:
    """Return points on walls and edges (n, 5): x, y, 0 (m), v_x, v_y (m/s).

    Ends included, at most ``spacing`` m apart; each with its own velocity.
    """
    capsules = obstacles.capsules[~obstacles.is_disc]
    ends = capsules[:, X1 : Y2 + 1]
    far = np.hypot(*(ends[:, 2:] - ends[:, :2]).T)
    counts = np.clip(np.ceil(far / spacing) + 1, 2, 1000).astype(int)
    of, last = np.repeat(np.arange(len(ends)), counts), np.cumsum(counts) - 1
    place = np.arange(len(of)) - (last - counts + 1)[of]
    share = place * (1.0 / (counts - 1))[of]
    share[last] = 1.0
    # Not start + share · length: both ends are then exact.
    places = (1.0 - share[:, None]) * ends[of, :2] + share[:, None] * ends[of, 2:]
    capsules, points = capsules[of], np.zeros((len(places), 5))
    lever = places - capsules[:, PIVOT_X : PIVOT_Y + 1]
    points[:, :2] = places
    points[:, 3] = capsules[:, V_X] - capsules[:, TURN] * lever[:, 1]
    points[:, 4] = capsules[:, V_Y] + capsules[:, TURN] * lever[:, 0]
    return points


def reference_ahead(
    context: StepContext, robot: Robot, stages: int, tick: float
) -> Array:
    """Return poses (stages, 3) of the reference after 1, 2, … ticks, robot frame.

    It continues with its present twist and stops at the goal. Poses that the robot
    cannot reach by then are moved to its reach along the straight line: a distant
    reference then costs no more than one within reach.
    """
    (x, y, heading), (v, omega) = context.target, context.reference
    left = math.hypot(context.goal[0] - x, context.goal[1] - y)
    most = left / abs(v) if v else math.inf
    ticks = tick * np.arange(1, stages + 1)
    times = np.minimum(ticks, most)
    half = 0.5 * omega * times
    chord = v * times * np.sinc(half / math.pi)
    x_r, y_r = x + chord * np.cos(heading + half), y + chord * np.sin(heading + half)
    reach = max(robot.limits.v_max, -robot.limits.v_min) * ticks
    share = np.minimum(1.0, reach / np.maximum(np.hypot(x_r, y_r), TINY))
    return np.column_stack([share * x_r, share * y_r, heading + omega * times])


@dataclass(frozen=True)
class Baseline:
    """A method without state: every plan follows from the present obstacles.

    Attributes:
        robot: Footprint and limits.
        settings: Radii and control step.
        period: s between two plans; 0: every step.
    """

    robot: Robot
    settings: AvoidanceSettings
    period: ClassVar[float] = 0.0

    @property
    def setup(self) -> Setup:
        """Robot and settings for compiled functions."""
        return Setup.of(self.robot, self.settings)

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        return self.stepping((v, omega), self.plan, self.period)

    def stepping(self, last: Twist, plan: Method, period: float = 0.0) -> Step:
        """Return the step of a method that plans every ``period`` s.

        Its twist is cut to the limits. Without a context the reference drives the
        desired twist from the robot's pose.

        Args:
            last: Twist driven last.
            plan: The method.
            period: s between two plans; 0: every step. A command is held in between.
        """
        dt, count = self.settings.dt, 0
        every = max(1, round(period / dt))
        answer: Command | None = None
        numbers, footprint = self.robot.limit_vector, self.robot.footprint

        def step(
            v: float,
            omega: float,
            obstacles: Obstacles,
            context: StepContext | None = None,
        ) -> Decision:
            nonlocal last, answer, count
            started = perf_counter()
            if not (math.isfinite(v) and math.isfinite(omega)):
                raise InvalidInputError("the desired twist (v, omega) must be finite")
            here, nowhere = (0.0, 0.0, 0.0), (math.inf, 0.0, 0.0)
            context = context or StepContext(here, here, (v, omega), nowhere, last)
            if count % every == 0:
                answer = plan((v, omega), obstacles, context)
            count += 1
            twist, status, slack, shortfall, lateral = answer or Command((v, omega))
            if status is Status.STOPPED:
                twist = braking_twist(numbers, *context.driven, dt)
            # From the measured twist: a base slips and lags.
            last = limit_twist(numbers, twist, context.driven, dt)
            off = max(abs(last[0] - v), abs(last[1] - omega), abs(lateral))
            # A solver returns the desired twist with rounding if nothing constrains it;
            # all methods then have the same status.
            if status in (Status.FILTERED, Status.STEERED) and off <= SAME_TWIST:
                status = Status.TRACKING
            clearance = clearance_of(footprint, obstacles.arrays)
            elapsed = perf_counter() - started
            more = elapsed, shortfall, lateral
            return Decision(*last, status, clearance, slack, 0.0, (), *more)

        return step

    def limited(self, twist: Twist, context: StepContext) -> Twist:
        """Return the twist that the robot can drive in the coming step."""
        numbers, dt = self.robot.limit_vector, self.settings.dt
        return limit_twist(numbers, twist, context.driven, dt)

    def brake(self, context: StepContext) -> Command:
        """Return full braking along the arc of the twist driven last, or holding."""
        if not any(context.driven):
            return Command((0.0, 0.0), Status.HOLDING)
        numbers, dt = self.robot.limit_vector, self.settings.dt
        return Command(braking_twist(numbers, *context.driven, dt), Status.BRAKING)

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the command; None: the desired twist."""
        return None


def round_robot(robot: Robot, ahead: float) -> float:
    """Return the radius (m) of the circle about (ahead, 0) around the footprint."""
    x, y = robot.footprint.vertices.T
    return float(np.hypot(x - ahead, y).max())


@lru_cache(maxsize=32)
def body_discs(robot: Robot, count: int) -> tuple[tuple[float, float], ...]:
    """Return discs that cover the footprint: x of the centre, radius, m.

    The footprint is cut across into ``count`` equal lengths, each covered by the least
    disc about a point of the x-axis, to the nearest of 200.
    """
    corners = robot.footprint.vertices
    ends = np.vstack([np.roll(x, -1, axis=0) for x in robot.footprint.outlines])
    cuts = np.linspace(corners[:, 0].min(), corners[:, 0].max(), count + 1)
    discs = []
    for low, high in pairwise(cuts.tolist()):
        held = [corners[(corners[:, 0] >= low) & (corners[:, 0] <= high)]]
        for cut in (low, high):
            across = (corners[:, 0] - cut) * (ends[:, 0] - cut) < 0.0
            start, way = corners[across], (ends - corners)[across]
            held.append(start + (cut - start[:, :1]) / way[:, :1] * way)
        x, y = np.vstack(held).T
        centres = np.linspace(low, high, 200)
        radii = np.hypot(x - centres[:, None], y).max(axis=1)
        best = int(radii.argmin())
        discs.append((float(centres[best]), float(radii[best])))
    return tuple(discs)
