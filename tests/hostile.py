"""Static scenes, hostile drivers, and the filter between them: one compiled loop."""

import math
from dataclasses import dataclass, replace

import numpy as np
from qpavoid.avoidance.ahead import fresh_state

from qpavoid.avoidance.decision import BRAKING, HOLDING, STATUSES, STOPPED, TRACKING
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.avoidance.step import filter_step, memory_rows
from qpavoid.compiled import allocating, compiled
from qpavoid.model.contacts import Contacts, contact_table, most_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles, in_robot_frame
from qpavoid.model.robot import Limits, Robot, braking_twist, twist_box

ROBOT = Robot.mir100()
LIMITS = {
    "no accelerations": ROBOT.limits,
    "accelerations": replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5),
    "wheels": Limits(-0.4, 1.0, -0.8, 1.5, 0.7, 1.2, wheel_speed=0.9, track=0.5),
}
R_MIN = 0.17
LOOK = 4e-3
"""m; the greatest way of a footprint point between two looks at the distance."""


@compiled
def worst_twist(edges, circumradius, seen, contacts):
    """The twist that drives fastest towards the nearest obstacle."""
    _, nearest = contact_table(edges, circumradius, seen, 0.0, contacts)
    p_x, p_y, n_x, n_y = contacts[nearest, :4]
    return math.copysign(9.0, n_x), math.copysign(9.0, n_y * p_x - n_x * p_y)


@allocating
def copies(world):
    return world[0].copy(), world[1].copy()


@allocating
def least_distance(edges, circumradius, pose, world):
    """The distance at a pose by the package's own contacts, m."""
    seen = copies(world)
    contacts = np.empty((most_contacts(edges, world), 9))
    in_robot_frame(pose[0], pose[1], pose[2], 0.0, world, seen)
    _, nearest = contact_table(edges, circumradius, seen, 0.0, contacts)
    return contacts[nearest, 4]


@allocating
def least_along(edges, circumradius, pose, v, omega, time, world):
    """The least distance while a twist is driven for some time, m."""
    least = least_distance(edges, circumradius, pose, world)
    looks = math.ceil((abs(v) + abs(omega) * circumradius) * time / LOOK)
    for k in range(1, looks + 1):
        there = arc(pose[0], pose[1], pose[2], v, omega, time * k / looks)
        least = min(least, least_distance(edges, circumradius, there, world))
    return least


@allocating
def drive_blindly(
    edges, robot, settings, ahead, world, demands, hunted, twist, outcome, counts, trace
):
    """Drive what the filter makes of the demands, whatever they are.

    ``outcome``: least distance on the way (m), greatest excess over box, wheels and
    accelerations, decisions whose status is not true. ``counts``: how often each status
    was given. ``trace`` (steps, 5): pose at the start of a step, and its twist.
    """
    dt, state, seen = settings[0].dt, fresh_state(), copies(world)
    memory = np.empty((memory_rows(most_contacts(edges, world), settings), 9))
    state[0], state[1] = twist
    x = y = heading = 0.0
    least = least_distance(edges, robot[8], (x, y, heading), world)
    excess, lies = 0.0, 0.0
    for step in range(demands.shape[0]):
        in_robot_frame(x, y, heading, 0.0, world, seen)
        d_v, d_omega = demands[step]
        if hunted[step]:
            d_v, d_omega = worst_twist(edges, robot[8], seen, memory)
        old_v, old_omega = state[0], state[1]
        code, v, omega, distance, slack, _, shortfall, _, _ = filter_step(
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
            lies += 1.0
        if code == TRACKING and (slack > 0.0 or shortfall > 0.0):
            lies += 1.0
        if code == BRAKING or code == HOLDING or code == STOPPED:
            b_v, b_omega = braking_twist(robot, old_v, old_omega, dt)
            stands = v == 0.0 and omega == 0.0
            if not (v == b_v and omega == b_omega) or (code == HOLDING and not stands):
                lies += 1.0
        way = (abs(v) + abs(omega) * robot[8]) * dt
        if distance - way < least:
            here = (x, y, heading)
            passed = least_along(edges, robot[8], here, v, omega, dt, world)
            least = min(least, passed)
        x, y, heading = arc(x, y, heading, v, omega, dt)
    outcome[0], outcome[1], outcome[2] = least, excess, lies


def make_scene(rng, least=R_MIN, most=2.0):
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
        contacts = Contacts.of(ROBOT.footprint, world)
        near = set(contacts.obstacle[contacts.distance < least].tolist())
        kept = np.array([i not in near for i in range(len(world))])
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

    @property
    def robot(self):
        return replace(ROBOT, limits=LIMITS[self.limits])

    @property
    def settings(self):
        radius = SafetyRadius(self.r_min, self.r_min)
        return AvoidanceSettings(
            radius, gamma=self.gamma, dt=self.dt, braking_room=self.braking_room
        )

    def drive(self, world, demands, hunted, twist=(0.0, 0.0)):
        """Return the outcome, the count of each status, and the trace of one scene."""
        outcome, counts = np.zeros(3), np.zeros(len(STATUSES), dtype=int)
        trace = np.empty((len(demands), 5))
        drive_blindly(
            self.robot.footprint.edges,
            self.robot.numbers,
            self.settings.record(),
            self.ahead,
            world.arrays,
            demands,
            hunted,
            twist,
            outcome,
            counts,
            trace,
        )
        return outcome, counts, trace

    def study(self, scenes, seed, seconds=5.0):
        """Return outcomes (scenes, 3) and how often each status was given.

        The robot starts at rest, with every obstacle at r_min or farther.
        """
        outcomes, counts = (
            np.zeros((scenes, 3)),
            np.zeros(len(STATUSES), dtype=np.int64),
        )
        for i in range(scenes):
            rng = np.random.default_rng([seed, i])
            world = make_scene(rng, self.r_min)
            demands = make_demands(rng, round(seconds / self.dt), self.dt)
            outcomes[i], given, _ = self.drive(world, *demands)
            counts += given
        return outcomes, counts
