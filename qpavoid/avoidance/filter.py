"""The safety filter: the twist nearest to the desired one that keeps its distance."""

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
    """The twist nearest to a desired one that keeps every obstacle away: a CBF-QP.

    A control barrier function's constraint in a quadratic program: at every
    call min (u − u_f)ᵀ W (u − u_f) over u = (v, ω) within all the robot's limits,
    subject to d̂_oᵀ J_0 u ≥ b for every contact in reach, with b = −γ(d − r_min) +
    d̂_oᵀ v_o (:func:`qpavoid.avoidance.barrier_rows.constraint_rows`). Looking ahead,
    the rows are those of the distances at times to come, d_k(u) ≥ r_min, linearised
    about the answer (:mod:`qpavoid.avoidance.lookahead`).

    What is driven has been judged as what it is, the beginning of a plan that keeps its
    distance until the robot stands (:mod:`qpavoid.avoidance.judge`). What cannot be
    satisfied goes down a ladder, and the desired twist is never passed on unchecked:
    ``planned``, where no single twist will do; ``relaxed``, least violation first, then
    nearest twist; ``braking`` along the arc at full deceleration; ``holding`` where
    that is standing still.

    It remembers the twist that it gave last with its plan: one filter for one robot,
    and for one thread until :meth:`reset`.

    Args:
        robot: Footprint and limits.
        settings: Weights, bound, radii, look-ahead, control step.
        solver: Back end by name: ``exact``, ``osqp``, ``qpsolvers:daqp``, ``casadi``, …
        ahead: Look ahead; else only the rows of the present are kept.
        freshness: How old what :meth:`step` is told may be, and when it drives again
            after a fault.

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
        self._braked("", (0.0, 0.0))  # what is not compiled yet is slow: not then, now

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy takes over: neither memory nor thread nor back end."""
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
        """Whether it looks ahead."""
        return self._engine.ahead

    @property
    def freshness(self) -> Freshness:
        """How old what :meth:`step` is told may be."""
        return self._watch.freshness

    @property
    def faults(self) -> dict[str, int]:
        """How many faults :meth:`step` and :meth:`brake` have met, by input and why."""
        return dict(self._watch.faults)

    @property
    def plan(self) -> Plan:
        """What is left, after the twist given last, of the plan that it began."""
        return kept_plan(self._engine.state)

    @property
    def foreseen(self) -> float:
        """Time ahead for which the plan has been checked against moving obstacles, s.

        Counted from the end of the last step; up to then the ``shortfall`` of its
        decision is known. The horizon less a control step where the plan is new; less
        where it is the rest of an earlier one, as it may be for ``planned``. 0 for a
        filter that does not look ahead.
        """
        return float(self._engine.state[UNTIL]) if self.ahead else 0.0

    @property
    def _last(self) -> Pair:
        """The twist that was given last, v in m/s and ω in rad/s."""
        return self._engine.state[0].item(), self._engine.state[1].item()

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Forget plan and thread; the robot drives (v, ω), or the nearest it can."""
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
            points: (N, 2) sensed points, m, from where the robot is now; with an empty
                array there are none. Or :class:`Obstacles`, and then no others.
            discs: (M, 3) x, y, radius, m.
            disc_velocities: (M, 2) velocities over ground in robot axes, m/s; without
                them discs stand still.
            walls: (K, 4) segments x1, y1, x2, y2, m.
            polygons: Of each its (n, 2) vertices, m, convex and counter-clockwise.
            polygon_velocities: (P, 3) v_x, v_y, m/s, and rate of turn, rad/s.
            age: s since the obstacles were measured; widens them, see
                :class:`qpavoid.avoidance.settings.Margins`.
            driven: (v, ω) that the robot drives at present, where it is not what the
                filter gave last; accelerations count from it. Beyond the limits it
                counts as the nearest twist within.

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
        """Do the same for whatever is given."""
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
        """Return the decision of :meth:`filter`; it does not raise but brakes.

        Whatever is wrong is a decision ``invalid`` with its ``problem``: the robot
        stops, and drives again only after
        :attr:`qpavoid.avoidance.freshness.Freshness.good` seconds of good steps, or
        :meth:`acknowledge`. It stops as the filter stops among what stood in the last
        good step; where there was none, along its arc at full deceleration. At rest it
        stays. ``None`` for obstacles is no data, and wrong; where there are none an
        empty array says so. Only ``KeyboardInterrupt`` is passed on, and where Python
        has no stack left its ``RecursionError``.

        Args:
            given: v, ω and obstacles as :meth:`filter` takes them.
            stamps: When what is given was measured; it has to be fresh, in order and
                not blind. Without stamps the age alone is looked at.
            age: s since the obstacles were measured, where stamps do not say more. Not
                above the ``points`` of the freshness.
            driven: See :meth:`filter`; the robot brakes from it, too.
            named: Obstacles by name. Arrays are kept as they are till a good step.
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
        """Return a decision ``invalid`` that stops the robot, and do not raise.

        For what goes wrong outside; it stops, and the same counts afterwards, as after
        a fault that :meth:`step` finds. From another thread than the filter's it
        changes nothing.

        Args:
            problem: What the decision is to say.
            driven: (v, ω) that the robot drives at present, where it is not what the
                filter gave last; one that is not valid is not used.
            seen: Obstacles that are known, robot frame; those of the last good step if
                there are none.
        """
        if not self._engine.is_elsewhere():
            self._watch.allows(QPAvoidError(problem))
            self._has_moved()
            if seen is not None:
                self._seen = LastSeen((*HALT, seen), {})
        return self._stopped(problem, driven)

    def acknowledge(self) -> None:
        """Let :meth:`step` drive again at once after a fault that is over."""
        self._watch.acknowledge()

    def _stopped(self, problem: str, driven: Any) -> Decision:
        """Stop among what stood when it was seen last; else brake along the arc."""
        found = caught(self._stop, driven)
        if isinstance(found, Decision):
            return found._replace(status=Status.INVALID, problem=problem)
        return self._braked(problem, driven)

    def _has_moved(self) -> None:
        """Take the twist given last as driven for a step since things were seen."""
        if self._seen is not None:
            self._seen = self._seen.after(*self._last, self._settings.dt)

    def _stop(self, driven: Pair | None) -> Decision | None:
        """Do as the filter would, exactly, asked to stand still; at rest do nothing."""
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
        """Brake from what is driven, as told if that is valid, else as given last."""
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
        """Return the memory of a robot that drives a twist at present."""
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

        That of the last attempt, with the rows of the last linearisation: where it was
        one within a trust region, that is its limits. Where no QP was solved, since
        only a plan will do, it is the one nearest to that plan's twist within the
        limits, without rows. Looking ahead with limited
        accelerations it is stated for u + δ, the twist aimed at, δ being what is left
        of the way there after this step: its desired twist is less by δ.
        :func:`qpavoid.qp.solve.solve` gives the twist of a decision ``tracking``,
        ``filtered`` or ``relaxed``; one that has no admissible twist it relaxes with
        its ``slack_tolerance``: hand it that of the settings where they have another.
        The filter's memory stays as it is.
        """
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        arrays, state = as_table(*given), self._state_at(driven).copy()
        desired, age = as_twist(v, omega), as_age(age)
        _, problem = self._engine.by_parts(desired, arrays, age, state)
        if problem is None:
            raise why_invalid(*given)
        return problem
