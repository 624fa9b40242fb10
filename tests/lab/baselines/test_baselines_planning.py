"""MPPI and NMPC: depths and plans against oracles, and what they do when they fail."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from guided import HERE, SETTINGS, SLOW_ROBOT, make, towards
from qpavoid.avoidance.decision import Status
from qpavoid.lab.baselines import nmpc
from qpavoid.lab.baselines.drive import reference_ahead, wide_discs
from qpavoid.lab.baselines.mppi import (
    Judgement,
    depth_within,
    rollout,
)
from qpavoid.lab.baselines.predictive import Situation
from qpavoid.model.capsules import RADIUS
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import braking_twist
from shapes import ROBOT, clearance


def test_mppi_is_seeded():
    disc = Obstacles(discs=[(2.0, 0.1, 0.3)])

    def drive(seed):
        step = make("mppi", seed=seed).start(0.5)
        return [step(0.5, 0.0, disc, towards())[:2] for _ in range(6)]

    assert drive(0) == drive(0) != drive(1)
    assert drive(0)[0] == drive(0)[1]  # held for 0.1 s


@pytest.mark.parametrize("seed", range(10))
def test_mppi_depth_is_that_of_the_contacts(seed):
    rng = np.random.default_rng(seed)
    pose, time = (*rng.uniform(-1, 1, 2).tolist(), rng.uniform(-3, 3)), 0.7
    discs = np.column_stack([rng.uniform(-2, 2, (4, 2)), rng.uniform(0, 0.4, 4)])
    moves, walls = rng.uniform(-1, 1, (4, 2)), rng.uniform(-3, 3, (2, 4))
    there = Obstacles([], discs + np.pad(time * moves, ((0, 0), (0, 1))), [], walls)
    r_min = 0.3
    wide = np.column_stack([discs[:, :2], discs[:, 2] + r_min, moves])
    lines = Obstacles(walls=walls).capsules
    lines[:, RADIUS] = r_min
    body = ROBOT.footprint.edges, ROBOT.limit_vector
    known = *body, wide, np.zeros(len(wide)), lines, r_min
    by = Judgement(*known, np.empty((0, 3)), (0.0, 0.0), (0.0, 0.0))
    depth = depth_within(by, pose, time)
    assert depth == pytest.approx(max(0.0, r_min - clearance(there, pose)))


@pytest.mark.parametrize("seed", range(10))
def test_mppi_misses_nothing_that_it_can_reach(seed):
    """Costs equal those with every obstacle checked from the first stage on."""
    rng = np.random.default_rng(seed)
    ways, far = rng.uniform(-3.1, 3.1, 60), rng.uniform(1.4, 9.0, 60)
    places = far * np.array([np.cos(ways), np.sin(ways)])
    discs = np.column_stack([places.T, rng.uniform(0, 0.2, 60)])
    moves = rng.uniform(-0.6, 0.6, (60, 2)) * (np.arange(60) % 2)[:, None]
    seen = Obstacles([], discs, moves)
    method = make("mppi", seed=seed, samples=64)
    driven = rng.uniform(0.0, 1.5), 0.0  # some drive faster than they may
    by = method.judgement(seen, towards()._replace(driven=driven))
    assert np.all(np.diff(by.soonest) >= 0.0) and by.soonest[-1] > 4.0
    samples = rng.uniform(-3, 3, (64, 82))
    first, second, least = samples.copy(), samples.copy(), np.zeros(len(by.soonest))
    rollout(by, first)
    rollout(by._replace(soonest=least), second)
    assert_array_equal(first, second)
    assert np.ptp(first[:, 81]) > 0.0


def planned(discs, driven=(0.5, 0.0)):
    """Return the plan of one step, and its context."""
    method, context = make("nmpc"), towards(driven=driven)
    reference = reference_ahead(context, ROBOT, method.stages, method.tick)
    start = next(method.starts(None, reference, (0.5, 0.0)))
    to = Situation((0.5, 0.0), context, discs)
    return method, method.solve(start, reference, to)


def test_nmpc_plan_is_a_motion_of_the_unicycle_and_keeps_its_distance():
    discs = wide_discs(Obstacles(discs=[(2.0, 0.3, 0.3)]), SETTINGS)
    method, plan = planned(discs)
    exact = np.array([HERE])
    for k, (v, omega) in enumerate(plan.twists):
        step = nmpc.driven_along(plan.twists[: k + 1], method.tick)[-1]
        assert plan.poses[k + 1] == pytest.approx(step, abs=1e-3)
        exact = np.vstack([exact, arc(*exact[-1], v, omega, method.tick)])
    assert plan.poses == pytest.approx(exact, abs=0.02)
    assert plan.slack.max() < 1e-3
    there = Obstacles(discs=[(2.0, 0.3, 0.3)])
    for pose in plan.poses:
        assert clearance(there, tuple(pose)) > SETTINGS.radius.r_min_slow - 2e-3


def test_nmpc_distance_is_that_of_the_polygon():
    import casadi as ca

    vertices = tuple(map(tuple, ROBOT.footprint.vertices.tolist()))
    pose, point = ca.SX.sym("pose", 3), ca.SX.sym("point", 2)
    distance = nmpc.polygon_distance(vertices, pose, point)
    function = ca.Function("distance", [pose, point], [distance])
    rng = np.random.default_rng(0)
    for *there, x, y in rng.uniform(-1.5, 1.5, (200, 5)):
        expected = clearance(Obstacles(points=[(x, y)]), tuple(there))
        assert float(function(there, (x, y))) == pytest.approx(expected, abs=1e-5)


def test_nmpc_brakes_where_the_solver_fails(monkeypatch):
    monkeypatch.setattr(nmpc, "IPOPT", {**nmpc.IPOPT, "max_iter": 0})
    nmpc.make_program.cache_clear()
    step = make("nmpc", SLOW_ROBOT).start(0.5, 0.0)
    decision = step(0.5, 0.0, Obstacles(discs=[(1.5, 0.1, 0.3)]))
    nmpc.make_program.cache_clear()
    braked = braking_twist(SLOW_ROBOT.limit_vector, 0.5, 0.0, SETTINGS.dt)
    assert decision[:3] == (*braked, Status.STOPPED)
