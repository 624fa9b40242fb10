"""Single discs for the look-ahead, and what it does about them."""

import math

import numpy as np

from oracles import point_distance, wall_distance
from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.lab.simulation.world import Track, World
from qpavoid.model.kinematics import arc
from shapes import ROBOT

RADIUS, DT = SafetyRadius(), 0.02


def parked(pose):
    return 0.0, 0.0


def along_x(pose):
    """0.6 m/s along the x axis."""
    return 0.6, -1.0 * pose[1] - 2.0 * pose[2]


def distance(obstacles, pose):
    """The least distance at a pose, by the oracles."""
    seen, vertices = obstacles.seen_from(pose), ROBOT.footprint.vertices
    near = seen.points[np.hypot(*seen.points.T) < 1.2]
    gaps = [point_distance(vertices, p) for p in near]
    gaps += [point_distance(vertices, d[:2]) - d[2] for d in seen.discs]
    return min(gaps + [wall_distance(vertices, wall) for wall in seen.walls], default=9)


def drive(safety, world, seconds, wish=parked):
    """Return the least distance within and between steps, poses and decisions."""
    pose, least, poses, decisions = (0.0, 0.0, 0.0), math.inf, [], []
    for k in range(round(seconds / DT)):
        seen = world.at(k * DT).seen_from(pose)
        decision = safety.filter(*wish(pose), seen)
        poses.append(pose)
        decisions.append(decision)
        if decision.clearance < 0.6:
            for share in (0.5, 1.0):
                there = arc(*pose, *decision[:2], share * DT)
                least = min(least, distance(world.at((k + share) * DT), there))
        pose = arc(*pose, *decision[:2], DT)
    return least, np.array([*poses, pose]), decisions


def moving(place, velocity, radius):
    """A world of one disc that keeps its velocity."""
    return World(tracks=(Track.straight(np.array(place), np.array(velocity), radius),))
