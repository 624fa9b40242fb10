"""Scenes for the look-ahead, and the way of a plan, step by step, by other arcs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import strategies as st

from driven import driven_to
from qpavoid.avoidance import bodies as table
from qpavoid.avoidance import plan as pre
from qpavoid.avoidance.bodies import FEW, Scene, bodies_in_reach
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, braking_twist, limit_twist
from qpavoid.types import Box
from shapes import ELL, FORKS, NEEDLE, ROBOT, SHIFTED

LIMITED = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=2.0, angular_acceleration=2.5)
)
WHEELS = replace(
    ROBOT, limits=Limits(-0.6, 1.0, -1.5, 1.2, 1.5, 3.0, wheel_speed=0.9, track=0.5)
)
SETTINGS = AvoidanceSettings()
HORIZON = SETTINGS.ahead.horizon
BOX = Box(-1.0, 1.0, -1.5, 1.5)
ROBOTS = {
    "free": ROBOT,
    "limited": LIMITED,
    "wheels": WHEELS,
    "needle": replace(LIMITED, footprint=NEEDLE),
    "shifted": replace(WHEELS, footprint=SHIFTED),
    "ell": replace(LIMITED, footprint=ELL),
    "forks": replace(WHEELS, footprint=FORKS),
}
robots = pytest.mark.parametrize("robot", (ROBOT, LIMITED), ids=("free", "limited"))
every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
seeds = st.integers(0, 2**32 - 1)
speeds, turns = st.floats(-1, 1), st.floats(-1.5, 1.5)


def scene_of(robot, world, last=(0.0, 0.0), settings=SETTINGS, age=0.0, horizon=None):
    """The scene of a step, as ``prepare`` has it."""
    record = settings.record()
    bodies = np.zeros(len(world.points) + len(world.capsules), table.BODY)
    groups = np.zeros(len(bodies) // FEW, table.BODY)
    arcs = np.zeros(pre.most_arcs(record), pre.ARC)
    last = float(last[0]), float(last[1])
    known = robot.footprint.edges, robot.limit_vector, record
    rest = last, (0.0, 0.0), arcs, groups, settings.dt, 0.0, math.inf
    scene = Scene(*known, bodies, *rest)
    horizon = settings.ahead.horizon if horizon is None else horizon
    count = bodies_in_reach(scene, world.arrays, age, horizon)
    return scene._replace(bodies=bodies[:count])


def rolled(scene, plan, many=1):
    """Result of ``roll_out``, in memory of its own.

    A compiled function that takes no part in counting references hands Python the whole
    array in place of a slice.
    """
    scene.arcs["begin"] = np.nan
    made = pre.roll_out(scene, plan, many)
    count = np.isfinite(scene.arcs["begin"]).sum()
    return made._replace(arcs=scene.arcs[:count].copy())


def mixed(rng, size=2.0):
    """A piece of a scan, points, discs at rest and moving, walls, and a cart."""
    start, step = rng.uniform(-size, size, 2), rng.uniform(-0.12, 0.12, 2)
    scan = start + np.arange(12)[:, None] * step + rng.normal(size=(12, 2)) * 0.01
    discs = np.column_stack([rng.uniform(-size, size, (4, 2)), rng.uniform(0, 0.3, 4)])
    points = np.vstack([scan, rng.uniform(-size, size, (2, 2))])
    velocities = rng.normal(size=(4, 2)) * [[0.6], [0.0], [0.3], [0.0]]
    cart = np.array([(-0.2, -0.1), (0.2, -0.15), (0.25, 0.1), (-0.1, 0.2)])
    return Obstacles(
        points,
        discs,
        velocities,
        rng.uniform(-size, size, (2, 4)),
        polygons=[cart + rng.uniform(-size, size, 2)],
        polygon_velocities=[rng.normal(size=3) * [0.5, 0.5, 0.8]],
    )


def some_plan(rng, box=BOX, end=HORIZON):
    """Two twists within the box, and when one goes over to the other."""
    dt = SETTINGS.dt
    twists = rng.uniform(box[::2], box[1::2], (2, 2))
    twists[rng.random((2, 2)) < 0.3] = 0.0
    ends = dt * np.sort(rng.integers(0, round(end / dt) + 1, 2))
    return pre.Plan(*twists[0], ends[0], *twists[1], max(ends[1], dt))


def steps_of(robot, plan, last, dt, seconds):
    """The trace (steps, 5) of a plan, one control step after the other.

    ``last`` is the twist driven before. Where a part of the plan ends, the next begins;
    after the last control step before its end it brakes.
    """
    numbers, pose, twist, braking = robot.limit_vector, (0.0, 0.0, 0.0), last, False
    trace = []
    for k in range(round(seconds / dt)):
        time, wanted = k * dt, (plan.v_then, plan.omega_then)
        if time < plan.switch - 1e-9:
            wanted = plan.v, plan.omega
        if time > plan.end - 0.5 * dt:
            braking = True
        if braking:
            twist = braking_twist(numbers, *twist, dt)
        else:
            twist = limit_twist(numbers, wanted, twist, dt)
        trace.append((*pose, *twist))
        pose = driven_to(pose, *twist, dt)
    return np.array(trace)


def line_of(body):
    """A body as ``driven`` has obstacles: its distance to keep as radius."""
    body = table.Body(*body)
    x, y = body.x, body.y
    levers = body.x1 + x, body.y1 + y, body.x2 + x, body.y2 + y
    motion = body.v_x, body.v_y, body.turn
    return np.array([*levers, body.required, *motion, x, y])


def frame_of(rollout, time, dt=SETTINGS.dt):
    """Pose of a rollout at a time: x, y and heading."""
    row = np.searchsorted(rollout.arcs["begin"], time + 1e-12, "right") - 1
    at = pre.frame_at(rollout.arcs[row], time, dt)
    return at.x, at.y, math.atan2(at.sin, at.cos)
