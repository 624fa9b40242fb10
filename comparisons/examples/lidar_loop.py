"""A control loop without the laboratory: ranges in, twist out.

A robot drives among posts that it senses with 360 beams.

Run: python comparisons/examples/lidar_loop.py [lidar_loop.png]
"""

import math
import sys

import matplotlib.pyplot as plt
import numpy as np

import qpavoid as qp

POSTS = np.array([(2.0, 0.3), (2.4, -1.0), (4.0, -0.2), (4.2, 1.2), (5.5, 0.5)])
RADIUS, GOAL, DT = 0.12, np.array([7.0, 0.0]), 0.05
BEARINGS = np.linspace(-math.pi, math.pi, 360, endpoint=False)


def scan(x, y, heading):
    """Return the ranges to the posts in m, inf without an echo."""
    ways = np.stack([np.cos(BEARINGS + heading), np.sin(BEARINGS + heading)], axis=1)
    to = POSTS - (x, y)
    along = to @ ways.T
    beside = RADIUS**2 - np.sum(to**2, axis=1)[:, None] + along**2
    hit = (beside > 0.0) & (along > 0.0)
    ranges = np.where(hit, along - np.sqrt(np.maximum(beside, 0.0)), np.inf)
    return ranges.min(axis=0)


def drive():
    """Return the poses, and the least clearance of all decisions."""
    settings = qp.AvoidanceSettings(dt=DT, margins=qp.Margins(error=0.01))
    safety = qp.SafetyFilter(qp.Robot.jackal(), settings)
    pose, poses, least = np.zeros(3), [], math.inf
    while np.hypot(*(GOAL - pose[:2])) > 0.2 and len(poses) < 600:
        ranges = scan(*pose)
        hit = np.isfinite(ranges)
        xy = ranges[hit, None] * np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], 1)[hit]
        bearing = math.atan2(*(GOAL - pose[:2])[::-1]) - pose[2]
        turn = 2.0 * math.atan2(math.sin(bearing), math.cos(bearing))
        safe = safety.filter(0.8, turn, points=xy)
        poses.append(pose.copy())
        least = min(least, safe.clearance)
        pose += DT * np.array(
            [safe.v * math.cos(pose[2]), safe.v * math.sin(pose[2]), safe.omega]
        )
    return np.array(poses), least


if __name__ == "__main__":
    poses, least = drive()
    print(f"{len(poses) * DT:.1f} s, least clearance {least:.3f} m")
    figure, axes = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
    axes.plot(poses[:, 0], poses[:, 1])
    for post in POSTS:
        axes.add_patch(plt.Circle(post, RADIUS, color="0.3"))
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    figure.savefig(sys.argv[1] if sys.argv[1:] else "lidar_loop.png", dpi=120)
