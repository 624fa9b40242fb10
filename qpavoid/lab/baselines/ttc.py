"""NH-TTC: subgradient descent on the time to collision [Davis2020]."""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import StepContext
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.lab.baselines.drive import Baseline, Command, reference_ahead
from qpavoid.lab.baselines.predictive import PERIOD, everything_wide
from qpavoid.model.contact import point_contact
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import twist_box
from qpavoid.types import Box, Discs, Edges, Twist

TOUCH = 1e-3
"""m; distance that counts as a collision in conservative advancement."""

OUT = 0.01
"""m; distance to which a disc in contact is shrunk: the original's."""

SMALL = 1e-5
"""s, m/s and rad/s: differences for the derivatives of the distance."""

FLATTEST = 1e-5
"""Least |g|², so that a step on a plateau is bounded; the box cuts longer ones."""

STEEPEST = 1e-2
"""m/s; least approach speed of a disc, for grazing contacts."""

FASTEST = 10.0
"""m/s and rad/s; greatest twist that is tried for a robot without limits."""


class Problem(NamedTuple):
    """Context of the cost of a twist.

    Attributes:
        edges: Of the footprint.
        circumradius: m.
        discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        target: x, y, robot frame, m.
        preview: s after which the robot should be there.
        horizon: s; later collisions do not count.
        weight: k_ttc, m s.
        box: Admissible twists.
    """

    edges: Edges
    circumradius: float
    discs: Discs
    target: tuple[float, float]
    preview: float
    horizon: float
    weight: float
    box: Box


@compiled
def gap(by: Problem, i: int, twist: Twist, time: float) -> float:
    """Return the distance (m) of the footprint from a disc after ``time`` s."""
    x, y, heading = arc(0.0, 0.0, 0.0, twist[0], twist[1], time)
    d_x = by.discs[i, 0] + time * by.discs[i, 3] - x
    d_y = by.discs[i, 1] + time * by.discs[i, 4] - y
    cos, sin = math.cos(heading), math.sin(heading)
    contact = point_contact(by.edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x)
    return float(contact.distance - by.discs[i, 2])


@entry
@compiled_once
def first_met(by: Problem, twist: Twist) -> tuple[float, int]:
    """Return the time to collision of a twist (s, at most the horizon), and the disc.

    −1: none. A disc within :data:`TOUCH` that approaches is a collision at once.
    """
    end, first = by.horizon, -1
    for i in range(by.discs.shape[0]):
        speed = abs(twist[0]) + abs(twist[1]) * by.circumradius
        speed += math.sqrt(by.discs[i, 3] ** 2 + by.discs[i, 4] ** 2)
        x, y, time = by.discs[i, 0], by.discs[i, 1], 0.0
        away = math.sqrt(x * x + y * y) - by.discs[i, 2] - by.circumradius
        if away >= speed * end:
            continue
        while time < end:
            # Near and approaching: a twist away from a contact is free.
            room = gap(by, i, twist, time)
            if room <= TOUCH and gap(by, i, twist, time + SMALL) < room:
                end, first = time, i
            time += max(room, TOUCH) / max(speed, SMALL)
    return end, first


@compiled_once
def cost_of(by: Problem, twist: Twist) -> tuple[float, float, float]:
    """Return the cost of a twist, m, and its subgradient in v and ω.

    |p(t_p) − target| + k_ttc / t_c. The time of collision t_c(u) solves f(u, t_c) = 0,
    f the distance from the disc: ∂t_c/∂u = −(∂f/∂u)/(∂f/∂t).
    """
    (v, omega), t, h = twist, by.preview, SMALL
    x, y, _ = arc(0.0, 0.0, 0.0, v, omega, t)
    off_x, off_y = x - by.target[0], y - by.target[1]
    cost = math.sqrt(off_x * off_x + off_y * off_y)
    x_v, y_v, _ = arc(0.0, 0.0, 0.0, v + h, omega, t)
    x_o, y_o, _ = arc(0.0, 0.0, 0.0, v, omega + h, t)
    # The derivative of |p − target| is (p − target)·∂p/|p − target|: 0/0 at the target.
    unit = h * max(cost, h)
    g_v = (off_x * (x_v - x) + off_y * (y_v - y)) / unit
    g_o = (off_x * (x_o - x) + off_y * (y_o - y)) / unit
    met, i = first_met(by, twist)
    if i >= 0:
        met = max(met, TOUCH)
        room = gap(by, i, twist, met)
        # For a grazed disc ∂f/∂t = 0, and t_c has no derivative.
        rate = min((gap(by, i, twist, met + h) - room) / h, -STEEPEST)
        cost += by.weight / met
        share = by.weight / (met * met) / rate
        g_v += share * (gap(by, i, (v + h, omega), met) - room) / h
        g_o += share * (gap(by, i, (v, omega + h), met) - room) / h
    return cost, g_v, g_o


@entry
@compiled_once
def descend(by: Problem, start: Twist, steps: int) -> tuple[float, float, float]:
    """Return the least cost found by subgradient descent from a twist, its v and ω.

    Polyak's step with an unknown optimum, (C − C_best + γ_k)/|g|², γ_k = 10/(10 + k),
    then cut to the box.
    """
    v, omega = start
    best, best_v, best_omega = math.inf, v, omega
    for k in range(steps):
        v = min(max(v, by.box.v_min), by.box.v_max)
        omega = min(max(omega, by.box.omega_min), by.box.omega_max)
        cost, g_v, g_o = cost_of(by, (v, omega))
        if cost < best:
            best, best_v, best_omega = cost, v, omega
        size = (cost - best + 10.0 / (10.0 + k)) / max(g_v * g_v + g_o * g_o, FLATTEST)
        v, omega = v - size * g_v, omega - size * g_o
    return best, best_v, best_omega


@dataclass(frozen=True)
class TimeToCollisionController(Baseline):
    """The constant twist that trades the distance to the target against the collision.

    Minimises |p(t_p) − target| + k_ttc/t_c over twists; the target is the reference in
    t_p, t_c the time at which the footprint comes within r_min of an obstacle of
    constant velocity. The descent is the original's, by implicit differentiation, and
    starts from the twist driven last, from rest and from the desired one turned to
    either side. Only the first collision counts (``find_all_ttcs = false``: a wall is
    many points here, 0.2 m apart). The original has discs only; here the robot is its
    polygon. Left out: momentum of the descent (CFM), and reciprocity. Without
    constraints an unavoidable collision is delayed. If the desired twist has no
    collision within the horizon it is driven.

    Attributes:
        weight: k_ttc, m s.
        preview: t_p, s.
        horizon: s; later collisions do not count.
        steps: Of the descent, from each start.
        turn: rad/s, of the starts to either side.
    """

    period: ClassVar[float] = PERIOD
    weight: float = 3.0
    preview: float = 1.0
    horizon: float = 8.0
    steps: int = 40
    turn: float = 0.5

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the least costly twist that is found; None: the desired twist."""
        problem = self.problem(obstacles, context)
        wanted = self.limited(desired, context)
        if first_met(problem, wanted)[1] < 0:
            return None
        v, omega = wanted
        sides = ((v, omega + self.turn), (v, omega - self.turn))
        starts = (context.driven, (0.0, 0.0), *sides)
        _, v, omega = min(descend(problem, start, self.steps) for start in starts)
        return Command((v, omega))

    def problem(self, obstacles: Obstacles, context: StepContext) -> Problem:
        """Return the context of the cost of the twists of a step."""
        discs = everything_wide(obstacles, self.settings)
        footprint = self.robot.footprint
        for disc in discs:
            room = point_contact(footprint.edges, disc[0], disc[1]).distance
            # Else t_c = 0 for every twist, and descent fails.
            disc[2] = min(disc[2], room - OUT)
        x, y, _ = reference_ahead(context, self.robot, 1, self.preview)[0].tolist()
        box = twist_box(self.robot.limit_vector, *context.driven, self.settings.dt)
        return Problem(
            footprint.edges,
            footprint.circumradius,
            discs,
            (x, y),
            self.preview,
            self.horizon,
            self.weight,
            Box(*np.clip(box, -FASTEST, FASTEST).tolist()),
        )
