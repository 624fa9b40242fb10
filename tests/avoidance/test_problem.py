"""The problem is the QP whose solution is the decision, looking ahead too."""

import numpy as np
import pytest

from problems import ROBOTS, Scene, loop
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.robot import limit_twist
from qpavoid.qp.solve import solve

SETTINGS = AvoidanceSettings(dt=0.05)
SOLVED = (Status.TRACKING, Status.FILTERED, Status.RELAXED)
OWN = (Status.PLANNED, Status.BRAKING, Status.HOLDING)
STEPS = 5
aheads = pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
robots = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


def wishes(rng):
    """Sequence of commands: constant for a while, or changed in every step."""
    box = [-1.0, -1.5], [1.0, 1.5]
    if rng.random() < 0.5:
        return np.repeat(rng.uniform(*box, (1, 2)), STEPS, axis=0)
    return rng.uniform(*box, (STEPS, 2))


def sequences(robot, ahead, count, seed, solver="exact", ask=True):
    """Yield problem and decision of every step: from afar, and from below r_min."""
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        scene = Scene(rng, least=0.3 if k % 3 else 0.03, movers=3 if k % 2 else 0)
        safety = SafetyFilter(robot, SETTINGS, solver, ahead)
        given = safety.problem if ask else None
        decisions, _, problems = loop(safety, scene, wishes(rng), 0.05, given)
        yield decisions, problems


def off(problem, robot, steps):
    """Distance of the first step to a problem's solution from the decision's twist."""
    last, decision = steps
    solution = solve(problem, "exact", SETTINGS.slack_tolerance)
    first = limit_twist(robot.limit_vector, tuple(solution.u), last, SETTINGS.dt)
    return float(np.abs(np.subtract(first, decision[:2])).max())


@aheads
@robots
def test_the_solution_of_the_problem_is_the_decision(robot, ahead):
    seen = set()
    for decisions, problems in sequences(robot, ahead, 60, 1):
        last = (0.0, 0.0)
        for decision, problem in zip(decisions, problems, strict=True):
            seen.add(decision.status)
            steps, last = (last, decision), decision[:2]
            if decision.status not in SOLVED:
                continue
            assert off(problem, robot, steps) <= 1e-9
    assert {Status.TRACKING, Status.FILTERED} <= seen
    assert seen <= {*SOLVED, *OWN}


@aheads
@robots
@pytest.mark.parametrize("solver", ["qpsolvers:daqp", "osqp"])
def test_whoever_solves_it_the_decision_is_the_same(solver, robot, ahead):
    """Twist, status, slack, shortfall, and who is responsible, over sequences."""
    count, unlike = 0, []
    exact = sequences(robot, ahead, 40, 2, ask=False)
    other = sequences(robot, ahead, 40, 2, solver, ask=False)
    for (one, _), (two, _) in zip(exact, other, strict=True):
        for a, b in zip(one, two, strict=True):
            count += 1
            same = a.status is b.status and set(a.active) == set(b.active)
            near = np.abs(np.subtract(a[:2], b[:2])).max() < 1e-4
            near = near and abs(a.slack - b.slack) < 1e-6
            if not (same and near and abs(a.shortfall - b.shortfall) < 1e-4):
                unlike.append((a, b))
                break
    assert count > 150 and not unlike
