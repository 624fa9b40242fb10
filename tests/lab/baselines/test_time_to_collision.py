"""NH-TTC: times and subgradients against rollouts and differences, and what it does."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines import HERE, following, make, seeds
from qpavoid.lab.baselines.ttc import cost_of, descend, first_met
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, clearance

METHOD = make("ttc")
twists = st.tuples(st.floats(-1, 1), st.floats(-1.5, 1.5))


def moving(rng, count=3):
    """Discs some way off, under way."""
    angle, away = rng.uniform(0, 2 * math.pi, count), rng.uniform(1.3, 4.0, count)
    discs = np.column_stack([away * np.cos(angle), away * np.sin(angle)])
    discs = np.column_stack([discs, rng.uniform(0.0, 0.4, count)])
    return Obstacles(discs=discs, disc_velocities=rng.uniform(-0.8, 0.8, (count, 2)))


def room(problem, twist, time):
    """Least distance from the discs after a time, by the oracles' clearances."""
    discs = problem.discs[:, :3].copy()
    discs[:, :2] += time * problem.discs[:, 3:]
    discs[:, 2] = np.maximum(discs[:, 2], 0.0)
    return clearance(Obstacles(discs=discs), arc(*HERE, *twist, time))


@given(seed=seeds, twist=twists)
def test_the_first_collision_is_that_of_a_fine_rollout(seed, twist):
    problem = METHOD.problem(moving(np.random.default_rng(seed)), following())
    met, which = first_met(problem, twist)
    times = np.linspace(0.0, met, 150)
    assert min(room(problem, twist, time) for time in times) > -2e-3
    if which >= 0:
        assert room(problem, twist, met) < 2e-3
    else:
        assert met == problem.horizon


@given(seed=seeds, twist=twists)
def test_the_subgradient_is_that_of_the_cost(seed, twist):
    problem = METHOD.problem(moving(np.random.default_rng(seed)), following())
    cost, *slopes = cost_of(problem, twist)
    h = 1e-4
    for i, slope in enumerate(slopes):
        beside = [
            tuple(u + sign * h * (i == j) for j, u in enumerate(twist))
            for sign in (1, -1)
        ]
        met = {first_met(problem, each)[1] for each in (twist, *beside)}
        high, low = (cost_of(problem, each)[0] for each in beside)
        smooth = abs(high - 2 * cost + low) < 1e-7  # at a corner, or grazing, it is not
        if len(met) == 1 and smooth and cost < 10.0:
            assert slope == pytest.approx((high - low) / (2 * h), abs=0.15, rel=0.15)


@given(seed=seeds, twist=twists)
def test_descent_never_ends_above_its_start(seed, twist):
    problem = METHOD.problem(moving(np.random.default_rng(seed)), following())
    best, v, omega = descend(problem, twist, 40)
    assert best <= cost_of(problem, twist)[0] + 1e-12
    assert best == pytest.approx(cost_of(problem, (v, omega))[0])
    assert problem.box.v_min <= v <= problem.box.v_max
    assert problem.box.omega_min <= omega <= problem.box.omega_max


def test_its_polygon_passes_where_its_circle_would_not():
    posts = Obstacles(points=[[1.2, 0.55], [1.2, -0.55]])
    decision = make("ttc").start(0.5)(0.5, 0.0, posts, following())
    assert ROBOT.footprint.circumradius > 0.55
    assert decision[:2] == (0.5, 0.0)
