"""MPC-CBF: its barriers against distances of discs, and what γ does."""

import numpy as np
import pytest

from guided import SETTINGS, make, towards
from qpavoid.lab.baselines.drive import body_discs, reference_ahead, wide_discs
from qpavoid.lab.baselines.predictive import Situation
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from shapes import ROBOT

CROSSES = Obstacles(discs=[(2.0, -0.6, 0.3)], disc_velocities=[(-0.1, 0.3)])


def planned(obstacles, **changes):
    """Return the plan of one step, its method and the discs."""
    method, context = make("mpc-cbf", **changes), towards()
    discs = wide_discs(obstacles, SETTINGS)
    reference = reference_ahead(context, ROBOT, method.stages, method.tick)
    (start,) = method.starts(None, reference, (0.5, 0.0))
    to = Situation((0.5, 0.0), context, discs)
    return method.solve(start, reference, to), discs


def barriers(poses, disc, tick, count):
    """Least h of the body's discs after each stage."""
    times = tick * np.arange(len(poses))
    there = disc[:2] + times[:, None] * disc[3:]
    rows = []
    for x, radius in body_discs(ROBOT, count):
        turned = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        off = np.hypot(*(poses[:, :2] + x * turned - there).T)
        rows.append(off - radius - disc[2])
    return np.array(rows)


@pytest.mark.parametrize("gamma", [0.1, 0.4])
@pytest.mark.parametrize("count", [1, 2])
def test_no_barrier_shrinks_faster_than_by_its_share(gamma, count):
    plan, discs = planned(CROSSES, gamma=gamma, discs=count)
    h = barriers(plan.poses, discs[0], 0.2, count)
    assert plan.slack.max() < 1e-3
    assert (h[:, 1:] - (1.0 - gamma) * h[:, :-1] > -2e-3).all()
    assert (h[:, 1:] < h[:, :-1]).any()


DODECAGON = [[0.3 * np.cos(t), 0.3 * np.sin(t)] for t in np.arange(0, 6.2, 0.5236)]


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize(
    "corners",
    [ROBOT.footprint.vertices, DODECAGON, [[-2.0, -0.2], [-1.0, -0.2], [-1.5, 0.3]]],
    ids=["pentagon", "round", "behind the axle"],
)
def test_the_discs_of_a_body_hold_it(corners, count):
    robot = Robot("any", Footprint.polygon(corners), ROBOT.limits)
    (x, radius), corners = np.array(body_discs(robot, count)).T, np.array(corners)
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    edges = (1.0 - share) * corners + share * np.roll(corners, -1, axis=0)
    edges = edges.reshape(-1, 2)
    places = np.vstack([edges, 0.5 * (edges + corners.mean(axis=0))])
    off = np.hypot(places[:, :1] - x, places[:, 1:])
    assert ((off - radius).min(axis=1) < 1e-9).all()
    assert radius.max() <= body_discs(robot, 1)[0][1] + 1e-3
