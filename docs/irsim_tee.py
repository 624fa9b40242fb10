"""A T-shaped robot in ir-sim (pip install ir-sim), which knows nothing of qpavoid."""

import os
import tempfile
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")

import irsim
import numpy as np

import qpavoid as qp

TEE = [(0.9, 0.15), (-0.4, 0.15), (-0.4, 0.6), (-0.7, 0.6)]
TEE += [(-0.7, -0.6), (-0.4, -0.6), (-0.4, -0.15), (0.9, -0.15)]
WORLD = f"""
world: {{height: 10, width: 16, step_time: 0.1, collision_mode: stop}}
robot:
  - kinematics: {{name: diff}}
    shape: {{name: polygon, vertices: {[[*corner] for corner in TEE]}}}
    state: [2, 5, 0]
    goal: [14, 5, 0]
    vel_min: [-1, -1.5]
    vel_max: [1, 1.5]
    sensors:
      - {{name: lidar2d, range_max: 8, angle_range: 6.283185307179586, number: 180}}
obstacle:
  - {{shape: {{name: circle, radius: 0.6}}, state: [6, 5.3, 0]}}
  - {{shape: {{name: rectangle, length: 1, width: 4}}, state: [9, 3, 0]}}
  - {{shape: {{name: rectangle, length: 1, width: 2}}, state: [11.5, 7, 0]}}
"""


def echoes(scan):
    """Return the points of a scan, robot frame, m."""
    ranges = np.asarray(scan["ranges"])
    angles = np.linspace(scan["angle_min"], scan["angle_max"], len(ranges))
    hit = ranges < scan["range_max"] - 1e-3
    return (ranges * [np.cos(angles), np.sin(angles)]).T[hit]


def drive(seconds=60.0):
    """Return the poses driven, and whether ir-sim reports a collision."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "world.yaml")
        file.write_text(WORLD, encoding="utf-8")
        env = irsim.make(str(file), display=False)
    footprint = qp.Footprint.polygon(TEE)
    robot = qp.Robot("tee", footprint, qp.Limits(-1.0, 1.0, -1.5, 1.5))
    guide = qp.Guide(robot, qp.AvoidanceSettings(dt=0.1))
    start, goal = (
        tuple(x.ravel()[:3].tolist()) for x in (env.robot.state, env.robot.goal)
    )
    guide.go_to(start, goal, speed=0.7)
    poses = [start]
    while env.time < seconds and np.hypot(*np.subtract(poses[-1], goal)[:2]) > 0.1:
        decision = guide.step(poses[-1], echoes(env.get_lidar_scan()))
        env.step(np.array([[decision.v], [decision.omega]]))
        poses.append(tuple(env.robot.state.ravel()[:3].tolist()))
    env.end(0)
    return np.array(poses), env.robot.collision


if __name__ == "__main__":
    way, touched = drive()
    print(f"{0.1 * len(way):.1f} s, at {way[-1].round(2)}, collision: {touched}")
