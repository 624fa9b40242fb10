"""Guards as parameters make them, and a loop of one with a world."""

import math

import numpy as np

import ros_messages as ros
from qpavoid.model.footprint import Footprint
from qpavoid.ros.guard import Guard
from qpavoid.ros.parameters import Wiring, defaults, preset, setup_of
from ray_world import World

DT, R_MIN, BEAMS = 0.05, 0.1, 360
AT_ONCE = {"freshness.good_s": 0.0}
SMALL = {"robot.footprint_m": str(Footprint.rectangle(0.5, 0.4).vertices.tolist()),
         "robot.acceleration_mps2": 1.5, "radius.r_min_slow_m": R_MIN,
         "radius.r_min_fast_m": R_MIN, **AT_ONCE}  # fmt: skip
"""The robot of ``ray_world``."""

LASER = {"frames": ("laser",), "frame_poses": (0.0,) * 6}


def setup(values=(), **changed):
    """Settings by names as they are, and by names with ``__`` for the dot."""
    robot = preset("mir100_rectangle")
    given = {name.replace("__", "."): value for name, value in changed.items()}
    values = {"actuation.jitter": 0.0} | dict(values) | given
    return setup_of(defaults(robot) | values, robot, DT)


def guarded(values=(), **wiring):
    return Guard(setup(values), Wiring(**wiring))


def laser_scan(ranges, time, topic):
    return ros.scan(time, ranges, "laser", near=0.05)


class Loop:
    """A guard in a world: scan, odometry and command in, a twist out that is driven.

    All attributes may change between two steps: ``mounts`` of scanners by topic,
    ``seen(ranges, k)`` changes ranges, ``made(ranges, time, topic)`` is their message;
    ``told`` is the twist of the odometry, if not the driven one; ``before`` are pose
    and people when the last step began.
    """

    def __init__(self, guard, walls=(), people=(), pose=(0.0, 0.0, 0.0)):
        self.guard, self.world = guard, World(walls, people, pose)
        self.now, self.steps, self.least = 100.0, [], math.inf
        self.noise, self.rng, self.every = 0.005, np.random.default_rng(5), 1
        self.seen, self.command, self.told = (lambda ranges, k: ranges), None, None
        self.by_odometry, self.beams = False, BEAMS
        self.mounts, self.made = {"scan": (0.0, 0.0, 0.0)}, laser_scan
        self.before = self.world.pose, self.world.people

    def step(self, *command):
        self.now += DT
        now, guard, world = (self.now, self.now), self.guard, self.world
        if len(self.steps) % self.every == 0:
            for topic, mount in self.mounts.items():
                how = {"noise": self.noise, "rng": self.rng, "mount": mount}
                ranges = self.seen(world.ranges(self.beams, **how), len(self.steps))
                guard.see(topic, self.made(ranges, self.now, topic), *now)
        if guard.wiring.odometry == "odom":
            twist = world.twist if self.told is None else self.told
            guard.see("odom", ros.odometry(self.now, world.pose.tolist(), *twist), *now)
        if command or self.command is not None:
            guard.command(ros.twist(*(command or self.command)), *now)
        driven = guard.odometry.twist if self.by_odometry else None
        step = guard.step(*now, driven)
        self.before = world.pose, world.people.copy()
        world.drive(step.v, step.omega, DT)
        self.steps.append(step)
        self.least = np.minimum(self.least, world.clearances())
        return step

    def run(self, seconds, every=lambda k: None):
        for k in range(round(seconds / DT)):
            every(k)
            self.step()
        return self.steps[-round(seconds / DT) :]
