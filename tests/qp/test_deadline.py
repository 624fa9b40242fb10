"""Back ends that are late, hang or die: an answer by the deadline, and it says so."""

import gc
import math
import os
from pathlib import Path
from time import monotonic
from types import SimpleNamespace

import pytest

from places import SUPPORT
from problem_bank import qp
from qpavoid import Robot, SafetyFilter
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import STOOD_IN
from qpavoid.errors import InvalidInputError, QPAvoidError, UnknownNameError
from qpavoid.qp import deadline as deadlines
from qpavoid.qp.deadline import DeadlineBackEnd
from qpavoid.qp.solve import BACK_ENDS, exact_twist, solve

SLOW = pytest.mark.slow
PROBLEM = qp([[-1, 0.3], [-1, -0.4]], [-0.2, -0.1], (0.8, 0.0))
SPOILT = """
import sys; sys.path.insert(0, {path!r})
from qpavoid.qp.deadline import serve
from slow_solvers import Solver
serve(lambda: Solver({way!r}, {every}))
"""


@pytest.fixture
def spoilt(monkeypatch):
    """Make back ends with a deadline run a spoilt solver instead."""

    def spoil(way, every=3):
        code = SPOILT.format(path=str(SUPPORT), way=way, every=every)
        braces = code.replace("{", "{{").replace("}", "}}")
        monkeypatch.setattr(deadlines, "CODE", braces)

    return spoil


@pytest.mark.parametrize(
    "way",
    [
        "sleeps",
        "dies",
        "raises",
        *(
            pytest.param(w, marks=SLOW)
            for w in ("keeps the lock", "leaves", "NaN", "stops")
        ),
    ],
)
def test_the_exact_solve_stands_in(way, spoilt):
    """Every third problem, and while a process is started; and then it is there again.

    Of six the third is spoilt: of those that go on, the sixth as well; of those that
    end, the fourth only starts another.
    """
    spoilt(way)
    back_end = DeadlineBackEnd("osqp", 0.5)
    for _ in range(6):
        assert back_end._talk.there.wait(60.0)
        assert solve(PROBLEM, back_end).u == pytest.approx(exact_twist(PROBLEM))
    assert back_end.stand_ins == 2 and not back_end.has_given_up


def test_while_none_is_there_it_does_not_wait(spoilt):
    spoilt("sleeps", every=1)
    back_end = DeadlineBackEnd("osqp", 0.2)
    first = back_end._talk
    solve(PROBLEM, back_end)
    assert first.gone.is_set() and back_end.stand_ins == 1
    for _ in range(20):
        solve(PROBLEM, back_end)  # some start a process, none asks it
    assert back_end.stand_ins == 21


def test_so_many_processes_in_a_row_and_no_more(spoilt):
    spoilt("dies", every=1)
    back_end = DeadlineBackEnd("osqp", 5.0)
    started = set()
    for _ in range(20):
        started.add(back_end._talk)
        back_end._talk.there.wait(60.0)
        answer = solve(PROBLEM, back_end)
        assert answer.u == pytest.approx(exact_twist(PROBLEM))
    assert len(started) == deadlines.TRIES and back_end.has_given_up
    assert back_end.stand_ins == 20


def test_what_it_prints_is_no_answer(spoilt):
    spoilt("prints", every=1)
    back_end = DeadlineBackEnd("osqp", 5.0)
    for _ in range(3):
        solution = solve(PROBLEM, back_end)
        assert solution.u == pytest.approx(exact_twist(PROBLEM))
    assert back_end.stand_ins == 0


def test_what_it_prints_when_it_is_loaded_is_no_answer(monkeypatch):
    loud = (
        "def load():\n    print('solver 1.0' * 9, flush=True)\n    return Solver('NaN')"
    )
    code = f"from slow_solvers import Solver\n{loud}\nserve(load)\n"
    head = f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n"
    head += "from qpavoid.qp.deadline import serve\n"
    monkeypatch.setattr(deadlines, "CODE", head + code)
    back_end = DeadlineBackEnd("osqp", 5.0)
    assert solve(PROBLEM, back_end).u == pytest.approx(exact_twist(PROBLEM))
    assert back_end.stand_ins == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_of_a_back_end_that_forks_one_answers(spoilt):
    """And each answer is that of its problem."""
    spoilt("forks", every=2)
    back_end = DeadlineBackEnd("osqp", 5.0)
    for k in range(6):
        problem = qp([[-1, 0.3], [-1, -0.4]], [-0.2 - 0.02 * k, -0.1], (0.8, 0.0))
        assert solve(problem, back_end).u == pytest.approx(exact_twist(problem))
    assert back_end.stand_ins == 0


def test_an_answer_that_nobody_awaited_is_not_the_next_one(spoilt):
    """A handler of signals raised while it was awaited; the loop went on."""
    spoilt("prints", every=10)
    back_end = DeadlineBackEnd("osqp", 5.0)
    talk, ask = back_end._talk, back_end._talk._answers.get

    def interrupted(timeout):
        monkey.undo()
        raise ValueError("of a handler")

    with pytest.MonkeyPatch.context() as monkey:
        monkey.setattr(talk, "_answers", SimpleNamespace(get=interrupted))
        with pytest.raises(ValueError, match="handler"):
            back_end(PROBLEM.scaled())
    assert talk._answers.get == ask
    for k in range(3):
        problem = qp([[-1, 0.3], [-1, -0.4]], [-0.2 - 0.02 * k, -0.1], (0.8, 0.0))
        assert solve(problem, back_end).u == pytest.approx(exact_twist(problem))
    assert back_end.stand_ins == 0


def test_the_deadline_is_that_of_a_whole_step(spoilt):
    """Three answers, each of them 0.2 s late: in time for one alone, not for all."""
    spoilt("dawdles", every=1)
    back_end = DeadlineBackEnd("osqp", 0.5)
    back_end.begin()
    began = monotonic()
    for _ in range(4):
        assert solve(PROBLEM, back_end).u == pytest.approx(exact_twist(PROBLEM))
    assert monotonic() - began < 0.75 and back_end.stand_ins == 2
    back_end._talk.there.wait(60.0)
    back_end.begin()
    assert math.isfinite(back_end._until) and back_end._until > began + 0.5


def test_the_filter_begins_a_step(monkeypatch):
    safety, begun = SafetyFilter(Robot.mir100(), solver="osqp", deadline=5.0), []
    monkeypatch.setattr(safety._engine.back_end, "begin", lambda: begun.append(1))
    for k in range(3):
        safety.filter(0.8, 0.0, [[0.8, 0.05]])
        assert len(begun) == k + 1


@pytest.mark.parametrize("way", ["leaves", pytest.param("sleeps", marks=SLOW)])
def test_the_filter_counts_and_says_it(way, spoilt):
    spoilt(way, every=1)
    safety = SafetyFilter(Robot.mir100(), solver="osqp", ahead=False, deadline=0.2)
    exact = SafetyFilter(Robot.mir100(), ahead=False)
    for k in range(3):
        decision = safety.step(0.8, 0.0, [[0.8, 0.05]])
        other = exact.filter(0.8, 0.0, [[0.8, 0.05]])
        assert decision[:2] == pytest.approx(other[:2], abs=1e-9)
        assert decision.status is other.status is not Status.INVALID
        assert decision.problem == STOOD_IN and safety.stand_ins == k + 1


def test_a_back_end_that_is_in_time_answers_itself():
    safety = SafetyFilter(Robot.mir100(), solver="osqp", ahead=False, deadline=5.0)
    own = SafetyFilter(Robot.mir100(), solver="osqp", ahead=False)
    for _ in range(5):
        decision = safety.filter(0.8, 0.0, [[0.8, 0.05]])
        assert decision[:4] == own.filter(0.8, 0.0, [[0.8, 0.05]])[:4]
        assert decision.problem == "" and safety.stand_ins == 0


@pytest.mark.skipif(not Path("/proc").exists(), reason="no /proc")
def test_its_process_ends_with_it(spoilt):
    spoilt("sleeps", every=1)
    back_end = DeadlineBackEnd("osqp", 0.2)
    talk = back_end._talk
    pid = talk._process.pid
    assert Path(f"/proc/{pid}").exists()
    del back_end
    gc.collect()
    talk.join(10.0)
    assert not Path(f"/proc/{pid}").exists()


def test_leaving_in_the_own_process_does_not_leave(monkeypatch):
    class Leaves:
        def __call__(self, problem):
            raise SystemExit("no licence")

    entry = BACK_ENDS["osqp"]._replace(load=Leaves)
    monkeypatch.setitem(BACK_ENDS, "osqp", entry)
    decision = SafetyFilter(Robot.mir100(), solver="osqp", ahead=False).filter(
        0.8, 0.0, [[0.8, 0.05]]
    )
    assert decision.status is Status.STOPPED and decision.v == 0.0


@pytest.mark.parametrize("deadline", [0.0, -1.0, float("nan")])
def test_a_deadline_is_positive(deadline):
    with pytest.raises(InvalidInputError, match="deadline"):
        SafetyFilter(Robot.mir100(), solver="osqp", deadline=deadline)


def test_it_is_a_back_end_that_there_is(monkeypatch):
    with pytest.raises(UnknownNameError):
        DeadlineBackEnd("osqq", 1.0)
    monkeypatch.setattr(deadlines, "CODE", "raise SystemExit")
    monkeypatch.setattr(deadlines, "START", 3.0)
    with pytest.raises(QPAvoidError, match="does not start"):
        DeadlineBackEnd("osqp", 1.0)
