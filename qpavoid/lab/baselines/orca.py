"""ORCA: reciprocal velocity obstacles [vandenBerg2011], by the RVO2 library (pyrvo)."""

import math
from dataclasses import dataclass
from typing import Any

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import MissingExtraError
from qpavoid.lab.baselines.drive import (
    FAILED,
    VIOLATED,
    Command,
    body_discs,
    stepping,
    twist_problem,
    wide_discs,
    wide_still,
)
from qpavoid.model.capsules import X1, Y1, Y2
from qpavoid.model.given import NO_POINTS
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import Solution, SolveStatus
from qpavoid.qp.solve import solve
from qpavoid.types import Array, Twist

NEIGHBOURS = 60
"""Nearest points and discs that the library looks at."""

ASIDE = 0.01
"""rad by which the preferred velocity is turned, much as in RVO2's examples: perfect
symmetry then holds no robot up."""

SINGLE = 1e-4
"""m/s; the library counts in single precision."""


@dataclass(frozen=True)
class OrcaController:
    """ORCA for a differential drive by effective centres [Snape2010].

    The body is ``discs`` discs that hold the footprint, widened by r_min. The centre of
    each, on the x-axis at c, moves with (v, ω c), any way that it likes: it is an
    agent, and its half-planes are rows in (v, ω); the nearest twist that all of them
    allow is driven, within the robot's limits. Points and obstacles' discs are agents,
    walls and polygons that stand are RVO2's obstacles. RVO2 knows none that move: such
    a wall or polygon is an agent, the disc round its pivot that holds it. It lets each
    of two agents take half of the evasion. What is met here takes none, so the library
    is asked ``rounds`` times, each time from the twist that was found: all but
    2^−rounds of it is taken. Where the desired twist needs no evasion it is driven;
    else the preferred velocity is that to the goal: a reference that waits behind an
    obstacle would hold ORCA up for good.

    Attributes:
        robot: Footprint and limits.
        settings: Radii and control step.
        discs: Of the body.
        horizon: τ, s, for points and discs.
        horizon_still: τ, s, for walls.
        gain: 1/s; see :meth:`preferred`.
        rounds: How often the library is asked.

    Raises:
        MissingExtraError: pyrvo is not installed.
    """

    robot: Robot
    settings: AvoidanceSettings
    discs: int = 2
    horizon: float = 1.0
    horizon_still: float = 1.0
    gain: float = 1.5
    rounds: int = 4

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        library()

        def plan(
            desired: Twist, obstacles: Obstacles, context: StepContext
        ) -> Command | None:
            still, moving = by_motion(obstacles)
            discs = wide_discs(moving, self.settings)
            found = self.evade(context, desired, discs, still)
            if math.dist(found.u, desired) > SINGLE:
                found = self.evade(context, self.preferred(context), discs, still)
            v, omega = found.u.tolist()
            if found.status is SolveStatus.FAILED:
                return FAILED
            if found.slack > VIOLATED:
                return Command((v, omega), Status.RELAXED, found.slack)
            return Command((v, omega))

        return stepping(self.robot, self.settings.dt, (v, omega), plan)

    def preferred(self, context: StepContext) -> Twist:
        """Return the twist that brings the foremost centre to where the goal has it.

        Its velocity is ``gain`` times the way, at most full speed, turned a little
        aside.
        """
        ahead, _ = self.body[-1]
        x, y, heading = context.goal
        x += ahead * (math.cos(heading) - 1.0)
        y += ahead * math.sin(heading)
        away = math.hypot(x, y)
        if not 0.0 < away < math.inf:
            return 0.0, 0.0
        speed = min(self.gain * away, self.robot.limits.v_max)
        x, y = speed * x / away, speed * y / away
        return x - ASIDE * y, (y + ASIDE * x) / ahead

    @property
    def body(self) -> tuple[tuple[float, float], ...]:
        """Discs that hold the footprint, from the rear: x of the centre, radius, m."""
        return body_discs(self.robot, self.discs)

    def evade(
        self, context: StepContext, wanted: Twist, discs: Array, still: list[Array]
    ) -> Solution:
        """Return the twist that evades.

        Args:
            context: Of the step.
            wanted: v, ω that would be driven.
            discs: As :func:`qpavoid.lab.baselines.drive.wide_discs` gives them.
            still: Corners of what stands, as :func:`by_motion` gives them.
        """
        weights, twist = (1.0, self.body[-1][0] ** 2), context.driven
        for _ in range(self.rounds):
            rows = [
                row
                for ahead, radius in self.body
                for row in self.rows((ahead, radius), twist, discs, still)
            ]
            problem = twist_problem(
                self.robot, self.settings, wanted, context.driven, rows, weights
            )
            found = solve(problem, "exact", self.settings.slack_tolerance)
            before, twist = twist, found.u.tolist()
            if math.dist(before, twist) <= SINGLE:
                break
        return found

    def rows(
        self, disc: Twist, twist: Twist, discs: Array, still: list[Array]
    ) -> list[tuple[float, float, float, int]]:
        """Return RVO2's half-planes for a disc of the body as rows a·u ≥ b.

        What may be driven lies to the left of a line.

        Args:
            disc: x of the centre and radius, m.
            twist: From which each half-plane takes half of the evasion.
            discs: As :func:`qpavoid.lab.baselines.drive.wide_discs` gives them.
            still: Corners of what stands, as :func:`by_motion` gives them.
        """
        (ahead, radius), r_min = disc, wide_still(self.settings)
        limits, velocity = self.robot.limits, (twist[0], twist[1] * disc[0])
        fastest = max(limits.v_max, -limits.v_min, math.hypot(*velocity))
        horizons = self.horizon, self.horizon_still
        agent = 10.0 * self.horizon, NEIGHBOURS, *horizons, radius + r_min, fastest
        sim = library().RVOSimulator(self.settings.dt, *agent)
        sim.add_agent((ahead, 0.0), *agent, velocity)
        for x, y, r, v_x, v_y in discs.tolist():
            sim.add_agent((x, y), 0.0, 0, *horizons, r - r_min, fastest, (v_x, v_y))
        for corners in still:
            sim.add_obstacle([(x, y) for x, y in corners.tolist()])
        sim.process_obstacles()
        sim.do_step()
        rows = []
        for i in range(sim.get_agent_num_orca_lines(0)):
            (d_x, d_y), (p_x, p_y) = sim.get_agent_orca_line(0, i)
            rows.append((-d_y, d_x * ahead, d_x * p_y - d_y * p_x, i))
        return rows


def by_motion(obstacles: Obstacles) -> tuple[list[Array], Obstacles]:
    """Return the corners (n, 2) of walls and polygons that stand, and all else.

    The rest are points and discs: those round what moves, too.
    """
    moves = ~obstacles.is_disc & (obstacles.speeds > 0.0)
    still = obstacles.chosen(~moves)
    moving = Obstacles.of(NO_POINTS, obstacles.capsules[moves]).as_discs
    corners = [
        one[:, X1 : Y1 + 1] if len(one) > 1 else one[0, X1 : Y2 + 1].reshape(2, 2)
        for one in still.lengthy
    ]
    return corners, still.chosen(still.is_disc).joined(moving)


def library() -> Any:
    """Return pyrvo, or raise MissingExtraError."""
    try:
        import pyrvo
    except ImportError:
        raise MissingExtraError("pyrvo", "baselines") from None
    return pyrvo
