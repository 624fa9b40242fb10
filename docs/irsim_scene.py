"""A published scene in ir-sim (pip install ir-sim), which knows nothing of qpavoid.

Robot, obstacles, start and goal are those of a scenario: trap, gap or corridor.

Run: python docs/irsim_scene.py trap
"""

import json
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")

import irsim
import numpy as np
import shapely

import qpavoid as qp

DT, BEAMS, SIGHT = 0.1, 360, 10.0


def static(name, state=(0, 0, 0), **shape):
    """Return an obstacle of ir-sim."""
    return {"shape": {"name": name, **shape}, "state": [*state]}


def environment(scenario):
    """Return the environment of a scenario in ir-sim."""
    walls, discs = scenario.world.walls.tolist(), scenario.world.discs.tolist()
    obstacles = [static("linestring", vertices=[x[:2], x[2:]]) for x in walls]
    obstacles += [static("circle", (x, y, 0), radius=r) for x, y, r in discs]
    limits = scenario.robot.limits
    outline = shapely.union_all([*map(shapely.Polygon, scenario.robot.footprint.parts)])
    corners = [*map(list, outline.normalize().reverse().exterior.coords)][:-1]
    lidar = {"name": "lidar2d", "range_max": SIGHT, "angle_range": 2 * np.pi}
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "polygon", "vertices": corners},
        "state": [*scenario.start],
        "vel_min": [limits.v_min, limits.omega_min],
        "vel_max": [limits.v_max, limits.omega_max],
        "sensors": [{**lidar, "number": BEAMS + 1}],  # the last beam is the first again
    }
    world = {"height": 60, "width": 70, "step_time": DT, "collision_mode": "stop"}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "world.yaml")  # JSON is YAML
        scene = {"world": world, "robot": [robot], "obstacle": obstacles}
        file.write_text(json.dumps(scene))
        return irsim.make(str(file), display=False)


def drive(name, seconds=120.0):
    """Return the poses driven, the goal, and whether ir-sim reports a collision."""
    scenario = qp.load_scenario(f"footprints/{name}")
    env, (*_, before, last) = environment(scenario), scenario.path.points
    goal = (*last, np.arctan2(*(last - before)[::-1]))
    perception = qp.Perception(scenario.robot, qp.Lidar(range_max=SIGHT))
    guide = qp.Guide(scenario.robot, scenario.settings, perception=perception)
    poses = [tuple(env.robot.state.ravel()[:3].tolist())]
    guide.go_to(poses[0], goal, speed=1.5)
    while env.time < seconds and np.hypot(*np.subtract(poses[-1][:2], last)) > 0.2:
        scan = np.asarray(env.get_lidar_scan()["ranges"])[:BEAMS]
        step = guide.step(poses[-1], scan=scan, stamp=env.time)
        env.step(np.array([[step.v], [step.omega]]))
        poses.append(tuple(env.robot.state.ravel()[:3].tolist()))
    env.end(0)
    return np.array(poses), last, env.robot.collision


if __name__ == "__main__":
    way, goal, touched = drive(*sys.argv[1:2])
    print(f"{DT * len(way):.1f} s, at {way[-1].round(2)}, collision: {touched}")
