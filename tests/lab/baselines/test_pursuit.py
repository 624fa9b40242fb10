"""Regulated pure pursuit and its collision monitor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines import DT, SETTINGS, start
from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.decision import Status
from qpavoid.lab.baselines.rpp import PursuitController
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT as MIR

NOWHERE, HERE = Obstacles(), (0.0, 0.0, 0.0)
RPP = PursuitController(MIR, SETTINGS, look_time=1.5, near=0.6)


def along(y=0.0, speed=0.5, driven=(0.5, 0.0)):
    """A straight path to the right of it, or the left, 8 m long."""
    return StepContext(HERE, (0.0, y, 0.0), (speed, 0.0), (8.0, y, 0.0), driven)


@given(y=st.floats(-0.4, 0.4), speed=st.floats(0.1, 1.0))
def test_the_arc_leads_to_the_carrot(y, speed):
    path = np.column_stack([0.05 * np.arange(60), np.full(60, y), np.zeros(60)])
    (v, omega), time = RPP.pursued(path, along(y, speed), math.inf)
    carrot = path[np.argmax(np.hypot(path[:, 0], path[:, 1]) >= 0.75)]
    angle = math.atan2(carrot[1], carrot[0])
    length = math.hypot(*carrot[:2]) / np.sinc(angle / math.pi)
    x, y, _ = arc(*HERE, v, omega, length / v)
    assert (x, y) == pytest.approx(tuple(carrot[:2]), abs=1e-9)
    assert time <= 1.0


def test_curves_and_what_is_near_slow_it_down():
    path = np.column_stack([0.05 * np.arange(60), np.zeros(60), np.zeros(60)])
    (free, _), _ = RPP.pursued(path, along(speed=1.0), math.inf)
    (near, _), _ = RPP.pursued(path, along(speed=1.0), 0.8 * RPP.near)
    assert near == pytest.approx(0.8 * free)
    path[:, 1] = 0.4
    (curve, omega), _ = RPP.pursued(path, along(0.4, 1.0), math.inf)
    (wide, _), _ = replace(RPP, radius=0.1).pursued(path, along(0.4, 1.0), math.inf)
    assert 0.25 <= curve == pytest.approx(wide * curve / omega / RPP.radius)


def test_a_carrot_behind_is_turned_to_on_the_spot():
    context = StepContext(HERE, (-1.0, 0.5, 0.0), (0.0, 0.0), (-1.0, 0.5, 0.0), (0, 0))
    decision = start("rpp")(0.5, 0.0, NOWHERE, context)
    assert decision.v == 0.0 and decision.omega > 0.5


def test_a_path_is_followed_and_its_end_reached():
    step, pose, driven, twist = start("rpp"), (0.0, 0.4, 0.3), (0.0, 0.0), (0.5, 0.0)
    for k in range(200):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])

        def seen(place, off=pose, cos=cos, sin=sin):
            d_x, d_y = place - off[0], -off[1]
            return cos * d_x + sin * d_y, cos * d_y - sin * d_x, -off[2]

        there = StepContext(pose, seen(min(0.5 * k * DT, 4.0)), twist, seen(4), driven)
        if math.hypot(*there.goal[:2]) < 0.25:
            break
        driven = step(9.0, 9.0, NOWHERE, there)[:2]  # its own tracking
        pose = arc(*pose, *driven, DT)
    assert abs(pose[1]) < 0.05 and abs(pose[2]) < 0.1
    assert step(0.1, 0.2, NOWHERE, there)[:2] == (0.1, 0.2)  # Eq. 6 docks


def test_the_monitor_keeps_the_time_to_a_collision():
    """Approach: as much slower as the collision is nearer than its time."""
    tip = MIR.footprint.vertices[:, 0].max()
    for room in (0.5, 0.3):
        method = PursuitController(MIR, SETTINGS, near=1e-9, time=2.0)
        point = Obstacles(points=[[tip + room, 0.0]])
        goal = (0.2, 0.0, 0.0)
        context = StepContext(HERE, goal, (0.0, 0.0), goal, (0.5, 0.0))
        decision = method.start(0.5)(0.5, 0.0, point, context)
        assert decision.v == pytest.approx(0.5 * (room / 0.5) / 2.0, abs=0.01)
        assert decision.status is Status.STEERED


def test_its_zone_stops_it():
    method = PursuitController(MIR, SETTINGS, near=1e-9)
    beside = [Obstacles(points=[[0.0, 0.29 + room]]) for room in (0.15, 0.01)]
    one, other = (method.start(0.5)(0.5, 0.0, x, along()) for x in beside)
    assert one.v > 0.0 == other.v and other.status is Status.BRAKING
    still = method.start()(0.5, 0.0, beside[1], along(driven=(0, 0)))
    assert still.status is Status.HOLDING
