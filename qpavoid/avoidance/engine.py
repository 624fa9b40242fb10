"""What takes the steps of a filter: its back end, and all that it remembers."""

import math
from collections.abc import Callable
from threading import get_ident
from time import perf_counter
from typing import Any

import numpy as np

from qpavoid.avoidance.decision import RELAXED, STATUSES, Decision
from qpavoid.avoidance.ladder import (
    AGAIN,
    READY,
    WORKSPACE_TOO_SMALL,
    Outcome,
    unsolved,
)
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.state import fresh_state, set_driven
from qpavoid.avoidance.step import attempts, decide, filter_step, prepare, trust_box
from qpavoid.avoidance.workspace import carve, memory_size
from qpavoid.compiled import bound
from qpavoid.errors import ThreadError
from qpavoid.model.contacts import most_contacts
from qpavoid.model.given import (
    NO_CAPSULES,
    NO_DISCS,
    NO_POINTS,
    NO_TURNS,
    NO_WALLS,
)
from qpavoid.model.robot import UNLIMITED_TWIST, Robot
from qpavoid.model.validation import NO_POLYGONS
from qpavoid.qp.exact import OWNER, B
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import BackEnd, load_back_end, solve
from qpavoid.types import Array, Arrays, Box, Pair

CONTACTS = 512
"""For so many there is memory from the start; for more it is made."""

ELSEWHERE = (
    "a filter remembers its robot's motion and belongs to the thread that uses it "
    "first: make one filter a thread, or reset() it to hand it over"
)

OPEN = math.inf, math.inf
"""No answer of a back end."""

POINTS, V, OMEGA = 3, 7, 8
"""Places among the parameters of :func:`filter_step`."""

NO_OTHERS = NO_DISCS, NO_POINTS, NO_WALLS, NO_POLYGONS, NO_TURNS
GIVEN = V, OMEGA, POINTS, *NO_OTHERS, 0.0, None
"""What comes with a call that is answered at once, and what stands for nothing."""

MADE = np.ndarray, Decision, STATUSES, np.zeros((2, 3))


def nothing(*given: Any) -> None:
    """Answer no call at once."""


class Engine:
    """Takes steps, and remembers what has been driven.

    Attributes:
        settings: Of the filter.
        setup: Robot and settings.
        solver: Name of the back end.
        ahead: Whether to look ahead.
        state: See :mod:`qpavoid.avoidance.state`; written in place.
        thread: That it belongs to; 0: to none yet.
        quick: The filter's call in one, for points alone; None: not so, or not valid.
    """

    def __init__(
        self, robot: Robot, settings: AvoidanceSettings, solver: str, ahead: bool
    ) -> None:
        self.settings, self.solver, self.ahead = settings, solver, ahead
        edges, limits = robot.footprint.edges, robot.limit_vector
        endless = np.isinf(limits) & (np.arange(len(limits)) < 4)
        limits[endless] = np.copysign(UNLIMITED_TWIST, limits[endless])
        self.setup = Setup(edges, limits, settings.record())
        self.forget()
        self.use(named_back_end(solver))

    def forget(self) -> None:
        """Be as at first; what another thread is at still has memory of its own."""
        self.state = fresh_state()
        self._begin()

    def _begin(self) -> None:
        self.thread, self.quick = 0, nothing  # bound to the thread that comes first
        self._memory = np.empty(memory_size(CONTACTS, self.setup.settings))

    def use(self, back_end: BackEnd | None) -> None:
        """Solve by a back end from now on; by None exactly."""
        self.back_end = back_end
        self._be_quick()

    def __getstate__(self) -> dict[str, Any]:
        """Return all but back end, memory and thread: a copy has its own."""
        own = ("back_end", "_memory", "thread", "quick")
        return {k: x for k, x in vars(self).items() if k not in own}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned of another one."""
        vars(self).update(state)
        self._begin()
        self.use(named_back_end(self.solver))

    def bind(self, thread: int) -> None:
        """Belong to the thread that uses it first."""
        if self.thread == thread:
            return
        if self.thread != 0:
            raise ThreadError(ELSEWHERE)
        self.thread = thread
        self._be_quick()

    def is_elsewhere(self) -> bool:
        """Return whether it belongs to another thread than this one."""
        return self.thread not in (0, get_ident())

    def _be_quick(self) -> None:
        """Hold what is the same in every call, where machine code can."""
        self.quick = nothing
        if self.thread != 0 and self.back_end is None:
            given = NO_POINTS, NO_CAPSULES, 0.0, self.ahead, 0.0, 0.0
            known = *self.setup, *given, self.state, self._memory
            self.quick = bound(filter_step, known, GIVEN, MADE) or nothing

    def drives(self, v: float, omega: float) -> None:
        """Forget the plan of a robot that drives a twist."""
        self.state[:] = 0.0
        set_driven(self.state, v, omega)

    def step(
        self, desired: Pair, arrays: Arrays, age: float, state: Array
    ) -> Outcome | tuple[Any, ...]:
        """Return the outcome of a step, and bring the state given up to date."""
        if self.back_end is not None:
            return self.by_parts(desired, arrays, age, state)[0]
        return self.step_exactly(desired, arrays, age, state)

    def step_exactly(
        self, desired: Pair, arrays: Arrays, age: float, state: Array
    ) -> tuple[Any, ...]:
        """Do the same without a back end."""
        now = *self.setup, *arrays, age, self.ahead, *desired, state
        call: Callable[..., tuple[Any, ...]] = filter_step.call  # type: ignore[attr-defined]
        outcome = call(*now, self._memory)
        if outcome[0] == WORKSPACE_TOO_SMALL:
            self._make_room(arrays)
            outcome = call(*now, self._memory)
        return outcome

    def _make_room(self, arrays: Arrays) -> None:
        most = most_contacts(self.setup.edges, arrays)
        self._memory = np.empty(memory_size(most, self.setup.settings))
        self._be_quick()

    def by_parts(
        self, desired: Pair, arrays: Arrays, age: float, state: Array
    ) -> tuple[Outcome, FilterProblem | None]:
        """Do what :func:`filter_step` does, one part after the other: any solver."""
        setup = self.setup
        given = setup, Request(arrays, age, self.ahead, desired), state
        prepared = prepare(*given, self._memory)
        if prepared.code == WORKSPACE_TOO_SMALL:
            self._make_room(arrays)
            prepared = prepare(*given, self._memory)
        if prepared.code != READY:
            return unsolved(prepared.code, (0.0, 0.0), 0.0), None
        carved = carve.py_func  # type: ignore[attr-defined]
        space = carved(self._memory, prepared.most, setup.settings)
        rows, rejected = space.rows[: prepared.m], prepared.anchor
        outcome, problem = unsolved(AGAIN, (0.0, 0.0), 0.0), None
        last = attempts(prepared)
        for attempt in range(last + 1):
            answer = OPEN
            if attempt < last:
                box = trust_box(prepared, attempt, rejected)
                problem = self._as_problem(prepared.desired, rows, prepared.n_hard, box)
                answer = self._answer(problem)
            tried = prepared, self._memory, attempt, rejected, answer
            outcome = decide(setup, *tried, state)
            if outcome.code != AGAIN:
                break
            rejected = outcome.v, outcome.omega
        if attempt == last and (problem is None or outcome.code == RELAXED):
            driven = outcome.v, outcome.omega
            problem = self._as_problem(driven, rows[:0], 0, prepared.box)
        return outcome, problem

    def _answer(self, problem: FilterProblem) -> Pair:
        """Return what the back end says; NaN where it fails, none without one."""
        if self.back_end is None:
            return OPEN
        solution = solve(problem, self.back_end, self.settings.slack_tolerance)
        if solution.status is SolveStatus.FAILED:
            return math.nan, math.nan
        return solution.u[0].item(), solution.u[1].item()

    def _as_problem(
        self, desired: Pair, rows: Array, n_hard: int, box: Box
    ) -> FilterProblem:
        return FilterProblem(
            desired=np.array(desired),
            weights=np.array(self.settings.weights),
            A=rows[:, :B],
            b=rows[:, B],
            lower=np.array(box[::2]),
            upper=np.array(box[1::2]),
            obstacle=rows[:, OWNER].astype(np.int64),
            n_hard=n_hard,
        )


def named_back_end(solver: str) -> BackEnd | None:
    """Return the back end of a name; None: ``exact``."""
    return None if solver == "exact" else load_back_end(solver)


def as_decision(outcome: tuple[Any, ...], started: float) -> Decision:
    """Return an :class:`Outcome`, named or not, that was begun at ``started``."""
    code, v, omega, clearance, slack, residual, shortfall, first, second = outcome
    held = (first,) if second in (-1, first) else (first, second)
    active = held if first >= 0 else held[1:]
    elapsed, status = perf_counter() - started, STATUSES[code]
    # fmt: off
    return tuple.__new__(Decision, (  # in half the time of Decision(...)
        v, omega, status, clearance, slack, residual, active, elapsed, shortfall, 0.0,
        "",
    ))
    # fmt: on
