"""Scenes told to a filter, step by step: what it is asked, and what it answers."""

import math
from dataclasses import replace

import numpy as np

from driven import driven_to, gap_at, lines_of
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from shapes import ROBOT

REST = (0.0, 0.0, 0.0)
ROBOTS = {
    "free": ROBOT,
    "accelerations": replace(
        ROBOT, limits=replace(ROBOT.limits, acceleration=1.0, angular_acceleration=2.5)
    ),
    "wheels": replace(
        ROBOT,
        limits=Limits(-0.8, 1.0, -1.5, 1.5, 1.5, 3.0, wheel_speed=0.9, track=0.45),
    ),
}


class Scene:
    """Points, discs that may move, and walls, none nearer than a distance at first."""

    def __init__(self, rng, least=0.05, most=2.5, movers=3, size=8):
        bearing = rng.uniform(-math.pi, math.pi, size + movers)
        reach = rng.uniform(0.3, most, size + movers)
        places = (reach * [np.cos(bearing), np.sin(bearing)]).T
        radii, speeds = rng.uniform(0.05, 0.35, movers), rng.uniform(0.1, 1.2, movers)
        aims = rng.uniform([-0.4, -0.25], [0.5, 0.25], (movers, 2)) - places[:movers]
        aims *= (speeds / np.hypot(*aims.T))[:, None]
        aims[rng.random(movers) < 0.2] = 0.0
        walls = rng.uniform(-most, most, (2, 4))
        self.points = self.far(lines_of(places[movers:]), places[movers:], least)
        discs = np.column_stack([places[:movers], radii])
        rows = np.column_stack([discs, aims])
        rows = self.far(lines_of(discs=discs), rows, least + 0.2)
        self.discs, self.velocities = rows[:, :3], rows[:, 3:]
        self.walls = self.far(lines_of(walls=walls), walls, least)

    @staticmethod
    def far(lines, rows, least):
        corners = ROBOT.footprint.vertices
        gaps = np.array([gap_at(corners, REST, line, 0.0) for line in lines])
        return rows[gaps >= least] if len(rows) else rows

    def at(self, time):
        discs = self.discs.copy()
        discs[:, :2] += time * self.velocities
        return Obstacles(self.points, discs, self.velocities, self.walls)

    @property
    def lines(self):
        return lines_of(self.points, self.discs, self.velocities, self.walls)


def calls(safety, scene, wishes, dt, pose=REST):
    """Yield what a filter is told at every step, and answer by driving its twist."""
    for k, wish in enumerate(wishes):
        seen = scene.at(k * dt).seen_from(pose)
        decision = yield tuple(map(float, wish)), seen, pose
        pose = driven_to(pose, decision.v, decision.omega, dt)


def loop(safety, scene, wishes, dt, ask=None):
    """Drive a filter; return its decisions, the trace, and what ``ask`` said before."""
    steps, decisions, trace, said = calls(safety, scene, wishes, dt), [], [], []
    told = next(steps)
    while True:
        (v, omega), seen, pose = told
        if ask is not None:
            said.append(ask(v, omega, seen))
        decision = safety.filter(v, omega, seen)
        decisions.append(decision)
        trace.append((*pose, decision.v, decision.omega))
        try:
            told = steps.send(decision)
        except StopIteration:
            return decisions, np.array(trace), said
