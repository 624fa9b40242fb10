"""ORCA: reciprocal velocity obstacles [vandenBerg2011], by the RVO2 library (pyrvo)."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.errors import MissingExtraError
from qpavoid.lab.baselines.drive import (
    RELAXED_FROM,
    Baseline,
    Command,
    round_robot,
    wide_discs,
    wide_still,
)
from qpavoid.model.capsules import X1, Y1, Y2
from qpavoid.model.obstacles import NO_POINTS, Obstacles
from qpavoid.types import Array, Twist

NEIGHBOURS = 60
"""Greatest number of nearest points and discs for the library."""

SYMMETRY_TURN = 0.01
"""rad by which the preferred velocity is turned, as in RVO2's examples: it breaks
perfect symmetry."""

SINGLE = 1e-4
"""m/s; tolerance of the library's single precision."""


class Near(NamedTuple):
    """Obstacles for RVO2, robot frame.

    Attributes:
        discs: (n, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        still: Corners of static obstacles, from :func:`by_motion`.
    """

    discs: Array
    still: list[Array]


@dataclass(frozen=True)
class OrcaController(Baseline):
    """ORCA for a differential drive by its effective centre [Snape2010].

    The point ``ahead`` of the axle moves with (v, ω·ahead) in any direction; it is the
    agent, and its circle contains the footprint, inflated by r_min. Points and discs
    are agents, static walls and polygons are RVO2's obstacles. A moving wall or polygon
    is an agent, the least disc about its pivot. In RVO2 each of two agents takes half
    of the evasion; obstacles here take none, so the library is called ``rounds`` times,
    each time from its last velocity: all but 2^−rounds of the evasion is taken. A
    velocity beyond the limits is scaled down. If the desired twist needs no evasion it
    is driven; else the preferred velocity is that to the goal, since a reference that
    waits behind an obstacle would stall ORCA.

    Attributes:
        ahead: Effective centre before the axle, m.
        horizon: τ, s, for points and discs.
        horizon_still: τ, s, for walls.
        gain: 1/s; see :meth:`preferred`.
        rounds: Number of calls of the library.

    Raises:
        MissingExtraError: pyrvo is not installed.
    """

    ahead: float = 0.3
    horizon: float = 3.0
    horizon_still: float = 1.0
    gain: float = 3.0
    rounds: int = 4

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        library()
        return super().start(v, omega)

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the twist; None for the desired one."""
        still, rest = by_motion(obstacles)
        near = Near(wide_discs(rest, self.settings), still)
        wanted, to_goal = self.velocity(*desired), self.preferred(context)
        fastest = max(map(self.fastest, (wanted, to_goal)))
        world = self.world(near, round_robot(self.robot, self.ahead), fastest)
        if math.dist(self.evade(world, context, wanted, near), wanted) <= SINGLE:
            return None
        v, sideways = self.evade(world, context, to_goal, near)
        v, omega = self.slowed(v, sideways / self.ahead)
        lacks = violation(world, self.velocity(v, omega))
        if lacks > RELAXED_FROM:
            return Command((v, omega), Status.RELAXED, lacks)
        return Command((v, omega))

    def velocity(self, v: float, omega: float) -> Twist:
        """Return the velocity of the effective centre, m/s, robot frame."""
        return v, omega * self.ahead

    def preferred(self, context: StepContext) -> Twist:
        """Return the velocity, m/s, of the effective centre to the goal's.

        ``gain`` times the difference, at most full speed, turned by SYMMETRY_TURN.
        """
        x, y, heading = context.goal
        x += self.ahead * (math.cos(heading) - 1.0)
        y += self.ahead * math.sin(heading)
        away = math.hypot(x, y)
        if not 0.0 < away < math.inf:
            return 0.0, 0.0
        speed = min(self.gain * away, self.robot.limits.v_max)
        x, y = speed * x / away, speed * y / away
        return x - SYMMETRY_TURN * y, y + SYMMETRY_TURN * x

    def evade(
        self, world: Any, context: StepContext, wanted: Twist, near: Near
    ) -> Twist:
        """Return the velocity of RVO2 after ``rounds``, m/s, robot frame.

        Args:
            world: RVO2's simulator, from :meth:`world`.
            context: Of the step.
            wanted: Preferred velocity of the effective centre, m/s, robot frame.
            near: Obstacles.
        """
        velocity = self.velocity(*context.driven)
        for _ in range(self.rounds):
            self.ask(world, near, velocity, wanted)
            now = world.get_agent_velocity(0)
            before, velocity = velocity, (now.x, now.y)
            if velocity == before:  # a fixed point
                break
        return velocity

    def fastest(self, wanted: Twist) -> float:
        """Return the greatest speed of RVO2's agent for a preferred velocity, m/s."""
        return max(
            self.robot.limits.v_max, -self.robot.limits.v_min, math.hypot(*wanted)
        )

    def world(self, near: Near, radius: float, fastest: float) -> Any:
        """Return RVO2's simulator of the obstacles; the robot's disc is agent 0.

        Without walls beyond ``horizon_still``: they have no effect but to split near
        walls along their lines.
        """
        r_min, sees = wide_still(self.settings), 10.0 * self.horizon
        horizons = self.horizon, self.horizon_still
        agent = sees, NEIGHBOURS, *horizons, radius + r_min, fastest
        sim = library().RVOSimulator(self.settings.dt, *agent)
        sim.add_agent((self.ahead, 0.0), *agent, (0.0, 0.0))
        # r_min would count in both radii: once is enough. With 0 neighbours the agents
        # keep their velocities.
        for x, y, r, v_x, v_y in near.discs.tolist():
            sim.add_agent((x, y), 0.0, 0, *horizons, r - r_min, fastest, (v_x, v_y))
        reach = radius + r_min + self.horizon_still * fastest
        for corners in near.still:
            low, high = (f(corners - (self.ahead, 0.0), 0) for f in (np.min, np.max))
            if np.hypot(*np.maximum(0.0, np.maximum(low, -high))) <= reach:
                sim.add_obstacle([(x, y) for x, y in corners.tolist()])
        sim.process_obstacles()
        return sim

    def ask(self, world: Any, near: Near, velocity: Twist, wanted: Twist) -> None:
        """Do a step of RVO2 from a velocity with a preferred one."""
        world.set_agent_max_speed(0, self.fastest(wanted))
        world.set_agent_pref_velocity(0, wanted)
        agents = {0: [self.ahead, 0.0, 0.0, *velocity]}
        # What a step of RVO2 changes: moving discs, and those that walls push.
        moves = np.flatnonzero(near.discs[:, 3:].any(axis=1) | bool(near.still))
        agents |= {k + 1: near.discs[k].tolist() for k in moves.tolist()}
        for i, (x, y, _, v_x, v_y) in agents.items():
            world.set_agent_position(i, (x, y))
            world.set_agent_velocity(i, (v_x, v_y))
        world.do_step()

    def slowed(self, v: float, omega: float) -> Twist:
        """Return the twist scaled into the limits."""
        limits = self.robot.limits
        v_most = limits.v_max if v > 0.0 else -limits.v_min
        omega_most = limits.omega_max if omega > 0.0 else -limits.omega_min
        shares = [1.0]
        shares += [v_most / abs(v)] if abs(v) > v_most else []
        shares += [omega_most / abs(omega)] if abs(omega) > omega_most else []
        return min(shares) * v, min(shares) * omega


def by_motion(obstacles: Obstacles) -> tuple[list[Array], Obstacles]:
    """Return the corners (n, 2) of static walls and polygons, and the other obstacles.

    The others are points and discs: those around moving obstacles, too.
    """
    moves = ~obstacles.is_disc & (obstacles.speeds > 0.0)
    still = obstacles.chosen(~moves)
    moving = Obstacles.of(NO_POINTS, obstacles.capsules[moves]).as_discs
    corners = [
        one[:, X1 : Y1 + 1] if len(one) > 1 else one[0, X1 : Y2 + 1].reshape(2, 2)
        for one in still.lengthy
    ]
    return corners, still.chosen(still.is_disc).joined(moving)


def violation(world: Any, velocity: Twist) -> float:
    """Return the violation of RVO2's half-planes by a velocity, m/s, at least 0.

    Allowed velocities lie to the left of a line.
    """
    (x, y), most = velocity, 0.0
    for i in range(world.get_agent_num_orca_lines(0)):
        (d_x, d_y), (p_x, p_y) = world.get_agent_orca_line(0, i)
        most = max(most, d_x * p_y - d_y * p_x + d_y * x - d_x * y)
    return most


def library() -> Any:
    """Return pyrvo, or raise MissingExtraError."""
    try:
        import pyrvo
    except ImportError:
        raise MissingExtraError("pyrvo", "baselines") from None
    return pyrvo
