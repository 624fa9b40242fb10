"""The safety filter: the twist nearest to the desired one that keeps distances."""

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from threading import get_ident
from time import perf_counter
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.decision import INVALID, STATUSES, Decision, Status
from qpavoid.avoidance.inputs import (
    PROBLEM,
    WAITING,
    FaultError,
    Freshness,
    InputMonitor,
    LastSeen,
    Stamps,
    StepMonitor,
    as_age,
    as_driven,
    as_table,
    as_twist,
    caught,
    only_points,
    problem_of,
    seen_of,
    why_invalid,
)
from qpavoid.avoidance.plan import (
    KEPT,
    PENDING,
    Plan,
    fresh_state,
    kept_plan,
    set_driven,
)
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import (
    WORKSPACE_TOO_SMALL,
    filter_outcome,
    filter_step,
    memory_size,
    workspace_in,
)
from qpavoid.compiled import bound
from qpavoid.errors import QPAvoidError, ThreadError
from qpavoid.model.contacts import most_contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import NO_CAPSULES, NO_POINTS, Obstacles
from qpavoid.model.robot import UNLIMITED_TWIST, Robot, braking_twist
from qpavoid.qp.backends import BackEnd, find_back_end
from qpavoid.qp.exact import ROW_OWNER, B
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import solve
from qpavoid.settings import want
from qpavoid.types import Array, Arrays, Pair

CONTACTS = 512
"""Contacts that memory is allocated for at first; it grows on demand."""

ELSEWHERE = (
    "a filter holds its robot's state and belongs to the thread that uses it first: "
    "make one filter per thread, or call reset() before another thread uses it"
)

POINTS_AT, V_AT, OMEGA_AT = 3, 7, 8
"""Positions among the parameters of :func:`filter_step`."""

GIVEN = V_AT, OMEGA_AT, POINTS_AT, 0.0, None
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
        has_band: Whether the motors have a dead band.
        state: See :mod:`qpavoid.avoidance.plan`; written in place.
        thread: Owner; 0: none yet.
        quick: Fast call for points alone; None: not applicable, or invalid input.
    """

    def __init__(
        self, robot: Robot, settings: AvoidanceSettings, solver: str, ahead: bool
    ) -> None:
        self.settings, self.solver, self.ahead = settings, solver, ahead
        self.has_band = robot.limits.dead != (0.0, 0.0)
        self.setup = setup_of(robot, settings)
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

    def fit(self, robot: Robot) -> None:
        """Set another footprint; the state is kept."""
        self.setup = setup_of(robot, self.settings)
        self._be_quick()

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
        if self.thread != 0 and self.back_end is None and not self.has_band:
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
            most = most_contacts(self.setup.edges, arrays)
            self._memory = np.empty(memory_size(most, self.setup.settings))
            self._be_quick()
            outcome = call(*now, self._memory)
        return outcome

    def problem(self, arrays: Arrays) -> FilterProblem:
        """Return the QP of the last step, among these obstacles."""
        most = most_contacts(self.setup.edges, arrays)
        carved = workspace_in.py_func  # type: ignore[attr-defined]
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


def setup_of(robot: Robot, settings: AvoidanceSettings) -> Setup:
    """Return robot and settings for compiled functions, with finite twists."""
    edges, limits = robot.footprint.edges, robot.limit_vector
    endless = np.isinf(limits) & (np.arange(len(limits)) < 4)
    limits[endless] = np.copysign(UNLIMITED_TWIST, limits[endless])
    return Setup(edges, limits, settings.record())


def named_back_end(solver: str) -> BackEnd | None:
    """Return the back end of a name; None for ``exact``."""
    return None if solver == "exact" else find_back_end(solver).load()


def as_decision(outcome: tuple[Any, ...], started: float) -> Decision:
    """Return the decision of an outcome or its tuple, begun at ``started``.

    See :class:`qpavoid.avoidance.step.Outcome`.
    """
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


HALT = (0.0, 0.0)


class SafetyFilter:
    """CBF-QP: the twist nearest to the desired one that keeps the required distances.

    Every call solves min (u − u_f)ᵀ W (u − u_f) over u = (v, ω) within the robot's
    limits, subject to d̂_oᵀ J_0 u ≥ b for every contact in reach, with
    b = −γ(d − r_min) + d̂_oᵀ v_o
    (:func:`qpavoid.avoidance.cbf_rows.constraint_rows`). With look-ahead, the rows
    are those of future distances, d_k(u) ≥ r_min, linearised about the solution
    (:mod:`qpavoid.avoidance.proposals`).

    A twist is driven as the beginning of a plan verified to keep the required distances
    until the robot stands still (:mod:`qpavoid.avoidance.verdict`). If there is none,
    three plans are compared: the best of two twists, the rest of the last plan, and
    braking. The one with the largest margin is driven: ``planned`` if it keeps the
    distances, else ``relaxed``; for braking ``braking`` or ``holding``. The desired
    twist is never passed on unchecked.

    The filter stores the last twist and its plan: one filter per robot, used by one
    thread until :meth:`reset`.

    Args:
        robot: Footprint and limits.
        settings: Weights, bound, radii, look-ahead, control step.
        solver: Back end by name: ``exact``, ``osqp``, ``qpsolvers:daqp``, ``casadi``, …
        ahead: Look ahead; else only rows of the present are used.
        freshness: Greatest ages of the inputs of :meth:`step`, and when a fault ends.

    Attributes:
        monitor: Of the inputs of :meth:`step`, with latch, faults and last static map;
            may be set to one that knows the inputs by other names.

    Raises:
        UnknownNameError: No back end of that name.
        MissingExtraError: The back end's package is not installed.
    """

    def __init__(
        self,
        robot: Robot,
        settings: AvoidanceSettings | None = None,
        solver: str = "exact",
        ahead: bool = True,
        freshness: Freshness | None = None,
    ) -> None:
        self._robot = robot
        self._settings = settings if settings is not None else AvoidanceSettings()
        self._engine = Engine(robot, self._settings, solver, ahead)
        self._freshness = freshness or Freshness()
        self.monitor: InputMonitor = StepMonitor(self._freshness, self._settings.dt)
        self._braked("", (0.0, 0.0))  # compile now, not in an emergency

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy, without memory, thread and back end."""
        return deepcopy(vars(self))

    @property
    def robot(self) -> Robot:
        """Footprint and limits."""
        return self._robot

    @property
    def footprint(self) -> Footprint:
        """Footprint of the robot, which may be set between steps.

        The state is kept: twist, plan, faults, thread. The next verdict is that of the
        new footprint, of the retained plan too: if that is not clear any more, and no
        other plan is, the robot brakes or the decision is ``relaxed``. Obstacles that a
        larger footprint has inside r_min, or overlaps with, are treated as any others
        there: the clearance says so, and they are only left. Theorem 1 holds again once
        the robot stands with d ≥ r_min − ε for the new footprint.

        Raises:
            InvalidInputError: It is no Footprint; the previous one is kept.
            ThreadError: Another thread has used the filter since :meth:`reset`.
        """
        return self._robot.footprint

    @footprint.setter
    def footprint(self, footprint: Footprint) -> None:
        want(isinstance(footprint, Footprint), "footprint must be a Footprint")
        if self._engine.is_elsewhere():
            raise ThreadError(ELSEWHERE)
        self._robot = replace(self._robot, footprint=footprint)
        self._engine.fit(self._robot)

    @property
    def settings(self) -> AvoidanceSettings:
        """Weights, bound, radii, look-ahead, control step."""
        return self._settings

    @property
    def solver(self) -> str:
        """Name of the back end."""
        return self._engine.solver

    @property
    def ahead(self) -> bool:
        """Whether the filter looks ahead."""
        return self._engine.ahead

    @property
    def freshness(self) -> Freshness:
        """As given; a ``monitor`` that was set has its own."""
        return self._freshness

    @property
    def faults(self) -> dict[str, int]:
        """Number of faults in :meth:`step` and :meth:`brake`, by input and reason."""
        return dict(self.monitor.faults)

    @property
    def plan(self) -> Plan:
        """Remaining plan after the last twist."""
        return kept_plan(self._engine.state)

    @property
    def foreseen(self) -> float:
        """Time for which the plan has been checked against moving obstacles, s.

        From the end of the last step; the ``shortfall`` of its decision covers it. The
        horizon minus a control step for a new plan; less if an earlier one is carried
        on, as it may be for ``planned``. 0 without look-ahead.
        """
        kept = self._engine.state[:PENDING].view(KEPT)[0]
        return float(kept.until) if self.ahead else 0.0

    @property
    def _last(self) -> Pair:
        """The last twist, v in m/s and ω in rad/s."""
        return self._engine.state[0].item(), self._engine.state[1].item()

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Reset plan and thread; the robot drives (v, ω), cut to its limits."""
        driven = as_driven((v, omega), self._engine.setup.robot)
        self._engine.forget()
        self._engine.drives(*driven)
        self.monitor.last = None

    def filter(
        self,
        v: float,
        omega: float,
        obstacles: Obstacles | npt.ArrayLike = NO_POINTS,
        *,
        points: npt.ArrayLike = NO_POINTS,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
    ) -> Decision:
        """Return the decision for a desired twist among obstacles, robot frame.

        Args:
            v: Desired forward speed, m/s.
            omega: Desired yaw rate, rad/s, counter-clockwise.
            obstacles: In the present robot frame; or (N, 2) points alone, m.
            points: The same points by name, without ``obstacles``.
            age: s since the obstacles were measured; inflates them, see
                :class:`qpavoid.avoidance.settings.Margins`.
            driven: Measured (v, ω), default the filter's last twist; accelerations are
                relative to it. It is projected onto the limits.

        Raises:
            InvalidInputError: A shape does not fit, a number is not finite, a radius or
                the age negative. Points inside the footprint are valid: their
                clearance is negative, and the robot moves away from them or holds.
            ThreadError: Another thread has used the filter since :meth:`reset`.
        """
        seen = obstacles if points is NO_POINTS else only_points(obstacles, points)
        decision = self._engine.quick(v, omega, seen, age, driven)
        if decision is not None:
            return decision
        return self._decided(v, omega, seen, age, driven)

    def _decided(
        self, v: float, omega: float, seen: Any, age: float, driven: Pair | None
    ) -> Decision:
        """Return the decision for any kind of arguments; see :meth:`filter`."""
        started, engine = perf_counter(), self._engine
        engine.bind(get_ident())
        desired, age = self._or_halt(as_twist(v, omega)), as_age(age)
        arrays, memory = as_table(seen), engine.state
        state = self._state_at(driven)
        outcome = engine.step(desired, arrays, age, state)
        if outcome[0] == INVALID:
            raise why_invalid(seen)
        if state is not memory:
            memory[:] = state
        return self._commanded(as_decision(outcome, started))

    def step(
        self,
        /,
        *given: Any,
        stamps: Stamps | None = None,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
        on_error: Literal["brake", "raise"] = "brake",
        accept: Callable[[float, float], bool] | None = None,
        **named: Any,
    ) -> Decision:
        """Return the decision of :meth:`filter`; on an error brake instead of raising.

        Any fault gives a decision ``invalid`` with its ``problem``: the robot stops,
        and drives again only after :attr:`qpavoid.avoidance.inputs.Freshness.good`
        seconds of good steps, or :meth:`acknowledge`. It stops clear of the static
        obstacles of the last good step; without one, along its arc at full
        deceleration. ``None`` for obstacles means no data, a fault; without obstacles
        pass an empty array. Only ``KeyboardInterrupt`` is raised, and Python's
        ``RecursionError`` if no stack is left.

        Args:
            given: v, ω and obstacles as for :meth:`filter`.
            stamps: Times of measurement; they have to be fresh, in order and not blind.
                Without stamps only the age is checked.
            age: s since the obstacles were measured, if stamps do not say more; at most
                ``points`` of the freshness.
            driven: See :meth:`filter`; braking starts from it, too.
            on_error: ``raise``: errors are raised, the latch is not used.
            accept: Function from (v, ω) to whether the robot may drive it; if not, it
                stops clear of the static obstacles, ``braking``.
            named: Obstacles by name. Points are stored uncopied until a good step.
        """
        named |= {"driven": driven, "accept": accept}
        if on_error == "raise":
            return self._checked(given, named, stamps, age)
        if self._engine.is_elsewhere():
            return self._braked(ELSEWHERE, driven)
        monitor, engine = self.monitor, self._engine
        before = None if monitor.latch.is_open else engine.state.copy()
        found = caught(self._checked, given, named, stamps, age)
        if isinstance(found, BaseException):
            return self.brake(found, driven)
        monitor.last = LastSeen(seen_of(given, named))
        if monitor.allows_after(None):
            return found
        engine.state[:] = before
        return self._stopped(WAITING, driven)

    def _checked(
        self,
        given: tuple[Any, ...],
        named: dict[str, Any],
        stamps: Stamps | None,
        age: float,
    ) -> Decision:
        """Return the decision of :meth:`filter` at the age of its inputs."""
        known, accept = self.monitor.age(stamps, age), named.pop("accept")
        before = self._engine.state if accept is None else self._engine.state.copy()
        found = self.filter(*given, **named, age=known)
        if accept is None or accept(found.v, found.omega):
            return found
        self._engine.state[:] = before
        self.monitor.last = LastSeen(seen_of(given, named))
        halt = self._stopped("", named["driven"])
        return halt._replace(status=Status.BRAKING, clearance=found.clearance)

    def brake(
        self,
        problem: str | BaseException = PROBLEM,
        driven: tuple[float, float] | None = None,
        seen: Obstacles | None = None,
    ) -> Decision:
        """Return a decision ``invalid`` that stops the robot, without raising.

        For faults outside the filter; recovery as after a fault that :meth:`step`
        finds. Called from another thread than the filter's it changes no state.

        Args:
            problem: Sentence for the decision; or an error: a :class:`FaultError` is
                counted by input.
            driven: Measured (v, ω), default the filter's last twist; ignored if
                invalid, or if odometry is at fault.
            seen: Known obstacles, robot frame; default those of the last good step.
        """
        error = QPAvoidError(problem) if isinstance(problem, str) else problem
        if not self._engine.is_elsewhere():
            self.monitor.allows_after(error)
            self.monitor.moved(*self._last, self._settings.dt)
            if seen is not None:
                self.monitor.last = LastSeen(seen)
        stale = isinstance(error, FaultError) and "odometry" in error.faults
        return self._stopped(problem_of(error), None if stale else driven)

    def acknowledge(self) -> None:
        """Let :meth:`step` drive again at once if the fault is over."""
        self.monitor.latch.acknowledge()

    def _stopped(self, problem: str, driven: Any) -> Decision:
        """Stop clear of the last known static obstacles; without any, along the arc."""
        found = caught(self._stop, driven)
        if isinstance(found, Decision):
            return found._replace(status=Status.INVALID, problem=problem)
        return self._braked(problem, driven)

    def _stop(self, driven: Pair | None) -> Decision | None:
        """Return the filter's decision for a stop; None at rest or on failure."""
        started, engine = perf_counter(), self._engine
        state, last = self._state_at(driven).copy(), self.monitor.last
        if last is None or engine.is_elsewhere() or not state[:2].any():
            return None
        outcome = engine.step_exactly(HALT, last.standing(), 0.0, state)
        if outcome[0] == INVALID:
            return None
        engine.state[:] = state
        return self._commanded(as_decision(outcome, started))

    def _braked(self, problem: str, driven: Any) -> Decision:
        """Brake from ``driven`` if it is valid, else from the last twist."""
        started, engine = perf_counter(), self._engine
        robot, dt, last = engine.setup.robot, self._settings.dt, self._last
        if driven is not None:
            told = caught(self._driven, driven)
            last = last if isinstance(told, BaseException) else told
        v, omega = braking_twist(robot, *last, dt)
        if not engine.is_elsewhere():
            engine.drives(v, omega)
        elapsed, status = perf_counter() - started, Status.INVALID
        known = math.nan, 0.0, 0.0, (), elapsed, 0.0, 0.0, problem
        return self._commanded(Decision(v + 0.0, omega + 0.0, status, *known))

    def _driven(self, driven: Pair) -> Pair:
        """Return a measured twist; within the dead band the last one, cut to the band.

        There the motors stand still for any command, and accelerations relative to the
        measured twist would never leave it.
        """
        twist = as_driven(driven, self._engine.setup.robot)
        within = self._robot.limits.within_band
        return within(*self._last) if self._sticks(twist) else twist

    def _commanded(self, decision: Decision) -> Decision:
        """Return a decision with zero in place of a twist within the dead band."""
        halts = self._sticks((decision.v, decision.omega))
        return decision._replace(v=0.0, omega=0.0) if halts else decision

    def _sticks(self, twist: Pair) -> bool:
        """Return whether motors with a dead band stand still for a twist."""
        return self._engine.has_band and not self._robot.limits.moves(*twist)

    def _or_halt(self, twist: Pair) -> Pair:
        """Return a twist, or zero if it lies within the dead band."""
        return HALT if self._sticks(twist) else twist

    def _state_at(self, driven: Pair | None) -> Array:
        """Return the state of a robot that drives a twist at present."""
        if driven is None:
            return self._engine.state
        state = self._engine.state.copy()
        state[:2] = self._driven(driven)
        return state

    def problem(
        self,
        v: float,
        omega: float,
        obstacles: Obstacles | npt.ArrayLike = NO_POINTS,
        *,
        points: npt.ArrayLike = NO_POINTS,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
    ) -> FilterProblem:
        """Return the QP whose solution is the decision; arguments as in :meth:`filter`.

        Its unknown is the target twist, whose first step within the accelerations is
        driven. Its rows are those of the last linearisation; its limits include the
        trust region. For a decision ``tracking`` or ``filtered`` its solution
        (:func:`qpavoid.qp.solve.solve`) has been verified. ``planned``, ``braking`` and
        ``holding`` mean that no twist has: then it is the projection of the driven
        twist onto the limits, without rows. With look-ahead the rows of static
        obstacles inside r_min, in m/s, are multiplied by 1 ms: they give way to the
        others, in m. An infeasible problem is relaxed with its ``slack_tolerance``:
        pass that of the settings if they have another. The filter's state is unchanged.
        """
        seen = obstacles if points is NO_POINTS else only_points(obstacles, points)
        arrays, state = as_table(seen), self._state_at(driven).copy()
        desired, age = self._or_halt(as_twist(v, omega)), as_age(age)
        outcome = self._engine.step_exactly(desired, arrays, age, state)
        if outcome[0] == INVALID:
            raise why_invalid(seen)
        return self._engine.problem(arrays)
