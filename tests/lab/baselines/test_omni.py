"""The omnidirectional base: its rows, its motion, and what it is meant to show."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import arc, integrate
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot

SETTINGS = AvoidanceSettings(dt=0.02)
numbers = st.floats(-2.0, 2.0)


@given(numbers, numbers, numbers, numbers)
def test_a_way_is_the_integral_of_its_velocities(heading, v, omega, lateral):
    def rate(_, pose):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        return v * cos - lateral * sin, v * sin + lateral * cos, omega

    begin = (0.3, -0.4, heading)
    end = solve_ivp(rate, (0.0, 0.7), begin, rtol=1e-9, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(
        integrate(begin, (v, omega), lateral, 0.7), end, atol=1e-6
    )
    assert integrate(begin, (v, omega), 0.0, 0.7) == arc(*begin, v, omega, 0.7)


def test_an_omnidirectional_base_steps_aside_and_comes_back():
    scenario = load_scenario("paper/test_case_2")
    log = run(scenario, "omni")
    assert log["room_m"].min() > -5e-3
    assert np.hypot(*(log.final - log.final_reference[:3])[:2]) < 0.05
    sideways = -np.sin(log["heading_rad"][:-1]) * np.diff(log["x_m"])
    sideways += np.cos(log["heading_rad"][:-1]) * np.diff(log["y_m"])
    assert abs(sideways).max() > 0.1 * scenario.dt  # m: what no wheeled base does


def test_its_rows_are_those_of_the_contacts():
    rng = np.random.default_rng(1)
    robot, method = Robot.mir100(), make_controller("omni", Robot.mir100(), SETTINGS)
    disc = np.array([(0.9, 0.5, 0.2)])
    velocity, turn, dt = np.array([(-0.3, 0.1)]), 0.4, 1e-6
    seen = Obstacles(discs=disc, disc_velocities=velocity)
    target = 1.0, 0.0, 0.2
    context = StepContext((0.0,) * 3, target, (0.5, 0.1), target, (0.0, 0.0))
    problem = method.problem(seen, context, turn, 0.0)
    before = Contacts.of(robot.footprint, seen).distance[0]
    r_min = SETTINGS.radius.r_min(math.hypot(*velocity[0]))
    for w in rng.uniform(-1.0, 1.0, (5, 2)):
        moved = Obstacles(discs=disc + [(*(dt * velocity[0]), 0.0)])
        pose = integrate((0.0, 0.0, 0.0), (w[0], turn), w[1], dt)
        after = Contacts.of(robot.footprint, moved.seen_from(pose)).distance[0]
        rate = (after - before) / dt + SETTINGS.gamma * (before - r_min)
        assert problem.A[0] @ w - problem.b[0] == pytest.approx(rate, abs=1e-4)
