"""A robot among walls and people, with a LiDAR, without ROS and the package."""

import math

import numpy as np

ROOM = [(-5, -5, 5, -5), (5, -5, 5, 5), (5, 5, -5, 5), (-5, 5, -5, -5)]
LOW, HIGH = (-0.3, -0.4), (0.3, 0.4)
BOX = [(*LOW, -0.3, 0.4), (0.3, -0.4, *HIGH), (-0.3, 0.4, *HIGH), (*LOW, 0.3, -0.4)]
DOCK = [(4.0, -0.3, 4.0, 0.3), (3.6, 0.62, 4.0, 0.62), (3.6, 0.62, 3.6, 1.5)]
"""Walls: a room, a box in it, a dock and two walls beside it."""


def ray_ranges(pose, walls, discs, angles):
    """Ranges of beams at angles from a pose to segments (n, 4) and discs (n, 3)."""
    walls, discs = np.reshape(walls, (-1, 4)), np.reshape(discs, (-1, 3))
    c, s = np.cos(angles + pose[2])[:, None], np.sin(angles + pose[2])[:, None]
    start, way = walls[:, :2] - pose[:2], walls[:, 2:] - walls[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = c * way[:, 1] - s * way[:, 0]
        along = (start[:, 0] * way[:, 1] - start[:, 1] * way[:, 0]) / cross
        share = (start[:, 0] * s - start[:, 1] * c) / cross
    hits = (share >= 0.0) & (share <= 1.0) & (along > 0.0)
    found = np.where(hits, along, np.inf).min(axis=1, initial=np.inf)
    x, y = (discs[:, :2] - pose[:2]).T
    along, across = x * c + y * s, x * s - y * c
    inside = discs[:, 2] ** 2 - across**2
    hits = (inside > 0.0) & (along > 0.0)
    near = np.where(hits, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)
    return np.minimum(found, near.min(axis=1, initial=np.inf))


class World:
    """Segments (n, 4), people (x, y, radius, v_x, v_y), and a rectangular robot.

    ``corners``: x_min, y_min, x_max, y_max of the robot about its axle, m.
    """

    def __init__(self, walls, people=(), pose=(0.0, 0.0, 0.0), corners=None):
        self.walls = np.array(walls, dtype=float).reshape(-1, 4)
        self.people = np.array(people, dtype=float).reshape(-1, 5)
        self.pose, self.twist, self.time = np.array(pose, dtype=float), (0.0, 0.0), 0.0
        self.corners = corners or (-0.25, -0.2, 0.25, 0.2)

    def drive(self, v, omega, dt):
        """Move robot and people; the twist is driven at once."""
        x, y, heading = self.pose
        half = 0.5 * omega * dt
        chord = v * dt * np.sinc(half / math.pi)
        move = chord * math.cos(heading + half), chord * math.sin(heading + half)
        self.pose = np.array([x + move[0], y + move[1], heading + 2.0 * half])
        self.people[:, :2] += dt * self.people[:, 3:]
        self.twist, self.time = (v, omega), self.time + dt

    def ranges(self, beams, far=10.0, noise=0.0, rng=None, mount=(0.0, 0.0, 0.0)):
        """Ranges (beams,) all round from a mount, the first behind; free: inf."""
        angles = 2.0 * math.pi / beams * np.arange(beams) - math.pi
        x, y, heading = self.pose
        c, s = math.cos(heading), math.sin(heading)
        x, y = x + c * mount[0] - s * mount[1], y + s * mount[0] + c * mount[1]
        pose = np.array([x, y, heading + mount[2]])
        found = ray_ranges(pose, self.walls, self.people[:, :3], angles)
        if noise:
            found = found + noise * rng.standard_normal(beams)
        return np.where(found > far, np.inf, found)

    def seen_at(self, places):
        """Places (n, 2) of the ground in the robot frame."""
        x, y = (np.reshape(places, (-1, 2)) - self.pose[:2]).T
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        return np.column_stack([c * x + s * y, c * y - s * x])

    def clearances(self):
        """Distances of the robot's outline from each wall, then from each person, m."""
        low, high = np.reshape(self.corners, (2, 2))
        share = np.linspace(0.0, 1.0, 401)[:, None]
        walls = [(1.0 - share) * one[:2] + share * one[2:] for one in self.walls]
        gaps = []
        for places in [*walls, *self.people[:, None, :2]]:
            seen = self.seen_at(places)
            out = np.maximum(np.maximum(low - seen, seen - high), 0.0)
            gaps.append(float(np.hypot(*out.T).min()))
        many = len(self.walls)
        return np.array(gaps) - np.append(np.zeros(many), self.people[:, 2])
