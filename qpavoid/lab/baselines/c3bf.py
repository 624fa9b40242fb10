"""Collision-cone control barrier functions in a QP [Tayal2024]."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.discs import body_of
from qpavoid.lab.baselines.drive import (
    FAILED,
    Command,
    moving_points,
    stepping,
    wide_discs,
)
from qpavoid.model.capsules import X1, Y2
from qpavoid.model.obstacles import Obstacles, nearest_on_lines
from qpavoid.model.robot import Robot, twist_box
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import solve
from qpavoid.types import Array, Twist

SLOW = 1e-3
"""m/s; below this relative speed a cone has no direction."""


@dataclass(frozen=True)
class CollisionConeController:
    """C3BF-QP: the relative velocity must leave, or stay out of, every collision cone.

    For the point ``ahead`` of the axle, with p and w the position and velocity of a
    disc relative to it, and R the disc's radius, r_min and the radius of the circle
    round that point that holds the footprint,

        h = p·w + |w| √(|p|² − R²),   ḣ ≥ −γ h.

    As in the paper the inputs are accelerations of the unicycle; over one control step
    they are (u − u_driven)/dt, which makes the row linear in the next twist u. A disc
    closer than R has no cone: its row then lets it come no nearer. At rest the cone
    is that of the desired twist. A wall or polygon is a disc of radius 0 at its nearest
    point, with the velocity of that. With two ``discs`` that hold the footprint
    together each of them has such rows, for its centre.

    Attributes:
        robot: Footprint and limits.
        settings: Radii, weights of the QP and control step.
        ahead: Of the axle, m; without it turning would have no effect on a robot at
            rest. Of one disc; several are where ``body_discs`` puts them.
        gamma: γ, 1/s.
        reach: m; what is farther away gets no row.
        discs: How many hold the body.
    """

    robot: Robot
    settings: AvoidanceSettings
    ahead: float = 0.2
    gamma: float = 5.0
    reach: float = 4.0
    discs: int = 1

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        return stepping(self.robot, self.settings.dt, (v, omega), self.plan)

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the QP's answer; None where it is the desired twist."""
        problem = self.problem(desired, obstacles, context.driven)
        solution = solve(problem, "exact", self.settings.slack_tolerance)
        if solution.status is SolveStatus.FAILED:
            return FAILED
        relaxed = solution.status is SolveStatus.RELAXED
        status = Status.RELAXED if relaxed else Status.FILTERED
        v, omega = solution.u.tolist()
        return Command((v, omega), status, solution.slack)

    def problem(
        self, desired: Twist, obstacles: Obstacles, driven: Twist
    ) -> FilterProblem:
        """Return the QP of a step: rows of what is within reach, and the wheels'."""
        bodies = body_of(self.robot, self.ahead, self.discs)
        found = [
            replace(self, ahead=x).rows(radius, desired, obstacles, driven)
            for x, radius in bodies
        ]
        near, rows = (np.concatenate(part) for part in zip(*found, strict=True))
        limits, dt = self.robot.limits, self.settings.dt
        wheels = [(-i, -0.5 * j * limits.track) for i in (1, -1) for j in (1, -1)]
        wheels = wheels if limits.wheel_speed < math.inf else []
        speeds = [(*row, -limits.wheel_speed) for row in wheels]
        rows = np.vstack([rows, np.array(speeds).reshape(-1, 3)])
        box = twist_box(self.robot.limit_vector, *driven, dt)
        return FilterProblem(
            desired=np.array(desired),
            weights=np.array(self.settings.weights),
            A=rows[:, :2],
            b=rows[:, 2],
            lower=np.array(box[::2]),
            upper=np.array(box[1::2]),
            obstacle=np.array([*near, *[-1] * len(wheels)], dtype=np.int64),
            n_hard=len(wheels),
        )

    def rows(
        self, radius: float, desired: Twist, obstacles: Obstacles, driven: Twist
    ) -> tuple[npt.NDArray[np.int64], Array]:
        """Return which obstacles are within reach of the disc, and their rows.

        Args:
            radius: Of the disc, m.
            desired: u_f.
            obstacles: Around the robot.
            driven: The twist driven last.
        """
        feet = nearest_feet(obstacles, self.ahead)
        discs = wide_discs(obstacles, self.settings, feet)
        discs[:, 0] -= self.ahead
        discs[:, 2] += radius
        gap = np.hypot(discs[:, 0], discs[:, 1]) - discs[:, 2]
        near = np.flatnonzero(gap < self.reach)
        return near, self.row(discs[near], desired, driven)

    def row(self, discs: Array, desired: Twist, driven: Twist) -> Array:
        """Return a_v, a_ω, b (…, 3) of a·u ≥ b, scaled to 1 in v and ω·ahead.

        Args:
            discs: (…, 5) x, y relative to the point ahead, R (m), v_x, v_y (m/s).
            desired: u_f.
            driven: The twist driven last.
        """
        g, drift, h = self.barrier(discs, driven, desired)
        # g·ẇ + drift ≥ −γ h with ẇ = (u_driven − u)/dt of the point ahead, times dt.
        a = -g * (1.0, self.ahead)
        b = a @ np.array(driven) - self.settings.dt * (self.gamma * h + drift)
        # Nearer than R, p·(v_o − u) ≥ 0: the distance of the centre may not shrink.
        b = np.where(np.isnan(h), -(g * discs[..., 3:]).sum(axis=-1), b)
        size = np.hypot(g[..., 0], g[..., 1])
        row: Array = np.stack([a[..., 0], a[..., 1], b], axis=-1)
        return row / np.where(size > 0.0, size, 1.0)[..., None]

    def barrier(
        self, discs: Array, driven: Twist, desired: Twist
    ) -> tuple[Array, Array, Array]:
        """Return ∂h/∂w (…, 2), ḣ without input, and h; NaN for a disc nearer than R.

        There the first is p. Everything in the robot frame; the point ahead is
        accelerated by (v̇ − ω²·ahead, ω̇·ahead + v ω).
        """
        p, w = discs[..., :2], discs[..., 3:] - (driven[0], driven[1] * self.ahead)
        square = (p * p).sum(axis=-1) - discs[..., 2] ** 2
        root = np.sqrt(np.maximum(square, 0.0))
        speed = np.hypot(w[..., 0], w[..., 1])
        still = discs[..., 3:] - (desired[0], desired[1] * self.ahead)
        to = np.where((speed < SLOW)[..., None], still, w)
        size = np.hypot(to[..., 0], to[..., 1])
        g = p + (root / np.where(size > 0.0, size, 1.0))[..., None] * to
        (v, omega), along = driven, (p * w).sum(axis=-1)
        drift = speed * (speed + along / np.where(root > 0.0, root, 1.0))
        drift += g @ np.array([omega * omega * self.ahead, -v * omega])
        return g, drift, np.where(square > 0.0, along + speed * root, np.nan)


def nearest_feet(obstacles: Obstacles, ahead: float) -> Array:
    """Return the point (n, 5) nearest to (ahead, 0) of each wall and polygon.

    x, y, 0 (m), v_x, v_y (m/s).
    """
    capsules, starts = obstacles.capsules, obstacles.starts
    places = nearest_on_lines(capsules[:, X1 : Y2 + 1], ahead)
    gaps = np.hypot(places[:, 0] - ahead, places[:, 1])
    of = np.repeat(np.arange(len(starts)), obstacles.sizes)
    nearest = np.lexsort((gaps, of))[starts][~obstacles.is_disc[starts]]
    return moving_points(capsules[nearest], places[nearest])
