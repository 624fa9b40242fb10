"""Static scenes, hostile drivers, and the filter between them."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from driven import gap_at, least_in_all, lines_of_world, off_the_arcs
from qpavoid.avoidance.decision import (
    BRAKING,
    HOLDING,
    RELAXED,
    STATUSES,
    STOPPED,
    TRACKING,
)
from qpavoid.avoidance.plan import STATE_SIZE, set_driven
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.avoidance.step import filter_step, memory_size
from qpavoid.model.capsules import in_robot_frame
from qpavoid.model.contacts import (
    CONTACT_SIZE,
    contact_at,
    contact_table,
    most_contacts,
)
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot, braking_twist, twist_box

ROBOT = Robot.mir100()
LIMITS = {
    "no accelerations": ROBOT.limits,
    "accelerations": replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5),
    "wheels": Limits(-0.4, 1.0, -0.8, 1.5, 0.7, 1.2, wheel_speed=0.9, track=0.5),
}
R_MIN = 0.17


class Outcome(NamedTuple):
    """Least distance on the way (m), excess over the limits, decisions that lie."""

    least: float
    excess: float
    lies: int


def epsilon(r_min):
    """By how much r_min may be undercut, m: by the theorem, and by rounding."""
    return min(1e-3, 0.5 * r_min) + 1e-7


def worst_twist(edges, circumradius, seen, contacts):
    """The twist that drives fastest towards the nearest obstacle."""
    _, nearest = contact_table(edges, circumradius, seen, 0.0, contacts)
    c = contact_at(contacts, nearest)
    return math.copysign(9.0, c.n_x), math.copysign(9.0, c.n_y * c.x - c.n_x * c.y)


def drive_blindly(
    edges, robot, settings, ahead, world, demands, hunted, twist, counts, trace
):
    """Drive what the filter makes of the demands; return the excess, and the lies.

    The excess over box, wheels and accelerations is the greatest; a lie is a decision
    whose status is not true. ``counts``: how often each status was given. ``trace``
    (steps, 5): pose at the start of a step, and its twist.
    """
    dt, state = float(settings["dt"][0]), np.zeros(STATE_SIZE)
    seen = world[0].copy(), world[1].copy()
    most = most_contacts(edges, world)
    memory = np.empty(memory_size(most, settings))
    contacts = np.empty(most * CONTACT_SIZE)
    set_driven(state, twist[0], twist[1])
    x = y = heading = 0.0
    excess, lies = 0.0, 0
    for step in range(demands.shape[0]):
        in_robot_frame((x, y, heading), step * dt, world, seen)
        d_v, d_omega = demands[step]
        if hunted[step]:
            d_v, d_omega = worst_twist(edges, robot[8], seen, contacts)
        old_v, old_omega = state[0], state[1]
        code, v, omega, _, slack, _, shortfall, _, _ = filter_step(
            edges,
            robot,
            settings,
            seen[0],
            seen[1],
            0.0,
            ahead,
            d_v,
            d_omega,
            state,
            memory,
        )
        counts[code] += 1
        trace[step] = (x, y, heading, v, omega)
        box = twist_box(robot, old_v, old_omega, dt)
        wheel = abs(v) + 0.5 * robot[7] * abs(omega) - robot[6]
        excess = max(excess, box[0] - v, v - box[1], box[2] - omega, omega - box[3])
        excess = max(excess, wheel)
        if code == TRACKING and not (v == d_v and omega == d_omega):
            lies += 1
        if code == TRACKING and (slack > 0.0 or shortfall > 0.0):
            lies += 1
        if code == RELAXED and not (slack > 0.0 or shortfall > 0.0):
            lies += 1
        if code == BRAKING or code == HOLDING or code == STOPPED:
            b_v, b_omega = braking_twist(robot, old_v, old_omega, dt)
            stands = v == 0.0 and omega == 0.0
            if not (v == b_v and omega == b_omega) or (code == HOLDING and not stands):
                lies += 1
        x, y, heading = arc(x, y, heading, v, omega, dt)
    return excess, lies


def make_scene(rng, least=R_MIN, most=2.0, parts=ROBOT.footprint.parts):
    """Points, discs and walls at rest round the robot, none nearer than ``least``."""
    while True:
        n_points, n_discs, n_walls = rng.integers(0, 8), *rng.integers(0, 4, 2)
        bearing = rng.uniform(-math.pi, math.pi, n_points + n_discs)
        reach = rng.uniform(0.3, most, n_points + n_discs)
        places = (reach * [np.cos(bearing), np.sin(bearing)]).T
        radii = rng.uniform(0.0, 0.4, n_discs)
        ends = rng.uniform(-most, most, (n_walls, 4))
        world = Obstacles(
            points=places[:n_points],
            discs=np.column_stack([places[n_points:], radii]),
            walls=ends,
        )
        if not len(world):
            continue
        lines, rest = lines_of_world(world), (0.0, 0.0, 0.0)
        gaps = [min(gap_at(x, rest, line, 0.0) for x in parts) for line in lines]
        kept = np.array(gaps) >= least
        if kept.any():
            discs = kept[n_points : n_points + n_discs]
            return Obstacles(
                points=world.points[kept[:n_points]],
                discs=world.discs[discs],
                walls=world.walls[kept[n_points + n_discs :]],
            )


def make_demands(rng, steps, dt):
    """Twists held for random times, to and fro at full rate, and straight at them."""
    demands, hunted = np.empty((steps, 2)), np.zeros(steps, dtype=np.bool_)
    k = 0
    while k < steps:
        end = k + max(1, round(rng.exponential(0.6) / dt))
        kind = rng.integers(4)
        if kind == 0:
            demands[k:end] = rng.uniform([-1.2, -2.0], [1.2, 2.0])
        elif kind == 1:
            demands[k:end] = rng.choice([-9.0, 0.0, 9.0], (len(demands[k:end]), 2))
        else:
            demands[k:end] = rng.choice([-9.0, -0.1, 0.0, 0.1, 9.0], 2)
            hunted[k:end] = kind == 3
        k = end
    return demands, hunted


@dataclass(frozen=True)
class Case:
    """A robot, a control step and a filter."""

    limits: str = "accelerations"
    dt: float = 0.05
    ahead: bool = False
    braking_room: bool = True
    r_min: float = R_MIN
    gamma: float = 2.0
    footprint: Footprint = ROBOT.footprint

    @property
    def robot(self):
        return replace(ROBOT, footprint=self.footprint, limits=LIMITS[self.limits])

    @property
    def settings(self):
        radius = SafetyRadius(self.r_min, self.r_min)
        return AvoidanceSettings(
            radius, gamma=self.gamma, dt=self.dt, braking_room=self.braking_room
        )

    def drive(self, world, demands, hunted, twist=(0.0, 0.0)):
        """Return the outcome, the count of each status, and the trace of one scene."""
        counts, trace = np.zeros(len(STATUSES), dtype=int), np.empty((len(demands), 5))
        excess, lies = drive_blindly(
            self.robot.footprint.edges,
            self.robot.limit_vector,
            self.settings.record(),
            self.ahead,
            world.arrays,
            demands,
            hunted,
            twist,
            counts,
            trace,
        )
        lines, parts = lines_of_world(world), self.footprint.parts
        least = min(least_in_all(part, trace, self.dt, lines) for part in parts)
        assert off_the_arcs(trace, self.dt) < 1e-6
        return Outcome(least, excess, lies), counts, trace

    def study(self, scenes, seed, seconds=5.0):
        """Return outcomes (scenes, 3) and how often each status was given.

        The robot starts at rest, with every obstacle at r_min or farther.
        """
        outcomes = np.zeros((scenes, 3))
        counts = np.zeros(len(STATUSES), dtype=np.int64)
        for i in range(scenes):
            rng = np.random.default_rng([seed, i])
            world = make_scene(rng, self.r_min, parts=self.footprint.parts)
            demands = make_demands(rng, round(seconds / self.dt), self.dt)
            outcomes[i], given, _ = self.drive(world, *demands)
            counts += given
        return outcomes, counts
