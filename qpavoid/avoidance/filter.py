"""The safety filter: the twist nearest to the desired one that keeps its distance."""

import math
from collections.abc import Sequence
from copy import deepcopy
from threading import get_ident
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import (
    INVALID,
    RELAXED,
    STATUSES,
    Decision,
    Status,
    blocked_if,
)
from qpavoid.avoidance.freshness import Freshness
from qpavoid.avoidance.ladder import (
    AGAIN,
    READY,
    WORKSPACE_TOO_SMALL,
    Outcome,
    unsolved,
)
from qpavoid.avoidance.prediction import Plan
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.sidestep import Sidestep
from qpavoid.avoidance.state import fresh_state, kept_plan, set_driven
from qpavoid.avoidance.step import attempts, decide, filter_step, prepare, trust_box
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
from qpavoid.avoidance.workspace import carve, memory_size
from qpavoid.errors import QPAvoidError, ThreadError
from qpavoid.model.contacts import most_contacts
from qpavoid.model.given import NO_DISCS, NO_POINTS, NO_TURNS, NO_WALLS
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, braking_twist
from qpavoid.model.validation import NO_POLYGONS
from qpavoid.qp.exact import OWNER, B
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import BackEnd, load_back_end, solve
from qpavoid.types import Array, Arrays, Box, Pair

CONTACTS = 512
"""For so many a filter keeps memory from the start; more are made room for."""

STOOD_IN = "The back end gave no answer in time; the exact solve stood in."

ELSEWHERE = (
    "a filter remembers its robot's motion and belongs to the thread that uses it "
    "first: make one filter a thread, or reset() it to hand it over"
)

OPEN = math.inf, math.inf
"""No answer of a back end."""


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
        aside: Where the robot stands before something at rest, desire to turn aside
            until it is past: :mod:`qpavoid.avoidance.sidestep`. Where there is no way
            the robot holds, ``blocked``. Not in the exported C.
        freshness: How old what :meth:`step` is told may be, and when it drives again
            after a fault.
        deadline: s that the back end has for each answer; it then runs in a process of
            its own, and where it is late or dead the exact solve stands in, counted in
            :attr:`stand_ins`: :class:`qpavoid.qp.deadline.DeadlineBackEnd`. ``inf``: no
            such thing, it runs in the caller's thread as long as it takes.

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
        aside: bool = False,
        freshness: Freshness | None = None,
        deadline: float = math.inf,
    ) -> None:
        self._robot, self._solver, self._ahead = robot, solver, ahead
        self._sidestep = Sidestep() if aside else None
        self._settings = settings if settings is not None else AvoidanceSettings()
        self._deadline, self._back_end = deadline, _back_end(solver, deadline)
        record, edges = self._settings.record(), robot.footprint.edges
        self._setup = Setup(edges, robot.limit_vector, record)
        self._state, self._thread = fresh_state(), 0
        self._memory = np.empty(memory_size(CONTACTS, record))
        self._watch = StepWatch(freshness or Freshness(), self._settings.dt)
        self._braked("", (0.0, 0.0))  # what is not compiled yet is slow: not then, now

    def __getstate__(self) -> dict[str, Any]:
        """Return all but back end, memory and thread: a copy has its own."""
        own = ("_back_end", "_memory", "_thread")
        return deepcopy({k: x for k, x in vars(self).items() if k not in own})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned of another one."""
        vars(self).update(state)
        self._back_end = _back_end(self._solver, self._deadline)
        self._memory = np.empty(memory_size(CONTACTS, self._setup.settings))
        self._thread = 0

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
        return self._solver

    @property
    def ahead(self) -> bool:
        """Whether it looks ahead."""
        return self._ahead

    @property
    def aside(self) -> bool:
        """Whether it turns aside."""
        return self._sidestep is not None

    @property
    def freshness(self) -> Freshness:
        """How old what :meth:`step` is told may be."""
        return self._watch.freshness

    @property
    def faults(self) -> dict[str, int]:
        """How many faults :meth:`step` and :meth:`brake` have met, by input and why."""
        return dict(self._watch.faults)

    @property
    def stand_ins(self) -> int:
        """How often the exact solve stood in for a back end with a deadline."""
        return getattr(self._back_end, "stand_ins", 0)

    @property
    def plan(self) -> Plan:
        """What is left, after the twist given last, of the plan that it began."""
        return kept_plan(self._state)

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Forget plan and thread; the robot drives (v, ω), or the nearest it can."""
        state = fresh_state()
        set_driven(state, *as_driven((v, omega), self._setup.robot))
        self._state, self._thread = state, 0
        self._sidestep = Sidestep() if self.aside else None

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
            points: (N, 2) sensed points, m; with an empty array there are none. Or
                :class:`Obstacles`, and then no others.
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
        started, thread = perf_counter(), get_ident()
        if self._thread != thread:
            self._bind(thread)
        if type(v) is not float or type(omega) is not float:
            v, omega = as_twist(v, omega)
        if type(age) is not float or age != 0.0:
            age = as_age(age)
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        arrays, state = as_table(*given), self._state_at(driven)
        stood_in = 0 if self._back_end is None else self.stand_ins
        sidestep = self._sidestep
        if sidestep is not None:
            sidestep = sidestep.step(self._setup, (v, omega), arrays, age, state)
            v, omega = sidestep.desired
        if self._back_end is None:
            now = *self._setup, *arrays, age, self._ahead, v, omega, state
            step = filter_step.call  # type: ignore[attr-defined]
            outcome = step(*now, self._memory)
            if outcome[0] == WORKSPACE_TOO_SMALL:
                self._make_room(arrays)
                outcome = step(*now, self._memory)
        else:
            outcome, _ = self._by_parts(v, omega, arrays, age, state)
        if outcome[0] == INVALID:
            raise why_invalid(*given)
        self._state, self._sidestep = state, sidestep
        decision = _as_decision(outcome, started)
        if self._back_end is not None and self.stand_ins != stood_in:
            decision = decision._replace(problem=STOOD_IN)
        return decision if sidestep is None else blocked_if(decision, sidestep.blocked)

    def step(
        self,
        *given: Any,
        stamps: Stamps | None = None,
        age: float = 0.0,
        driven: tuple[float, float] | None = None,
        **named: Any,
    ) -> Decision:
        """Return the decision of :meth:`filter`; it does not raise but brakes.

        Whatever is wrong is a decision ``invalid`` with its ``problem``: the robot
        brakes along its arc at full deceleration, and drives again only after
        :attr:`qpavoid.avoidance.freshness.Freshness.good` seconds of good steps, or
        :meth:`acknowledge`. ``None`` for obstacles is no data, and wrong; where there
        are none an empty array says so. Only ``KeyboardInterrupt`` is passed on.

        Args:
            given: v, ω and obstacles as :meth:`filter` takes them.
            stamps: When what is given was measured; it has to be fresh, in order and
                not blind. Without stamps the age alone is looked at.
            age: s since the obstacles were measured, where stamps do not say more. Not
                above the ``points`` of the freshness.
            driven: See :meth:`filter`; the robot brakes from it, too.
            named: Obstacles by name.
        """
        found: Decision | BaseException
        if self._is_elsewhere():
            return self._braked(ELSEWHERE, driven)
        known = caught(self._watch.age, stamps, age)
        if isinstance(known, BaseException):
            found = known
        else:
            named |= {"age": known, "driven": driven}
            found = caught(self.filter, *given, **named)
        if not isinstance(found, BaseException):
            return found if self._watch.allows(None) else self._braked(WAITING, driven)
        self._watch.allows(found)
        stale = isinstance(found, FaultError) and "odometry" in found.faults
        return self._braked(problem_of(found), None if stale else driven)

    def brake(
        self, problem: str = PROBLEM, driven: tuple[float, float] | None = None
    ) -> Decision:
        """Return a decision ``invalid`` that brakes along the arc, and do not raise.

        For what goes wrong outside; the same counts afterwards as after a fault that
        :meth:`step` finds. From another thread than the filter's it changes nothing.

        Args:
            problem: What the decision is to say.
            driven: (v, ω) that the robot drives at present, where it is not what the
                filter gave last; one that is not valid is not used.
        """
        if not self._is_elsewhere():
            self._watch.allows(QPAvoidError(problem))
        return self._braked(problem, driven)

    def acknowledge(self) -> None:
        """Let :meth:`step` drive again at once after a fault that is over."""
        self._watch.acknowledge()

    def _braked(self, problem: str, driven: Any) -> Decision:
        """Brake from what is driven, as told if that is valid, else as given last."""
        started, robot, dt = perf_counter(), self._setup.robot, self._settings.dt
        last = self._state[0].item(), self._state[1].item()
        if driven is not None:
            told = caught(as_driven, driven, robot)
            last = last if isinstance(told, BaseException) else told
        v, omega = braking_twist(robot, *last, dt)
        if not self._is_elsewhere():
            self._state = fresh_state()
            set_driven(self._state, v, omega)
            self._sidestep = Sidestep() if self.aside else None
        elapsed, status = perf_counter() - started, Status.INVALID
        known = math.nan, 0.0, 0.0, (), elapsed, 0.0, 0.0, problem
        return Decision(v + 0.0, omega + 0.0, status, *known)

    def _is_elsewhere(self) -> bool:
        """Return whether it belongs to another thread than this one."""
        return self._thread not in (0, get_ident())

    def _bind(self, thread: int) -> None:
        """Let the filter belong to the thread that uses it first."""
        if self._thread != 0:
            raise ThreadError(ELSEWHERE)
        self._thread = thread

    def _state_at(self, driven: Pair | None) -> Array:
        """Return the memory of a robot that drives a twist at present."""
        if driven is None:
            return self._state
        state = self._state.copy()
        state[:2] = as_driven(driven, self._setup.robot)
        return state

    def _make_room(self, arrays: Arrays) -> None:
        most = most_contacts(self._setup.edges, arrays)
        self._memory = np.empty(memory_size(most, self._setup.settings))

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
        if self._sidestep is not None:
            desired = self._sidestep.step(
                self._setup, desired, arrays, age, state
            ).desired
        _, problem = self._by_parts(*desired, arrays, age, state)
        if problem is None:
            raise why_invalid(*given)
        return problem

    def _by_parts(
        self, v: float, omega: float, arrays: Arrays, age: float, state: Array
    ) -> tuple[Outcome, FilterProblem | None]:
        """Do what :func:`filter_step` does, one part after the other: any solver."""
        setup = self._setup
        given = setup, Request(arrays, age, self._ahead, (v, omega)), state
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
        if self._back_end is None:
            return OPEN
        solution = solve(problem, self._back_end, self._settings.slack_tolerance)
        if solution.status is SolveStatus.FAILED:
            return math.nan, math.nan
        return solution.u[0].item(), solution.u[1].item()

    def _as_problem(
        self, desired: Pair, rows: Array, n_hard: int, box: Box
    ) -> FilterProblem:
        return FilterProblem(
            desired=np.array(desired),
            weights=np.array(self._settings.weights),
            A=rows[:, :B],
            b=rows[:, B],
            lower=np.array(box[::2]),
            upper=np.array(box[1::2]),
            obstacle=rows[:, OWNER].astype(np.int64),
            n_hard=n_hard,
        )


def _back_end(solver: str, deadline: float) -> BackEnd | None:
    """Return the back end of a name, within a deadline if there is one; None: exact."""
    if deadline == math.inf or solver == "exact":
        return None if solver == "exact" else load_back_end(solver)
    from qpavoid.qp.deadline import DeadlineBackEnd

    return DeadlineBackEnd(solver, deadline)


def _as_decision(outcome: tuple[Any, ...], started: float) -> Decision:
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
