"""The safety filter: the twist nearest to the desired one that respects the rows."""

import math
from collections.abc import Sequence
from time import perf_counter

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import ahead_memory_rows, aim, fresh_state
from qpavoid.avoidance.braking import may_drive
from qpavoid.avoidance.decision import (
    FILTERED,
    INVALID,
    RELAXED,
    STATUSES,
    STOPPED,
    TRACKING,
    Decision,
)
from qpavoid.avoidance.numbers import (
    as_age,
    as_driven,
    as_table,
    as_twist,
    why_invalid,
)
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import (
    CRAMPED,
    NOTHING,
    PASSES,
    Answer,
    fall_back,
    filter_rows,
    filter_step,
    memory_rows,
)
from qpavoid.model.contacts import most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import (
    NO_DISCS,
    NO_POINTS,
    NO_POLYGONS,
    NO_TURNS,
    NO_WALLS,
    Arrays,
    Obstacles,
)
from qpavoid.model.robot import Robot, stopping_time
from qpavoid.qp.exact import OWNER, WIDTH, B
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import TOLERANCE, load_back_end, solve

ROOM = 512
"""Contacts for which a filter keeps memory; a step among more takes its own."""


class SafetyFilter:
    """Gives the twist nearest to a desired one that keeps every obstacle away.

    It solves, at every call, min (u − u_f)ᵀ W (u − u_f) over u = (v, ω) within all the
    robot's limits, subject to d̂_oᵀ J_0 u ≥ b for every contact in reach (see
    :class:`qpavoid.avoidance.settings.AvoidanceSettings` for b) and, ahead, to
    d_k(u) ≥ r_min at times to come (:mod:`qpavoid.avoidance.ahead`).

    What cannot be satisfied goes down a ladder, and the desired twist is never passed
    on unchecked: ``relaxed``, least violation first, then nearest twist; ``braking``
    along the arc at full deceleration where nothing else leaves room to stop
    (:mod:`qpavoid.avoidance.braking`); ``holding`` where that is standing still.

    It remembers the twist that it gave last, and the side on which it passes: one
    filter for one robot; see :meth:`reset`.

    Args:
        robot: Footprint and limits.
        settings: Weights, bound, radii, look-ahead, control step.
        solver: Back end by name: ``exact``, ``osqp``, ``qpsolvers:daqp``, ``casadi``, …
        ahead: Look ahead; else only the rows of the present are kept.

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
    ) -> None:
        self.robot = robot
        self.settings = settings if settings is not None else AvoidanceSettings()
        self.solver = solver
        self.ahead = ahead
        self._back_end = None if solver == "exact" else load_back_end(solver)
        self._record = self.settings.record()
        self._edges = robot.footprint.edges
        self._numbers = robot.numbers
        self._state = fresh_state()
        self._memory = np.empty((memory_rows(ROOM, self._record), WIDTH))

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Forget what was driven and on which side; the robot now drives (v, ω)."""
        state = fresh_state()
        state[:2] = as_driven((v, omega))
        self._state = state

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
                filter gave last; accelerations count from it.

        Raises:
            InvalidInputError: A shape does not fit, a number is not finite, a radius or
                the age negative. Points inside the footprint are valid: their
                clearance is negative, and the robot moves away from them or holds.
        """
        started = perf_counter()
        if type(v) is not float or type(omega) is not float:
            v, omega = as_twist(v, omega)
        if type(age) is not float or age != 0.0:
            age = as_age(age)
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        arrays = as_table(*given)
        state = self._state
        if driven is not None:
            state = state.copy()
            state[:2] = as_driven(driven)
        if self._back_end is None:
            answer = self._step(v, omega, arrays, age, state)
        else:
            answer = self._step_by_back_end(v, omega, arrays, age, state)
        code, v, omega, clearance, slack, residual, shortfall, first, second = answer
        if code == INVALID:
            raise why_invalid(*given)
        self._state = state
        active = (first,) if second in (-1, first) else (first, second)
        return Decision(
            v,
            omega,
            STATUSES[code],
            clearance,
            slack,
            residual,
            active if first >= 0 else active[1:],
            perf_counter() - started,
            shortfall,
        )

    def _step(
        self, v: float, omega: float, arrays: Arrays, age: float, state: Array
    ) -> Answer:
        """Do a :func:`filter_step`; memory for more obstacles is taken when needed."""
        known = self._edges, self._numbers, self._record
        while True:
            answer = filter_step(
                *known, *arrays, age, self.ahead, v, omega, state, self._memory
            )
            if answer[0] != CRAMPED:
                return answer
            most = most_contacts(self._edges, arrays)
            self._memory = np.empty((memory_rows(most, self._record), WIDTH))

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
    ) -> FilterProblem:
        """Return the QP of the present rows; arguments and errors as :meth:`filter`.

        Its desired twist is the one aimed at: where the filter looks ahead, that need
        not be the one given. An infeasible one is relaxed by
        :func:`qpavoid.qp.solve.solve` with its default ``slack_tolerance``; hand it
        that of the settings where they have another.
        """
        given = points, discs, disc_velocities, walls, polygons, polygon_velocities
        arrays = as_table(*given)
        twist, age = as_twist(v, omega), as_age(age)
        problem = self._problem(*twist, arrays, age, self._state.copy())
        if problem is None:
            raise why_invalid(*given)
        return problem[0]

    def _problem(
        self, v: float, omega: float, arrays: Arrays, age: float, state: Array
    ) -> tuple[FilterProblem, float, Array, float, int] | None:
        """Return QP, clearance, contacts in reach, shortfall and obstacle ahead."""
        known = self._edges, self._numbers, self._record, arrays, age
        ahead = self.ahead and self.settings.bound == "barrier"
        most = most_contacts(self._edges, arrays)
        contacts, rows = np.empty((most, WIDTH)), np.empty((most + 8, WIDTH))
        last = state[0], state[1]
        found = filter_rows(*known, ahead, last, contacts, rows)
        n, nearest, m, hard, box = found
        if nearest == -2 or not (math.isfinite(v) and math.isfinite(omega)):
            return None
        shortfall, third = 0.0, -1
        if ahead:
            rest = np.empty((ahead_memory_rows(most, self._record), WIDTH))
            v, omega, shortfall, third = aim(*known, v, omega, state, rest)
        problem = FilterProblem(
            desired=np.array([v, omega]),
            weights=np.array(self.settings.weights),
            A=rows[:m, :B],
            b=rows[:m, B],
            lower=np.array(box[::2]),
            upper=np.array(box[1::2]),
            obstacle=rows[:m, OWNER].astype(np.int64),
            hard=hard,
        )
        clearance = contacts[nearest, 4].item() if nearest >= 0 else math.inf
        return problem, clearance, contacts[:n], shortfall, third

    def _step_by_back_end(
        self, v: float, omega: float, arrays: Arrays, age: float, state: Array
    ) -> Answer:
        """Do what :func:`filter_step` does, with another solver for the QP."""
        made = self._problem(v, omega, arrays, age, state)
        if made is None:
            return NOTHING
        assert self._back_end is not None
        problem, clearance, contacts, shortfall, third = made
        last = state[0], state[1]
        meets = shortfall > self.settings.radius.low or clearance < 0.0
        yields = self.settings.passive and meets
        seen = self._edges, self._numbers, self._record, arrays, contacts, age
        known = *seen, yields, last
        guarded = self.settings.braking_room and self.settings.bound == "barrier"
        allowed = False
        for _ in range(PASSES):
            solution = solve(problem, self._back_end, self.settings.slack_tolerance)
            failed = solution.status is SolveStatus.FAILED
            code = STOPPED if failed else FILTERED
            u_v, u_omega = solution.u.tolist()
            if failed or not guarded:
                allowed = not failed
                break
            allowed, lacks = may_drive(*known, u_v, u_omega)
            if allowed:
                break
            time = stopping_time(self._numbers, u_v, u_omega, self.settings.dt)
            problem = problem.relaxed(-lacks / time)
        if not allowed:
            code, u_v, u_omega = fall_back(*known, u_v, u_omega, code)
        elif abs(u_v - v) <= TOLERANCE and abs(u_omega - omega) <= TOLERANCE:
            code, u_v, u_omega = TRACKING, v, omega
        if code in (TRACKING, FILTERED) and (solution.slack > 0.0 or shortfall > 0.0):
            code = RELAXED
        state[:2] = u_v, u_omega
        active = [*problem.obstacle[list(solution.active)].tolist(), third, -1]
        active = [*dict.fromkeys(i for i in active if i >= 0), -1, -1]
        residual = max(solution.violation, solution.suboptimality)
        numbers = clearance, solution.slack, residual, shortfall
        return code, u_v, u_omega, *numbers, active[0], active[1]
