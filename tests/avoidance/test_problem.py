"""The problem is the QP whose solution is the decision, looking ahead too."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from problems import ROBOTS, Scene, loop
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import trust_box
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import load_back_end, solve
from qpavoid.types import Box

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


def off(problem, solver, decision):
    """Distance of a problem's solution from the decision's twist."""
    solution = solve(problem, solver, SETTINGS.slack_tolerance)
    if solution.status is SolveStatus.FAILED:
        return math.nan
    return float(np.abs(solution.u - decision[:2]).max())


@aheads
@robots
def test_the_solution_of_the_problem_is_the_decision(robot, ahead):
    """Exactly, and that of every back end to what it promises, where it has one."""
    names = ("osqp", "qpsolvers:daqp", "casadi:daqp")
    back_ends = {name: load_back_end(name) for name in names}
    seen, wrong, failed, asked = set(), [], 0, 0
    for decisions, problems in sequences(robot, ahead, 60, 1):
        for decision, problem in zip(decisions, problems, strict=True):
            seen.add(decision.status)
            if decision.status not in SOLVED:
                continue
            assert off(problem, "exact", decision) <= 1e-9
            for name, back_end in back_ends.items():
                gap = off(problem, back_end, decision)
                asked, failed = asked + 1, failed + math.isnan(gap)
                if gap > 1e-5:
                    wrong.append((name, decision))
    assert not wrong
    assert failed < 0.01 * asked
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


@aheads
@robots
def test_statuses_say_what_was_driven(robot, ahead):
    """Tracking: the desired twist. Relaxed: slack or shortfall. Never both unsaid."""
    for decisions, problems in sequences(robot, ahead, 60, 3):
        for decision, problem in zip(decisions, problems, strict=True):
            lacking = decision.slack > 0.0 or decision.shortfall > 0.0
            if decision.status in (Status.TRACKING, Status.FILTERED):
                assert not lacking
            if decision.status is Status.RELAXED:
                assert lacking
            if decision.status in SOLVED:
                inside = problem.lower - 1e-9 <= decision[:2]
                assert (inside & (decision[:2] <= problem.upper + 1e-9)).all()
            if decision.status is Status.HOLDING:
                assert decision[:2] == (0.0, 0.0)
            assert len(set(decision.active)) == len(decision.active) <= 2


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_trust_region_is_never_empty(share):
    """Not where the anchor is a rounding error outside the step's limits either."""
    box = Box(-0.072, -0.06, -1.5, 1.5)
    for v in (box[0], box[1]):
        for beyond in (-1.0, 1.0):
            anchor = float(np.nextafter(v, beyond)), 0.0
            prepared = SimpleNamespace(box=box, anchor=anchor)
            rejected = anchor[0] + share, anchor[1]
            found = trust_box.py_func(prepared, 1, rejected)
            assert found[0] <= found[1] and found[2] <= found[3]
            assert box[0] <= found[0] and found[1] <= box[1]
