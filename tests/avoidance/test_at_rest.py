"""'At rest' is no cliff: who drives at what creeps does not touch it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from driven import driven_to, least_in_all, lines_of
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT

SLOW = replace(
    ROBOT, limits=replace(ROBOT.limits, acceleration=0.5, angular_acceleration=1.0)
)
DT = 0.05


@pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
@pytest.mark.parametrize("r_min", [0.17, 0.02])
@pytest.mark.parametrize("speed", [0.009, 0.011, 0.05, 0.09])
def test_who_drives_at_what_creeps_does_not_touch_it(speed, r_min, ahead):
    """At 1 m/s, with 0.5 m/s², straight or in a curve, wherever it comes from."""
    settings = AvoidanceSettings(SafetyRadius(r_min, r_min), dt=DT)
    for k in range(12):
        rng = np.random.default_rng([7, k])
        turn, wish = rng.uniform(-math.pi, math.pi), (1.0, rng.choice([0.0, 0.3, -0.5]))
        place = rng.uniform([1.2, -0.4], [2.5, 0.4])
        velocity = speed * np.array([math.cos(turn), math.sin(turn)])
        if k % 2:
            velocity = -speed * place / np.hypot(*place)
        safety, pose, trace = SafetyFilter(SLOW, settings, ahead=ahead), (0.0,) * 3, []
        for step in range(80):
            disc = [[*(place + step * DT * velocity), 0.1]]
            world = Obstacles(discs=disc, disc_velocities=[velocity])
            decision = safety.filter(*wish, world.seen_from(pose))
            trace.append((*pose, decision.v, decision.omega))
            pose = driven_to(pose, decision.v, decision.omega, DT)
        lines = lines_of(discs=[[*place, 0.1]], velocities=[velocity])
        moving = np.abs(np.array(trace)[:, 3:]).max(axis=1) > 1e-9
        last = 1 + (np.flatnonzero(moving)[-1] if moving.any() else 0)
        trace = np.array(trace)[:last]
        assert least_in_all(SLOW.footprint.vertices, trace, DT, lines) > 0.0
