"""Engine of a filter: its back end, and the state between steps."""

import math
from collections.abc import Callable
from threading import get_ident
from time import perf_counter
from typing import Any

import numpy as np

from qpavoid.avoidance.decision import INVALID, STATUSES, Decision
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.state import fresh_state, set_driven
from qpavoid.avoidance.step import (
    WORKSPACE_TOO_SMALL,
    filter_outcome,
    filter_step,
)
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
from qpavoid.qp.exact import ROW_OWNER, B
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import BackEnd, load_back_end, solve
from qpavoid.types import Array, Arrays, Pair

CONTACTS = 512
"""Contacts that memory is allocated for at first; it grows on demand."""

ELSEWHERE = (
    "a filter holds its robot's state and belongs to the thread that uses it first: "
    "make one filter per thread, or call reset() before another thread uses it"
)

POINTS_AT, V_AT, OMEGA_AT = 3, 7, 8
"""Positions among the parameters of :func:`filter_step`."""

NO_OTHERS = NO_DISCS, NO_POINTS, NO_WALLS, NO_POLYGONS, NO_TURNS
GIVEN = V_AT, OMEGA_AT, POINTS_AT, *NO_OTHERS, 0.0, None
"""Arguments of the fast call, with their defaults."""

MADE = np.ndarray, Decision, STATUSES, np.zeros((2, 3))


def nothing(*given: Any) -> None:
    """Fast call that never answers."""


class Engine:
    """State of a filter, and its step.

    Attributes:
        settings: Of the filter.
        setup: Robot and settings.
        solver: Name of the back end.
        ahead: Whether to look ahead.
        state: See :mod:`qpavoid.avoidance.state`; written in place.
        thread: Owner; 0: none yet.
        quick: Fast call for points alone; None: not applicable, or invalid input.
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
        """Reset; memory is new, since another thread may still use the old one."""
        self.state = fresh_state()
        self._begin()

    def _begin(self) -> None:
        self.thread, self.quick = 0, nothing  # bound to the first thread that calls
        self._memory = np.empty(memory_size(CONTACTS, self.setup.settings))

    def use(self, back_end: BackEnd | None) -> None:
        """Set the back end; None: the exact solver."""
        self.back_end = back_end
        self._be_quick()

    def __getstate__(self) -> dict[str, Any]:
        """Return all but back end, memory and thread: a copy has its own."""
        own = ("back_end", "_memory", "thread", "quick")
        return {k: x for k, x in vars(self).items() if k not in own}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore what :meth:`__getstate__` returned."""
        vars(self).update(state)
        self._begin()
        self.use(named_back_end(self.solver))

    def bind(self, thread: int) -> None:
        """Bind to the first thread that uses it; ThreadError for another one."""
        if self.thread == thread:
            return
        if self.thread != 0:
            raise ThreadError(ELSEWHERE)
        self.thread = thread
        self._be_quick()

    def is_elsewhere(self) -> bool:
        """Return whether it belongs to another thread."""
        return self.thread not in (0, get_ident())

    def _be_quick(self) -> None:
        """Prepare the fast call of machine code, if there is any."""
        self.quick = nothing
        if self.thread != 0 and self.back_end is None:
            given = NO_POINTS, NO_CAPSULES, 0.0, self.ahead, 0.0, 0.0
            known = *self.setup, *given, self.state, self._memory
            self.quick = bound(filter_step, known, GIVEN, MADE) or nothing

    def drives(self, v: float, omega: float) -> None:
        """Discard the plan; the robot drives a twist."""
        self.state[:] = 0.0
        set_driven(self.state, v, omega)

    def step(
        self, desired: Pair, arrays: Arrays, age: float, state: Array
    ) -> tuple[Any, ...]:
        """Return the outcome of a step, and update the given state."""
        if self.back_end is None:
            return self.step_exactly(desired, arrays, age, state)
        outcome = self.step_exactly(desired, arrays, age, state.copy())
        if outcome[0] == INVALID:
            return outcome
        request = Request(arrays, age, self.ahead, desired)
        answer = self._answer(self.problem(arrays))
        return filter_outcome(self.setup, request, answer, state, self._memory)

    def step_exactly(
        self, desired: Pair, arrays: Arrays, age: float, state: Array
    ) -> tuple[Any, ...]:
        """Return the outcome of a step with the exact solver; see :meth:`step`."""
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

    def problem(self, arrays: Arrays) -> FilterProblem:
        """Return the QP of the last step, among these obstacles."""
        most = most_contacts(self.setup.edges, arrays)
        carved = carve.py_func  # type: ignore[attr-defined]
        space = carved(self._memory, most, self.setup.settings)
        m, hard, v_min, v_max, omega_min, omega_max, *desired = space.problem.tolist()
        rows = space.rows[: int(m)]
        return FilterProblem(
            desired=np.array(desired),
            weights=np.array(self.settings.weights),
            A=rows[:, :B],
            b=rows[:, B],
            lower=np.array([v_min, omega_min]),
            upper=np.array([v_max, omega_max]),
            obstacle=rows[:, ROW_OWNER].astype(np.int64),
            n_hard=int(hard),
        )

    def _answer(self, problem: FilterProblem) -> Pair:
        """Return the back end's twist; NaN if it fails."""
        assert self.back_end is not None
        solution = solve(problem, self.back_end, self.settings.slack_tolerance)
        if solution.status is SolveStatus.FAILED:
            return math.nan, math.nan
        return solution.u[0].item(), solution.u[1].item()


def named_back_end(solver: str) -> BackEnd | None:
    """Return the back end of a name; None for ``exact``."""
    return None if solver == "exact" else load_back_end(solver)


def as_decision(outcome: tuple[Any, ...], started: float) -> Decision:
    """Return the decision of an :class:`Outcome` or its tuple, begun at ``started``."""
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
