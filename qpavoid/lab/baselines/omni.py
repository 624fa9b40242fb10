"""Omnidirectional base: the filter with planar velocity as its unknown."""

import math
from dataclasses import dataclass

import numpy as np

from qpavoid.avoidance.cbf_rows import required_distance
from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.baselines.drive import FAILED, Command, stepping
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import TINY
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import solve
from qpavoid.types import Array, Twist


@dataclass(frozen=True)
class OmniController:
    """The nearest planar velocity w = (w_x, w_y) that keeps the required distances.

    A base that can move sideways, with the same footprint, limits and sensing: it shows
    the cost of the constraint of a differential drive. It is another machine, and no
    method for this robot.

        minimise |w − w_f|²   subject to   d̂ᵀ(w + ω × P_r) ≥ −γ (d − r_min) + d̂ᵀ v_o

    for every contact, and |w_x|, |w_y| within the robot's greatest speed and
    acceleration. It turns with its reference, ω = ω_r + k_γ sin e_γ; w_f is the
    reference's velocity plus k (e_x, e_y), robot frame.

    Not tuned: k and k_γ are those of the tracking law that the others have, γ is
    that of the filter.

    Attributes:
        robot: Footprint and limits.
        settings: Radii, γ and control step.
        gain: k, 1/s.
        turn_gain: k_γ, rad/s.
        reach: Greatest distance of an obstacle with a row, m.
    """

    robot: Robot
    settings: AvoidanceSettings
    gain: float = 1.0
    turn_gain: float = 2.0
    reach: float = 2.0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a base that drives (v, ω) at present."""
        lateral = 0.0

        def plan(desired: Twist, obstacles: Obstacles, context: StepContext) -> Command:
            nonlocal lateral
            turn = self.turn_rate(context)
            problem = self.problem(obstacles, context, turn, lateral)
            solution = solve(problem, "exact", self.settings.slack_tolerance)
            if solution.status is SolveStatus.FAILED:
                lateral = 0.0
                return FAILED
            relaxed = solution.status is SolveStatus.RELAXED
            status = Status.RELAXED if relaxed else Status.FILTERED
            ahead, lateral = solution.u.tolist()
            return Command((ahead, turn), status, solution.slack, lateral=lateral)

        return stepping(self.robot, self.settings.dt, (v, omega), plan)

    def turn_rate(self, context: StepContext) -> float:
        """Return ω, rad/s, within the limits."""
        limits, step = self.robot.limits, self.robot.limits.angular_acceleration
        step *= self.settings.dt
        omega = context.reference[1] + self.turn_gain * math.sin(context.target[2])
        omega = min(max(omega, context.driven[1] - step), context.driven[1] + step)
        return min(max(omega, limits.omega_min), limits.omega_max)

    def problem(
        self, obstacles: Obstacles, context: StepContext, turn: float, lateral: float
    ) -> FilterProblem:
        """Return the QP of a step; its unknowns are w_x and w_y, m/s.

        Args:
            obstacles: Robot frame.
            context: Of the step.
            turn: ω, rad/s.
            lateral: w_y driven last, m/s.
        """
        contacts = Contacts.of(self.robot.footprint, obstacles.within(self.sight()))
        record = self.settings.record()
        speeds = np.hypot(*contacts.velocity.T).tolist()
        r_min = [required_distance(record, speed, 0.0)[1] for speed in speeds]
        away = -contacts.normal
        swept = turn * np.column_stack([-contacts.point[:, 1], contacts.point[:, 0]])
        room = contacts.distance - np.array(r_min)
        rows = ((contacts.velocity - swept) * away).sum(axis=1)
        lower, upper = self.box((context.driven[0], lateral))
        return FilterProblem(
            desired=self.wanted(context),
            weights=np.ones(2),
            A=away,
            b=rows - self.settings.gamma * room,
            lower=lower,
            upper=upper,
            obstacle=contacts.obstacle,
        )

    def sight(self) -> float:
        """Return the greatest distance of an obstacle with a row from the origin, m."""
        return self.reach + self.robot.footprint.circumradius

    def box(self, driven: Twist) -> tuple[Array, Array]:
        """Return least and greatest w after a velocity driven last."""
        limits = self.robot.limits
        most, step = limits.v_max, limits.acceleration * self.settings.dt
        now = np.clip(driven, -most, most)
        return np.maximum(-most, now - step), np.minimum(most, now + step)

    def wanted(self, context: StepContext) -> Array:
        """Return w_f, m/s, robot frame, at most the robot's speed."""
        x, y, heading = context.target
        course = np.array([math.cos(heading), math.sin(heading)])
        wanted = context.reference[0] * course + self.gain * np.array([x, y])
        most = self.robot.limits.v_max
        return np.asarray(wanted * min(1.0, most / max(np.hypot(*wanted), TINY)))
