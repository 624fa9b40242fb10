"""ORCA: reciprocal velocity obstacles [vandenBerg2011], by the RVO2 library (pyrvo)."""

import math
from dataclasses import dataclass
from typing import Any

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import MissingExtraError
from qpavoid.lab.baselines.drive import (
    VIOLATED,
    Command,
    round_robot,
    stepping,
    wide_discs,
    wide_still,
)
from qpavoid.model.capsules import X1, Y1, Y2
from qpavoid.model.given import NO_POINTS
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
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
    """ORCA for a differential drive by its effective centre [Snape2010].

    The point ``ahead`` of the axle moves with (v, ω·ahead), any way that it likes; it
    is the agent, and its circle holds the footprint, widened by r_min. Points and discs
    are agents, walls and polygons that stand are RVO2's obstacles. RVO2 knows none that
    move: such a wall or polygon is an agent, the disc round its pivot that holds it. It
    lets each of two agents take half of the evasion. What is met here takes none, so
    the library is asked ``rounds`` times, each time from the velocity that it found:
    all but 2^−rounds of it is taken. A velocity beyond the limits is slowed down,
    direction kept. Where the desired twist needs no evasion it is driven; else the
    preferred velocity is that to the goal: a reference that waits behind an obstacle
    would hold ORCA up for good.

    The disc of 0.62 m about the centre, 0.1 m ahead, is all but the least that holds
    the pentagon; of 12 forests it crossed none. Two discs of 0.4 m, the rows of both in
    (v, ω), passed 7 of 8 strangers in 25.0 s instead of 6 in 18.6 s, and did worse at a
    disc that stands beside the way.

    Attributes:
        robot: Footprint and limits.
        settings: Radii and control step.
        ahead: Effective centre before the axle, m.
        horizon: τ, s, for points and discs.
        horizon_still: τ, s, for walls.
        gain: 1/s; see :meth:`preferred`.
        rounds: How often the library is asked.

    Raises:
        MissingExtraError: pyrvo is not installed.
    """

    robot: Robot
    settings: AvoidanceSettings
    ahead: float = 0.1
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
            wanted = self.velocity(*desired)
            world = self.evade(context, wanted, discs, still)
            if math.dist(found_by(world), wanted) <= SINGLE:
                return None
            world = self.evade(context, self.preferred(context), discs, still)
            v, sideways = found_by(world)
            v, omega = self.slowed(v, sideways / self.ahead)
            lacks = violation(world, self.velocity(v, omega))
            if lacks > VIOLATED:
                return Command((v, omega), Status.RELAXED, lacks)
            return Command((v, omega))

        return stepping(self.robot, self.settings.dt, (v, omega), plan)

    def velocity(self, v: float, omega: float) -> Twist:
        """Return the velocity of the effective centre, m/s, robot frame."""
        return v, omega * self.ahead

    def preferred(self, context: StepContext) -> Twist:
        """Return the velocity, m/s, that brings the effective centre to the goal's.

        ``gain`` times the way to it, at most full speed, turned a little aside.
        """
        x, y, heading = context.goal
        x += self.ahead * (math.cos(heading) - 1.0)
        y += self.ahead * math.sin(heading)
        away = math.hypot(x, y)
        if not 0.0 < away < math.inf:
            return 0.0, 0.0
        speed = min(self.gain * away, self.robot.limits.v_max)
        x, y = speed * x / away, speed * y / away
        return x - ASIDE * y, y + ASIDE * x

    def evade(
        self, context: StepContext, wanted: Twist, discs: Array, still: list[Array]
    ) -> Any:
        """Return RVO2's simulator after the step that evades.

        Args:
            context: Of the step.
            wanted: Velocity that the effective centre prefers, m/s, robot frame.
            discs: As :func:`qpavoid.lab.baselines.drive.wide_discs` gives them.
            still: Corners of what stands, as :func:`by_motion` gives them.
        """
        velocity = self.velocity(*context.driven)
        for _ in range(self.rounds):
            world = self.world(velocity, wanted, discs, still)
            world.do_step()
            velocity = found_by(world)
        return world

    def world(
        self, velocity: Twist, wanted: Twist, discs: Array, still: list[Array]
    ) -> Any:
        """Return RVO2's simulator before a step; the robot is agent 0."""
        limits, r_min = self.robot.limits, wide_still(self.settings)
        fastest = max(limits.v_max, -limits.v_min, math.hypot(*wanted))
        sees = 10.0 * self.horizon
        horizons = self.horizon, self.horizon_still
        radius = round_robot(self.robot, self.ahead) + r_min
        agent = sees, NEIGHBOURS, *horizons, radius, fastest
        sim = library().RVOSimulator(self.settings.dt, *agent)
        sim.add_agent((self.ahead, 0.0), *agent, velocity)
        sim.set_agent_pref_velocity(0, wanted)
        # r_min is in their radius and in the robot's: once is enough. They look at
        # nobody (0 neighbours), so they go on as they do.
        for x, y, r, v_x, v_y in discs.tolist():
            sim.add_agent((x, y), 0.0, 0, *horizons, r - r_min, fastest, (v_x, v_y))
        for corners in still:
            sim.add_obstacle([(x, y) for x, y in corners.tolist()])
        sim.process_obstacles()
        return sim

    def slowed(self, v: float, omega: float) -> Twist:
        """Return the twist within the limits that moves the same way."""
        limits = self.robot.limits
        v_most = limits.v_max if v > 0.0 else -limits.v_min
        omega_most = limits.omega_max if omega > 0.0 else -limits.omega_min
        shares = [1.0]
        shares += [v_most / abs(v)] if abs(v) > v_most else []
        shares += [omega_most / abs(omega)] if abs(omega) > omega_most else []
        return min(shares) * v, min(shares) * omega


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


def found_by(world: Any) -> Twist:
    """Return the velocity that RVO2 found for the effective centre, m/s."""
    velocity = world.get_agent_velocity(0)
    return velocity.x, velocity.y


def violation(world: Any, velocity: Twist) -> float:
    """Return by how much (m/s) a velocity violates RVO2's half-planes; 0: not at all.

    What may be driven lies to the left of a line.
    """
    worst = 0.0
    for i in range(world.get_agent_num_orca_lines(0)):
        (d_x, d_y), (p_x, p_y) = world.get_agent_orca_line(0, i)
        off_x, off_y = p_x - velocity[0], p_y - velocity[1]
        worst = max(worst, d_x * off_y - d_y * off_x)
    return worst


def library() -> Any:
    """Return pyrvo, or raise MissingExtraError."""
    try:
        import pyrvo
    except ImportError:
        raise MissingExtraError("pyrvo", "baselines") from None
    return pyrvo
