"""The safety filter: the twist nearest to the desired one that keeps distances."""

import math
from collections.abc import Sequence
from copy import deepcopy
from threading import get_ident
from time import perf_counter
from typing import Any, TypeAlias

import numpy.typing as npt

from qpavoid.avoidance.decision import INVALID, Decision, Status
from qpavoid.avoidance.engine import ELSEWHERE, Engine, as_decision
from qpavoid.avoidance.freshness import Freshness
from qpavoid.avoidance.prediction import Plan
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.state import UNTIL, kept_plan
from qpavoid.avoidance.stopping import LastSeen
from qpavoid.avoidance.validation import (
    as_age,
    as_driven,
    as_table,
    as_twist,
    why_invalid,
)
from qpavoid.avoidance.watch import (
    PROBLEM,
    WAITING,
    FaultError,
    Stamps,
    StepWatch,
    caught,
    problem_of,
)
from qpavoid.errors import QPAvoidError
from qpavoid.model.given import NO_DISCS, NO_POINTS, NO_TURNS, NO_WALLS
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, braking_twist
from qpavoid.model.validation import NO_POLYGONS
from qpavoid.qp.problem import FilterProblem
from qpavoid.types import Array, Pair

Given: TypeAlias = tuple[Any, ...]
"""Obstacles, in the order of the parameters."""

HALT = (0.0, 0.0)


class SafetyFilter:
    """CBF-QP: the twist nearest to the desired one that keeps the required distances.

    Every call solves min (u − u_f)ᵀ W (u − u_f) over u = (v, ω) within the robot's
    limits, subject to d̂_oᵀ J_0 u ≥ b for every contact in reach, with
    b = −γ(d − r_min) + d̂_oᵀ v_o
    (:func:`qpavoid.avoidance.barrier_rows.constraint_rows`). With look-ahead, the rows
    are those of future distances, d_k(u) ≥ r_min, linearised about the solution
    (:mod:`qpavoid.avoidance.proposals`).

    A twist is driven only as the beginning of a plan verified to keep the required
    distances until the robot stands still (:mod:`qpavoid.avoidance.verdict`). Otherwise
    the fallbacks are, in this order: ``planned``, a plan of two twists; ``relaxed``,
    the least violation; ``braking`` along the arc at full deceleration; ``holding``.
    The desired twist is never passed on unchecked.

    The filter stores the last twist and its plan: one filter per robot, used by one
    thread until :meth:`reset`.

    Args:
        robot: Footprint and limits.
        settings: Weights, bound, radii, look-ahead, control step.
        solver: Back end by name: ``exact``, ``osqp``, ``qpsolvers:daqp``, ``casadi``, …
        ahead: Look ahead; else only rows of the present are used.
        freshness: Greatest ages of the inputs of :meth:`step`, and when a fault ends.

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
        self._watch = StepWatch(freshness or Freshness(), self._settings.dt)
        self._seen: LastSeen | None = None
        self._braked("", (0.0, 0.0))  # compile now, not in an emergency

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy, without memory, thread and back end."""
        return deepcopy(vars(self))

    @property
    def robot(self) -> Robot:
        """Footprint and limits."""
        return self._robot

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
        """Greatest ages of the inputs of :meth:`step`."""
        return self._watch.freshness

    @property
    def faults(self) -> dict[str, int]:
        """Number of faults in :meth:`step` and :meth:`brake`, by input and reason."""
        return dict(self._watch.faults)

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
        return float(self._engine.state[UNTIL]) if self.ahead else 0.0

    @property
    def _last(self) -> Pair:
        """The last twist, v in m/s and ω in rad/s."""
        return self._engine.state[0].item(), self._engine.state[1].item()

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Reset plan and thread; the robot drives (v, ω), cut to its limits."""
        driven = as_driven((v, omega), self._engine.setup.robot)
        self._engine.forget()
        self._engine.drives(*driven)
        self._seen = None

    def filter(
        self,
        v: float,
        omega: float,
        points: npt.ArrayLike | Obstacles = NO_POINTS,
        discs: npt.ArrayLike = NO_DISCS,
        disc_velocities: npt.ArrayLike = NO_POINTS,
        walls: npt.ArrayLike = NO_WALLS,
        polygons: Sequence[npt.ArrayLike] = NO_POLYGONS,
        polygon_velocities: npt.ArrayLike = NO_TURNS,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
    ) -> Decision:
        """Return the decision for a desired twist among obstacles, robot frame.

        Args:
            v: Desired forward speed, m/s.
            omega: Desired yaw rate, rad/s, counter-clockwise.
            points: (N, 2) sensed points, m, in the present robot frame; may be empty.
                Or :class:`Obstacles`, without the other arrays.
            discs: (M, 3) x, y, radius, m.
            disc_velocities: (M, 2) velocities over ground in robot axes, m/s; default
                0.
            walls: (K, 4) segments x1, y1, x2, y2, m.
            polygons: Of each its (n, 2) vertices, m, convex and counter-clockwise.
            polygon_velocities: (P, 3) v_x, v_y, m/s, and rate of turn, rad/s.
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
        decision = self._engine.quick(
            v,
            omega,
            points,
            discs,
            disc_velocities,
            walls,
            polygons,
            polygon_velocities,
            age,
            driven,
        )
        if decision is not None:
            return decision
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        return self._decided(v, omega, given, age, driven)

    def _decided(
        self, v: float, omega: float, given: Given, age: float, driven: Pair | None
    ) -> Decision:
        """Return the decision for any kind of arguments; see :meth:`filter`."""
        started, engine = perf_counter(), self._engine
        engine.bind(get_ident())
        desired, age = as_twist(v, omega), as_age(age)
        arrays, memory = as_table(*given), engine.state
        state = self._state_at(driven)
        outcome = engine.step(desired, arrays, age, state)
        if outcome[0] == INVALID:
            raise why_invalid(*given)
        if state is not memory:
            memory[:] = state
        return as_decision(outcome, started)

    def step(
        self,
        /,
        *given: Any,
        stamps: Stamps | None = None,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
        **named: Any,
    ) -> Decision:
        """Return the decision of :meth:`filter`; on an error brake instead of raising.

        Any fault gives a decision ``invalid`` with its ``problem``: the robot stops,
        and drives again only after :attr:`qpavoid.avoidance.freshness.Freshness.good`
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
            named: Obstacles by name. Arrays are stored uncopied until a good step.
        """
        found: Decision | BaseException
        if self._engine.is_elsewhere():
            return self._braked(ELSEWHERE, driven)
        known = caught(self._watch.age, stamps, age)
        before = None if self._watch.is_open else self._engine.state.copy()
        if isinstance(known, BaseException):
            found = known
        else:
            named |= {"age": known, "driven": driven}
            found = caught(self.filter, *given, **named)
        if not isinstance(found, BaseException):
            self._seen = LastSeen(given, named)
            if self._watch.allows(None):
                return found
            self._engine.state[:] = before
            return self._stopped(WAITING, driven)
        self._watch.allows(found)
        self._has_moved()
        stale = isinstance(found, FaultError) and "odometry" in found.faults
        return self._stopped(problem_of(found), None if stale else driven)

    def brake(
        self,
        problem: str = PROBLEM,
        driven: tuple[float, float] | None = None,
        seen: Obstacles | None = None,
    ) -> Decision:
        """Return a decision ``invalid`` that stops the robot, without raising.

        For faults outside the filter; recovery as after a fault that :meth:`step`
        finds. Called from another thread than the filter's it changes no state.

        Args:
            problem: Sentence for the decision.
            driven: Measured (v, ω), default the filter's last twist; ignored if
                invalid.
            seen: Known obstacles, robot frame; default those of the last good step.
        """
        if not self._engine.is_elsewhere():
            self._watch.allows(QPAvoidError(problem))
            self._has_moved()
            if seen is not None:
                self._seen = LastSeen((*HALT, seen), {})
        return self._stopped(problem, driven)

    def acknowledge(self) -> None:
        """Let :meth:`step` drive again at once if the fault is over."""
        self._watch.acknowledge()

    def _stopped(self, problem: str, driven: Any) -> Decision:
        """Stop clear of the last known static obstacles; without any, along the arc."""
        found = caught(self._stop, driven)
        if isinstance(found, Decision):
            return found._replace(status=Status.INVALID, problem=problem)
        return self._braked(problem, driven)

    def _has_moved(self) -> None:
        """Advance the last known obstacles by a step of the last twist."""
        if self._seen is not None:
            self._seen = self._seen.after(*self._last, self._settings.dt)

    def _stop(self, driven: Pair | None) -> Decision | None:
        """Return the filter's decision for a stop; None at rest or on failure."""
        started, engine = perf_counter(), self._engine
        state = self._state_at(driven).copy()
        if self._seen is None or engine.is_elsewhere() or not state[:2].any():
            return None
        outcome = engine.step_exactly(HALT, self._seen.standing(), 0.0, state)
        if outcome[0] == INVALID:
            return None
        engine.state[:] = state
        return as_decision(outcome, started)

    def _braked(self, problem: str, driven: Any) -> Decision:
        """Brake from ``driven`` if it is valid, else from the last twist."""
        started, engine = perf_counter(), self._engine
        robot, dt, last = engine.setup.robot, self._settings.dt, self._last
        if driven is not None:
            told = caught(as_driven, driven, robot)
            last = last if isinstance(told, BaseException) else told
        v, omega = braking_twist(robot, *last, dt)
        if not engine.is_elsewhere():
            engine.drives(v, omega)
        elapsed, status = perf_counter() - started, Status.INVALID
        known = math.nan, 0.0, 0.0, (), elapsed, 0.0, 0.0, problem
        return Decision(v + 0.0, omega + 0.0, status, *known)

    def _state_at(self, driven: Pair | None) -> Array:
        """Return the state of a robot that drives a twist at present."""
        if driven is None:
            return self._engine.state
        state = self._engine.state.copy()
        state[:2] = as_driven(driven, self._engine.setup.robot)
        return state

    def problem(
        self,
        v: float,
        omega: float,
        points: npt.ArrayLike | Obstacles = NO_POINTS,
        discs: npt.ArrayLike = NO_DISCS,
        disc_velocities: npt.ArrayLike = NO_POINTS,
        walls: npt.ArrayLike = NO_WALLS,
        polygons: Sequence[npt.ArrayLike] = NO_POLYGONS,
        polygon_velocities: npt.ArrayLike = NO_TURNS,
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
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        arrays, state = as_table(*given), self._state_at(driven).copy()
        desired, age = as_twist(v, omega), as_age(age)
        outcome = self._engine.step_exactly(desired, arrays, age, state)
        if outcome[0] == INVALID:
            raise why_invalid(*given)
        return self._engine.problem(arrays)
