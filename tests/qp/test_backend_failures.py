"""Back ends that raise, lie or are not there: never an unchecked twist."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from places import ROOT
from problem_bank import qp
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.errors import MissingExtraError, UnknownNameError
from qpavoid.qp.backends import BACK_ENDS, back_end_names, find_back_end, is_installed
from qpavoid.qp.problem import SolveStatus
from qpavoid.qp.solve import solve


class Raises:
    def __call__(self, problem):
        raise RuntimeError("no licence")


class Answers:
    def __init__(self, answer):
        self.answer = answer

    def __call__(self, problem):
        return self.answer


MISBEHAVED = {
    "raises": Raises(),
    "NaN": Answers(np.full(2, math.nan)),
    "half NaN": Answers(np.array([0.0, math.nan])),
    "infinite": Answers(np.array([math.inf, -math.inf])),
    "huge": Answers(np.array([2.1e9, -2.1e9])),
    "the desired twist": Answers(np.array([0.8, 0.0])),
    "a feasible but wrong twist": Answers(np.array([-0.4, 0.1])),
    "always zero": Answers(np.zeros(2)),
    "None": Answers(None),
    "three numbers": Answers(np.zeros(3)),
    "one number": Answers(0.5),
    "no numbers": Answers(np.zeros(0)),
    "text": Answers("solved"),
}
misbehaved = pytest.mark.parametrize("bad", MISBEHAVED.values(), ids=MISBEHAVED)


@misbehaved
def test_a_wrong_answer_is_a_failed_solution(bad):
    solution = solve(qp([[-1, 0.3], [-1, -0.4]], [-0.2, -0.1], (0.8, 0.0)), bad)
    assert solution.status is SolveStatus.FAILED
    assert np.isnan(solution.u).all() and solution.active == ()
    assert solution.violation > 1e-6 or solution.suboptimality > 1e-6


@misbehaved
def test_a_wrong_answer_never_leaves_the_filter(bad, robot, monkeypatch):
    """The robot brakes and says so, and is right again with the next good answer."""
    monkeypatch.setitem(
        BACK_ENDS, "osqp", BACK_ENDS["osqp"]._replace(make=lambda settings: bad)
    )
    for ahead in (False, True):
        safety = SafetyFilter(robot, solver="osqp", ahead=ahead)
        decision = safety.filter(0.8, 0.0, points=[[0.80, 0.05]])
        assert (decision.v, decision.omega) == (0.0, 0.0)
        assert decision.status is Status.STOPPED
        assert "brakes" in decision.status.sentence
        assert decision.clearance == pytest.approx(0.11, abs=0.02)
        assert decision.active == () or ahead
        assert not decision.residual <= 1e-6


PASSES_ALL_ON = """
import numpy as np
from qpavoid import AvoidanceSettings, Obstacles, Robot, SafetyFilter, Status
from qpavoid.avoidance import proposals
from qpavoid.avoidance.decision import STATUSES
from qpavoid.avoidance.bodies import Request
from qpavoid.avoidance.step import NO_ANSWER, filter_outcome
from qpavoid.qp.exact import Optimum

proposals.solve_exactly = lambda *_: Optimum(True, 0.8, 0.0, 0.0, -1, -1)
safety = SafetyFilter(Robot.mir100(), ahead=False)

def decided(points):
    arrays = Obstacles(points=points).arrays
    engine = safety._engine
    setup, request = engine.setup, Request(arrays, 0.0, False, (0.8, 0.0))
    state, memory = engine.state.copy(), engine._memory
    return filter_outcome.py_func(setup, request, NO_ANSWER, state, memory)

free, blocked = decided([[5.0, 0.0]]), decided([[0.80, 0.05]])
assert (free.v, STATUSES[free.code]) == (0.8, Status.TRACKING)
assert (blocked.v, blocked.omega) == (0.0, 0.0)
assert STATUSES[blocked.code] in (Status.STOPPED, Status.HOLDING)
"""


def test_a_wrong_exact_answer_is_braked_too():
    """In plain Python, with an exact solver that passes all on."""
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "QPAVOID_NATIVE": "0"}
    subprocess.run([sys.executable, "-P", "-c", PASSES_ALL_ON], env=plain, check=True)


class Moody:
    """Wrong at every second call."""

    def __init__(self, good):
        self.good, self.calls = good, 0

    def __call__(self, problem):
        self.calls += 1
        if self.calls % 2 == 0:
            return np.full(2, math.nan)
        return self.good(problem)


def test_each_call_is_judged_alone(robot, monkeypatch):
    moody = Moody(find_back_end("osqp").load())
    monkeypatch.setitem(
        BACK_ENDS, "osqp", BACK_ENDS["osqp"]._replace(make=lambda settings: moody)
    )
    safety = SafetyFilter(robot, solver="osqp", ahead=False)
    statuses = [safety.filter(0.8, 0.0, points=[[0.85, 0.0]]).status for _ in range(6)]
    assert statuses == [Status.FILTERED, Status.STOPPED] * 3


def test_unknown_names_are_suggested_for(robot):
    for ask in (
        lambda name: solve(qp(), name),
        lambda name: SafetyFilter(robot, solver=name),
    ):
        with pytest.raises(UnknownNameError, match="qpsolvers:daqp") as caught:
            ask("qpsolvers:dapq")
        assert caught.value.known == back_end_names()


@pytest.mark.parametrize("name", back_end_names()[1:])
def test_an_absent_package_names_what_installs_it(name, monkeypatch):
    monkeypatch.setattr("qpavoid.qp.backends.find_spec", lambda module: None)
    assert not is_installed(name)
    with pytest.raises(MissingExtraError) as caught:
        solve(qp(), name)
    extra = BACK_ENDS[name].extra
    assert name in str(caught.value) and caught.value.extra == extra
    assert "pip install" in str(caught.value)
    if extra:
        assert f"qpavoid[{extra}]" in str(caught.value)
    else:
        assert "[]" not in str(caught.value)


def test_every_extra_is_one_of_the_package():
    import tomllib

    text = (ROOT / "pyproject.toml").read_text()
    project = tomllib.loads(text)["project"]
    shipped = " ".join(project["dependencies"])
    for entry in BACK_ENDS.values():
        if entry.extra:
            wanted = " ".join(project["optional-dependencies"][entry.extra])
            assert entry.module in wanted
        else:
            assert entry.module in shipped
